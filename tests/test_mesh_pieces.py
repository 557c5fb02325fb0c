"""Smooth and flat pieces of meshes."""

import math

import numpy as np
import pytest
import trimesh

from warpdem.mesh.grouping import components
from warpdem.mesh.triangle_mesh import build_mesh


def box(size=(1.0, 2.0, 3.0)):
    """Triangles of a box about the origin, shape (12, 3, 3)."""
    return np.array(trimesh.creation.box(size).triangles)


def floor(count, tilt=0.3):
    """A tilted square floor of 2 count^2 triangles, rounded to float32 as in a binary file."""
    x = np.arange(count + 1) / count
    plane = np.stack([*np.meshgrid(x, x, indexing="ij"), np.zeros((count + 1, count + 1))], axis=-1).reshape(-1, 3)
    c, s = math.cos(tilt), math.sin(tilt)
    placed = plane @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) + [3.0, 2.0, 0.3]
    i = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    triangles = np.concatenate(
        [np.stack([i, i + count + 1, i + count + 2], axis=1), np.stack([i, i + count + 2, i + 1], axis=1)]
    )
    return placed.astype(np.float32)[triangles]


def test_box_has_six_pieces_and_six_planes_with_outward_normals():
    mesh = build_mesh(box())
    assert mesh.piece.dtype == mesh.plane.dtype == np.int32
    assert set(mesh.piece) == set(mesh.plane) == set(range(6))
    np.testing.assert_array_equal(np.bincount(mesh.plane), 2)
    np.testing.assert_allclose(np.abs(mesh.plane_normal).max(axis=1), 1.0)
    np.testing.assert_allclose(np.sort(mesh.plane_offset), [0.5, 0.5, 1.0, 1.0, 1.5, 1.5])
    for triangle, plane in zip(mesh.corners, mesh.plane, strict=True):
        normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        assert normal @ mesh.plane_normal[plane] > 0.0
        np.testing.assert_allclose(triangle @ mesh.plane_normal[plane], mesh.plane_offset[plane], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("sections", "pieces"), [(48, 3), (13, 3), (12, 14), (6, 8)])
def test_cylinder_side_is_smooth_when_its_facets_meet_below_30_degrees(sections, pieces):
    # 13 facets meet at 27.7 degrees; 12 at 30, which is not below
    mesh = build_mesh(np.array(trimesh.creation.cylinder(1.0, 2.0, sections=sections).triangles, np.float32))
    assert mesh.piece.max() + 1 == pieces
    assert mesh.plane.max() + 1 == sections + 2


def test_floor_of_many_triangles_is_one_plane_despite_float32_rounding():
    mesh = build_mesh(floor(60))
    assert len(mesh.triangles) == 7200
    assert mesh.piece.max() == mesh.plane.max() == 0
    # rounding of the corners is 1e-7; what is left of it in the mean of many triangles
    np.testing.assert_allclose(mesh.plane_normal, [[-math.sin(0.3), 0.0, math.cos(0.3)]], rtol=0, atol=1e-7)
    off = mesh.vertices @ mesh.plane_normal[0] - mesh.plane_offset[0]
    assert 0.0 < np.abs(off).max() < 4e-7


def test_small_bend_is_not_taken_for_rounding():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 2e-6]]])
    assert build_mesh(corners).plane.max() == 1
    corners[1, 2, 2] = 2e-7
    assert build_mesh(corners).plane.max() == 0


def test_finely_bent_surface_is_not_one_plane():
    # strips of a cylinder of radius 1 so narrow that neighbours differ by less than rounding
    count, step = 1000, 2e-4
    angle = step * np.arange(count + 1)
    low = np.stack([np.cos(angle), np.sin(angle), np.zeros(count + 1)], axis=1)
    high = low + np.array([0.0, 0.0, 1e-3])
    corners = np.concatenate(
        [np.stack([low[:-1], low[1:], high[1:]], axis=1), np.stack([low[:-1], high[1:], high[:-1]], axis=1)]
    )
    mesh = build_mesh(corners)
    assert mesh.piece.max() == 0
    off = (mesh.corners * mesh.plane_normal[mesh.plane][:, None]).sum(axis=2) - mesh.plane_offset[mesh.plane][:, None]
    assert np.abs(off).max() < 2e-6


def test_pieces_do_not_depend_on_winding():
    corners = np.array(box())
    corners[::2] = corners[::2, ::-1]
    mesh = build_mesh(corners[:-1])  # nothing is mended in an open mesh
    assert mesh.plane.max() + 1 == mesh.piece.max() + 1 == 6
    assert mesh.mismatched_edges > 0
    np.testing.assert_allclose(np.abs(mesh.plane_normal).max(axis=1), 1.0)


def test_components_are_found_along_a_long_shuffled_chain():
    order = np.random.default_rng(0).permutation(2000)
    chain = np.stack([order[:-1], order[1:]], axis=1)
    cut = np.delete(chain, 700, axis=0)
    label = components(2001, cut)
    assert len(np.unique(label)) == 3
    assert len(np.unique(label[order[:701]])) == len(np.unique(label[order[701:]])) == 1
