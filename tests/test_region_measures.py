"""Measures in regions of every shape, in the laboratory and on a wall: against sums by hand and other axes."""

import numpy as np
import pytest
import pyvista
import trimesh

from warpdem import Scene, SceneError, Simulation
from warpdem.measure.snapshot import take_snapshot
from warpdem.output.write_grid import GridWriter

R = 1e-3
GRAINS = np.random.default_rng(4).uniform(-0.01, 0.01, (300, 3))
WAYS = np.random.default_rng(5).normal(0.0, 0.05, (300, 3))
SHAPES = {
    "box": {"box": {"min": [-0.008, -0.006, -0.007], "max": [0.004, 0.008, 0.006]}},
    "cylinder": {"cylinder": {"point": [0.002, 0.001, -0.004], "axis": [1, 0.5, 0.2], "radius": 0.006, "length": 0.008}},
    "sphere": {"sphere": {"centre": [0.002, -0.001, 0.001], "radius": 0.008}},
    "mesh": {"mesh": {"file": "ring.stl", "scale": 0.001}},
    "all": {},
}


def apart(positions, velocities):
    """Those that overlap none before them by more than 3 % of a radius."""
    kept = []
    for k, place in enumerate(positions):
        if all(np.linalg.norm(place - positions[j]) > 1.97 * R for j in kept):
            kept.append(k)
    return positions[kept], velocities[kept]


def simulation(folder, regions, place, **keys):
    trimesh.creation.annulus(r_min=3, r_max=8, height=10).export(folder / "ring.stl")
    positions, velocities = apart(GRAINS, WAYS)
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.2, 0, 0], "radius": 0.01, "inside": False},
           "motion": [{"axis": [0, 1, 1], "origin": [0.01, 0, 0], "rate": -7.0}, {"velocity": [0.1, 0, 0]}],
           "fixed_to": "laboratory"}  # fmt: skip
    entries = [{"name": name, **SHAPES[name], **place, "fabric": True} for name in regions]
    scene = {
        "base": folder,
        "gravity": [0, 0, -9.81],
        "materials": {"g": {"density": 2500.0, "young_modulus": 1e6, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none", "rolling": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.7}],
        "grains": [
            {"material": "g", "positions": positions, "radius": R, "velocities": velocities, "velocities_in": "laboratory"}
        ],
        "walls": [arm],
        "measures": {"regions": entries, "profiles": [{"name": "cut", **SHAPES["box"], "along": "y", "slices": 3, **place}]},
        "time": {"end": 1.0, "step": 2e-5, "max_speed": 1.0},
        **keys,
    }
    return Simulation(Scene.model_validate(scene), device="cpu", threads=1)


def test_sums_of_the_grains_inside(tmp_path):
    sim = simulation(tmp_path, SHAPES, {})
    sim.step(20)
    found, p = sim.measure(), sim.particles
    centre, axis = np.array([0.002, 0.001, -0.004]), np.array([1, 0.5, 0.2]) / np.linalg.norm([1, 0.5, 0.2])
    height = (p.position - centre) @ axis
    beside = np.linalg.norm(p.position - centre - np.outer(height, axis), axis=1)
    level = np.linalg.norm(p.position[:, :2], axis=1)
    inside = {
        "cylinder": (beside <= 0.006) & (height >= 0) & (height <= 0.008),
        "sphere": np.linalg.norm(p.position - [0.002, -0.001, 0.001], axis=1) <= 0.008,
        "all": np.ones(len(p.id), bool),
    }
    for name, within in inside.items():
        assert 10 < within.sum()
        assert found[f"region {name} grains [-]"] == within.sum()
        assert found[f"region {name} mass [kg]"] == pytest.approx(p.mass[within].sum(), rel=1e-13)
        mean = p.velocity[within].mean(axis=0)
        assert found[f"region {name} velocity_y [m/s]"] == pytest.approx(mean[1], rel=1e-12)
        agitation = ((p.velocity[within] - mean) ** 2).sum(axis=1).mean() / 3.0
        assert found[f"region {name} granular_temperature [m2/s2]"] == pytest.approx(agitation, rel=1e-12)
        assert (f"region {name} solid_fraction [-]" in found) == (name != "all")
    # the ring is made of flat sides, up to 0.1 mm within the circle
    least = ((level >= 0.003) & (level <= 0.0079) & (np.abs(p.position[:, 2]) < 0.005)).sum()
    most = ((level >= 0.0029) & (level <= 0.008) & (np.abs(p.position[:, 2]) < 0.005)).sum()
    assert least <= found["region mesh grains [-]"] <= most
    assert most - least < 15


def test_every_shape_that_holds_all_measures_the_same_stress(tmp_path):
    """Stress times volume, and solid fraction times volume, of a box, a sphere and a cylinder around all grains."""
    around = {
        "box": ({"min": [-0.02] * 3, "max": [0.02] * 3}, 0.04**3),
        "sphere": ({"centre": [0, 0, 0], "radius": 0.03}, 4 / 3 * np.pi * 0.03**3),
        "cylinder": ({"point": [0, 0, -0.02], "axis": [0, 0, 1], "radius": 0.03, "length": 0.04}, np.pi * 0.03**2 * 0.04),
    }
    entries = [{"name": name, name: shape} for name, (shape, _) in around.items()]
    trimesh.creation.icosphere(radius=0.03).export(tmp_path / "ball.stl")
    entries.append({"name": "ball", "mesh": {"file": "ball.stl"}})
    around["ball"] = None, trimesh.load(tmp_path / "ball.stl").volume
    sim = simulation(tmp_path, (), {}, measures={"regions": entries})
    sim.step(20)
    found = sim.measure()
    for name in ("solid_fraction [-]", "stress_xx [Pa]", "stress_yz [Pa]"):
        box, sphere, cylinder, ball = (found[f"region {key} {name}"] * volume for key, (_, volume) in around.items())
        assert box != 0.0
        np.testing.assert_allclose([sphere, cylinder, ball], box, rtol=1e-8)


def test_a_mesh_like_a_box_measures_as_the_box(tmp_path):
    low, high = np.array(SHAPES["box"]["box"]["min"]), np.array(SHAPES["box"]["box"]["max"])
    trimesh.creation.box(bounds=[low, high]).export(tmp_path / "box.ply")
    entries = [{"name": "box", **SHAPES["box"]}, {"name": "mesh", "mesh": {"file": "box.ply"}}]
    sim = simulation(tmp_path, (), {}, measures={"regions": entries})
    sim.step(20)
    found = sim.measure()
    names = [name.removeprefix("region box ") for name in found if name.startswith("region box ")]
    assert "solid_fraction [-]" in names and found["region box stress_xx [Pa]"] != 0.0
    # corners of the file are of single precision
    np.testing.assert_allclose(*([found[f"region {key} {name}"] for name in names] for key in ("mesh", "box")), rtol=1e-6)


def test_a_mesh_whose_bodies_intersect_is_refused(tmp_path):
    boxes = [trimesh.creation.box(extents=[0.01] * 3).apply_translation([x, 0.7 * x, 0.5 * x]) for x in (0.0, 0.004)]
    trimesh.util.concatenate(boxes).export(tmp_path / "two.stl")
    words = r"measures.regions\[0\].mesh.file: two.stl: 2 closed bodies, of which some intersect.*boolean union"
    with pytest.raises(SceneError, match=words):
        simulation(tmp_path, (), {}, measures={"regions": [{"name": "two", "mesh": {"file": "two.stl"}}]})


@pytest.mark.parametrize("place", [{"fixed_to": "laboratory"}, {"follows": "arm"}], ids=["laboratory", "wall"])
def test_measures_do_not_depend_on_the_frame(tmp_path, place):
    """What rests in the laboratory, or on a wall, is measured alike in whatever axes the run is computed."""
    frame = {"axis": [1, 2, 0], "origin": [0.02, 0, 0], "rate": 25.0}
    found = []
    for keys in ({}, {"frame": frame}):
        sim = simulation(tmp_path, SHAPES, place, **keys)
        sim.step(300)
        found.append(sim.measure())
    still, turning = found
    assert still.keys() == turning.keys()
    assert still["region box grains [-]"] > 10
    assert any("stress" in key for key in still) and any(key.startswith("region cut_2") for key in still)
    for key, value in still.items():
        scale = 1e3 if "stress" in key else 1.0
        assert turning[key] == pytest.approx(value, rel=1e-7, abs=1e-9 * scale, nan_ok=True), key


def test_a_region_on_a_wall_sees_what_rests_on_it_at_rest(tmp_path):
    """Grains without weight that move with the arm: no velocity in its region, whatever they do in the laboratory."""
    rate = 20.0
    arm = {"name": "arm", "material": "g", "sphere": {"centre": [0.2, 0, 0], "radius": 0.01, "inside": False},
           "motion": {"axis": [0, 0, 1], "rate": rate}}  # fmt: skip
    places = np.array([[0.1, 0, 0], [0.11, 0.004, 0.0]])
    keys = {
        "walls": [arm], "gravity": [0, 0, 0],
        "grains": [{"material": "g", "positions": places, "radius": R, "velocities": np.cross([0, 0, rate], places)}],
        "measures": {"regions": [{"name": "near", "sphere": {"centre": [0.1, 0, 0], "radius": 0.02}, "follows": "arm"}]},
    }  # fmt: skip
    sim = simulation(tmp_path, (), {}, **keys)
    found = sim.measure()
    assert found["region near grains [-]"] == 2
    assert abs(found["region near velocity_y [m/s]"]) < 1e-12
    assert found["region near centre_x [m]"] == pytest.approx(0.105, rel=1e-12)
    sim.step(1000)  # they fly on straight, the arm turns by 0.4
    found = sim.measure()
    assert found["region near velocity_x [m/s]"] > 0.5


def test_what_is_wrong_is_said(tmp_path):
    for region, message in (
        ({"box": SHAPES["box"]["box"], "sphere": SHAPES["sphere"]["sphere"]}, "found box and sphere"),
        ({"follows": "x"}, r"measures.regions\[0\].follows = \"x\"\n *no such wall"),
        ({"mesh": {"file": "none.stl"}}, r"measures.regions\[0\].mesh.file.*none.stl"),
    ):
        with pytest.raises(SceneError, match=message):
            simulation(tmp_path, (), {}, measures={"regions": [{"name": "r", **region}]})


def test_a_grid_of_the_laboratory_does_not_depend_on_the_frame(tmp_path):
    """Every field on it, from the files of two runs in other axes."""
    grid = {"box": {"min": [-0.01, -0.01, -0.01], "max": [0.01, 0.01, 0.01]}, "cell": 0.005, "fixed_to": "laboratory"}
    fields = []
    for number, keys in enumerate(({}, {"frame": {"axis": [1, 2, 0], "origin": [0.02, 0, 0], "rate": 25.0}})):
        sim = simulation(tmp_path, (), {}, measures={"grid": grid}, **keys)
        sim.step(200)
        sim.prepare()
        writer = GridWriter(tmp_path / str(number), sim.scene.measures.grid, sim.domain.period)
        writer.write(take_snapshot(sim.live))
        data = pyvista.read(tmp_path / str(number) / "grid_000000.vti")
        fields.append({name: np.array(data.point_data[name]) for name in data.point_data})
    still, turning = fields
    assert still.keys() == turning.keys()
    assert {"velocity", "contact_stress"} <= still.keys(), list(still)
    for name, values in still.items():
        scale = np.nanmax(np.abs(values))
        assert scale > 0.0
        np.testing.assert_allclose(turning[name], values, rtol=0, atol=1e-7 * scale, err_msg=name)
