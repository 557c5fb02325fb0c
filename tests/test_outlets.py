"""Outlets: each shape, at rest, in the laboratory and carried by a wall; what they remove and when, and the columns."""

import csv

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation, load_scene
from warpdem.runner import run_scene
from warpdem.scene.convert import convert
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

R = 1e-3
SHAPES = {
    "box": {"box": {"min": [0.05, -1, -1], "max": [1, 1, 1]}},
    "plane": {"plane": {"point": [0.05, 0, 0], "normal": [1, 0, 0]}},
    "disk": {"plane": {"point": [0.05, 0, 0], "normal": [1, 0, 0], "radius": 0.012}},
    "cylinder": {"cylinder": {"point": [0.05, 0, 0], "axis": [1, 0, 0], "radius": 0.012, "length": 0.05}},
    "sphere": {"sphere": {"centre": [0.06, 0, 0], "radius": 0.01}},
    "mesh": {"mesh": {"file": "block.stl", "scale": 0.01, "translate": [0.055, 0, 0]}},
}
"""Each begins at x = 0.05 on the x axis; all but the first two end at 12 mm or less beside it."""
FAR = 1000.0  # [m]: where an outlet meets no grain


def hole(name, **keys):
    """Outlet "hole" of a shape, and outlets of all others far away: so that all shapes have the same kernels."""
    far = {
        "box": {"box": {"min": [FAR, -1, -1], "max": [FAR + 1, 1, 1]}},
        "plane": {"plane": {"point": [FAR, 0, 0], "normal": [1, 0, 0]}},
        "disk": {"plane": {"point": [FAR, 0, 0], "normal": [1, 0, 0], "radius": 0.012}},
        "cylinder": {"cylinder": {"point": [FAR, 0, 0], "axis": [1, 0, 0], "radius": 0.012, "length": 0.05}},
        "sphere": {"sphere": {"centre": [FAR, 0, 0], "radius": 0.01}},
        "mesh": {"mesh": {"file": "block.stl", "scale": 0.01, "translate": [FAR, 0, 0]}},
    }
    return [{"name": "hole", **SHAPES[name], **keys}, *({"name": f"far_{k}", **far[k], **keys} for k in far if k != name)]


def scene(folder, outlets, positions=((0, 0, 0),), velocities=None, **keys):
    grains = {"material": "g", "positions": [list(p) for p in positions], "radius": R}
    if velocities is not None:
        grains["velocities"] = velocities
    trimesh.creation.box([1, 2, 2]).export(folder / "block.stl")
    return Scene.model_validate(
        {
            "base": folder,
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": 2500.0, "young_modulus": 1e6, "poisson_ratio": 0.3}},
            "contact": {"tangential": "none", "rolling": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.7}],
            "grains": [grains],
            "outlets": outlets,
            "time": {"end": 0.2, "step": 1e-4},
            **keys,
        }
    )


@pytest.mark.parametrize("name", SHAPES)
def test_a_grain_is_removed_at_the_step_at_which_its_centre_is_inside(device, tmp_path, name):
    """Two grains side by side: 0 along the axis of the outlet, 1 beside it where it has an end."""
    sim = Simulation(scene(tmp_path, hole(name), [(0, 0, 0), (0, 0.02, 0)], [[1, 0, 0], [1, 0, 0]]), device=device, threads=1)
    sim.step(499)
    assert len(sim.state) == 2
    sim.step(2)
    both = name in ("box", "plane")
    assert sim.left["hole"][0] == 2 if both else 1
    assert sim.particles.id.tolist() == ([] if both else [1])
    assert sim.left["hole"][1] == pytest.approx(sim.left["hole"][0] * 2500.0 * 4.0 / 3.0 * np.pi * R**3, rel=1e-14)


def test_two_meshes(tmp_path):
    """Each has triangles of its own: a ball with many and a block with few."""
    trimesh.creation.icosphere(subdivisions=3, radius=0.01).export(tmp_path / "ball.stl")
    ball = {"name": "ball", "mesh": {"file": "ball.stl", "translate": [0.06, 0.05, 0]}}
    sim = Simulation(
        scene(tmp_path, [ball, {"name": "block", **SHAPES["mesh"]}], [(0, 0, 0), (0, 0.05, 0), (0, 0.1, 0)], [[1, 0, 0]] * 3),
        device="cpu", threads=1,
    )  # fmt: skip
    counts = []
    for _ in range(6):
        sim.step(100)
        counts.append((sim.left["ball"][0], sim.left["block"][0]))
    assert counts == [(0, 0)] * 5 + [(1, 1)]
    assert sim.particles.id.tolist() == [2]


CROWD = [(0.003 * k, 0.004 * j, 0.0) for k in range(15) for j in range(-2, 3)]


def crowd(folder, kinds=tuple(SHAPES), **keys):
    """Grains that fly to all outlets, one beside the other, and meet on their way."""
    outlets = [{"name": name, **SHAPES[name]} for name in reversed(kinds)]
    ways = np.random.default_rng(0).normal([1.0, 0.0, 0.0], 0.1, (len(CROWD), 3)).tolist()
    return scene(folder, outlets, CROWD, ways, **keys)


@pytest.mark.parametrize("place", ["frame", "laboratory"])
def test_bits_on_threads_in_the_graph_and_after_a_resume(tmp_path, place):
    """All shapes at once, also in a turning frame where they rest in the laboratory."""
    keys = {"frame": {"axis": [0, 0, 1], "rate": 5.0}} if place == "laboratory" else {}
    one = crowd(tmp_path, **keys)
    if place == "laboratory":
        one = one.model_copy(update={"outlets": [o.model_copy(update={"fixed_to": place}) for o in one.outlets]})
        one = Scene.model_validate({**one.model_dump(mode="json"), "base": tmp_path})
    found = {}
    for threads, resident in ((1, False), (2, False), (1, True)):
        sim = Simulation(one, device="cpu", threads=threads, resident=resident)
        sim.step(333)
        if threads == 1 and not resident:
            sim.save_checkpoint(tmp_path / "c.h5")
        sim.step(400)
        found[threads, resident] = sim.state_hash(), sim.left
    resumed = Simulation.from_checkpoint(tmp_path / "c.h5", threads=2)
    resumed.step(400)
    stepwise = Simulation(one, device="cpu", threads=1)
    for _ in range(733):
        stepwise.step(1)
    first = found[1, False]
    assert all(other == first for other in [*found.values(), (resumed.state_hash(), resumed.left)])
    assert (stepwise.state_hash(), stepwise.left) == first
    assert sum(count > 0 for count, _ in first[1].values()) >= 3


def test_outlets_whose_energy_is_asked_for_take_the_same_grains(tmp_path):
    """The host removes them then, at the same steps."""
    plain, asked = (Simulation(crowd(tmp_path, measures=m), device="cpu", threads=1) for m in ({}, {"energy": True}))
    for sim in (plain, asked):
        sim.step(700)
    assert plain.left == asked.left
    assert plain.state_hash() == asked.state_hash()


@pytest.mark.parametrize("name", [name for name in SHAPES if name != "plane"])
def test_an_outlet_of_the_laboratory_in_a_turning_frame(tmp_path, name):
    """A grain that flies straight in the laboratory leaves at the same step, whatever turns beneath it."""
    outlets = hole(name, fixed_to="laboratory")
    turning = {"frame": {"axis": [0.2, 1, 0.5], "origin": [0.01, 0.02, 0], "rate": 40.0}}
    grains = {"positions": [(0, 0, 0), (0, 0.02, 0)], "velocities": [[1, 0, 0], [1, 0, 0]]}
    both = []
    for keys in ({}, turning):
        one = scene(tmp_path, outlets, grains["positions"], grains["velocities"], **keys)
        # the same velocities in the laboratory
        data = {**one.model_dump(mode="json"), "base": tmp_path}
        data["grains"][0]["velocities_in"] = "laboratory"
        sim = Simulation(Scene.model_validate(data), device="cpu", threads=1)
        left = []
        for _ in range(700):
            sim.step(1)
            left.append(sim.left["hole"][0])
        both.append(left)
    assert both[0][-1] > 0
    assert np.abs(np.array(both[0]) - both[1]).sum() <= 2  # round-off may shift it by a step


def test_borders_of_the_laboratory(tmp_path):
    borders = {"x": {"max": 0.05, "kind": "open"}, "fixed_to": "laboratory"}
    data = scene(tmp_path, [], velocities=[[1, 0, 0]], borders=borders, frame={"axis": [0, 0, 1], "rate": 20.0})
    data = {**data.model_dump(mode="json"), "base": tmp_path}
    data["grains"][0]["velocities_in"] = "laboratory"
    sim = Simulation(Scene.model_validate(data), device="cpu", threads=1)
    sim.step(498)
    assert len(sim.state) == 1
    sim.step(5)
    assert sim.left["x max"][0] == 1
    # at rest in the frame it would have been 1.5 m away by then
    assert sim.time * 20.0 > 0.9


@pytest.mark.parametrize("frame", [None, {"axis": [0, 0, 1], "rate": 3.0}])
def test_an_outlet_that_follows_a_wall_sweeps_up_what_it_meets(tmp_path, frame):
    """A ball on an arm of 0.05 m takes grains at rest on its circle, each at the angle at which it is met."""
    rate, angles = 10.0, np.array([0.5, 1.0, 1.5])
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.05, 0, 1.0], "radius": 0.01, "inside": False},
           "motion": {"axis": [0, 0, 1], "rate": rate}, "fixed_to": "laboratory"}  # fmt: skip
    outlet = {"name": "cup", "sphere": {"centre": [0.05, 0, 0], "radius": 0.005}, "follows": "arm"}
    places = np.stack([0.05 * np.cos(angles), 0.05 * np.sin(angles), 0 * angles], axis=1)
    data = scene(tmp_path, [outlet], places.tolist(), walls=[arm], **({"frame": frame} if frame else {}))
    data = {**data.model_dump(mode="json"), "base": tmp_path}
    data["grains"][0]["velocities_in"] = "laboratory"
    sim = Simulation(Scene.model_validate(data), device="cpu", threads=1)
    seen = []
    for _ in range(2000):
        sim.step(1)
        if sim.left["cup"][0] > len(seen):
            seen.append(sim.time)
    met = angles - 2.0 * np.arcsin(0.5 * 0.005 / 0.05)
    np.testing.assert_allclose(seen, met / rate, rtol=0, atol=1.01e-4)


def test_columns_of_mass_and_count(tmp_path):
    output = {"interval": 0.02, "history_interval": 0.01, "picture": False}
    one = crowd(tmp_path, output=output, time={"end": 0.08, "step": 1e-4})
    run_scene(one, tmp_path / "out")
    with open(tmp_path / "out" / "history.csv") as file:
        rows = list(csv.DictReader(file))
    mass = 2500.0 * 4.0 / 3.0 * np.pi * R**3
    total = np.zeros(len(rows))
    for name in SHAPES:
        count = np.array([float(row[f"outlet {name} count [-]"]) for row in rows])
        np.testing.assert_allclose([float(row[f"outlet {name} mass [kg]"]) for row in rows], mass * count, rtol=1e-12)
        total += count
    np.testing.assert_array_equal(total, len(CROWD) - np.array([float(row["grains [-]"]) for row in rows]))
    assert total[-1] > 30
    assert len(set(total)) > 4


def test_outlets_survive_a_stage_and_a_file(tmp_path):
    one = crowd(tmp_path)
    outlets = [{**o.model_dump(mode="json", exclude_unset=True)} for o in one.outlets]
    outlets[0] |= {"follows": "arm"}
    outlets[1] |= {"fixed_to": "laboratory"}
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.5, 0, 1.0], "radius": 0.01, "inside": False}}
    borders = {"z": {"min": -1, "kind": "open"}, "fixed_to": "laboratory"}
    one = scene(tmp_path, outlets, walls=[arm], borders=borders)
    (tmp_path / "a.toml").write_text(toml_text(scene_tables(one, relative_to(tmp_path))))
    convert(tmp_path / "a.toml", tmp_path / "b.usda")
    convert(tmp_path / "b.usda", tmp_path / "c.toml")
    for name in ("a.toml", "b.usda", "c.toml"):
        back = load_scene(tmp_path / name)
        assert back.outlets == one.outlets
        assert back.borders == one.borders


WRONG = {
    "none": ({"name": "o"}, "give exactly one of box, cylinder, sphere, mesh, plane; found none"),
    "two": ({"name": "o", **SHAPES["box"], **SHAPES["sphere"]}, "found box and sphere"),
    "wall": ({"name": "o", **SHAPES["box"], "follows": "belt"}, r"outlets\[0\].follows = \"belt\"\n *no such wall"),
    "servo": ({"name": "o", **SHAPES["box"], "follows": "lid"}, "has a servo or is free: its load moves it"),
    "both": ({"name": "o", **SHAPES["box"], "follows": "belt", "fixed_to": "laboratory"}, "cannot be given with follows"),
    "radius": ({"name": "o", "sphere": {"centre": [0, 0, 0], "radius": 0}}, r"sphere.radius = 0\n *must be > 0"),
    "file": ({"name": "o", "mesh": {"file": "none.stl"}}, r"outlets\[0\].mesh.file.*none.stl"),
    "open": ({"name": "o", "mesh": {"file": "open.stl"}}, r"outlets\[0\].mesh.file: open.stl: the mesh must be closed"),
    "bodies": ({"name": "o", "mesh": {"file": "two.stl"}}, "must be one closed body"),
    "start": ({"name": "o", "sphere": {"centre": [0, 0, 0], "radius": 1}}, "grain 0 at .* starts in the outlet o"),
    "outside": ({"name": "o", "mesh": {"file": "../x.stl"}}, "x.stl"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said(tmp_path, case):
    outlet, message = WRONG[case]
    box = trimesh.creation.box([1, 1, 1])
    trimesh.Trimesh(box.vertices, box.faces[:-1]).export(tmp_path / "open.stl")
    trimesh.util.concatenate([box, trimesh.creation.box([0.5, 0.5, 0.5])]).export(tmp_path / "two.stl")
    with pytest.raises(SceneError, match=message):
        lid = {"name": "lid", "material": "g", "plane": {"point": [0, 0, 1], "normal": [0, 0, -1]},
               "servo": {"axis": [0, 0, -1], "force": 1.0, "max_speed": 0.1}}  # fmt: skip
        Simulation(scene(tmp_path, [outlet], walls=[lid]), device="cpu", threads=1)


def test_periodic_borders_refuse_what_would_cross_them(tmp_path):
    periodic = {"z": {"min": -0.1, "max": 0.1, "kind": "periodic"}}
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.5, 0, 0], "radius": 0.01, "inside": False},
           "motion": {"axis": [0, 0, 1], "rate": 1.0}}  # fmt: skip
    with pytest.raises(SceneError, match=r"outlets\[0\].follows = 'arm': .* has no periodic images"):
        follows = {"name": "o", **SHAPES["box"], "follows": "arm"}
        Simulation(scene(tmp_path, [follows], walls=[arm], borders=periodic), device="cpu")
    shifted = {"frame": {"velocity": [0, 0, 0.1]}, "borders": periodic}
    with pytest.raises(SceneError, match=r"outlets\[0\].fixed_to = \"laboratory\": the frame is shifted"):
        resting = {"name": "o", **SHAPES["box"], "fixed_to": "laboratory"}
        Simulation(scene(tmp_path, [resting], **shifted), device="cpu")
    with pytest.raises(SceneError, match="periodic borders belong to the frame"):
        scene(tmp_path, [], borders={**periodic, "fixed_to": "laboratory"})
