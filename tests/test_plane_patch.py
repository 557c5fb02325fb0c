"""Patches of planes for drawing: under the points, in the plane, wound about its normal, cut off by other planes."""

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.mesh.plane_patch import patch, plane_of

UP = np.array([0.0, 0.0, 1.0])


def area(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return 0.5 * np.cross(b - a, c - a).sum(axis=0)


@pytest.mark.parametrize("normal", [[0, 0, 1], [0, -1, 0], [1, 2, -3]])
def test_patch_lies_in_its_plane_under_the_points(normal):
    normal = np.array(normal) / np.linalg.norm(normal)
    points = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    mesh = patch("wall", (normal, -2.0), [], points)
    assert mesh.infinite
    np.testing.assert_allclose(mesh.vertices @ normal, -2.0)
    assert area(mesh) @ normal == pytest.approx(np.linalg.norm(area(mesh)))
    found, offset = plane_of(mesh)
    np.testing.assert_allclose(found, normal, rtol=0, atol=1e-12)
    assert offset == pytest.approx(-2.0)
    middle = mesh.vertices.mean(axis=0)
    shadow = points - (points @ normal + 2.0)[:, None] * normal
    assert np.linalg.norm(shadow - middle, axis=1).max() < np.linalg.norm(mesh.vertices - middle, axis=1).min()


def test_planes_of_a_box_end_at_each_other():
    halves = {name: (np.array(n), -0.5) for name, n in {"west": [1.0, 0, 0], "east": [-1.0, 0, 0], "floor": UP}.items()}
    floor = patch("floor", halves["floor"], [halves["west"], halves["east"]], np.array([[0, -1, 0], [0, 1, 0.0]]))
    np.testing.assert_allclose([floor.vertices[:, 0].min(), floor.vertices[:, 0].max()], [-0.5, 0.5])
    assert floor.vertices[:, 1].max() > 1.0


def test_plane_behind_another_is_drawn_all_the_same():
    mesh = patch("low", (UP, -1.0), [(UP, 0.0)], np.zeros((1, 3)))
    assert len(mesh.vertices) == 4


def test_single_grain_has_a_patch_as_wide_as_it_is_high():
    mesh = patch("floor", (UP, 0.0), [], np.array([[3.0, 4.0, 0.1]]))
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), [3.0, 4.0, 0.0])
    assert 0.03 < np.ptp(mesh.vertices[:, 0]) < 0.2


def test_walls_of_another_motion_do_not_cut_a_plane_off():
    walls = [
        {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
        {"name": "side", "material": "g", "plane": {"point": [-0.01, 0, 0], "normal": [1, 0, 0]}},
        {"name": "belt", "material": "g", "plane": {"point": [0, -0.01, 0], "normal": [0, 1, 0]},
         "motion": {"velocity": [0.1, 0, 0]}},
    ]  # fmt: skip
    scene = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.5}],
        "grains": [{"material": "g", "positions": [[0, 0, 0.02], [0.05, 0.05, 0.02]], "radius": 1e-3}],
        "walls": walls,
        "time": {"end": 1e-3, "step": 1e-5, "max_speed": 1.0},
    }
    drawn = {mesh.name: mesh for mesh in Simulation(Scene.model_validate(scene), device="cpu", threads=1).wall_meshes()}
    floor = drawn["floor"].vertices
    assert floor[:, 0].min() == pytest.approx(-0.01)  # ends at the side
    assert floor[:, 1].min() < -0.0101  # goes on under the belt
