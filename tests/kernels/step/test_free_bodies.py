"""Placement of a free body whose carrier moves: its points go with the carrier and with the body's own motion."""

import numpy as np
import warp as wp
from warpdem.kernels.step.free_bodies import placement_of
from warpdem.kernels.step.schedule import Placement

from warpdem.core import rigid_motion


@wp.kernel(enable_backward=False)
def place(
    carrier: wp.array(dtype=Placement), rotation: wp.mat33d, x: wp.vec3d, center: wp.vec3d, v: wp.vec3d, w: wp.vec3d,
    out: wp.array(dtype=Placement),
):  # fmt: skip
    out[0] = placement_of(carrier[0], rotation, x, center, v, w)


def turned(axis, angle):
    return np.eye(3) + rigid_motion.rotation_increment(rigid_motion.unit(axis), np.array([angle]))[0].astype(float)


def at(placement, point):
    """Where a body point is [m], and how fast it moves [m/s]."""
    where = placement[:9].reshape(3, 3) @ point + placement[9:12]
    return where, placement[15:18] + np.cross(placement[12:15], where)


def test_a_point_of_a_free_body_moves_with_its_carrier_and_about_its_center():
    rng = np.random.default_rng(1)
    outer, own = turned([1, 2, 3], 0.7), turned([-2, 1, 1], 1.1)
    carrier = np.concatenate([outer.ravel(), rng.normal(size=15)])
    x, center, v, w, point = rng.normal(size=(5, 3))
    out = wp.zeros(1, dtype=Placement, device="cpu")
    given = wp.array(carrier[None], dtype=Placement, device="cpu")
    inputs = [given, wp.mat33d(*own.ravel()), *(wp.vec3d(*vector) for vector in (x, center, v, w)), out]
    wp.launch(place, dim=1, inputs=inputs, device="cpu")
    arm = own @ (point - center)
    where, carried = at(carrier, x + arm)
    found, velocity = at(out.numpy()[0], point)
    np.testing.assert_allclose(found, where, rtol=0, atol=1e-14)
    np.testing.assert_allclose(velocity, carried + outer @ (v + np.cross(w, arm)), rtol=0, atol=1e-14)
    np.testing.assert_allclose(out.numpy()[0][12:15], carrier[12:15] + outer @ w, rtol=0, atol=1e-14)
