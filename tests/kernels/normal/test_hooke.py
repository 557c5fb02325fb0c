import math
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.normal import hooke

from model_probes import RTOL, normal_constants, normal_force

MATERIAL = SimpleNamespace(young_modulus=5e6, poisson_ratio=0.3)


def force(real, overlap, speed, stiffness=1e3, damping=0.0):
    return normal_force(hooke, real, overlap, speed, stiffness, damping)


def constants(real, *inputs):
    return normal_constants(hooke, real, *inputs)


def test_force_stiffness_and_dashpot_are_the_hand_values(real):
    np.testing.assert_allclose(force(real, 1e-3, 0.25, 1e3, 2.0), [1.0 - 0.5, 1e3, 2.0], rtol=RTOL[real])


@pytest.mark.parametrize("overlap", [0.0, -1e-12, -1e-3])
def test_nothing_acts_without_overlap(real, overlap):
    assert force(real, overlap, -1.0, 1e3, 2.0) == [0.0, 0.0, 0.0]


def test_the_dashpot_acts_from_the_first_touch(real):
    assert force(real, 1e-30, -1.0, 1e3, 2.0)[0] == pytest.approx(2.0, rel=RTOL[real])


def test_elastic_force_is_minus_the_gradient_of_the_energy():
    slope = (hooke.energy(1e-3 + 1e-7, 1e3) - hooke.energy(1e-3 - 1e-7, 1e3)) / 2e-7
    assert slope == pytest.approx(force(wp.float64, 1e-3, 0.0)[0], rel=1e-9)  # a parabola: only round-off is left


def test_damping_gives_the_restitution_asked_for():
    # e = exp(-gamma t_c / (2 m)), t_c = pi / sqrt(k/m - (gamma/2m)^2) (exact_solutions: linear spring-dashpot)
    mass, stiffness = 2e-5, 1e3
    for e in (0.05, 0.5, 0.95):
        pair = SimpleNamespace(stiffness=stiffness, restitution=e, tangential_stiffness_ratio=2 / 7)
        base, damping, shear, shear_damping = hooke.coefficients(MATERIAL, MATERIAL, pair)
        k, gamma = constants(wp.float64, base, damping, 1e-3, mass)
        rate = gamma / (2 * mass)
        assert math.exp(-rate * math.pi / math.sqrt(k / mass - rate**2)) == pytest.approx(e, rel=1e-13)
        assert (k, shear) == (stiffness, 2 / 7)
        assert shear_damping == pytest.approx(math.sqrt(2 / 7), rel=1e-15)
