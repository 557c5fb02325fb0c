import functools

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.rolling import constant

RTOL = {wp.float32: 1e-6, wp.float64: 1e-14}
ZERO = (0.0, 0.0, 0.0)


@functools.cache
def probe(real):
    """A kernel that calls the model for each row of its inputs: Warp functions with ``wp.where`` need one."""
    vec3 = wp.types.vector(3, real)
    model = constant.build(real)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(
        spin: vec3, spin_predicted: vec3, angle: vec3, limit: real, spring: real, damping: real, inertia: real,
        dt: real, moment_out: wp.array(dtype=vec3), angle_out: wp.array(dtype=vec3),
    ):  # fmt: skip
        moment, held = model(spin, spin_predicted, angle, limit, spring, damping, inertia, dt)
        moment_out[0] = moment
        angle_out[0] = held

    return kernel


def evaluate(real, spin, spin_predicted, angle, *numbers):
    vec3 = wp.types.vector(3, real)
    out = [wp.zeros(1, dtype=vec3, device="cpu") for _ in range(2)]
    vectors = [vec3(*(float(x) for x in v)) for v in (spin, spin_predicted, angle)]
    wp.launch(probe(real), dim=1, inputs=[*vectors, *numbers, *out], device="cpu")
    return [x.numpy()[0].astype(float) for x in out]


def torque(real, spin, limit, inertia=1e-9, dt=1e-5):
    return evaluate(real, spin, ZERO, ZERO, limit, 1.0, 0.3, inertia, dt)[0]


def test_a_quick_spin_meets_the_constant_torque_against_it(real):
    # |w| = 5, limit 1e-5 N m: direction (3, 4, 0)/5
    np.testing.assert_allclose(torque(real, (3.0, 4.0, 0.0), 1e-5), [-6e-6, -8e-6, 0.0], rtol=RTOL[real])


def test_a_slow_spin_is_stopped_within_one_step_and_not_turned_round(real):
    spin = np.array([3e-3, 0.0, -4e-3])
    moment = torque(real, spin, 1e-5, inertia=1e-9, dt=1e-5)  # stopping torque 1e-9/1e-5 * 5e-3 = 5e-7 < 1e-5
    np.testing.assert_allclose(spin + moment * 1e-5 / 1e-9, 0.0, atol=5e-3 * RTOL[real])


def test_no_spin_or_no_load_gives_no_torque(real):
    assert np.all(torque(real, (0.0, 0.0, 0.0), 1e-5) == 0.0)
    assert np.all(torque(real, (3.0, 4.0, 0.0), 0.0) == 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_the_torque_never_drives_and_never_exceeds_its_limit(real, seed):
    rng = np.random.default_rng(seed)
    spin = rng.normal(size=3) * 10.0 ** rng.uniform(-6, 3)
    limit = 10.0 ** rng.uniform(-9, -3)
    moment = torque(real, spin, limit)
    assert moment @ spin < 0
    assert np.linalg.norm(moment) <= limit * (1 + 4 * RTOL[real])
    np.testing.assert_allclose(np.cross(moment, spin), 0.0, atol=RTOL[real] * limit * np.linalg.norm(spin))
