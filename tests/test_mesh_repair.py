"""Repair of meshes: duplicates and windings."""

import numpy as np
import pytest
import trimesh

from warpdem.mesh.triangle_mesh import build_mesh, inside


def box(size=(1.0, 1.0, 1.0), at=(0.0, 0.0, 0.0)):
    """Triangles of a box, shape (12, 3, 3)."""
    return np.array(trimesh.creation.box(size).triangles) + at


def reverse(corners):
    """The same triangles wound the other way."""
    return corners[:, ::-1]


def test_triangle_that_is_there_twice_counts_once_whichever_way_it_runs():
    corners = box()
    mesh = build_mesh(np.concatenate([corners, np.roll(corners[2:4], 1, axis=1), reverse(corners[5:6])]))
    assert mesh.duplicates == 3
    assert mesh.is_closed
    np.testing.assert_array_equal(mesh.corners, corners)


@pytest.mark.parametrize("seed", range(3))
def test_windings_of_a_closed_mesh_are_mended(seed):
    ball = np.array(trimesh.creation.icosphere(subdivisions=2).triangles)
    wrong = np.random.default_rng(seed).permutation(len(ball))[:100]
    torn = ball.copy()
    torn[wrong] = reverse(ball[wrong])
    mesh = build_mesh(torn)
    assert mesh.flipped == 100
    assert mesh.mismatched_edges == 0
    np.testing.assert_array_equal(mesh.corners[:, [0, 2]][wrong], ball[wrong][:, [0, 2]])
    np.testing.assert_allclose(mesh.volume, build_mesh(ball).volume, rtol=1e-12)


def test_mesh_that_is_wound_inwards_as_a_whole_is_left_so():
    corners = reverse(box())
    corners[3] = corners[3, ::-1]
    mesh = build_mesh(corners)
    assert mesh.flipped == 1
    np.testing.assert_allclose(mesh.volume, -1.0)


@pytest.mark.parametrize("inverted", [(), (0,), (1,), (2,), (1, 2)])
def test_bodies_beside_and_in_each_other_are_wound_so_that_inside_is_right(inverted):
    """A vessel with a solid in it that has a hollow, and another vessel beside it."""
    solid = [box((9, 9, 9)), reverse(box((5, 5, 5))), box((2, 2, 2)), box((3, 3, 3), (10, 0, 0))]
    given = [reverse(part) if k in inverted else part for k, part in enumerate(solid)]
    mesh = build_mesh(np.concatenate(given))
    # the most area decides: where the vessel is inverted, the others follow it, and inside stays inside
    assert mesh.flipped == (36 if inverted == (0,) else 12 * len(inverted))
    points = np.array([[3.5, 0, 0], [2, 0, 0], [0.5, 0, 0], [10, 0, 0], [7, 0, 0]])
    np.testing.assert_array_equal(inside(mesh, points), [True, False, True, True, False])


@pytest.mark.parametrize("vessel", [1, -1])
@pytest.mark.parametrize("shaft", [1, -1])
def test_bodies_that_cut_each_other_are_left_as_they_are(vessel, shaft):
    mesh = build_mesh(np.concatenate([box((4, 4, 4))[:, ::vessel], box((1, 1, 1), (2, 0, 0))[:, ::shaft]]))
    assert mesh.flipped == 0
