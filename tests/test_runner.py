"""A run with its outputs, from Python: files, run.json, history, summary, resume."""

import csv
import errno
import io
import json
import math
import os
import re
import shutil
import signal
import time
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import Mock

import h5py
import numpy as np
import pytest
from rich.console import Console

from warpdem import Scene, SceneError, Simulation, StabilityError
from warpdem.app.outputs import output_schedule
from warpdem.app.run import run_scene
from warpdem.app.run_folder import check_request, default_folder, named_folder
from warpdem.app.summary import print_summary, speed_text, steps_per_contact
from warpdem.core.progress import report_if_long
from warpdem.core.run_lock import FolderLocked, locked
from warpdem.errors import OutputError
from warpdem.model.digests import scene_hash
from warpdem.output.history import history_columns
from warpdem.output.read_vtk import read_results
from warpdem.state import checkpoint

GLASS = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}


def scene(**changes) -> Scene:
    """Twelve grains that fall on a floor and roll."""
    rng = np.random.default_rng(12)
    cell = np.stack(np.meshgrid(np.arange(2), np.arange(2), np.arange(3), indexing="ij"), axis=-1).reshape(-1, 3)
    data = {
        "title": "twelve grains",
        "gravity": [0, 0, -60],
        "materials": {"glass": GLASS},
        "contact": {"rolling": "constant"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.1}],
        "grains": [
            {
                "material": "glass",
                "positions": cell * 2.05e-3 + [0, 0, 1.1e-3],
                "radius": 1e-3,
                "velocities": rng.normal(0, 0.05, (12, 3)),
            }
        ],
        "walls": [{"name": "floor", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 6e-3, "step": 1e-5, "max_speed": 1},
        "output": {"interval": 2e-3, "formats": [], "picture": False},
        "engine": {"max_overlap": 0.3},
    }
    return Scene.model_validate(data | changes)


def run(of: Scene, folder, **keys):
    text = io.StringIO()
    sim = run_scene(of, folder, device="cpu", threads=1, console=Console(file=text, width=200), **keys)
    return sim, text.getvalue()


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runner") / "out"
    folder.mkdir()
    return folder, *run(scene(), folder)


def history(folder) -> tuple[list[str], np.ndarray]:
    with (folder / "history.csv").open(newline="") as file:
        header, *rows = list(csv.reader(file))
    return header, np.array(rows, dtype=float)


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

    from warpdem.model.features import coefficient_table
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


OFTEN = {"interval": 2e-3, "formats": [], "picture": False, "checkpoint_interval": 2e-4}


def status(folder) -> str:
    return json.loads((folder / "run.json").read_text())["status"]


def test_blow_up_keeps_the_last_good_checkpoint_and_says_so(tmp_path):
    bad = scene(engine={"max_overlap": 5e-3}, output=OFTEN)
    with pytest.raises(StabilityError, match="allowed is engine.max_overlap"):
        run(bad, tmp_path)
    stopped = json.loads((tmp_path / "run.json").read_text())
    assert stopped["status"] == "stopped itself"
    kept = checkpoint.read(tmp_path / "checkpoint.h5")
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


def test_a_new_run_in_the_folder_takes_the_old_checkpoint_away(tmp_path, monkeypatch):
    """Ended before its first checkpoint, it could not go on from the other run's: its rows are gone."""
    run(scene(), tmp_path, until=1e-3)
    monkeypatch.setattr(checkpoint, "save", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        run(scene(), tmp_path, overwrite=True)
    assert not (tmp_path / "checkpoint.h5").exists()


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
    assert checkpoint.read(tmp_path / "checkpoint.h5")["step"] == 160
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
    assert checkpoint.read(tmp_path / "checkpoint.h5")["step"] == 40
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
    assert 200 < checkpoint.read(tmp_path / "checkpoint.h5")["step"] == there["steps"] < 600
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
    assert checkpoint.read(tmp_path / "checkpoint.h5")["scene_hash"] == again.model.given.hash


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


def test_default_folder_never_holds_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert default_folder(tmp_path / "some" / "bed.toml").as_posix() == "out/bed"
    (tmp_path / "out" / "bed").mkdir(parents=True)
    (tmp_path / "out" / "bed" / "run.json").touch()
    assert default_folder(tmp_path / "bed.toml").as_posix() == "out/bed-2"


def test_folder_of_a_result_stage_is_named_after_its_run(tmp_path, monkeypatch):
    assert named_folder(Path("out/drum/result.usda")).as_posix() == "out/drum"
    assert named_folder(Path("out/drum/result.toml")).as_posix() == "out/result"
    monkeypatch.chdir(tmp_path)
    assert named_folder(Path("result.usdc")).name == tmp_path.name


def test_folder_with_results_is_refused(tmp_path):
    check_request(tmp_path / "new", None, overwrite=False)
    assert not (tmp_path / "new").exists()
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "run.json").touch()
    with pytest.raises(SceneError, match="holds the results of a run"):
        check_request(tmp_path / "new", None, overwrite=False)
    check_request(tmp_path / "new", None, overwrite=True)
    (tmp_path / "file").touch()
    for below in (tmp_path / "file" / "below", tmp_path / "file"):
        with pytest.raises(SceneError, match=r"cannot be written \(.*file is no folder"):
            check_request(below, None, overwrite=False)


def held(folder, at, monkeypatch):
    """Have ``at`` called with what happens while a run is set up in ``folder``."""
    real = Simulation.__init__

    def while_set_up(sim, *arguments, **keys):
        at()
        real(sim, *arguments, **keys)

    monkeypatch.setattr(Simulation, "__init__", while_set_up)


@pytest.mark.parametrize("keys", [{}, {"overwrite": True}, {"resume": True}])
def test_a_folder_is_claimed_before_anything_is_computed(tmp_path, monkeypatch, keys):
    refused = []

    def second():
        assert default_folder(tmp_path / "bed.toml").as_posix() == "out/bed-2"
        monkeypatch.undo()
        monkeypatch.chdir(tmp_path)
        with pytest.raises(FolderLocked, match=rf"out/bed: another run is writing there \(process {os.getpid()} on"):
            run(scene(), Path("out/bed"), **keys)
        refused.append(True)

    monkeypatch.chdir(tmp_path)
    held(tmp_path, second, monkeypatch)
    run(scene(), Path("out/bed"), until=1e-4)
    assert refused == [True]
    assert ".running" not in os.listdir("out/bed")
    assert default_folder(tmp_path / "bed.toml").as_posix() == "out/bed-2"


def test_a_run_that_is_refused_leaves_no_folder(tmp_path):
    with pytest.raises(SceneError, match="not on this machine"):
        run_scene(scene(), tmp_path / "some" / "where", device="cuda:77", quiet=True)
    assert os.listdir(tmp_path) == []
    (tmp_path / "mine").mkdir()
    with pytest.raises(SceneError, match="not on this machine"):
        run_scene(scene(), tmp_path / "mine", device="cuda:77", quiet=True)
    assert os.listdir(tmp_path) == ["mine"] and os.listdir(tmp_path / "mine") == []


@pytest.mark.parametrize("anew", [False, True])
def test_a_folder_that_is_removed_stops_the_run_and_is_left_to_others(tmp_path, monkeypatch, anew):
    step, folder = Simulation.step, tmp_path / "out"
    with ExitStack() as other:

        def removed(sim, count=1):
            step(sim, count)
            if 200 < sim.step_number and not (tmp_path / "done").exists():
                (tmp_path / "done").touch()
                shutil.rmtree(folder)
                if anew:
                    other.enter_context(locked(folder))

        monkeypatch.setattr(Simulation, "step", removed)
        said = "now belongs to another run" if anew else "was removed during the run"
        with pytest.raises(OutputError, match=said):
            run(scene(output=OFTEN), folder)
        assert not anew or [name for name in os.listdir(folder) if name != "run.json"] == [".running"]


def test_run_scene_takes_a_name_and_overwrites_nothing_unasked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(scene(), "mine", until=1e-4)
    before = {path: path.read_bytes() for path in Path("mine").iterdir()}
    with pytest.raises(SceneError, match=r"mine: holds the results of a run.*overwrite=True"):
        run(scene(), "mine")
    assert {path: path.read_bytes() for path in Path("mine").iterdir()} == before
    with pytest.raises(SceneError, match="--until 0: .* above 0"):
        run(scene(), "other", until=0.0)
    assert not Path("other").exists()
    run(scene(), "mine", until=2e-4, overwrite=True)
    assert history(Path("mine"))[1][-1, 0] == pytest.approx(2e-4)


@pytest.mark.parametrize(("seconds", "quiet", "said"), [(0.0, False, ""), (0.2, False, "compiling\n"), (0.2, True, "")])
def test_a_word_is_said_of_what_takes_long(monkeypatch, seconds, quiet, said):
    monkeypatch.setattr("warpdem.core.progress.LONG", 0.05)
    text = io.StringIO()
    with report_if_long("compiling", Console(file=text, force_terminal=True), quiet):
        time.sleep(seconds)
    time.sleep(0.1)
    assert text.getvalue() == said


def test_the_lines_of_the_readme_read_the_history(done, monkeypatch):
    """From README.md: the block that reads history.csv, run."""
    page = (Path(__file__).resolve().parent.parent / "README.md").read_text(encoding="utf-8")
    [block] = [b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "history.csv" in b]
    left = {}
    exec(block.replace("out/hourglass", done[0].as_posix()).replace("glass", "floor"), left)
    header, rows = history(done[0])
    np.testing.assert_array_equal(left["table"]["time [s]"], rows[:, 0])
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
