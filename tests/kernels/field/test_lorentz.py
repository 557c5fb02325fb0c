import numpy as np
import pytest
import warp as wp
from warpdem.kernels.field import Numbers, lorentz

CHARGE, MAGNETIC, ELECTRIC = -2.0, np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -3.0])
NUMBERS = np.array([CHARGE, *MAGNETIC, *ELECTRIC, *np.zeros(5)])
VECTORS = np.random.default_rng(0).normal(size=(5, 3))


def force(q, v):
    one = wp.float64(1.0)
    return np.array(lorentz.build()(wp.vec3d(*q), wp.vec3d(*v), one, one, one, Numbers(*NUMBERS)))


@pytest.mark.parametrize("v", VECTORS)
def test_force_is_the_lorentz_force(v):
    np.testing.assert_allclose(force((5.0, 6.0, 7.0), v), CHARGE * (ELECTRIC + np.cross(v, MAGNETIC)), rtol=1e-13)


@pytest.mark.parametrize("v", VECTORS)
def test_the_magnetic_part_does_no_work(v):
    magnetic = force((0.0, 0.0, 0.0), v) - CHARGE * ELECTRIC
    assert abs(magnetic @ v) < 1e-14
    assert np.linalg.norm(magnetic) > 0.01


@pytest.mark.parametrize("q", VECTORS)
def test_force_at_rest_is_minus_the_gradient_of_the_energy(q):
    step = 1e-3 * np.eye(3)
    mass = radius = np.ones(3)
    rise = lorentz.energy(q + step, mass, radius, NUMBERS) - lorentz.energy(q - step, mass, radius, NUMBERS)
    np.testing.assert_allclose(-rise / 2e-3, force(q, (0.0, 0.0, 0.0)), rtol=1e-11)
