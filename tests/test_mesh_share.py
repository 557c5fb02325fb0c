"""Volumes of balls and shares of lines in closed meshes: against boxes, cavities, random points, sums of parts."""

import numpy as np
import pytest
import trimesh

from warpdem.measure.ball_in_box import ball_in_box
from warpdem.measure.box_share import BoxShare
from warpdem.measure.mesh_share import MeshShare, balls_in_mesh
from warpdem.mesh.solid import MeshSolid
from warpdem.mesh.triangle_mesh import build_mesh

NONE = (0.0, 0.0, 0.0)
BALL = 4.0 / 3.0 * np.pi


def solid(*bodies):
    return MeshSolid(build_mesh(np.concatenate([body.triangles for body in bodies]), name="region"))


def box(size, at=NONE):
    return trimesh.creation.box(extents=size).apply_translation(at)


def test_a_box_as_a_mesh():
    """Balls of all sizes that its faces, edges and corners cut: as ``ball_in_box``; centres on a face, an edge, a corner."""
    one, rng = solid(box((2, 3, 4))), np.random.default_rng(0)
    low, high = np.array([-1, -1.5, -2.0]), np.array([1, 1.5, 2.0])
    centre, radius = rng.uniform(-3, 3, (400, 3)), rng.uniform(0.05, 3.0, 400)
    centre[:3], radius[:3] = [[1, 0, 0], [1, 1.5, 0], [1, 1.5, 2]], 0.7
    found = balls_in_mesh(one, centre, radius)
    np.testing.assert_allclose(found, ball_in_box(centre, radius, low, high), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:3] / BALL / 0.7**3, [1 / 2, 1 / 4, 1 / 8], rtol=1e-13)
    start, end = rng.uniform(-3, 3, (2, 1000, 3))
    start[:3], end[:3] = [[-5, 0, 0], [-5, 1.4, 0], [0, 0, 0]], [[5, 0, 0], [5, 1.4, 3], [0, 0, 9]]  # through edges too
    as_box = BoxShare(low, high, NONE).of_lines(start, end)
    np.testing.assert_allclose(MeshShare(one, NONE).of_lines(start, end), as_box, rtol=0, atol=1e-14)
    period = (2.5, 0.0, 0.0)  # images come in from both sides
    np.testing.assert_allclose(
        MeshShare(one, period).of_balls(centre, radius),
        sum(ball_in_box(centre + image, radius, low, high).sum() for image in ([0, 0, 0], [2.5, 0, 0], [-2.5, 0, 0])),
        rtol=1e-12,
    )


def test_a_cavity_holds_nothing():
    """A box within a box: the difference of both, whichever way the file winds them."""
    outer, inner = box((4, 4, 4)), box((1, 2, 2), (0.3, 0, 0))
    rng = np.random.default_rng(1)
    centre, radius = rng.uniform(-2, 2, (200, 3)), rng.uniform(0.1, 1.5, 200)
    start, end = rng.uniform(-3, 3, (2, 300, 3))
    balls = balls_in_mesh(solid(outer), centre, radius) - balls_in_mesh(solid(inner), centre, radius)
    lines = MeshShare(solid(outer), NONE).of_lines(start, end) - MeshShare(solid(inner), NONE).of_lines(start, end)
    flipped = inner.copy()
    flipped.invert()
    for cavity in (inner, flipped):
        both = solid(outer, cavity)
        assert both.volume == pytest.approx(60.0, rel=1e-12)
        np.testing.assert_allclose(balls_in_mesh(both, centre, radius), balls, rtol=0, atol=1e-12)
        np.testing.assert_allclose(MeshShare(both, NONE).of_lines(start, end), lines, rtol=0, atol=1e-13)


def test_a_ring():
    """Not convex, and with a hole: shares of points drawn at random; a ball around all of it holds its volume."""
    ring = solid(trimesh.creation.annulus(r_min=1, r_max=2.5, height=2))
    points = np.random.default_rng(2).uniform(-1, 1, (100_000, 3))
    points = points[(points**2).sum(axis=1) < 1.0]
    for place in ([2, 0.3, 0.8], [1.2, 0, 0], [0, 0, 0]):
        found = balls_in_mesh(ring, np.array([place], float), np.array([1.2]))[0] / BALL / 1.2**3
        assert 0.1 < found < 0.9
        assert found == pytest.approx(ring.holds(1.2 * points + place).mean(), abs=6e-3)
    assert MeshShare(ring, NONE).of_balls(np.zeros((1, 3)), np.array([10.0])) == pytest.approx(ring.volume, rel=1e-10)
    start, end = np.array([[-4, 0.1, 0.2]]), np.array([[4, 0.3, 0.1]])
    along = ring.holds(start + np.linspace(0, 1, 20_001)[:, None] * (end - start)).mean()
    assert MeshShare(ring, NONE).of_lines(start, end)[0] == pytest.approx(along, abs=2e-4)
