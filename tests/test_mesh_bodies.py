"""Meshes of several closed bodies that lie in each other, touch or cut."""

import numpy as np
import pytest
import trimesh

from warpdem.mesh.triangle_mesh import build_mesh, require_closed, signed_distance


def box(size=(1.0, 1.0, 1.0), at=(0.0, 0.0, 0.0)):
    """Triangles of a box, shape (12, 3, 3)."""
    return np.array(trimesh.creation.box(size).triangles) + at


def checked(*parts):
    """A mesh of bodies, which must count as closed."""
    mesh = build_mesh(np.concatenate(parts))
    require_closed(mesh, "walls[0].mesh", "mend it")
    return mesh


def distance_of_boxes(points, *boxes):
    """Signed distance from the surfaces of boxes (size, middle): inside is what an odd number of them hold."""
    found = []
    for size, at in boxes:
        beyond = np.abs(points - at) - 0.5 * np.array(size)
        found.append(np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0))
    odd = (np.array(found) < 0.0).sum(axis=0) % 2 == 1
    return np.abs(found).min(axis=0) * np.where(odd, -1.0, 1.0)


CASES = {
    "side by side along an edge": [((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (1, 1, 0))],
    "at a corner": [((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (1, 1, 1))],
    "at a whole face": [((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (1, 0, 0))],
    "at a part of a face": [((2, 2, 2), (0, 0, 0)), ((0.5, 0.5, 0.5), (1.25, 0, 0))],
    "through each other's sides": [((2, 2, 2), (0, 0, 0)), ((1, 0.5, 0.5), (1, 0.1, 0.2))],
    "vessel with two lifters": [((3, 3, 3), (0, 0, 0)), ((1, 0.5, 2), (1.5, 0, 0)), ((1, 0.5, 2), (-1.5, 0, 0))],
    "shaft through a hub": [((1, 1, 1), (0, 0, 0)), ((0.4, 0.4, 3), (0, 0.05, 0))],
}


@pytest.mark.parametrize("boxes", CASES.values(), ids=CASES.keys())
def test_inside_of_bodies_that_touch_or_cut_is_right_everywhere(boxes):
    mesh = checked(*(box(*one) for one in boxes))
    assert mesh.flipped == 0
    points = np.random.default_rng(1).uniform(-2.0, 2.0, (4000, 3))
    expected = distance_of_boxes(points, *boxes)
    distance, gradient = signed_distance(mesh, points)
    np.testing.assert_allclose(distance, expected, rtol=0, atol=2e-7)  # of the search in float32
    # where one surface is much nearer than any other, going along the gradient is going outwards
    step = 1e-5
    ahead = distance_of_boxes(points + step * gradient, *boxes)
    clear = np.abs(expected) > 2 * step
    assert np.median(np.abs(ahead - expected - step)[clear]) < 1e-12
    assert (ahead > expected)[clear].mean() > 0.99


def test_bodies_that_cut_are_named_with_the_place_and_the_remedy():
    mesh = checked(box((2, 2, 2)), box((1, 0.5, 0.5), (1, 0.1, 0.2)))
    (note,) = mesh.notes
    assert note.startswith("2 closed bodies, of which some intersect, first at (1, ")
    assert "boolean union" in note
    assert build_mesh(np.concatenate([box((2, 2, 2)), box((1, 1, 1))[:, ::-1], box((1, 1, 1), (3, 0, 0))])).notes == ()


def test_bodies_that_touch_are_not_open():
    (note,) = checked(box(), box(at=(1, 1, 0))).notes
    assert note == "2 closed bodies, of which some touch along edges, first at (0.5, 0.5, 0) m"
    flat = checked(box(), box(at=(2.0, 0, 0)))
    assert flat.notes == ()


def test_faces_that_two_bodies_share_cancel():
    """Two bricks of one wall, with the same triangles where they meet: what is left is one brick."""
    one = box()
    other = one * [-1, 1, 1] + [1, 0, 0]
    mesh = checked(one, other[:, ::-1])
    assert mesh.open_edges == mesh.nonmanifold_edges == mesh.flipped == 0
    assert len(mesh.triangles) == 20
    np.testing.assert_allclose(mesh.volume, 2.0)
    assert signed_distance(mesh, [[0.5, 0.1, 0.0]])[0] == pytest.approx(-0.4)
    assert mesh.notes == (
        "2 triangles left out where bodies touch face to face: two of opposite winding cancel, the first at "
        "(0.5, -0.166667, -0.166667) m",
    )


def test_a_triangle_that_is_wound_wrongly_where_bodies_touch_is_turned_round():
    corners = np.concatenate([box(), box(at=(1, 1, 0))])
    at_edge = np.flatnonzero((np.isclose(corners[:, :, :2], 0.5).all(axis=2)).sum(axis=1) == 2)
    corners[at_edge[0]] = corners[at_edge[0], ::-1]
    mesh = checked(corners)
    assert mesh.flipped == 1
    np.testing.assert_allclose(mesh.volume, 2.0)


def test_an_inner_skin_that_points_the_wrong_way_is_told():
    mesh = checked(box((2, 2, 2)), box((1.9, 1.9, 1.9)))
    assert mesh.flipped == 12
    assert "12 triangles of wrong winding flipped" in mesh.notes[0]
    np.testing.assert_array_equal(signed_distance(mesh, [[0, 0, 0], [0.97, 0, 0]])[0] < 0.0, [False, True])


@pytest.mark.parametrize("lid", [0.05, 0.0525, 0.055, 0.06], ids=["inner edge", "amid", "outer edge", "beyond"])
def test_a_tube_with_lids_on_its_ends_is_wound_as_its_file(lid):
    """Points on a face that two bodies share are neither in nor out of the other: none of them tells that it is inverted."""
    tube = trimesh.creation.annulus(r_min=0.05, r_max=0.055, height=0.06, sections=32)
    disk = trimesh.creation.cylinder(radius=lid, height=0.005, sections=32)
    up = np.array([0.0, 0.0, 0.0325])
    parts = [np.array(tube.triangles), disk.triangles + up, disk.triangles - up]
    parts = [part.astype(np.float32).astype(float) for part in parts]
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (4000, 3)) * [0.065, 0.065, 0.04]
    expected = np.any([signed_distance(build_mesh(part), points)[0] < 0.0 for part in parts], axis=0)
    for order in ([0, 1, 2], [2, 0, 1]):
        mesh = checked(*(parts[k] for k in order))
        assert mesh.flipped == 0
        np.testing.assert_allclose(mesh.volume, tube.volume + 2.0 * disk.volume, rtol=1e-5)
        np.testing.assert_array_equal(signed_distance(mesh, points)[0] < 0.0, expected)
