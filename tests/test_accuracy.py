"""The option --accuracy: the step it chooses where the error is known, a chaotic measure, and how a run is verified."""

import csv
import io
import json

import pytest
from rich.console import Console

from scene_text import GLASS
from stub_executor import StubExecutor
from warpdem import SceneError, WarpdemError
from warpdem.app import accuracy, cli
from warpdem.app.accuracy import Source, Trial, Wish
from warpdem.sweep import sweep as sweeps

SCENE = GLASS + """
friction = 0.3
[[grains]]
material = "glass"
radius = 1e-3
positions = [[0, 0, 1.5e-3], [0.5e-3, 0, 4e-3]]
[time]
end = 0.02
step = 8e-6
"""


@pytest.fixture
def source(tmp_path, monkeypatch):
    (tmp_path / "s.toml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    stub = StubExecutor(lambda values: {"kinetic [J]": 1.0 + 2e9 * float(values["time.step"]) ** 2})
    run_sweep = sweeps.run_sweep
    monkeypatch.setattr(accuracy, "run_sweep", lambda sweep, **how: run_sweep(sweep, on=stub))
    return Source(tmp_path / "s.toml", threads=1, device="cpu")


def chosen(source, share, monkeypatch, scatter):
    monkeypatch.setattr(accuracy, "_scatter", lambda *given: (scatter, []))
    screen = io.StringIO()
    trial = Trial.of(source, Wish.of(share, "kinetic:last"), source.scene.parent / "trials", Console(file=screen, width=200))
    return trial, screen.getvalue()


def test_it_chooses_the_step_of_a_known_error_and_verifies_the_run(source, monkeypatch):
    """Error 2e9 h^2: 12.8 % with the scene's step of 8 us, 1 % with 2.2 us."""
    trial, said = chosen(source, "1%", monkeypatch, 1e-6)
    assert trial.choice.found.order == pytest.approx(2.0) and trial.choice.found.limit == pytest.approx(1.0)
    assert trial.choice.step == pytest.approx(2.2e-6) and trial.choice.reached
    assert "order of the error 2;" in said and "for 1 %: --set time.step=2.2e-06 engine.precision=double" in said
    folder = source.scene.parent / "run"
    source.run([source.row(*trial.choice.settings)], folder.parent / "made", "kinetic:last", 1)
    (folder.parent / "made" / "0001").rename(folder)
    screen = io.StringIO()
    trial.verify(folder, None, Console(file=screen, width=200))
    data = json.loads((folder / "accuracy.json").read_text())
    assert data["holds"] and data["measured_error"] == pytest.approx(2e9 * 2.2e-6**2, rel=0.01)
    assert "off by up to 0.97 % by the step: as accurate as asked (1 %)" in screen.getvalue()


def test_a_step_that_is_fine_stays(source, monkeypatch):
    trial, _ = chosen(source, "20%", monkeypatch, 1e-6)
    assert trial.choice.step == 8e-6


def test_a_chaotic_measure_is_told(source, monkeypatch):
    trial, said = chosen(source, "1%", monkeypatch, 0.1)
    assert trial.choice.chaotic and not trial.choice.reached
    assert "no step makes a single run as accurate as 1 %: the measure is chaotic; the mean of 345 runs" in said
    assert "(a sweep over grains.0.fill.seed), or a mean over a longer time" in " ".join(said.split())


def test_what_is_out_of_reach_is_told_with_what_is_in_reach_and_a_remedy(source, monkeypatch):
    """Twins scatter by a little less than is asked, two of them differ by more, and the steps by less."""
    trial, said = chosen(source, "20%", monkeypatch, 0.09)
    choice = trial.choice
    assert choice.found.chance and not choice.reached and not choice.chaotic
    off = 100.0 * choice.found.error(choice.step) / choice.found.limit
    assert off > 20.0 and f"20 % is out of reach for a single run: by chance equal runs differ by up to {off:.2g} %" in said
    assert "measure the mean over a longer time, or ask for that" in " ".join(said.split())


def test_the_work_precision_diagram_has_a_point_for_each_run_and_more_steps_run_no_more_than_they_add(source, monkeypatch):
    monkeypatch.setattr(accuracy, "_scatter", lambda *given: (1e-6, []))
    folder, wish, screen = source.scene.parent, Wish.of("1%", "kinetic:last"), Console(file=io.StringIO(), width=200)
    trial = Trial.of(source, wish, folder / "trials", screen, count=3, diagram=folder / "a.svg")
    with (folder / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["precision"], float(row["step [s]"])) for row in rows] == [
        ("double", 8e-6), ("double", 4e-6), ("double", 2e-6), ("mixed", 8e-6)
    ]  # fmt: skip
    for row in rows:
        share = 2e9 * float(row["step [s]"]) ** 2 / trial.choice.found.limit
        assert float(row["error"]) == pytest.approx(share, rel=1e-3)
        assert float(row["time of the steps [s]"]) == 0.08
    text = (folder / "a.svg").read_text()
    for words in ("kinetic:last: order 2", "asked: 1 %", "chance: equal runs scatter so far", "mixed precision", "2e-06 s"):
        assert words in text, words
    with pytest.raises(SceneError, match="--accuracy-steps 9: must be from 3 to 8"):
        Trial.of(source, wish, folder / "trials", screen, count=9)
    with pytest.raises(WarpdemError, match=r"a\.gif: suffix '\.gif' cannot be drawn"):
        Trial.of(source, wish, folder / "other", screen, diagram=folder / "a.gif")
    assert not (folder / "other").exists()
    before = (folder / "trials" / "0004" / "run.json").stat().st_mtime_ns
    finer = Trial.of(source, wish, folder / "trials", screen, count=5).choice.found
    assert finer.steps[-1] == 5e-7 and finer.order == pytest.approx(2.0) and len(finer.values) == 5
    assert (folder / "trials" / "0004" / "run.json").stat().st_mtime_ns == before


def test_a_demo_draws_its_diagram_by_its_own_measure(tmp_path, monkeypatch):
    asked = {}

    def of(source, wish, folder, console, twins, count, diagram):
        asked.update(scene=source.scene, measure=wish.measure, share=wish.share, folder=folder, diagram=diagram)
        return "a trial"

    monkeypatch.setattr(accuracy.Trial, "of", of)
    monkeypatch.setattr("warpdem.app.cli_scenes.run", lambda *given, **how: asked.update(run=True))
    out = tmp_path / "x"
    cli.app(["demo", "bouncing_sphere", "--accuracy", "1%", "--out", str(out), "--quiet"], result_action="return_value")
    assert asked == {"scene": out / "bouncing_sphere.toml", "measure": "centre_z:mean", "share": 0.01,
                     "folder": out / "accuracy", "diagram": out / "work_precision.png"}  # fmt: skip


@pytest.mark.parametrize(
    ("share", "measure", "said"),
    [("1", "kinetic:last", "above 0 and below 1"), ("x%", "kinetic:last", "such as 1% or 0.01"), ("0", None, "above 0"),
     ("1%", None, r"--measure .*plot DIR --list"), ("1%", "kinetic", "must be COLUMN:HOW"),
     ("1%", "kinetik:last", "did you mean")],
)  # fmt: skip
def test_what_is_wrong_is_told(source, monkeypatch, share, measure, said):
    monkeypatch.setattr(accuracy, "_scatter", lambda *given: (None, []))
    with pytest.raises(SceneError, match=said):
        Trial.of(source, Wish.of(share, measure), source.scene.parent / "trials", Console(file=io.StringIO()))


def test_scatter_comes_from_twins(tmp_path):
    """Two grains that fall on a floor are not chaotic: a nudge of 1e-9 of a radius leaves 1e-9 of their energy."""
    floor = '[[walls]]\nname = "floor"\nmaterial = "glass"\nplane = { point = [0, 0, 0], normal = [0, 0, 1] }\n'
    text = SCENE.replace("[time]", floor + "[time]") + "max_speed = 0.5\n[output]\nformats = []\npicture = false\n"
    (tmp_path / "s.toml").write_text(text)
    source = Source(tmp_path / "s.toml", threads=1, device="cpu")
    source.run([source.row("time.step=8e-6")], tmp_path / "t", "kinetic:last", 1)
    scatter, notes = accuracy._scatter(source, Wish(0.01, "kinetic:last"), tmp_path / "t", 2, Console(file=io.StringIO()))
    assert not notes and 0.0 < scatter < 1e-10
