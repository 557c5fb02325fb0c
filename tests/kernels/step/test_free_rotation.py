"""Free rotation of a rigid body against Jacobi's functions (moments 1, 2, 3; computed with 30 digits)."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import MODULE_OPTIONS
from warpdem.kernels.step import free_rotation as code

MOMENTS, SPIN = np.array([1.0, 2.0, 3.0]), np.array([0.3, 2.0, 0.2])
AT_10 = np.array([-0.35739232902914479, 0.91782939385206195, 0.076282208691741946, -0.15505144813702833])
SPIN_AT_10 = np.array([1.1474523355968126, -1.6653387455810364, 0.66998678157771149])


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def turn(
    steps: int, dt: wp.float64, rate: wp.vec3d, momentum: wp.vec3d, q: wp.array(dtype=wp.vec4d), out: wp.array(dtype=wp.vec3d)
):
    for _ in range(steps):
        l = wp.transpose(code.rotation_matrix(q[0])) * momentum
        p = code.free_rotation(l, rate, dt)
        out[1] = code.rotation_vector(p)
        q[0] = code.product(q[0], p)
    out[0] = wp.transpose(code.rotation_matrix(q[0])) * momentum


def turned(moments, spin, dt, steps):
    """Quaternion, angular momentum in the body's axes and rotation vector of the last step."""
    q = wp.array([[1.0, 0.0, 0.0, 0.0]], dtype=wp.vec4d, device="cpu")
    out = wp.zeros(2, dtype=wp.vec3d, device="cpu")
    inputs = [steps, dt, wp.vec3d(*(1.0 / moments)), wp.vec3d(*(moments * spin)), q, out]
    wp.launch(turn, 1, inputs, device="cpu")
    return q.numpy()[0], out.numpy()[0], out.numpy()[1]


@pytest.mark.parametrize(
    ("steps", "error"),
    [(100, 5e-9), (200, 2e-11), (400, 3e-13), (1000, 5e-13), (12000, 1e-12), (50_000, 1e-12), (200_000, 1e-12)],
)
def test_an_asymmetric_top_is_where_the_formula_has_it(steps, error):
    """|W| dt from 0.2 down to 0.0017, by the power series, and to 4e-4 and 1e-4, by the rotation vector."""
    q, momentum, _ = turned(MOMENTS, SPIN, 10.0 / steps, steps)
    np.testing.assert_allclose(q, AT_10, rtol=0, atol=error)
    np.testing.assert_allclose(momentum / MOMENTS, SPIN_AT_10, rtol=0, atol=5.0 * error)
    assert abs(q @ q - 1.0) < 1e-15


def test_a_body_of_revolution_turns_exactly_at_any_step():
    moments = np.array([2.0, 2.0, 0.5])
    coarse, fine = turned(moments, SPIN, 2.5, 4)[0], turned(moments, SPIN, 0.01, 1000)[0]
    np.testing.assert_allclose(coarse, fine, rtol=0, atol=2e-13)
    # in space: about L, after the turn about its own axis
    momentum = moments * SPIN
    size, own = np.linalg.norm(momentum) / 2.0 * 10.0, (1.0 / 0.5 - 1.0 / 2.0) * momentum[2] * 10.0
    a = np.array([np.cos(size / 2), *(np.sin(size / 2) * momentum / np.linalg.norm(momentum))])
    b = np.array([np.cos(own / 2), 0.0, 0.0, np.sin(own / 2)])
    w, z = b[0], b[3]
    both = [a[0] * w - a[3] * z, a[1] * w + a[2] * z, a[2] * w - a[1] * z, a[0] * z + a[3] * w]
    np.testing.assert_allclose(coarse, both, rtol=0, atol=1e-13)


@pytest.mark.parametrize("moments", [[2e-10, 2e-10, 5e-11], [1e-10, 2e-10, 3e-10]])
def test_a_body_at_rest_stays(moments):
    """Small moments: whatever is not 0 of a body at rest would turn it by any angle."""
    q, _, vector = turned(np.array(moments), np.zeros(3), 1e-3, 1)
    np.testing.assert_array_equal(q, [1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(vector, 0.0)


def test_a_body_that_turns_by_radians_per_step_is_still_a_body():
    q, _, _ = turned(MOMENTS, SPIN, 2.0, 50)
    assert abs(q @ q - 1.0) < 1e-12


def test_a_sphere_turns_about_its_spin():
    q, _, vector = turned(np.full(3, 2.0), SPIN, 0.25, 1)
    np.testing.assert_allclose(vector, 0.25 * SPIN, rtol=1e-14)
    assert q[0] == pytest.approx(np.cos(0.125 * np.linalg.norm(SPIN)), rel=1e-15)


@pytest.mark.parametrize("dt", [1e-9, 1e-5, 0.1, 1.0])
def test_the_rotation_vector_keeps_its_digits(dt):
    _, _, vector = turned(np.full(3, 2.0), SPIN, dt, 1)
    np.testing.assert_allclose(vector, dt * SPIN, rtol=1e-13)
