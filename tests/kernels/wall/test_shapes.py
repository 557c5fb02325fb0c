"""Every analytic shape as the kernels see it, beside the scene's own nearest points and samples of its surface."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.wall import shapes
from warpdem.kernels.wall.surface import NO_SIDE, WIDTH, Numbers

from warpdem.mesh.tessellation import tessellated
from warpdem.scene.shapes.cone import Cone
from warpdem.scene.shapes.cylinder import Cylinder
from warpdem.scene.shapes.plane import Plane
from warpdem.scene.shapes.sphere import Sphere

RADIUS = 0.1
AXIS = (1.0, 2.0, -2.0)
closest_on_shape = shapes.build(tuple(shapes.SHAPES))


@wp.kernel(module="unique", enable_backward=False)
def probe(
    q: wp.array(dtype=wp.vec3d),
    shape: int,
    numbers: Numbers,
    point_out: wp.array(dtype=wp.vec3d),
    direction_out: wp.array(dtype=wp.vec3d),
    distance_out: wp.array(dtype=wp.float64),
    share_out: wp.array(dtype=wp.float64),
    height_out: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    point, direction, distance, share = closest_on_shape(shape, q[i], wp.float64(wp.static(RADIUS)), numbers)
    point_out[i] = point
    direction_out[i] = direction
    distance_out[i] = distance
    share_out[i] = share
    height_out[i] = shapes.height(shape, q[i], numbers)


def closest(shape, q):
    """Closest points, directions, distances, shares and heights of the kernels for points (n, 3)."""
    q = np.atleast_2d(np.asarray(q, dtype=float))
    numbers = np.zeros(WIDTH)
    numbers[: len(shape.numbers)] = shape.numbers
    kinds = (wp.vec3d, wp.vec3d, wp.float64, wp.float64, wp.float64)
    out = [wp.zeros(len(q), dtype=kind, device="cpu") for kind in kinds]
    inputs = [wp.array(q, dtype=wp.vec3d, device="cpu"), shapes.NUMBER[shape.KERNEL], Numbers(*numbers)]
    wp.launch(probe, dim=len(q), inputs=inputs, outputs=out, device="cpu")
    return [a.numpy() for a in out]


SHAPES = {
    "plane": Plane(point=(0.1, 0.2, 0.3), normal=AXIS),
    "cylinder": Cylinder(point=(0.1, 0.2, 0.3), axis=AXIS, radius=0.5),
    "rod": Cylinder(point=(0.1, 0.2, 0.3), axis=AXIS, radius=0.5, inside=False),
    "pipe": Cylinder(point=(0.1, 0.2, 0.3), axis=AXIS, radius=0.5, length=0.7),
    "cone": Cone(apex=(0.1, 0.2, 0.3), axis=AXIS, half_angle=0.6),
    "spike": Cone(apex=(0.1, 0.2, 0.3), axis=AXIS, half_angle=0.6, inside=False),
    "funnel": Cone(apex=(0.1, 0.2, 0.3), axis=AXIS, half_angle=0.6, start=0.3, end=0.9),
    "bowl": Sphere(centre=(0.1, 0.2, 0.3), radius=0.5),
    "ball": Sphere(centre=(0.1, 0.2, 0.3), radius=0.5, inside=False),
}


@pytest.mark.parametrize("name", SHAPES)
def test_random_points_have_the_closest_point_that_the_scene_gives(name):
    shape = SHAPES[name]
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (400, 3))
    expected, height = shape.nearest(q)
    if name == "cone":
        # behind its apex the kernels go on with the straight line: nothing is lost there
        keep = height > 0.0
        q, expected, height = q[keep], expected[keep], height[keep]
    point, direction, distance, share, from_side = closest(shape, q)
    single = share == 1.0
    assert single.mean() > 0.9
    np.testing.assert_allclose(distance, height, rtol=0, atol=1e-14)
    np.testing.assert_allclose(from_side, height if shape.sided else NO_SIDE, rtol=0, atol=1e-14)
    np.testing.assert_allclose(point[single], expected[single], rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(point + direction * distance[:, None], q, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", ["cylinder", "rod", "pipe", "funnel", "bowl", "ball"])
def test_the_closest_point_is_closer_than_all_others(name):
    """Against samples of the surface itself, made without the kernels' formulas."""
    shape = SHAPES[name]
    q = np.random.default_rng(2).uniform(-0.4, 0.6, (50, 3))
    surface = tessellated(name, shape, np.array([[-1.0] * 3, [1.0] * 3]))
    corners = surface.vertices[surface.triangles]
    share = np.random.default_rng(3).dirichlet(np.ones(3), (len(corners), 20000 // len(corners) + 20))
    samples = np.einsum("tsk,tkx->tsx", share, corners).reshape(-1, 3)
    nearest = np.array([np.linalg.norm(samples - p, axis=1).min() for p in q])
    np.testing.assert_allclose(np.abs(closest(shape, q)[2]), nearest, rtol=0, atol=0.02)


@pytest.mark.parametrize(
    ("name", "along", "across", "distance", "side"),
    [
        ("cylinder", 9.0, 0.4, 0.1, -1),
        ("cylinder", 9.0, 0.6, -0.1, -1),  # behind: pushed back
        ("rod", 9.0, 0.6, 0.1, 1),
        ("pipe", 0.3, 0.45, 0.05, -1),  # inside and outside of the sheet
        ("pipe", 0.3, 0.55, 0.05, 1),
        ("bowl", 0.4, 0.0, 0.1, None),
    ],
)
def test_hand_made_distances(name, along, across, distance, side):
    shape = SHAPES[name]
    axis = np.array(AXIS) / 3.0
    out = np.array([2.0, 1.0, 2.0]) / 3.0  # across the axis
    q = np.array([0.1, 0.2, 0.3]) + along * axis + across * out
    _, direction, found, share, _ = closest(shape, q)
    assert found[0] == pytest.approx(distance, abs=1e-14)
    assert share[0] == 1.0
    expected = -axis if side is None else side * out
    np.testing.assert_allclose(direction[0], expected, rtol=0, atol=1e-12)


def test_beyond_the_end_of_a_pipe_its_rim_is_met():
    shape = SHAPES["pipe"]
    axis, out = np.array(AXIS) / 3.0, np.array([2.0, 1.0, 2.0]) / 3.0
    q = np.array([0.1, 0.2, 0.3]) + (0.7 + 0.03) * axis + (0.5 + 0.04) * out
    point, direction, distance, _, _ = closest(shape, q)
    assert distance[0] == pytest.approx(0.05, abs=1e-14)
    np.testing.assert_allclose(direction[0], 0.6 * axis + 0.8 * out, rtol=0, atol=1e-12)


def test_a_grain_on_the_axis_of_a_cone_is_carried_along_it():
    """It touches all around: the force has no part across, and gains one steadily as the grain leaves the axis."""
    shape = SHAPES["cone"]
    axis, out = np.array(AXIS) / 3.0, np.array([2.0, 1.0, 2.0]) / 3.0
    apex, height = np.array([0.1, 0.2, 0.3]), 0.99 * RADIUS / np.sin(0.6)
    off = np.array([0.0, 1e-9, 1e-5, 1e-4])
    _, direction, distance, share, _ = closest(shape, apex + height * axis + off[:, None] * out)
    np.testing.assert_allclose(direction[0], axis, rtol=0, atol=1e-12)
    assert share[0] == pytest.approx(np.sin(0.6))
    across = (direction * share[:, None]) @ out
    assert across[0] == pytest.approx(0.0, abs=1e-12)
    # s = 2 off cos(a)/overlap, g = 1.5 s for small s
    expected = -np.cos(0.6) * 1.5 * 2.0 * off * np.cos(0.6) / (RADIUS - distance)
    np.testing.assert_allclose(across[1:3], expected[1:3], rtol=0.02)
    far = closest(shape, apex + height * axis + 0.02 * RADIUS * out)
    assert far[3][0] == 1.0, "off the axis it is the one nearest place"
