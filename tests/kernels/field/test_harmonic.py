import numpy as np
import pytest
import warp as wp
from warpdem.kernels.field import Numbers, harmonic

STIFFNESS, CENTRE = 3.0, np.array([0.1, -0.2, 0.3])
NUMBERS = np.array([STIFFNESS, *CENTRE, *np.zeros(8)])
PLACES = np.random.default_rng(0).normal(size=(5, 3))


def force(q, v=(0.0, 0.0, 0.0)):
    one = wp.float64(1.0)
    return np.array(harmonic.build()(wp.vec3d(*q), wp.vec3d(*v), one, one, one, Numbers(*NUMBERS)))


@pytest.mark.parametrize("q", PLACES)
def test_force_points_to_the_centre_and_ignores_the_velocity(q):
    np.testing.assert_allclose(force(q, v=(5.0, 6.0, 7.0)), -STIFFNESS * (q - CENTRE), rtol=1e-14)


def test_nothing_acts_at_the_centre():
    assert force(CENTRE).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("q", PLACES)
def test_force_is_minus_the_gradient_of_the_energy(q):
    step = 1e-6 * np.eye(3)
    mass = radius = np.ones(3)
    rise = harmonic.energy(q + step, mass, radius, NUMBERS) - harmonic.energy(q - step, mass, radius, NUMBERS)
    np.testing.assert_allclose(-rise / 2e-6, force(q), rtol=1e-7)
