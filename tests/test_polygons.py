"""Polygons cut into triangles."""

import numpy as np
import pytest

from warpdem.mesh.polygons import MAX_CONCAVE, triangulate


def area(points, triangles):
    """Vector area of each triangle."""
    p = points[triangles]
    return 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def star(corners, seed=0, tilt=True):
    """A polygon that is not convex, in a tilted plane."""
    rng = np.random.default_rng(seed)
    angle, radius = 2 * np.pi * np.arange(corners) / corners, rng.uniform(0.3, 1.0, corners)
    flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(corners)], axis=1)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return flat @ turn if tilt else flat


def test_triangles_and_convex_polygons_keep_their_order_and_winding():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-0.5, 0.5, 0]], float)
    triangles = triangulate(points, [3, 5, 3, 4], [0, 1, 2, 0, 1, 2, 3, 4, 2, 1, 0, 0, 1, 2, 3])
    assert triangles.tolist() == [
        [0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 1, 0], [0, 1, 2], [0, 2, 3]
    ]  # fmt: skip


@pytest.mark.parametrize("corners", [4, 5, 9, 40])
@pytest.mark.parametrize("seed", range(4))
def test_polygon_that_is_not_convex_is_covered_once(corners, seed):
    points = star(corners, seed)
    for order in (np.arange(corners), np.arange(corners)[::-1]):
        triangles = triangulate(points, [corners], order)
        assert triangles.shape == (corners - 2, 3)
        parts = area(points, triangles)
        ring = points[order]
        whole = 0.5 * np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
        # all on the polygon's side, and together as large as it is: nothing is covered twice
        assert (parts @ whole > 0.0).all()
        np.testing.assert_allclose(parts.sum(axis=0), whole, rtol=0, atol=1e-12)


def test_hole_joined_to_the_rim_by_a_slit_stays_a_hole():
    outer = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)
    inner = np.array([[1, 1], [1, 3], [3, 3], [3, 1]], float)
    points = np.column_stack([np.concatenate([outer, inner]), np.zeros(8)])
    triangles = triangulate(points, [10], [0, 1, 2, 3, 0, 4, 5, 6, 7, 4])
    parts = area(points, triangles)[:, 2]
    assert (parts >= 0.0).all()
    np.testing.assert_allclose(parts.sum(), 12.0)
    middle = points[triangles].mean(axis=1)
    assert not ((np.abs(middle[:, :2] - 2.0) < 1.0).all(axis=1) & (parts > 0.0)).any()


def test_polygon_that_crosses_itself_ends():
    points = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0], [0.5, 2, 0]], float)
    assert triangulate(points, [5], range(5)).shape == (3, 3)
    assert triangulate(np.full((6, 3), np.nan), [6], range(6)).shape == (4, 3)


@pytest.mark.parametrize(
    ("counts", "indices", "text"),
    [
        ([3, 2], [0, 1, 2, 0, 1], "face 1 has 2 corners"),
        ([-3], [0, 1, 2], "face 0 has -3 corners"),
        ([3, 3], [0, 1, 2], "have 6 corners in all, but 3 are given"),
        ([2**62, 2**62, 2**62], [0, 1, 2], "but 3 are given"),
        ([3], [0, 1, 4], "names the point 4, there are the points 0 to 3"),
        ([3], [0, -1, 2], "names the point -1"),
    ],
)
def test_faces_that_do_not_fit_are_refused(counts, indices, text):
    with pytest.raises(ValueError, match=text):
        triangulate(np.zeros((4, 3)), counts, indices)


def test_huge_polygon_is_refused_when_it_is_not_convex():
    points = star(MAX_CONCAVE + 1)
    with pytest.raises(ValueError, match="not convex and has 5001 corners"):
        triangulate(points, [len(points)], range(len(points)))
    angle = 2 * np.pi * np.arange(len(points)) / len(points)
    even = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert len(triangulate(even, [len(points)], range(len(points)))) == len(points) - 2
