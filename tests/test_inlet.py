"""Streams and walls: grains come in where walls leave room at that moment, and a run says when they could not."""

import itertools

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation, StabilityError
from warpdem.app import summary
from warpdem.filling.inlet import Inlet
from warpdem.filling.inlet_walls import InletWalls
from warpdem.filling.stream_place import StreamPlace

R = 1e-3
BOX = {"min": [-0.01, -0.01, -0.005], "max": [0.01, 0.01, 0.01]}
STREAM = {"material": "g", "box": BOX, "diameter": 2 * R, "count_rate": 2e4, "until": 0.02}


def scene(folder, walls, time=None, stream=(), **keys):
    """A scene with one stream; walls are sizes of a box (from, to) [m], or tables of a shape, with what else the wall says."""
    entries = []
    for name, (shape, more) in walls.items():
        if not isinstance(shape, dict):
            low, high = map(np.array, shape)
            block = trimesh.creation.box(high - low)
            block.apply_translation(0.5 * (low + high))
            block.export(folder / f"{name}.stl")
            shape = {"mesh": f"{name}.stl"}
        entries.append({"name": name, "material": "g", **shape, **more})
    return Scene.model_validate(
        {
            "base": folder,
            "gravity": [0, 0, -9.81],
            "materials": {"g": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.7, "friction": 0.5}],
            "walls": entries,
            "streams": [{**STREAM, **dict(stream)}],
            "time": time or {"end": 0.05, "step": 1e-5, "max_speed": 1.0},
            **keys,
        }
    )


FLOOR = {"floor": ({"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}, {})}


def test_grains_come_in_on_the_side_of_a_floor_where_they_may_be(tmp_path):
    hashes = set()
    for threads in (1, 2):
        sim = Simulation(scene(tmp_path, FLOOR), device="cpu", threads=threads)
        assert sim.notes == [
            "streams[0].box: the wall 'floor' leaves 62% of it: grains are inserted where it leaves space for them"
        ]
        lowest = []
        for _ in range(20):
            sim.step(50)
            lowest.append(sim.particles.position[:, 2].min(initial=np.inf))
        assert min(lowest) > 0.95 * R
        assert sim.extremes["wall_overlap_share"] < 0.05
        if threads == 1:
            sim.save_checkpoint(tmp_path / "c.h5")
            resumed = Simulation.from_checkpoint(tmp_path / "c.h5", threads=1)
        sim.step(500)
        hashes.add(sim.state_hash())
    resumed.step(500)
    assert hashes == {resumed.state_hash()}


def test_a_run_says_what_a_stream_could_not_bring(tmp_path):
    crowded = scene(tmp_path, FLOOR, stream={"count_rate": 1e6})
    sim = Simulation(crowded, device="cpu", threads=1)
    sim.step(500)
    [words] = summary.shortfalls(sim)
    assert words.startswith(f"streams[0] inserted {sim.inlets[0].count} grains of 5000 grains, ")
    assert sim.inlets[0].due(500) == (pytest.approx(5000.0), "grains")
    kept_up = Simulation(scene(tmp_path, FLOOR, stream={"count_rate": 2000.0}), device="cpu", threads=1)
    kept_up.step(500)
    assert kept_up.inlets[0].count > 5
    assert summary.shortfalls(kept_up) == []


def inlet(one: Scene, places=None, moves=None):
    """The inlet of a scene's stream, with walls that stand at ``places(time)``, without a simulation."""
    from warpdem.model.walls import load_meshes

    still = [(np.eye(3), np.zeros(3)) for _ in one.walls]
    place = StreamPlace(one.streams[0].box)
    walls = InletWalls(0, one, load_meshes(one), place, places or (lambda time: still), moves or [False] * len(one.walls))
    return Inlet(0, one, 1e-5, place, walls)


def brought(one: Inlet, step: int):
    new = one.insert(step, np.zeros((0, 3)), np.zeros(0), lambda way: way)
    return new.position, 0.5 * np.array(new.drawn)


PLATE = [-0.008, -0.008, -7.5e-4], [0.008, 0.008, 7.5e-4]
BLOCK = [-0.008, -0.008, -0.003], [0.008, 0.008, 0.006]


@pytest.mark.parametrize("body", [PLATE, BLOCK])
def test_grains_come_in_beside_closed_meshes_thinner_and_thicker_than_a_grain(tmp_path, body):
    place, radius = brought(inlet(scene(tmp_path, {"body": (body, {})})), 1000)
    assert len(place) > 20
    outside = np.linalg.norm(np.maximum(np.maximum(body[0] - place, place - body[1]), 0.0), axis=1)
    assert (outside >= radius * (1.0 - 1e-7)).all()


def test_a_vessel_around_the_box_holds_what_comes_in(tmp_path):
    vessel = inlet(scene(tmp_path, {"vessel": (([-0.02] * 3, [0.02] * 3), {})}))
    assert len(brought(vessel, 1000)[0]) > 60
    assert vessel.walls.notes == ["streams[0].box: is within the closed mesh 'vessel': its grains are inserted and stay inside"]


def test_a_wall_that_passes_the_box_is_kept_clear_of_while_it_is_there(tmp_path):
    one = scene(tmp_path, {"paddle": (BLOCK, {"motion": {"velocity": [1.0, 0, 0]}})})

    def places(time):
        return [(np.eye(3), np.array([2.0 * time - 0.04, 0.0, 0.0]))]

    swept = inlet(one, places, [True])
    blocked = []
    for step in range(0, 4001, 100):
        place, radius = brought(swept, step)
        middle = places(step * 1e-5)[0][1]
        outside = np.linalg.norm(np.maximum(np.maximum(BLOCK[0] + middle - place, place - BLOCK[1] - middle), 0.0), axis=1)
        assert (outside >= radius * (1.0 - 1e-7)).all()
        blocked.append(np.abs(middle[0]) < 0.012 and len(place) < 10)
    assert any(blocked)
    assert "'paddle' leaves " in swept.walls.notes[0] and "to 100% of it" in swept.walls.notes[0]


def test_far_walls_change_no_bit(tmp_path):
    far = {"far": (([0.05] * 3, [0.06] * 3), {}), "under": ({"plane": {"point": [0, 0, -0.02], "normal": [0, 0, 1]}}, {})}
    without = Inlet(0, scene(tmp_path, {}), 1e-5, StreamPlace(scene(tmp_path, {}).streams[0].box))
    with_walls = inlet(scene(tmp_path, far))
    for step in (200, 400):
        for one, two in zip(brought(with_walls, step), brought(without, step), strict=True):
            assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize(
    ("walls", "message"),
    [
        ({"lid": ({"plane": {"point": [0, 0, 0.02], "normal": [0, 0, 1]}}, {})}, "nowhere .* clear of the wall 'lid'"),
        ({"solid": ({"cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.1, "inside": False}}, {})}, "'solid'"),
        (
            {"blade": (([-0.011, -0.011, -0.01], [0.011, 0.011, 0.011]), {}), "vessel": (([-0.1] * 3, [0.1] * 3), {})},
            "the wall 'blade'",
        ),
    ],
)
def test_a_box_that_is_never_free_is_refused(tmp_path, walls, message):
    with pytest.raises(SceneError, match=rf"<scene>: streams\[0\]\.box: .*{message}.*: move the box off it"):
        Simulation(scene(tmp_path, walls), device="cpu", threads=1)


def test_a_box_that_a_moving_wall_frees_later_is_not_refused(tmp_path):
    one = scene(tmp_path, {"gate": (FLOOR["floor"][0], {"motion": {"velocity": [0, 0, -1]}})})
    later = inlet(one, lambda time: [(np.eye(3), np.array([0.0, 0.0, 0.012 - 1.2 * time]))], [True])
    counts = list(itertools.accumulate(len(brought(later, step)[0]) for step in (200, 900, 1500, 2000)))
    assert counts[0] == 0
    assert counts[-1] > 50


def test_a_rotor_sweeps_its_feed(tmp_path):
    """A blade of a closed mesh that passes the box again and again, at up to 4 m/s; within it a grain would stop the run."""
    blade = ([0.004, -0.008, -7.5e-4], [0.03, 0.008, 7.5e-4]), {"motion": {"axis": [0, 1, 0], "rate": "1200 rpm"}}
    stream = {"velocity": [0, 0, -0.5], "count_rate": 4000.0, "box": {"min": [0.005, -0.01, -0.01], "max": [0.025, 0.01, 0.01]}}
    borders = {"z": {"min": -0.03, "kind": "open"}}
    time = {"end": 0.15, "step": 1e-5, "max_speed": 4.0}
    one = scene(tmp_path, {"blade": blade}, time, {**stream, "until": None}, borders=borders, engine={"max_overlap": 0.3})
    sim = Simulation(one, device="cpu", threads=1)
    sim.step(5500)
    assert sim.extremes["wall_approach_speed"] > 1.0  # it met them
    assert sim.inlets[0].count > 100


def test_a_grain_that_was_placed_in_a_wall_is_not_told_to_take_smaller_steps(tmp_path, monkeypatch):
    monkeypatch.setattr(InletWalls, "at", lambda self, time: [])
    sim = Simulation(scene(tmp_path, FLOOR), device="cpu", threads=1)
    with pytest.raises(StabilityError, match="Nothing moved as far as that: it was so when the grain was placed") as error:
        sim.step(1000)
    assert "smaller time.step" not in str(error.value)
