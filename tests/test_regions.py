"""Shapes of regions: volumes, what they hold, random points in them, bounds."""

import math

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation
from warpdem.mesh.solid import MeshSolid, facets, shape_of
from warpdem.mesh.triangle_mesh import build_mesh
from warpdem.scene.regions import Box, CylinderRegion, PlaneRegion, SphereRegion

CYLINDER = CylinderRegion(point=(0.1, -0.2, 0.3), axis=(1.0, 2.0, -0.5), radius=0.4, length=0.7)


def solids():
    brick = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    return {
        "box": Box(min=(-0.3, -0.2, 0.1), max=(0.5, 0.6, 0.7)),
        "cylinder": CYLINDER,
        "sphere": SphereRegion(centre=(0.1, 0.2, 0.3), radius=0.45),
        "mesh": MeshSolid(build_mesh(brick.triangles)),
    }


@pytest.mark.parametrize("name", solids())
def test_volume_and_bounds_are_those_of_what_is_held(name):
    solid = solids()[name]
    low, high = solid.bounds
    generator = np.random.default_rng(0)
    points = low - 0.05 + generator.random((200_000, 3)) * (high - low + 0.1)
    held = solid.holds(points)
    volume = held.mean() * np.prod(high - low + 0.1)
    # four standard deviations of a count of some 1e5
    assert solid.volume == pytest.approx(volume, rel=0.01)
    np.testing.assert_array_equal(held, solid.depth(points) > 0.0)
    inside = points[held]
    assert (np.abs(inside.min(axis=0) - low) < 0.03).all()
    assert (np.abs(inside.max(axis=0) - high) < 0.03).all()


@pytest.mark.parametrize("name", solids())
def test_random_points_are_spread_evenly_at_their_distance_from_the_surface(name):
    solid, radius = solids()[name], np.full(4000, 0.05)
    points = solid.random_points(np.random.default_rng(2), radius)
    depth = solid.depth(points)
    assert depth.min() >= 0.05 * (1.0 - 1e-12)
    # as points drawn from the box and kept where they are deep enough
    low, high = solid.bounds
    others = low + np.random.default_rng(3).random((60_000, 3)) * (high - low)
    others = others[solid.depth(others) >= 0.05]
    for measure in (lambda p: p.mean(axis=0), lambda p: p.std(axis=0), lambda p: solid.depth(p).mean()):
        np.testing.assert_allclose(measure(points), measure(others), rtol=0, atol=0.02)


def test_a_cylinder_without_a_length_has_no_end_along_its_axis():
    tube = CylinderRegion(point=(1.0, 2.0, 3.0), axis=(0, 0, 2), radius=0.5)
    np.testing.assert_array_equal(tube.bounds, [[0.5, 1.5, -math.inf], [1.5, 2.5, math.inf]])
    assert tube.holds(np.array([[1.2, 2.2, -1e6], [1.4, 2.4, 0.0]])).tolist() == [True, False]
    assert tube.volume == math.inf


def test_what_lies_beyond_a_plane_and_beyond_a_disk():
    points = np.array([[0, 0, -1e-9], [0, 0, 0], [5, 0, -1], [0.3, 0, -1], [0, 0, 1]])
    plane = PlaneRegion(point=(0, 0, 0), normal=(0, 0, -3))
    assert plane.holds(points).tolist() == [True, True, True, True, False]
    disk = PlaneRegion(point=(0, 0, 0), normal=(0, 0, -1), radius=0.5)
    assert disk.holds(points).tolist() == [True, True, False, True, False]


@pytest.mark.parametrize("name", ["cylinder", "sphere"])
def test_facets_lie_on_the_shape_and_close_it(name):
    solid = solids()[name]
    mesh = facets(solid)
    assert mesh.is_closed
    assert mesh.mismatched_edges == 0
    assert 0.998 < mesh.volume / solid.volume < 1.0
    on_it = np.abs(solid.depth(mesh.vertices))
    # the ends of a cylinder have a corner in their middle, which lies on them too
    assert on_it.max() < 1e-12


FILLS = {
    "cylinder": {"cylinder": {"point": [0, 0, 0.01], "axis": [1, 0, 1], "radius": 0.012, "length": 0.03}},
    "sphere": {"sphere": {"centre": [0.01, 0, 0.02], "radius": 0.016}},
    "mesh": {"mesh": {"file": "ring.stl", "scale": 0.001, "translate": [0, 0, 0.02]}},
}


@pytest.mark.parametrize("name", FILLS)
def test_a_filling_keeps_within_its_region(tmp_path, name):
    trimesh.creation.annulus(r_min=8, r_max=18, height=30).export(tmp_path / "ring.stl")
    fill = {**FILLS[name], "solid_fraction": 0.5, "diameter": {"uniform": ["2 mm", "2.6 mm"]}}
    scene = Scene.model_validate(
        {
            "base": tmp_path,
            "materials": {"g": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.7}],
            "grains": [{"material": "g", "fill": fill}],
            "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
            "time": {"end": 1.0, "step": 1e-6},
        }
    )
    assert [path[-1] for path, _ in scene.files()] == (["file"] if name == "mesh" else [])
    p = Simulation(scene, device="cpu", threads=1).particles
    shape = shape_of(scene, next(iter(getattr(scene.grains[0].fill, key) for key in FILLS if key == name)), "")
    assert (shape.depth(p.position) - p.radius).min() > -0.01 * p.radius.max()
    assert (4.0 / 3.0 * np.pi * p.radius**3).sum() / shape.volume == pytest.approx(0.5, rel=0.02)


def test_a_filling_says_what_is_wrong():
    for fill, message in (
        ({"count": 1, "diameter": 1.0}, "exactly one of wall, tile, box, cylinder, sphere, mesh; found none"),
        ({"cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 1}, "count": 1}, "a filling has an end"),
        ({**FILLS["sphere"], "count": 1, "diameter": 1e-3, "point": [0, 0, 0]}, "selects a space of a wall"),
    ):
        with pytest.raises(SceneError, match=message):
            Scene.model_validate({"materials": {"g": {"density": 1, "young_modulus": 1, "poisson_ratio": 0.3}},
                                  "grains": [{"material": "g", "fill": fill}], "time": {"end": 1}})  # fmt: skip
