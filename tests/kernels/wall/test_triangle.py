import numpy as np
import pytest
import warp as wp
from warpdem.kernels.wall.triangle import closest_point

CORNERS = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]])


@wp.kernel(module="unique", enable_backward=False)
def probe(
    q: wp.array(dtype=wp.vec3d),
    corners: wp.array(dtype=wp.mat33d),
    point_out: wp.array(dtype=wp.vec3d),
    mask_out: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    point, mask = closest_point(q[i], corners[i])
    point_out[i] = point
    mask_out[i] = mask


def closest(q, corners):
    q = np.atleast_2d(np.asarray(q, dtype=float))
    corners = np.broadcast_to(corners, (len(q), 3, 3))
    point, mask = wp.zeros(len(q), dtype=wp.vec3d, device="cpu"), wp.zeros(len(q), dtype=wp.int32, device="cpu")
    inputs = [wp.array(q, dtype=wp.vec3d, device="cpu"), wp.array(corners, dtype=wp.mat33d, device="cpu"), point, mask]
    wp.launch(probe, dim=len(q), inputs=inputs, device="cpu")
    return point.numpy(), mask.numpy()


def on_segment(q, a, b):
    t = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return a + t * (b - a)


def reference(q, corners):
    """Closest point by another way: the foot on the plane if it is inside, else the best of the three edges."""
    a, b, c = corners
    n = np.cross(b - a, c - a)
    foot = q - n * ((q - a) @ n) / (n @ n)
    if all(np.cross(y - x, foot - x) @ n >= 0 for x, y in ((a, b), (b, c), (c, a))):
        return foot
    return min((on_segment(q, x, y) for x, y in ((a, b), (b, c), (c, a))), key=lambda p: np.linalg.norm(q - p))


@pytest.mark.parametrize(
    ("q", "point", "mask"),
    [
        ((1.0, 1.0, 5.0), (1.0, 1.0, 0.0), 7),
        ((1.0, 1.0, -2.0), (1.0, 1.0, 0.0), 7),
        ((-1.0, -2.0, 1.0), (0.0, 0.0, 0.0), 1),
        ((6.0, -1.0, 0.0), (4.0, 0.0, 0.0), 2),
        ((-1.0, 5.0, 0.0), (0.0, 3.0, 0.0), 4),
        ((1.5, -2.0, 1.0), (1.5, 0.0, 0.0), 3),
        ((-2.0, 1.5, 1.0), (0.0, 1.5, 0.0), 5),
        ((2.0 + 3.0, 1.5 + 4.0, 0.0), (2.0, 1.5, 0.0), 6),  # from the middle of bc along its normal (3, 4)
    ],
)
def test_each_region_gives_its_point_and_names_its_corners(q, point, mask):
    found, corners = closest(q, CORNERS)
    np.testing.assert_allclose(found[0], point, rtol=0, atol=1e-15)
    assert corners[0] == mask


def test_random_points_and_triangles_agree_with_projection_on_face_and_edges():
    rng = np.random.default_rng(1)
    corners = rng.normal(size=(500, 3, 3))
    q = 2 * rng.normal(size=(500, 3))
    found, mask = closest(q, corners)
    expected = np.array([reference(a, t) for a, t in zip(q, corners, strict=True)])
    # distances agree to round-off; points only to its root where two are nearly as close, which 500 random ones are not
    np.testing.assert_allclose(np.linalg.norm(q - found, axis=1), np.linalg.norm(q - expected, axis=1), rtol=1e-12)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert set(mask) == {1, 2, 3, 4, 5, 6, 7}


def test_the_point_does_not_depend_on_where_the_corners_are_counted_from():
    rng = np.random.default_rng(2)
    q = 4 * rng.normal(size=(200, 3))
    first, _ = closest(q, CORNERS)
    for turn in (1, 2):
        np.testing.assert_allclose(closest(q, np.roll(CORNERS, turn, axis=0))[0], first, rtol=0, atol=1e-14)
