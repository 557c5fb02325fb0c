"""Folders of results: their default names, who may write into one, and what a refused run leaves."""

import os
import shutil
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import Mock

import pytest

from twelve_grains import OFTEN, history, run, scene
from warpdem import SceneError, Simulation
from warpdem.app.run import run_scene
from warpdem.app.run_folder import check_request, default_folder, named_folder
from warpdem.core.run_lock import FolderLocked, locked
from warpdem.errors import OutputError
from warpdem.state import checkpoint


def test_a_new_run_in_the_folder_takes_the_old_checkpoint_away(tmp_path, monkeypatch):
    """Ended before its first checkpoint, it could not go on from the other run's: its rows are gone."""
    run(scene(), tmp_path, until=1e-3)
    monkeypatch.setattr(checkpoint, "save", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        run(scene(), tmp_path, overwrite=True)
    assert not (tmp_path / "checkpoint.h5").exists()


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
