"""Phases: each is the scene with its changes, started from the state before; resumed anywhere, told in one time."""

import copy
import csv
import io
import itertools
import json
import xml.etree.ElementTree as ElementTree
from unittest.mock import Mock

import numpy as np
import pytest
from rich.console import Console

from scene_text import GLASS
from warpdem import SceneError, Simulation, StabilityError
from warpdem.app.phases import run as run_all
from warpdem.core.run_lock import FolderLocked, locked
from warpdem.drawing.rendering import render
from warpdem.scene.file import load_scene, scene_from_dict
from warpdem.state import checkpoint_file

STEP = 2e-5


def tables() -> dict:
    """Grains that fall, settle in a frame that begins to turn, and lose their floor."""
    cell = np.stack(np.meshgrid(np.arange(2), np.arange(2), np.arange(2), indexing="ij"), axis=-1).reshape(-1, 3)
    return {
        "title": "in phases",
        "gravity": [0, 0, -60],
        "materials": {"glass": {"density": 2500, "young_modulus": 4e6, "poisson_ratio": 0.3}},
        "contact": {"rolling": "spring"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.6, "friction": 0.5, "rolling_friction": 0.2}],
        "grains": [
            {"material": "glass", "radius": 1e-3, "positions": ((cell - [0.5, 0.5, 0]) * 2.05e-3 + [0, 0, 1.1e-3]).tolist()}
        ],
        "walls": [
            {"name": "floor", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
            {"name": "tube", "material": "glass", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.01}},
        ],
        "time": {"end": 40 * STEP, "step": STEP, "max_speed": 1},
        "output": {"interval": 20 * STEP, "formats": ["vtk"], "picture": False, "checkpoint_interval": 10 * STEP},
        "engine": {"max_overlap": 0.3},
        "phases": [
            {"name": "fall"},
            {"name": "turn", "frame": {"axis": [0, 1, 0], "schedule": [{"until": 20 * STEP, "rate": [0, 40]}, {"rate": 40}]},
             "time": {"end": 60 * STEP}, "pairs": [{"materials": ["glass", "glass"], "friction": 0.2}]},
            {"name": "open", "without": ["floor"], "output": {"interval": 10 * STEP},
             "walls": [{"name": "tube", "motion": {"axis": [0, 0, 1], "rate": 20}}]},
        ],
    }  # fmt: skip


def scene(change=lambda data: None):
    data = copy.deepcopy(tables())
    change(data)
    return scene_from_dict(data)


def run(of, folder, **keys):
    text = io.StringIO()
    folder.mkdir(exist_ok=True)
    sim = run_all(of, folder, device="cpu", threads=1, console=Console(file=text, width=200), **keys)
    return sim, text.getvalue()


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("phases") / "out"
    return folder, *run(scene(), folder)


def record(folder) -> dict:
    return json.loads((folder / "run.json").read_text())


def state(folder) -> dict:
    return checkpoint_file.read(folder / "checkpoint.h5")


FOLDERS = ("1-fall", "2-turn", "3-open")


def test_a_warning_of_all_phases_is_told_once(tmp_path):
    _, said = run(scene(lambda data: data["materials"]["glass"].update(density=31000)), tmp_path / "out")
    assert said.count("warning materials.glass.density = 31000") == 1
    assert said.count("steps of 2e-05 s on cpu") == 3


def test_each_phase_has_its_changes_and_those_before_it(done):
    _, sim, _ = done
    phases = [scene().phase(k) for k in range(3)]
    assert [p.time.end for p in phases] == [40 * STEP, 60 * STEP, 60 * STEP]
    assert [p.time.step for p in phases] == [STEP] * 3
    assert [len(p.walls) for p in phases] == [2, 2, 1]
    assert [p.pairs[0].friction for p in phases] == [0.5, 0.2, 0.2]
    assert phases[2].pairs[0].restitution == 0.6
    assert phases[2].output.interval == 10 * STEP
    assert [len(p.grains) for p in phases] == [1, 0, 0]
    assert phases[2].title == "in phases: open"
    # the frame that the second began goes on in the third, in its own time; the tube begins to turn where it stands
    assert scene().continues(2) == ("frame", "streams")
    assert sim.scene.frame[0].elapsed == pytest.approx(60 * STEP)
    assert sim.scene.walls[0].motion[0].elapsed == 0.0


def test_results_of_each_phase_and_one_index_over_all(done):
    folder, sim, text = done
    said = record(folder)
    assert said["status"] == "done"
    assert [p["folder"] for p in said["phases"]] == list(FOLDERS)
    np.testing.assert_allclose([p["begin"] for p in said["phases"]], np.array([0, 40, 100]) * STEP)
    assert [record(folder / name)["status"] for name in FOLDERS] == ["done"] * 3
    assert record(folder / "3-open")["state_hash"] == sim.state_hash()
    entries = list(ElementTree.parse(folder / "result.pvd").iter("DataSet"))
    times = [float(e.attrib["timestep"]) for e in entries if e.attrib["name"] == "grains"]
    expected = [0, 20, 40, 60, 80, 100, 110, 120, 130, 140, 150, 160]
    np.testing.assert_allclose(np.array(times) / STEP, expected, rtol=0, atol=1e-9)
    assert all((folder / e.attrib["file"]).exists() for e in entries)
    assert "in phases: turn" in text


def test_motion_goes_on_from_phase_to_phase(done):
    folder = done[0]
    for before, after in itertools.pairwise(FOLDERS):
        last = state(folder / before)
        phase, start = scene().phase(FOLDERS.index(after)), folder / before / "checkpoint.h5"
        first = Simulation(phase, start=start, device="cpu", threads=1)
        np.testing.assert_allclose(first.particles.position, last["record"][:, :3], rtol=0, atol=1e-17)
    with (folder / "3-open" / "history.csv").open() as file:
        header, *rows = csv.reader(file)
    height = header.index("centre_z [m]")
    assert float(rows[-1][height]) < float(rows[0][height])  # nothing holds them any more


@pytest.mark.parametrize("cut", [25, 40, 75, 100, 130])
def test_resume_goes_on_in_any_phase(done, tmp_path, cut):
    whole = done[0]
    run(scene(), tmp_path / "out", until=cut * STEP)
    again, _ = run(scene(), tmp_path / "out", resume=True)
    assert again.state_hash() == done[1].state_hash()
    for name in FOLDERS:
        assert record(tmp_path / "out" / name)["state_hash"] == record(whole / name)["state_hash"]
        assert record(tmp_path / "out" / name)["status"] == "done"
    assert record(tmp_path / "out")["status"] == "done"


def test_resume_of_other_phases_is_refused_before_what_is_not_begun(tmp_path):
    """A phase that is done is not run again: its scene must be the one asked for all the same."""
    run(scene(), tmp_path / "out", until=40 * STEP)
    other = scene(lambda data: data["pairs"][0].update(friction=0.4))
    with pytest.raises(SceneError, match=r"1-fall/checkpoint.h5: belongs to another scene.* other values of pairs;"):
        run(other, tmp_path / "out", resume=True)
    assert not (tmp_path / "out" / "2-turn").exists()
    run(scene(lambda data: data["output"].update(checkpoint_wall_time=5)), tmp_path / "out", resume=True)
    assert record(tmp_path / "out")["status"] == "done"


def test_phases_claim_their_folder_and_leave_none_when_refused(tmp_path):
    with locked(tmp_path / "out"), pytest.raises(FolderLocked, match="another run is writing there"):
        run_all(scene(), tmp_path / "out", device="cpu", threads=1, overwrite=True)
    for folder in (tmp_path / "out", tmp_path / "out" / "2-turn"):
        assert not folder.exists()
    with pytest.raises(SceneError, match="not on this machine"):
        run_all(scene(), tmp_path / "out", device="cuda:77", quiet=True)
    assert list(tmp_path.iterdir()) == []


def test_a_phase_that_stops_itself_is_told(tmp_path):
    strict = scene(lambda data: data["phases"][1].update(engine={"max_overlap": 1e-9}))
    with pytest.raises(StabilityError):
        run(strict, tmp_path / "out")
    said = record(tmp_path / "out")
    assert said["status"] == "stopped itself"
    assert [p["status"] for p in said["phases"]] == ["done", "stopped itself", "not begun"]


def test_one_picture_is_drawn_of_the_whole_and_its_interrupt_loses_nothing(tmp_path, monkeypatch):
    drawn = Mock()
    monkeypatch.setattr("warpdem.drawing.rendering.render", drawn)
    run(scene(), tmp_path / "out", until=50 * STEP, picture=True)
    drawn.side_effect = KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt, match="while the picture was drawn, with all other results written"):
        run(scene(), tmp_path / "out", picture=True, resume=True)
    assert drawn.call_args_list == 2 * [((tmp_path / "out", tmp_path / "out" / "picture.png"),)]
    assert record(tmp_path / "out")["status"] == "done"


def test_picture_of_phases_without_a_common_index_is_of_the_last(tmp_path, monkeypatch):
    drawn = Mock()
    monkeypatch.setattr("warpdem.drawing.rendering.render", drawn)
    run(scene(put(1, "output", {"formats": ["vtkhdf"]})), tmp_path / "out", until=50 * STEP, picture=True)
    drawn.assert_called_once_with(tmp_path / "out" / "2-turn", tmp_path / "out" / "picture.png")


def test_pictures_of_phases_show_the_time_over_all_and_the_names(done, tmp_path, monkeypatch):
    legend = Mock()
    legend.return_value.draw.side_effect = lambda image, panes: image
    monkeypatch.setattr("warpdem.drawing.frame_drawer.Legend", legend)
    for time in (20, 60, 160):
        render(done[0], tmp_path / "a.png", time=time * STEP, size=(64, 64), colour="type")
    headings = [panes[0].heading for _, panes in (call.args for call in legend.return_value.draw.call_args_list)]
    assert headings == ["t = 0.4 ms", "t = 1.2 ms", "t = 3.2 ms"]
    assert [bar.names for bar in legend.call_args.args[1]] == [("glass",)]


def test_a_new_run_leaves_nothing_of_an_older_one(done, tmp_path):
    run(scene(), tmp_path / "out", until=110 * STEP)
    for refused in ({}, {"until": -1.0, "overwrite": True}):
        with pytest.raises(SceneError, match="holds the results of a run|--until -1: .* above 0"):
            run(scene(), tmp_path / "out", **refused)
    run(scene(), tmp_path / "out", until=20 * STEP, overwrite=True)
    assert [p["status"] for p in record(tmp_path / "out")["phases"]] == ["done", "not begun", "not begun"]
    entries = ElementTree.parse(tmp_path / "out" / "result.pvd").iter("DataSet")
    assert max(float(e.attrib["timestep"]) for e in entries) == pytest.approx(20 * STEP)


def test_a_simulation_is_one_phase():
    with pytest.raises(SceneError, match=r"phases: a simulation is one of them: take scene.phase\(0\), or warpdem run"):
        Simulation(scene(), device="cpu", threads=1)


def put(*keys_and_value):
    """A change of one entry of the phases."""
    *keys, last, value = keys_and_value

    def change(data):
        data = data["phases"]
        for key in keys:
            data = data[key]
        data[last] = value

    return change


NO_AXIS = {"axis": [0, 0, 0], "rate": 1}
WRONG = {
    "unknown key": (put(1, "gravitty", [0, 0, 1]), ["phases[1].gravitty", "unknown key", 'did you mean "gravity"']),
    "grains": (put(1, "grains", []), ["phases[1].grains", "a phase cannot change this"]),
    "wrong value": (put(1, "time", "end", -1.0), ["phases[1].time.end = -1.0", "must be > 0"]),
    "wrong value in a list": (put(2, "walls", 0, "motion", NO_AXIS), ["phases[2].walls[0].motion.axis", "zero vector"]),
    "unknown key below": (put(2, "walls", 0, "motoin", {}), ["phases[2].walls[0].motoin", "unknown key", "motion"]),
    "key missing": (put(2, "walls", 0, "name", "lid"), ["phases[2].walls[0].material", "missing: Name of the material"]),
    "no such wall": (put(2, "without", ["lid"]), ['phases[2].without = "lid"', 'there are "floor", "tube"']),
    "name twice": (put(2, "name", "turn"), ["phases[2].name", "phases[1] has this name too"]),
    "no table": (put(1, "walls", 3), ["phases[1].walls = 3", "must be a list"]),
    "missing material": (put(2, "walls", 0, "material", "tin"), ["phases[2].walls[0].material", "no such material"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_phases_are_named(case):
    change, words = WRONG[case]
    with pytest.raises(SceneError) as error:
        scene(change)
    for word in words:
        assert word in str(error.value)


def test_phases_from_a_file_with_units_and_overrides(tmp_path):
    (tmp_path / "scene.toml").write_text(GLASS + """
[[grains]]
material = "glass"
positions = [[0, 0, 1]]
radius = "1 mm"
[time]
end = 1
[[phases]]
name = "one"
[[phases]]
name = "two"
time.end = "20 ms"
frame = { axis = [0, 0, 1], rate = "30 rpm" }
""")
    loaded = load_scene(tmp_path / "scene.toml", ["phases.0.time.end=0.25"])
    assert [loaded.phase(k).time.end for k in range(2)] == [0.25, 0.02]
    assert loaded.phase(1).frame[0].rate == pytest.approx(np.pi)
