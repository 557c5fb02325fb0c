"""A run with its outputs, from Python: run.json, history, summary, frames, resume."""

import io
import json
import math
import re
import time
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from twelve_grains import history, run, scene
from warpdem import Scene, SceneError, Simulation
from warpdem.app.outputs import output_schedule
from warpdem.app.summary import print_summary, steps_per_contact
from warpdem.core.progress import report_if_long
from warpdem.core.timers import speed_text
from warpdem.model.digests import scene_hash
from warpdem.output.history import history_columns
from warpdem.output.read_vtk import read_results


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runner") / "out"
    folder.mkdir()
    return folder, *run(scene(), folder)


def test_run_json_tells_what_was_run_and_what_came_out(done):
    folder, sim, _ = done
    record = json.loads((folder / "run.json").read_text())
    assert record["status"] == "done"
    assert record["state_hash"] == sim.state_hash()
    assert record["scene_hash"] == scene_hash(scene())
    assert (record["grains"], record["steps"], record["device"], record["threads"]) == (12, 600, "cpu", 1)
    assert record["time"] == sim.time
    assert set(record["versions"]) == {"warpdem", "warp", "numpy", "python"}
    assert record["plan"] == sim.plan.explain()
    assert record["time_step"]["used"] == 1e-5
    assert record["time_step"]["binding"] in record["time_step"]["candidates"]
    assert record["extremes"]["pair_overlap_share"] == sim.extremes["pair_overlap_share"] > 0
    assert record["extremes"]["steps_per_contact"] == steps_per_contact(sim)
    assert record["lists"]["rebuilds"] >= 1
    assert record["seconds"]["total"] > record["seconds"]["steps"] > 0
    assert record["seconds"]["compile"] > 0
    assert Scene.model_validate(record["scene_data"]) == scene()


def test_result_equals_the_bare_simulation(done):
    _, sim, _ = done
    bare = Simulation(scene(), device="cpu", threads=1)
    bare.run(until=6e-3)
    assert sim.state_hash() == bare.state_hash()


def test_history_has_a_row_at_every_interval(done):
    folder, sim, _ = done
    header, rows = history(folder)
    assert header[0] == "time [s]"
    assert "kinetic [J]" in header
    np.testing.assert_allclose(rows[:, 0], np.arange(13) * 5e-4, rtol=0, atol=1e-12)
    energy = sim.energy()
    for name in ("kinetic", "rotational", "elastic", "potential"):
        assert rows[-1, header.index(f"{name} [J]")] == energy[name]
    p = sim.particles
    for axis, name in enumerate("xyz"):
        centre = (p.mass @ p.position[:, axis]) / p.mass.sum()
        assert rows[-1, header.index(f"centre_{name} [m]")] == pytest.approx(centre, rel=1e-14)


@pytest.mark.parametrize("rows", [None, 2.3e-4])
def test_every_frame_has_a_row_of_its_time(tmp_path, rows):
    """37 steps a frame, which no 4 divide; the same after a cut between two rows, and as many as check foretells."""
    output = {"interval": 3.7e-4, "history_interval": rows, "formats": ["vtk"], "picture": False, "checkpoint_interval": 2e-5}
    run(scene(output=output), tmp_path / "whole")
    whole = history(tmp_path / "whole")[1]
    frames = read_results(tmp_path / "whole").times
    assert len(frames) == 18
    assert set(frames) <= set(whole[:, 0])
    sim = Simulation(scene(output=output), device="cpu", threads=1)
    assert len(whole) == output_schedule(sim, 6e-3).rows(600)
    run(scene(output=output), tmp_path / "cut", until=1.01e-3)
    run(scene(output=output), tmp_path / "cut", resume=True)
    cut = history(tmp_path / "cut")[1]
    np.testing.assert_array_equal(cut[np.isin(cut[:, 0], whole[:, 0])], whole)
    assert len(cut) == len(whole) + 1  # where the first part ended


def test_summary_tells_speed_lists_and_extremes(done):
    _, sim, text = done
    for what in ("twelve grains", "12 grains", "us per step on 1 threads", "outer neighbor list", "largest overlap",
                 "steps per contact", sim.state_hash(), "wall time"):  # fmt: skip
        assert what in text, what
    assert "left out" not in text  # check tells


def test_summary_of_a_narrow_terminal_has_the_whole_hash(done):
    text = io.StringIO()
    print_summary(done[1], Console(file=text, width=60), 1.0, done[0], None)
    assert f"\nstate hash {done[1].state_hash()}\n" in text.getvalue()


@pytest.mark.parametrize(
    ("seconds", "grains", "said"),
    [(38.08e-6, 4, "38.1 us per step"), (2.0123e-2, 99, "20100 us per step"),
     (38.08e-6, 100, "381 ns per grain and step"), (4.5678e-5, 5000, "9.14 ns per grain and step")],
)  # fmt: skip
def test_speed_is_told_per_grain_where_there_are_many(seconds, grains, said):
    assert speed_text(seconds, grains) == said


def test_steps_per_contact_is_the_least_over_pairs_and_walls():
    sim = Simulation(scene(), device="cpu", threads=1)
    assert steps_per_contact(sim) == math.inf
    sim.run(until=6e-3)
    from warpdem.kernels.normal import hertz

    from warpdem.model.coefficients import coefficient_table
    from warpdem.model.time_step import contact_time

    met = sim.extremes
    mass = 2500 * 4 / 3 * math.pi * 1e-9
    base = 4 / 3 * 1e7 / (2 * (1 - 0.3**2))
    row = coefficient_table(sim.scene)[0]
    assert row[sim.plan.contact.coefficients.stiffness] == pytest.approx(base, rel=1e-14)
    pair = contact_time(sim.scene, row, mass / 2, 0.5e-3, met["pair_approach_speed"])
    wall = contact_time(sim.scene, row, mass, 1e-3, met["wall_approach_speed"])
    assert steps_per_contact(sim) == pytest.approx(min(pair, wall) * hertz.damped_time(0.6) / 1e-5, rel=1e-9)


def test_quiet_prints_nothing(tmp_path, capfd):
    _, text = run(scene(time={"end": 1e-3, "step": 1e-5, "max_speed": 1}), tmp_path, quiet=True)
    assert text == ""
    assert capfd.readouterr().out == ""


def test_time_to_compile_is_booked_as_such(tmp_path, monkeypatch):
    monkeypatch.setattr(Simulation, "load_kernels", lambda sim: time.sleep(0.2))
    sim, _ = run(scene(), tmp_path, until=1e-4)
    assert 0.2 <= sim.seconds["compile"] < 0.5


def test_until_ends_sooner(tmp_path):
    sim, _ = run(scene(), tmp_path, until=1.5e-3)
    assert sim.step_number == 150
    assert history(tmp_path)[1][-1, 0] == pytest.approx(1.5e-3)


@pytest.mark.parametrize("cut", [1.5e-3, 2e-3])
def test_resume_goes_on_as_if_nothing_had_been(done, tmp_path, cut):
    """Same hash, and history.csv without a gap or a row twice."""
    folder, sim, _ = done
    run(scene(), tmp_path, until=cut)
    again, _ = run(scene(), tmp_path, resume=True)
    assert again.state_hash() == sim.state_hash()
    header, rows = history(tmp_path)
    np.testing.assert_array_equal(np.unique(rows[:, 0]), rows[:, 0])
    whole = history(folder)[1]
    shared = np.isin(np.round(rows[:, 0] / 1e-5), np.round(whole[:, 0] / 1e-5))
    np.testing.assert_array_equal(rows[shared], whole)
    assert json.loads((tmp_path / "run.json").read_text())["status"] == "done"


def test_resume_without_a_checkpoint_is_refused(tmp_path):
    with pytest.raises(SceneError, match="no checkpoint there"):
        run(scene(), tmp_path, resume=True)


def test_output_does_not_change_a_bit(done, tmp_path):
    often = scene(output={"interval": 3e-5, "formats": [], "picture": False})
    assert run(often, tmp_path)[0].state_hash() == done[1].state_hash()


def test_frames_are_written_in_both_formats(tmp_path):
    run(scene(output={"interval": 3e-3, "formats": ["vtk", "usd"], "picture": False}), tmp_path)
    import pyvista
    from pxr import Usd

    [index] = tmp_path.rglob("*.pvd")
    reader = pyvista.get_reader(index)
    np.testing.assert_allclose(sorted(set(reader.time_values)), [0.0, 3e-3, 6e-3], rtol=0, atol=1e-9)
    stages = [p for p in tmp_path.glob("*.usd*")]
    assert stages
    assert Usd.Stage.Open(str(stages[0]))


@pytest.mark.parametrize(("seconds", "quiet", "said"), [(0.0, False, ""), (0.2, False, "compiling\n"), (0.2, True, "")])
def test_a_word_is_said_of_what_takes_long(monkeypatch, seconds, quiet, said):
    monkeypatch.setattr("warpdem.core.progress.LONG", 0.05)
    text = io.StringIO()
    with report_if_long("compiling", Console(file=text, force_terminal=True), quiet):
        time.sleep(seconds)
    time.sleep(0.1)
    assert text.getvalue() == said


def test_the_lines_of_the_readme_read_the_results(tmp_path):
    """From README.md: the block that reads a run back."""
    page = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")
    [block] = [b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "runs.read" in b]
    run(scene(output={"interval": 2e-3, "formats": ["vtk"], "picture": False}), tmp_path)
    left = {}
    exec(block.replace("out/hourglass", tmp_path.as_posix()).replace("glass", "floor"), left)
    header, rows = history(tmp_path)
    np.testing.assert_array_equal(left["run"].history["time"], rows[:, 0])
    np.testing.assert_array_equal(left["force"], rows[:, header.index("floor force z [N]")])
    assert np.any(left["force"] != 0.0)


def test_the_page_on_scenes_lists_the_columns_of_the_history():
    """Every column that is there whatever the scene asks for, and those of walls, planes and samples."""
    page = (Path(__file__).resolve().parent.parent / "scenes" / "README.md").read_text(encoding="utf-8")
    section = page.split("## history.csv")[1].split("\n## ")[0]
    plane = {"point": [0, 0, 0], "normal": [0, 0, 1]}
    asked = {"flow": [{"name": "NAME", **plane}], "mixing": [{"name": "NAME", "by": "x", "cell": 1.0}]}
    floor = {"name": "NAME", "material": "glass", "plane": plane}
    for column in history_columns(scene(walls=[floor], measures=asked)):
        assert f"`{re.sub(' [yz] ', ' x ', column.header)}`" in section, column
