"""Pose arithmetic against 4 x 4 matrices and scipy's rotations, and rounding without a bias."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from warpdem.core import rigid_motion
from warpdem.core.rigid_motion import WIDE

AXIS = np.array([1.0, 2.0, 2.0]) / 3.0


def test_rotation_increment_is_the_rotation_less_one():
    angles = np.array([0.0, 1e-9, -1e-5, 0.3, 3.0, 40.0])
    for angle, increment in zip(angles, rigid_motion.rotation_increment(AXIS, angles), strict=True):
        np.testing.assert_allclose(increment, Turn.from_rotvec(AXIS * angle).as_matrix() - np.eye(3), rtol=0, atol=1e-14)
    # small angles keep all their digits: the second order of 1e-9 is 5e-19, lost in 1 - cos
    small = rigid_motion.rotation_increment(AXIS, np.array([1e-9]))[0]
    np.testing.assert_allclose(AXIS @ small, 0.0, rtol=0, atol=1e-25)
    across = np.array([2.0, -1.0, 0.0])
    np.testing.assert_allclose(across @ small @ across, -0.5e-18 * (across @ across), rtol=1e-6)


def test_quaternion_rotation_increment_is_that_of_the_rotation():
    for angle in (0.0, 1e-9, -1e-5, 0.3, 3.0):
        quaternion = np.array([[np.cos(angle / 2), *(np.sin(angle / 2) * AXIS)]])
        wanted = rigid_motion.rotation_increment(AXIS, np.array([angle]))
        np.testing.assert_allclose(rigid_motion.quaternion_rotation_increment(quaternion), wanted, rtol=1e-12, atol=1e-30)


def test_cross_is_that_of_numpy():
    a, b = np.random.default_rng(0).normal(size=(2, 7, 3))
    np.testing.assert_allclose(rigid_motion.cross(a, b), np.cross(a, b), rtol=1e-13)
    np.testing.assert_allclose(rigid_motion.cross_matrix(a[0]) @ b[0], np.cross(a[0], b[0]), rtol=1e-13)


def random_pose(rng, count=4) -> rigid_motion.Pose:
    axes = Turn.random(count, random_state=int(rng.integers(1 << 30))).as_matrix()
    return rigid_motion.Pose(axes.astype(WIDE), *(rng.normal(size=(count, 3)).astype(WIDE) for _ in range(5)))


def matrix(pose) -> np.ndarray:
    out = np.zeros((len(pose.axes), 4, 4))
    out[:, :3, :3], out[:, :3, 3], out[:, 3, 3] = pose.axes, pose.origin, 1.0
    return out


def test_composed_places_are_products_of_matrices():
    rng = np.random.default_rng(1)
    outer, inner = random_pose(rng), random_pose(rng)
    np.testing.assert_allclose(matrix(rigid_motion.compose(outer, inner)), matrix(outer) @ matrix(inner), rtol=0, atol=1e-14)


def test_composing_does_not_depend_on_the_brackets():
    rng = np.random.default_rng(2)
    a, b, c = (random_pose(rng) for _ in range(3))
    left, right = rigid_motion.compose(rigid_motion.compose(a, b), c), rigid_motion.compose(a, rigid_motion.compose(b, c))
    for name, values in vars(left).items():
        np.testing.assert_allclose(values.astype(float), getattr(right, name).astype(float), rtol=0, atol=1e-13, err_msg=name)


def test_what_is_still_changes_nothing():
    pose = random_pose(np.random.default_rng(3))
    for other in (rigid_motion.compose(rigid_motion.still(4), pose), rigid_motion.compose(pose, rigid_motion.still(4))):
        for name, values in vars(pose).items():
            np.testing.assert_array_equal(getattr(other, name), values)


def test_velocity_of_the_composed_body_is_that_of_its_points():
    """v(x) of the whole equals, in inner axes, the outer velocity at x's outer place and its own within the outer body."""
    rng = np.random.default_rng(4)
    outer, inner = random_pose(rng), random_pose(rng)
    whole = rigid_motion.compose(outer, inner)
    x = rng.normal(size=3).astype(WIDE)
    outer_place = rigid_motion.apply(inner.axes, x) + inner.origin
    outer_velocity = outer.velocity + rigid_motion.cross(outer.spin, outer_place)
    carried = rigid_motion.apply(rigid_motion.transposed(inner.axes), outer_velocity)
    own = inner.velocity + rigid_motion.cross(inner.spin, np.broadcast_to(x, (4, 3)))
    wanted = (carried + own).astype(float)
    found = whole.velocity + rigid_motion.cross(whole.spin, np.broadcast_to(x, (4, 3)))
    np.testing.assert_allclose(found.astype(float), wanted, rtol=0, atol=1e-14)


def test_chained_increments_are_differences_of_poses():
    rng = np.random.default_rng(5)
    g1, h1, g2, h2 = (random_pose(rng) for _ in range(4))

    def increment(before, after) -> rigid_motion.Increment:
        whole = np.linalg.inv(matrix(after)) @ matrix(before) - np.eye(4)
        return rigid_motion.Increment(whole[:, :3, :3].astype(WIDE), whole[:, :3, 3].astype(WIDE))

    wanted = increment(rigid_motion.compose(g1, h1), rigid_motion.compose(g2, h2))
    found = rigid_motion.chained(increment(g1, g2), increment(h1, h2), h1, h2)
    np.testing.assert_allclose(found.rotation.astype(float), wanted.rotation.astype(float), rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.shift.astype(float), wanted.shift.astype(float), rtol=0, atol=1e-13)


@pytest.mark.skipif(np.finfo(WIDE).nmant < 63, reason="long double is double on this machine")
def test_rounding_has_no_bias_and_knows_only_the_step():
    exact = np.full((100_000, 1), WIDE(1) / WIDE(3) * WIDE(1e-5))
    step = np.arange(len(exact))
    rounded = rigid_motion.rounded(exact, step)
    assert len(np.unique(rounded)) == 2
    bias = float(np.sum(rounded.astype(WIDE) - exact))
    assert abs(bias) < 2 * np.spacing(rounded[0, 0]), "each number rounded to nearest: 5000 units of the last place"
    assert abs(float(np.sum(exact.astype(float).astype(WIDE) - exact))) > 1000 * np.spacing(rounded[0, 0])
    np.testing.assert_array_equal(rigid_motion.rounded(exact[700:], step[700:]), rounded[700:])
    np.testing.assert_array_equal(rigid_motion.rounded(np.zeros((3, 2), dtype=WIDE), np.arange(3)), 0.0)
