import numpy as np
import pytest
import warp as wp
from warpdem.kernels.field import Numbers, drag

COEFFICIENT, FLOW = 2.0, np.array([0.5, 0.0, -1.0])
NUMBERS = np.array([COEFFICIENT, *FLOW, *np.zeros(8)])


def force(v, q=(0.0, 0.0, 0.0)):
    one = wp.float64(1.0)
    return np.array(drag.build()(wp.vec3d(*q), wp.vec3d(*v), one, one, one, Numbers(*NUMBERS)))


@pytest.mark.parametrize("v", np.random.default_rng(0).normal(size=(5, 3)))
def test_force_is_against_the_velocity_relative_to_the_flow(v):
    np.testing.assert_allclose(force(v, q=(5.0, 6.0, 7.0)), -COEFFICIENT * (v - FLOW), rtol=1e-14)
    assert force(v) @ (v - FLOW) < 0.0


def test_nothing_acts_on_a_grain_that_floats_along():
    assert force(FLOW).tolist() == [0.0, 0.0, 0.0]
