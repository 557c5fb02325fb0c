"""Placement of a free body whose carrier moves: its points go with the carrier and with the body's own motion."""

import numpy as np
import warp as wp
from warpdem.kernels.step.free_bodies import placement_of
from warpdem.kernels.step.schedule import Placement

from placements import moving_axes, point_and_velocity, turned


@wp.kernel(enable_backward=False)
def place(
    carrier: wp.array(dtype=Placement), rotation: wp.mat33d, x: wp.vec3d, center: wp.vec3d, v: wp.vec3d, w: wp.vec3d,
    out: wp.array(dtype=Placement),
):  # fmt: skip
    out[0] = placement_of(carrier[0], rotation, x, center, v, w)


def test_a_point_of_a_free_body_moves_with_its_carrier_and_about_its_center():
    carrier, own = moving_axes(), turned([-2, 1, 1], 1.1)
    outer = carrier[:9].reshape(3, 3)
    x, center, v, w, point = np.random.default_rng(2).normal(size=(5, 3))
    out = wp.zeros(1, dtype=Placement, device="cpu")
    given = wp.array(carrier[None], dtype=Placement, device="cpu")
    inputs = [given, wp.mat33d(*own.ravel()), *(wp.vec3d(*vector) for vector in (x, center, v, w)), out]
    wp.launch(place, dim=1, inputs=inputs, device="cpu")
    arm = own @ (point - center)
    where, carried = point_and_velocity(carrier, x + arm)
    found, velocity = point_and_velocity(out.numpy()[0], point)
    np.testing.assert_allclose(found, where, rtol=0, atol=1e-14)
    np.testing.assert_allclose(velocity, carried + outer @ (v + np.cross(w, arm)), rtol=0, atol=1e-14)
    np.testing.assert_allclose(out.numpy()[0][12:15], carrier[12:15] + outer @ w, rtol=0, atol=1e-14)
