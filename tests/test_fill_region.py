"""Regions of fillings: clipping, levels, volumes."""

import numpy as np
import pytest
import trimesh

from warpdem.errors import SceneError
from warpdem.filling.fill_region import closed_region
from warpdem.filling.fill_request import filling
from warpdem.filling.packing import pack
from warpdem.mesh.triangle_mesh import build_mesh, signed_distance
from warpdem.scene.size_distribution import size_law

BOX = [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]


def ball():
    """A closed mesh of a ball of radius 1 about the origin, and its volume."""
    mesh = build_mesh(np.array(trimesh.creation.icosphere(subdivisions=3).triangles))
    return mesh, abs(mesh.volume)


def cap(height):
    """Volume of a cap of the unit ball."""
    return np.pi * height**2 * (3.0 - height) / 3.0


@pytest.mark.parametrize(
    ("up", "low", "high"),
    [
        ((0, 0, 9.81), (0, 0, 0), (1, 2, 0.5)),
        ((0, 0, -1), (0, 0, 2.5), (1, 2, 3)),
        ((2, 0, 0), (0, 0, 0), (0.5, 2, 3)),
        ((0, -1, 0), (0, 1.5, 0), (1, 2, 3)),
    ],
)
def test_level_along_an_axis_clips_the_box(up, low, high):
    space = closed_region(None, BOX, "fill", height=0.5, up=up)
    np.testing.assert_allclose(space.bounds, [low, high])
    np.testing.assert_allclose(space.volume, np.prod(np.subtract(high, low)))


def test_height_above_the_top_changes_nothing():
    np.testing.assert_allclose(closed_region(None, BOX, "fill", height=9.0).bounds, BOX)


def test_slanted_level_of_a_box_and_of_a_mesh():
    up = np.array([1.0, 0.0, 2.0]) / np.sqrt(5.0)
    # below x + 2 z = sqrt(5) h lies, for small h, a wedge of triangles (sqrt(5) h) x (sqrt(5) h / 2) / 2, 2 m long
    space = closed_region(None, BOX, "fill", height=0.2, up=up)
    np.testing.assert_allclose(space.volume, 2.0 * 0.25 * 5.0 * 0.2**2, rtol=1e-6)
    mesh, _ = ball()
    space = closed_region(mesh, None, "fill", height=0.7, up=(0.3, -0.5, 0.4))
    np.testing.assert_allclose(space.volume, cap(0.7), rtol=0.03)


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.3, -0.5, 0.4)])
def test_grains_stay_below_the_level_and_inside(up):
    mesh, _ = ball()
    asked = filling(closed_region(mesh, None, "fill", height=0.8, up=up), size_law(0.1), 1, solid_fraction=0.5)
    [position], _ = pack([asked])
    level = position @ (np.array(up) / np.linalg.norm(up)) + asked.radius
    lowest = -1.0
    assert level.max() <= lowest + 0.8 + 1e-2
    assert level.max() > lowest + 0.8 - 1e-2
    assert (signed_distance(mesh, position)[0] <= -asked.radius).all()
    assert abs(asked.solid_fraction - 0.5) < 2e-3


def test_grains_fill_a_box_below_a_slanted_level():
    up = np.array([1.0, 0.0, 2.0]) / np.sqrt(5.0)
    asked = filling(closed_region(None, BOX, "fill", height=1.0, up=up), size_law(0.1), 1, solid_fraction=0.5)
    [position], _ = pack([asked])
    assert (position >= 0.05 - 1e-12).all()
    assert (position <= np.array(BOX[1]) - 0.05 + 1e-12).all()
    assert 0.98 < (position @ up + 0.05).max() <= 1.0 + 1e-12


def test_what_cannot_be_a_region_is_refused():
    mesh, _ = ball()
    with pytest.raises(SceneError, match=r"grains\[0\]\.fill\.height: counts against gravity, but gravity is zero"):
        closed_region(mesh, None, "grains[0].fill", height=1.0, up=(0.0, 0.0, 0.0))
    with pytest.raises(SceneError, match=r"fill\.height: cannot be combined with a region while gravity slants"):
        closed_region(mesh, BOX, "fill", height=1.0, up=(1.0, 0.0, 1.0))
    with pytest.raises(SceneError, match="is empty"):
        closed_region(None, [[0, 0, 0], [1, 1, 0]], "fill")
