import math

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.rolling import spring

from model_probes import RTOL, rolling

K = 4e-3  # k_n (mu_r R*)^2 [N m]; the model's own stiffness is 2.25 times that
LIMIT, ETA, INERTIA = 9e-5, 0.3, 1e-9


def torque(real, angle, spin, limit=LIMIT):
    return rolling(spring, real, (0.0, 0.0, 0.0), spin, angle, limit, K, ETA, INERTIA, 1e-5)


def test_within_the_limit_spring_and_dashpot_add_up(real):
    moment, held = torque(real, (3e-3, 0.0, 0.0), (0.0, 2.0, 0.0))
    # k_r a = 2.25 * 4e-3 * 3e-3 = 2.7e-5; C_r w = 2 * 0.3 sqrt(1e-9 * 9e-3) * 2
    np.testing.assert_allclose(moment, [-2.7e-5, -1.2 * math.sqrt(9e-12), 0.0], rtol=2 * RTOL[real])
    np.testing.assert_allclose(held, [3e-3, 0.0, 0.0], rtol=RTOL[real])


def test_beyond_the_limit_the_spring_slides_and_the_dashpot_is_left_out(real):
    moment, held = torque(real, (0.03, 0.04, 0.0), (0.0, 50.0, 0.0))
    np.testing.assert_allclose(moment, [-0.6 * LIMIT, -0.8 * LIMIT, 0.0], rtol=4 * RTOL[real])
    np.testing.assert_allclose(np.linalg.norm(held), LIMIT / (2.25 * K), rtol=4 * RTOL[real])


def test_no_angle_and_no_spin_or_no_load_gives_no_torque(real):
    assert np.all(torque(real, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))[0] == 0.0)
    moment, held = torque(real, (1e-3, 0.0, 0.0), (0.0, 2.0, 0.0), limit=0.0)
    assert np.all(moment == 0.0)
    assert np.all(held == 0.0)


@pytest.mark.parametrize("reach", [0.1, 0.9, 5.0])
def test_a_closed_cycle_of_rolling_takes_energy_away_and_gives_none(reach):
    """Quasi-static rolling there, beyond and back: elastic within the limit, friction beyond it."""
    most = LIMIT / (2.25 * K)
    path = reach * most * np.concatenate([np.linspace(0, 1, 200), np.linspace(1, -1, 400), np.linspace(-1, 0, 200)])
    angle, before, work, moment = 0.0, 0.0, 0.0, 0.0
    for point in path:
        m, held = torque(wp.float64, (angle + point - before, 0.0, 0.0), (0.0, 0.0, 0.0))
        work += 0.5 * (moment + m[0]) * (point - before)
        angle, before, moment = held[0], point, m[0]
    stored = 0.5 * LIMIT * most
    if reach < 1:
        assert abs(work) < 1e-12 * stored  # trapezoids are exact on a straight line
    else:
        # in units of limit x most: slides reach - 1 out, 2 (reach - 1) there and back, reach - 2 home, and 1/2 stays
        # stored; a step of the path is 1/40 of the spring's range, its corners cost (1/40)^2
        assert work == pytest.approx(-LIMIT * most * (4 * reach - 4.5), rel=1e-3)
