"""Analytic walls: what a scene accepts, where grains may start, contacts, motion, and how they are drawn."""

import numpy as np
import pytest
from pydantic import ValidationError

from warpdem import Scene, Simulation
from warpdem.errors import SceneError
from warpdem.mesh.tessellation import tessellated
from warpdem.scene.shapes.cone import Cone
from warpdem.scene.shapes.cylinder import Cylinder
from warpdem.scene.shapes.sphere import Sphere
from warpdem.scene.walls import Wall

RADIUS = 1e-3
CYLINDER = {"point": [0, 0, 0], "axis": [0, 0, 2], "radius": 5e-3}
CONE = {"apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": "30 deg"}
SPHERE = {"centre": [0, 0, 0], "radius": 5e-3}


def simulate(walls, position, velocity=(0, 0, 0), *, gravity=(0, 0, -9.81), step=1e-5):
    scene = {
        "gravity": list(gravity),
        "materials": {"glass": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
        "contact": {"rolling": "spring"},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.7, "friction": 0.4, "rolling_friction": 0.02}],
        "grains": [{"material": "glass", "positions": [position], "radius": RADIUS, "velocities": [velocity]}],
        "walls": [{"name": f"wall{k}", "material": "glass", **wall} for k, wall in enumerate(walls)],
        "time": {"end": 1.0, "step": step, "max_speed": 1.0},
    }
    return Simulation(Scene.model_validate(scene), device="cpu", threads=1)


def test_a_wall_is_exactly_one_thing():
    wall = Wall(name="w", material="m", cylinder=CYLINDER)
    assert wall.shape.axis == (0.0, 0.0, 1.0)
    assert Wall(name="w", material="m", cone=CONE).shape.half_angle == pytest.approx(np.pi / 6)
    with pytest.raises(ValidationError, match="exactly one of mesh, plane, cylinder, cone, sphere; found cylinder and sphere"):
        Wall(name="w", material="m", cylinder=CYLINDER, sphere=SPHERE)
    with pytest.raises(ValidationError, match="found none"):
        Wall(name="w", material="m")


@pytest.mark.parametrize(
    ("shape", "change", "words"),
    [
        ("cylinder", {"radius": 0}, "must be > 0"),
        ("cylinder", {"axis": [0, 0, 0]}, "zero vector"),
        ("cylinder", {"length": -1}, "must be > 0"),
        ("cone", {"half_angle": "90 deg"}, "must be > 0 and < 1.57"),
        ("cone", {"start": 0.1}, "needs an end"),
        ("cone", {"start": 0.2, "end": 0.1}, "must be above start = 0.2 m"),
        ("sphere", {"radius": "1 kg"}, "length"),
        ("sphere", {"wide": 1}, "Extra inputs"),
    ],
)
def test_wrong_values_are_named(shape, change, words):
    data = {"cylinder": CYLINDER, "cone": CONE, "sphere": SPHERE}[shape]
    with pytest.raises(ValidationError, match=words):
        Wall.model_validate({"name": "w", "material": "m", shape: data | change})


def test_a_pose_is_for_meshes():
    with pytest.raises(ValidationError, match="a shape is positioned by its own keys"):
        Wall(name="w", material="m", sphere=SPHERE, scale=2.0)


@pytest.mark.parametrize(
    ("wall", "position", "words"),
    [
        ({"cylinder": CYLINDER}, [6e-3, 0, 0], r"walls\[0\]\.cylinder: grain 0 at .* is 0\.001 m behind .*inside = true"),
        ({"cylinder": CYLINDER | {"inside": False}}, [4e-3, 0, 0], "inside = false"),
        ({"sphere": SPHERE}, [0, 0, 7e-3], r"walls\[0\]\.sphere: .* 0\.002 m behind"),
        ({"cone": CONE}, [0, 3e-3, 1e-3], r"walls\[0\]\.cone: "),
        ({"cylinder": CYLINDER | {"radius": 0.9e-3}}, [0, 0, 0], r"\]\.cylinder: .* does not fit into .* there is 0\.0009 m"),
        ({"cylinder": CYLINDER | {"radius": 0.9e-3, "length": 1}}, [0, 0, 0.1], "does not fit into"),
        ({"sphere": SPHERE | {"radius": 1e-3}}, [0, 0, 0], "does not fit into"),
    ],
)
def test_a_grain_that_cannot_start_there_is_named(wall, position, words):
    with pytest.raises(SceneError, match=words):
        simulate([wall], position)


@pytest.mark.parametrize(
    ("wall", "position", "normal"),
    [
        ({"cylinder": CYLINDER}, [4.01e-3, 0, 3.0], [-1, 0, 0]),
        ({"cylinder": CYLINDER | {"inside": False}}, [0, 5.99e-3, -3.0], [0, 1, 0]),
        ({"cylinder": CYLINDER | {"length": 1e-2}}, [0, 5.99e-3, 5e-3], [0, 1, 0]),
        ({"sphere": SPHERE}, [0, 0, 4.01e-3], [0, 0, -1]),
        ({"sphere": SPHERE | {"inside": False}}, [0, 0, 5.99e-3], [0, 0, 1]),
        ({"cone": CONE}, [0.01e-3 + 5e-3 * np.tan(np.pi / 6) - 1e-3 / np.cos(np.pi / 6), 0, 5e-3], [-0.75**0.5, 0, 0.5]),
        ({"cone": CONE | {"inside": False}}, [0, 0, -0.99e-3], [0, 0, -1]),
    ],
)
def test_one_contact_with_the_overlap_that_geometry_gives(wall, position, normal):
    sim = simulate([wall], position)
    contacts = sim.contacts()
    assert len(contacts.i) == 1
    np.testing.assert_allclose(contacts.normal[0], normal, rtol=0, atol=1e-9)
    [shape] = [w.shape for w in sim.scene.walls]
    assert contacts.overlap[0] == pytest.approx(RADIUS - shape.nearest(np.array([position]))[1][0], abs=1e-15)


def test_a_point_on_the_axis_is_as_far_from_the_wall_as_the_wall_from_the_axis():
    at, distance = Cylinder(**CYLINDER).nearest(np.array([[0.0, 0.0, 3e-3]]))
    assert distance[0] == pytest.approx(5e-3) == np.linalg.norm(at[0, :2])


def test_far_from_the_wall_nothing_is_touched():
    for wall in ({"cylinder": CYLINDER}, {"cone": CONE}, {"sphere": SPHERE}):
        assert len(simulate([wall], [0, 0, 3e-3]).contacts().i) == 0


def test_a_turning_drum_lifts_a_grain_as_the_frame_that_turns_with_it_does_not():
    """Wall velocity at the contact: surface speed 0.1 m/s, sliding friction mu m g along it."""
    wall = {"cylinder": CYLINDER | {"axis": [0, 1, 0]}, "motion": {"axis": [0, 1, 0], "rate": 20.0}}
    sim = simulate([wall], [0, 0, -4e-3 - 5e-7])
    sim.step(100)
    contacts = sim.contacts()
    push = contacts.force[0] - contacts.normal[0] * (contacts.force[0] @ contacts.normal[0])
    assert push[0] < 0.0, "turning about +y moves the bottom of the drum along -x"
    assert np.linalg.norm(push) == pytest.approx(0.4 * contacts.force[0] @ contacts.normal[0], rel=1e-6)


def test_a_wall_that_is_carried_along_is_met_in_its_body_axes():
    """A cylinder that shifts: the grain between is struck by it as if it flew against the wall at rest."""
    moving = simulate(
        [{"cylinder": CYLINDER, "motion": {"velocity": [-0.1, 0, 0]}}], [3.8973e-3, 0, 0], gravity=(0, 0, 0)
    )
    resting = simulate([{"cylinder": CYLINDER}], [3.8973e-3, 0, 0], [0.1, 0, 0], gravity=(0, 0, 0))
    for sim in (moving, resting):
        sim.step(400)
    assert resting.particles.velocity[0, 0] < -0.05
    np.testing.assert_allclose(moving.particles.velocity[0], resting.particles.velocity[0] - [0.1, 0, 0], rtol=0, atol=1e-12)


def test_an_analytic_wall_is_one_candidate_where_a_mesh_has_many():
    sim = simulate([{"cylinder": CYLINDER}], [4.0e-3, 0, 0])
    sim.step(1)
    assert sim.lists.wall_contacts.candidates.numpy().tolist() == [1]


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (Cylinder(**CYLINDER, length=0.01), 2 * np.pi * 5e-3 * 0.01),
        (Cone(**CONE, end=0.01), np.pi * 0.01**2 * np.tan(np.pi / 6) / np.cos(np.pi / 6)),
        (Cone(**CONE, start=0.005, end=0.01), 0.75 * np.pi * 0.01**2 * np.tan(np.pi / 6) / np.cos(np.pi / 6)),
        (Sphere(**SPHERE), 4 * np.pi * 25e-6),
    ],
)
def test_drawings_have_the_area_and_lie_on_the_surface(shape, area):
    mesh = tessellated("wall", shape, np.zeros((0, 3)))
    corners = mesh.vertices[mesh.triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert areas.sum() == pytest.approx(area, rel=2e-3)
    assert areas.min() > 0.0
    np.testing.assert_allclose(shape.nearest(mesh.vertices)[1], 0.0, rtol=0, atol=1e-15)


def test_what_has_no_end_is_drawn_as_far_as_the_grains_reach():
    sim = simulate([{"cylinder": CYLINDER}, {"plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}}], [0, 0, 0.02])
    mesh, patch = sim.wall_meshes()
    assert (mesh.name, mesh.infinite) == ("wall0", False)
    assert (patch.name, patch.infinite) == ("wall1", True)
    assert mesh.vertices[:, 2].min() < 0.02 < mesh.vertices[:, 2].max()
    assert set(sim.snapshot().walls) == {"wall0", "wall1"}
