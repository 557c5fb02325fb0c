import math
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.normal import hertz

from model_probes import RTOL, normal_constants, normal_force

GLASS = SimpleNamespace(young_modulus=5e6, poisson_ratio=0.3)
STEEL = SimpleNamespace(young_modulus=2e8, poisson_ratio=0.25)


def force(real, overlap, speed, stiffness=1e6, damping=0.0):
    return normal_force(hertz, real, overlap, speed, stiffness, damping)


def constants(real, *inputs):
    return normal_constants(hertz, real, *inputs)


def test_force_stiffness_and_dashpot_are_the_hand_values(real):
    # d = 1e-4 m: sqrt(d) = 1e-2, d^(1/4) = 1e-1; F = 1e6 * 1e-6 - 2 * 1e-1 * 0.5
    f_n, k_n, gamma_n = force(real, 1e-4, 0.5, 1e6, 2.0)
    np.testing.assert_allclose([f_n, k_n, gamma_n], [1.0 - 0.1, 1e4, 0.2], rtol=RTOL[real])


@pytest.mark.parametrize("overlap", [0.0, -1e-12, -1e-3])
def test_nothing_acts_without_overlap(real, overlap):
    assert force(real, overlap, -1.0, 1e6, 2.0) == [0.0, 0.0, 0.0]


def test_force_follows_the_three_halves_law_over_ten_decades(real):
    for overlap in 10.0 ** np.arange(-12, -2):
        assert force(real, overlap, 0.0)[0] == pytest.approx(1e6 * overlap**1.5, rel=10 * RTOL[real], abs=0)


def test_dashpot_is_odd_in_the_speed(real):
    base = force(real, 1e-4, 0.0, 1e6, 2.0)[0]
    apart, together = (force(real, 1e-4, v, 1e6, 2.0)[0] - base for v in (0.3, -0.3))
    assert apart < 0 < together
    assert apart == pytest.approx(-together, rel=20 * RTOL[real])


def test_elastic_force_is_minus_the_gradient_of_the_energy():
    h = 1e-8  # central difference: relative error (h/d)^2 = 1e-8
    for d in (1e-4, 3e-4):
        slope = (hertz.energy(d + h, 1e6) - hertz.energy(d - h, 1e6)) / (2 * h)
        assert slope == pytest.approx(force(wp.float64, d, 0.0)[0], rel=1e-7)
    assert hertz.energy(0.0, 1e6) == 0.0


def test_constants_are_the_hand_values(real):
    # K = 3e6 * 0.02 = 6e4, C = 0.5 sqrt(6e-4 * 6e4) = 3
    np.testing.assert_allclose(constants(real, 3e6, 0.5, 4e-4, 6e-4), [6e4, 3.0], rtol=RTOL[real])


def test_coefficients_of_like_materials_are_the_textbook_ones():
    base, damping, shear, shear_damping = hertz.coefficients(GLASS, GLASS, SimpleNamespace(restitution=0.5))
    beta = math.log(2.0) / math.hypot(math.log(2.0), math.pi)
    # E* = E / (2 (1 - nu^2)); k_t / S_n = 2 (1 - nu) / (2 - nu) with S_n = (3/2) k_n (Mindlin 1949)
    assert base == pytest.approx(4.0 / 3.0 * 5e6 / (2 * 0.91), rel=1e-14)
    assert damping == pytest.approx(math.sqrt(5.0) * beta, rel=1e-14)
    assert shear == pytest.approx(1.5 * 2 * 0.7 / 1.7, rel=1e-14)
    # gamma = 2 sqrt(5/6) |beta| sqrt(S m*) in both directions
    assert shear_damping == pytest.approx(math.sqrt(2 * 0.7 / 1.7), rel=1e-14)


def test_coefficients_do_not_depend_on_the_order_of_the_materials():
    pair = SimpleNamespace(restitution=0.8)
    np.testing.assert_allclose(
        hertz.coefficients(GLASS, STEEL, pair), hertz.coefficients(STEEL, GLASS, pair), rtol=1e-15
    )


def test_restitution_one_means_no_damping():
    assert hertz.coefficients(GLASS, STEEL, SimpleNamespace(restitution=1.0))[1] == 0.0
