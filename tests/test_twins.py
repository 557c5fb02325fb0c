"""Twins of a run: the same scene but for a nudge, kept and resumed; the command compare."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

import twelve_grains
from page_check import check_html
from warpdem import SceneError, Simulation, WarpdemError, runs
from warpdem.app import cli, twins
from warpdem.app.compare import print_comparison
from warpdem.runs.compare import Comparison, Difference

SILENT = Console(file=io.StringIO())


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("twins") / "a"
    output = {"interval": 2e-3, "history_interval": 2e-4, "formats": [], "picture": False}
    sim, _ = twelve_grains.run(twelve_grains.scene(output=output), folder)
    return folder, sim


def test_without_a_nudge_a_twin_is_the_run_itself(done, monkeypatch):
    """Same bits: nothing else is changed."""
    folder, sim = done
    monkeypatch.setattr(twins, "NUDGE", 0.0)
    scene = twelve_grains.scene()
    other = Simulation(twins.twin(scene, Simulation(scene, device="cpu", threads=1), 1), device="cpu", threads=1)
    other.run(until=6e-3)
    assert other.state_hash() == sim.state_hash()


def test_twins_begin_a_nudge_apart_and_are_kept(done):
    folder, sim = done
    made = twins.make_twins(runs.read(folder), 2, SILENT, "cpu", 1)
    assert made == [folder / "twins" / "1", folder / "twins" / "2"]
    hashes = [runs.read(path).record["state_hash"] for path in made]
    assert len({sim.state_hash(), *hashes}) == 3
    away = [runs.read(path).history["centre_x"] - runs.read(folder).history["centre_x"] for path in made]
    assert all(0 < abs(x[0]) < 1e-11 for x in away) and len(away[0]) == 31
    when = [(path / "run.json").stat().st_mtime_ns for path in made]
    assert twins.make_twins(runs.read(folder), 2, SILENT, "cpu", 1) == made
    assert [(path / "run.json").stat().st_mtime_ns for path in made] == when


def test_a_twin_that_was_cut_short_goes_on(done):
    folder, _ = done
    [path] = twins.make_twins(runs.read(folder), 1, SILENT, "cpu", 1)
    whole = runs.read(path).record["state_hash"]
    scene = twelve_grains.scene(output={"interval": 2e-3, "history_interval": 2e-4, "formats": [], "picture": False})
    first = Simulation(scene, device="cpu", threads=1)
    cut = twins.twin(scene, first, 1)
    for name in ("run.json", "checkpoint.h5", "history.csv"):
        (path / name).unlink()
    twelve_grains.run(cut, path, until=2e-3)
    record = json.loads((path / "run.json").read_text()) | {"status": "interrupted"}
    (path / "run.json").write_text(json.dumps(record))
    twins.make_twins(runs.read(folder), 1, SILENT, "cpu", 1)
    assert runs.read(path).record["state_hash"] == whole and runs.read(path).history.rows == 31


def test_groups_materials_and_streams_are_kept():
    box = {"min": [-0.05, -0.05, 0.05], "max": [0.05, 0.05, 0.06]}
    entry = {"material": "glass", "radius": 1e-3}
    scene = twelve_grains.scene(
        grains=[entry | {"name": "low", "positions": [[0, 0, 2e-3]]},
                entry | {"name": "high", "positions": [[0, 0, 2e-2]], "spins": [[0, 5, 0]]}],
        streams=[{"material": "glass", "box": box, "diameter": 2e-3, "count_rate": 10.0, "seed": 4}],
    )  # fmt: skip
    other = twins.twin(scene, Simulation(scene, device="cpu", threads=1), 3)
    assert other.groups == scene.groups and [entry.name for entry in other.grains] == ["low", "high"]
    assert other.grains[1].spins.tolist() == [[0, 5, 0]] and other.streams[0].seed == 7
    assert 0 < np.abs(other.grains[0].positions - [0, 0, 2e-3]).max() < 1e-11


def test_what_cannot_be_repeated_is_told(tmp_path):
    def run_of(record):
        (tmp_path / "run.json").write_text(json.dumps(record))
        return runs.read(tmp_path)

    with pytest.raises(SceneError, match=r"not finished \(interrupted\); go on with it first"):
        twins.make_twins(run_of({"status": "interrupted"}), 1, SILENT)
    with pytest.raises(SceneError, match=r"checkpoint\.h5"):
        twins.make_twins(run_of({"status": "done", "time_step": {"used": 1e-5}, "time": 1.0}), 1, SILENT)


def test_clumps_are_no_grains_of_their_own(tmp_path):
    """Refused: a twin made of their members would be another scene."""
    pair = [{"centre": [0, 0, 0], "radius": 1e-3}, {"centre": [0, 0, 1e-3], "radius": 1e-3}]
    scene = twelve_grains.scene(
        clumps={"pair": {"spheres": pair}}, contact={}, output={"interval": 2e-3, "formats": ["vtk"], "picture": False},
        grains=[{"material": "glass", "clump": "pair", "positions": [[0, 0, 5e-3]]}],
        pairs=[{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5}],
    )  # fmt: skip
    twelve_grains.run(scene, tmp_path)
    with pytest.raises(SceneError, match="twins of a run with clumps are not made"):
        twins.make_twins(runs.read(tmp_path), 1, SILENT, "cpu", 1)
    assert not (tmp_path / "twins").exists()


def test_the_command_compares_and_writes_a_page(done, tmp_path, capsys):
    folder, _ = done
    other = tmp_path / "b"
    output = {"interval": 2e-3, "history_interval": 2e-4, "formats": [], "picture": False}
    twelve_grains.run(twelve_grains.scene(gravity=[0, 0, -30], output=output), other)

    def call(*options):
        cli.app(["compare", str(folder), str(other), *options], result_action="return_value")
        return capsys.readouterr().out

    assert "--twins 4 makes four of a" in call("--columns", "centre_z")
    said = call("--twins", "2", "--columns", "centre_z", "grains", "--device", "cpu", "--threads", "1")
    assert "differ by more than the scatter" in said and "2 twins of a" in said
    page = tmp_path / "c.html"
    data = json.loads(call("--twins", "2", "--columns", "centre_z", "grains", "--json", "--out", str(page), "--device", "cpu"))
    assert data["verdict"] == "differs" and data["twins"] == 2
    assert {one["column"]: one["verdict"] for one in data["columns"]} == {"centre_z [m]": "differs", "grains [-]": "same"}
    text = page.read_text()
    assert text.count('class="chart"') == 2 and "differ by more" in text and "greatest" in text
    assert data["columns"][0]["second"] > data["columns"][0]["first"]  # it falls more slowly


def test_a_page_of_a_comparison_is_html_without_a_fault(done, tmp_path):
    from warpdem.reports.comparison import write_comparison
    from warpdem.runs.compare import compare

    history = runs.read(done[0]).history
    found = compare(history, history, [history, history])
    page = write_comparison(found, ("<a>", "b"), 2, tmp_path / "c.html")
    check_html(page)
    assert "&lt;a&gt;" in page.read_text()


@pytest.mark.parametrize(("options", "said"), [(["--twins", "-1"], "must be from 0"), (["--out", "a.txt"], "ends in .html")])
def test_wrong_options_are_told(done, options, said):
    with pytest.raises(WarpdemError, match=said):
        cli.app(["compare", str(done[0]), str(done[0]), *options], result_action="return_value")


def test_the_table_tells_the_number_that_decided():
    """Of a column whose mean is the same and whose course is not."""
    one = Difference("x [m]", 1.0, 1.0, 0.1, 0.2, 0.876, 54.3, 1.2)
    found = Comparison([one], [], [], np.arange(3.0), {}, {})
    text = io.StringIO()
    print_comparison(found, 4, ("a", "b"), Console(file=text, width=80))
    [line] = [line for line in text.getvalue().splitlines() if line.startswith("x [m]")]
    assert line.split()[2:] == ["1", "1", "0.2", "0.876", "54.3", "differs:", "curve", ">", "3.6"]
    assert "curve / scatter" in text.getvalue()
