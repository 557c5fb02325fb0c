"""A folder of results read back: record, frames, phases, and what is no run."""

import json

import numpy as np
import pytest

import twelve_grains
import warpdem
from warpdem import WarpdemError, runs
from warpdem.core.run_lock import LOCK, locked


def recorded(folder, record, history="time [s],x [m]\n0,1\n1,2\n"):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "run.json").write_text(json.dumps(record))
    (folder / "history.csv").write_text(history)
    return folder


def test_a_run_gives_its_record_and_its_frames(tmp_path):
    output = {"interval": 2e-3, "formats": ["vtk"], "picture": False}
    sim, _ = twelve_grains.run(twelve_grains.scene(output=output), tmp_path / "out")
    run = warpdem.runs.read(str(tmp_path / "out"))
    assert run.status == "done" and run.record["state_hash"] == sim.state_hash() and run.last is run.record
    np.testing.assert_allclose(run.frames.times, [0, 2e-3, 4e-3, 6e-3])
    np.testing.assert_allclose(run.frames.frame(3).position, sim.particles.position, rtol=1e-6)
    assert repr(run) == f"<Run in {tmp_path / 'out'} of {sim.scene.source}: done at t = 0.006 s, 12 grains>"


def test_a_run_with_phases_gives_one_history_of_those_that_have_begun(tmp_path):
    recorded(tmp_path / "1-fill", {"status": "done", "time": 1.0, "grains": 5})
    recorded(tmp_path / "2-turn", {"status": "interrupted", "time": 1.0, "grains": 7})
    phases = [
        {"name": "fill", "folder": "1-fill", "begin": 0.0, "status": "done"},
        {"name": "turn", "folder": "2-turn", "begin": 1.0, "status": "interrupted"},
        {"name": "empty", "folder": "3-empty", "begin": 2.0, "status": "not begun"},
    ]
    (tmp_path / "run.json").write_text(json.dumps({"status": "interrupted", "scene": "a.toml", "phases": phases}))
    run = runs.read(tmp_path)
    assert run.history["time"].tolist() == [0.0, 1.0, 2.0] and run.history["x"].tolist() == [1.0, 2.0, 2.0]
    assert run.last["grains"] == 7
    assert repr(run).endswith("of a.toml: interrupted at t = 1 s, 7 grains, 2 phases>")


def test_folders_that_hold_no_run_are_told(tmp_path):
    with pytest.raises(WarpdemError, match="there: no such folder; give the folder of a run"):
        runs.read(tmp_path / "there")
    with pytest.raises(WarpdemError, match=r"holds no run\.json"):
        runs.read(tmp_path)
    recorded(tmp_path / "mine" / "results", {"status": "done"})
    with pytest.raises(WarpdemError, match="the results are in .*mine/results; give that folder"):
        runs.read(tmp_path / "mine")


@pytest.mark.parametrize("text", ["{", "[]", '{"phases": [1]}', '{"phases": [{"folder": "x"}]}', "[" * 100_000])
def test_a_record_that_cannot_be_read_is_told(tmp_path, text):
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(WarpdemError, match=r"run\.json: cannot be read as the record of a run"):
        runs.read(tmp_path)


def test_a_record_leads_to_no_other_folder(tmp_path):
    phase = {"name": "x", "folder": "../other", "begin": 0.0, "status": "done"}
    (tmp_path / "run.json").write_text(json.dumps({"phases": [phase]}))
    with pytest.raises(WarpdemError, match="'../other' is no folder of a phase"):
        runs.read(tmp_path)


def test_an_unfinished_run_is_read(tmp_path):
    run = runs.read(recorded(tmp_path / "a", {"status": "running", "scene": "b.toml"}))
    assert run.history.rows == 2
    with locked(tmp_path / "a"):
        assert repr(run).endswith("of b.toml: running>")


def test_a_run_that_was_killed_is_not_said_to_run(tmp_path):
    """Whether the file of its lock is still there, as after SIGKILL, or was removed with it."""
    run = runs.read(recorded(tmp_path / "a", {"status": "running", "scene": "b.toml"}))
    assert run.status == "ended without a record"
    (tmp_path / "a" / LOCK).write_text("{}")
    assert run.status == "ended without a record"


def test_a_run_that_has_ended_since_its_record_was_read_is_done(tmp_path):
    with locked(tmp_path / "a"):
        run = runs.read(recorded(tmp_path / "a", {"status": "running", "scene": "b.toml"}))
        (tmp_path / "a" / "run.json").write_text(json.dumps({"status": "done", "scene": "b.toml"}))
        assert run.status == "running"
    assert run.status == "done"
