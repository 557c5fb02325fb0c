"""Runs that end before their time: unsound states, full disks, signals; what may change when they are resumed."""

import errno
import json
import os
import signal
from contextlib import ExitStack
from unittest.mock import Mock

import h5py
import numpy as np
import pytest

from twelve_grains import OFTEN, history, run, scene
from warpdem import SceneError, Simulation, StabilityError
from warpdem.errors import OutputError
from warpdem.output.read_vtk import read_results
from warpdem.state import checkpoint, checkpoint_file


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runner") / "out"
    folder.mkdir()
    return folder, *run(scene(), folder)


def status(folder) -> str:
    return json.loads((folder / "run.json").read_text())["status"]


def test_blow_up_keeps_the_last_good_checkpoint_and_says_so(tmp_path):
    bad = scene(engine={"max_overlap": 5e-3}, output=OFTEN)
    with pytest.raises(StabilityError, match="allowed is engine.max_overlap"):
        run(bad, tmp_path)
    stopped = json.loads((tmp_path / "run.json").read_text())
    assert stopped["status"] == "stopped itself"
    kept = checkpoint_file.read(tmp_path / "checkpoint.h5")
    assert 0 < kept["step"] < stopped["steps"] <= kept["step"] + 20
    assert kept["extreme"][[0, 2]].max() < 5e-3


@pytest.mark.parametrize("wall_time", [60.0, 1e-9])
def test_checkpoints_come_by_simulated_time_and_by_wall_time(tmp_path, monkeypatch, wall_time):
    steps = []
    save = checkpoint.save
    monkeypatch.setattr(checkpoint, "save", lambda sim, path: (steps.append(sim.step_number), save(sim, path)))
    run(scene(output={**OFTEN, "checkpoint_interval": 1e-3, "checkpoint_wall_time": wall_time}), tmp_path, until=3.5e-3)
    by_time = [0, 100, 200, 300, 350]
    assert steps == by_time if wall_time == 60.0 else set(by_time) < set(steps)


@pytest.mark.parametrize("format_", ["history", "vtk", "vtkhdf", "usd"])
def test_full_disk_stops_the_run_and_the_rest_follows_after_resume(done, tmp_path, monkeypatch, file_size_limit, format_):
    """Rows or frames that do not fit any more; what was written before stays readable."""
    rows = 3e-4 if format_ == "history" else 1.0
    formats = [] if format_ == "history" else [format_]
    often = {"interval": 3e-4, "history_interval": rows, "checkpoint_interval": 8e-4, "formats": formats, "picture": False}
    asked = scene(output=often)
    step = Simulation.step
    with ExitStack() as full:

        def filled(sim, count=1):
            step(sim, count)
            if sim.step_number == 240:
                full.enter_context(file_size_limit(700))

        monkeypatch.setattr(Simulation, "step", filled)
        with pytest.raises(OutputError, match=r"stopped at t = .* cannot be written .*checkpoint is kept"):
            run(asked, tmp_path)
    monkeypatch.undo()
    assert status(tmp_path) in ("output cannot be written", "running")  # run.json itself may not fit
    assert checkpoint_file.read(tmp_path / "checkpoint.h5")["step"] == 160
    again, _ = run(asked, tmp_path, resume=True)
    assert again.state_hash() == done[1].state_hash()
    if format_ == "history":
        np.testing.assert_allclose(history(tmp_path)[1][:, 0], np.arange(21) * 3e-4, rtol=0, atol=1e-12)
    if format_ == "vtk":
        np.testing.assert_allclose(read_results(tmp_path).times, np.arange(21) * 3e-4, rtol=0, atol=1e-12)
    if format_ == "vtkhdf":
        with h5py.File(tmp_path / "result.vtkhdf") as file:
            np.testing.assert_allclose(file["VTKHDF/Steps/Values"], np.arange(21) * 3e-4, rtol=0, atol=1e-12)
    assert status(tmp_path) == "done"


def test_full_disk_at_a_checkpoint_keeps_the_one_before(tmp_path, monkeypatch):
    save, count = checkpoint.save, []

    def full(sim, path):
        count.append(sim.step_number)
        if len(count) == 4:
            error = OSError(errno.ENOSPC, "No space left on device")
            monkeypatch.setattr("os.fsync", Mock(side_effect=error))
        save(sim, path)

    monkeypatch.setattr(checkpoint, "save", full)
    with pytest.raises(OutputError, match=r"checkpoint.h5: cannot be written \(No space left on device\)") as stopped:
        run(scene(output=OFTEN), tmp_path)
    assert stopped.value.exit_code == 3
    assert checkpoint_file.read(tmp_path / "checkpoint.h5")["step"] == 40
    assert status(tmp_path) == "output cannot be written"
    assert [path.name for path in tmp_path.iterdir() if ".part" in path.name] == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_leave_a_checkpoint_of_the_present_step(done, tmp_path, monkeypatch, number):
    step = Simulation.step

    def signalled(sim, count=1):
        step(sim, count)
        if 200 < sim.step_number < 300:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(Simulation, "step", signalled)
    with pytest.raises(KeyboardInterrupt):
        run(scene(), tmp_path)
    monkeypatch.undo()
    there = json.loads((tmp_path / "run.json").read_text())
    assert there["status"] == "interrupted"
    assert 200 < checkpoint_file.read(tmp_path / "checkpoint.h5")["step"] == there["steps"] < 600
    again, _ = run(scene(), tmp_path, resume=True)
    assert again.state_hash() == done[1].state_hash()
    assert (tmp_path / "history.csv").read_text() == (done[0] / "history.csv").read_text()


def test_a_terminal_that_closes_ends_no_run_under_nohup(done, tmp_path, monkeypatch):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    step = Simulation.step

    def closed(sim, count=1):
        step(sim, count)
        os.kill(os.getpid(), signal.SIGHUP)

    monkeypatch.setattr(Simulation, "step", closed)
    try:
        assert run(scene(), tmp_path)[0].state_hash() == done[1].state_hash()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


GOES_ON = {
    "checkpoint_wall_time": {"output": {**OFTEN, "checkpoint_wall_time": 7.0}},
    "checkpoint_interval": {"output": {**OFTEN, "checkpoint_interval": 1e-3}},
    "picture": {"output": {**OFTEN, "picture": True}},
    "skin": {"engine": {"max_overlap": 0.3, "skin": 3e-4}},
    "guards": {"engine": {"max_overlap": 0.3, "guards": "record"}},
    "max_overlap": {"engine": {"max_overlap": 0.35}},
}


@pytest.mark.parametrize("case", GOES_ON)
def test_what_changes_no_result_may_change_at_resume(done, tmp_path, monkeypatch, case):
    monkeypatch.setattr("warpdem.drawing.rendering.render", Mock())
    run(scene(output=OFTEN), tmp_path, until=2e-3)
    again, _ = run(scene(**{"output": OFTEN, **GOES_ON[case]}), tmp_path, resume=True)
    assert again.state_hash() == done[1].state_hash()
    assert checkpoint_file.read(tmp_path / "checkpoint.h5")["scene_hash"] == again.model.given.hash


OTHER_RESULTS = {
    "output.interval": {"output": {**OFTEN, "interval": 1e-3}},
    "output.history_interval": {"output": {**OFTEN, "history_interval": 1e-3}},
    "output.formats": {"output": {**OFTEN, "formats": ["vtk"]}},
    "output.wall_loads": {"output": {**OFTEN, "wall_loads": False}},
    "output.orientation": {"output": {**OFTEN, "orientation": True}},
    "engine.precision": {"engine": {"max_overlap": 0.3, "precision": "mixed"}},
    "time.end": {"time": {"end": 7e-3, "step": 1e-5, "max_speed": 1}},
}


@pytest.mark.parametrize("key", OTHER_RESULTS)
def test_what_changes_results_is_refused_at_resume_by_its_key(tmp_path, key):
    run(scene(output=OFTEN), tmp_path, until=1e-4)
    with pytest.raises(SceneError, match=f"other values of {key}; nothing was changed") as refused:
        run(scene(**{"output": {**OFTEN, "picture": True}, **OTHER_RESULTS[key]}), tmp_path, resume=True)
    assert ("the part before is there already" in str(refused.value)) == key.startswith("output.")
    assert ("--until" in str(refused.value)) == (key == "time.end")
