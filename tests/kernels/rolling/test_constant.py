
import numpy as np
import pytest
from warpdem.kernels.rolling import constant

from model_probes import RTOL, rolling

ZERO = (0.0, 0.0, 0.0)


def torque(real, spin, limit, inertia=1e-9, dt=1e-5):
    return rolling(constant, real, spin, ZERO, ZERO, limit, 1.0, 0.3, inertia, dt)[0]


def test_a_quick_spin_meets_the_constant_torque_against_it(real):
    # |w| = 5, limit 1e-5 N m: direction (3, 4, 0)/5
    np.testing.assert_allclose(torque(real, (3.0, 4.0, 0.0), 1e-5), [-6e-6, -8e-6, 0.0], rtol=RTOL[real])


def test_a_slow_spin_is_stopped_within_one_step_and_not_turned_round(real):
    spin = np.array([3e-3, 0.0, -4e-3])
    moment = torque(real, spin, 1e-5, inertia=1e-9, dt=1e-5)  # stopping torque 1e-9/1e-5 * 5e-3 = 5e-7 < 1e-5
    np.testing.assert_allclose(spin + moment * 1e-5 / 1e-9, 0.0, rtol=0, atol=5e-3 * RTOL[real])


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
    np.testing.assert_allclose(np.cross(moment, spin), 0.0, rtol=0, atol=RTOL[real] * limit * np.linalg.norm(spin))
