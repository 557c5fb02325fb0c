import numpy as np
import pytest
import warp as wp
from warpdem.kernels.integrator.lobatto import solved


@pytest.mark.parametrize("size", [0.0, 1e-6, 0.02, 3.0])
def test_the_solution_solves_the_implicit_equation(size):
    c, r = size * np.array([1.0, -2.0, 2.0]) / 3.0, np.array([0.3, 0.5, -0.7])
    x = np.array(solved(wp.vec3d(*c), wp.vec3d(*r)))
    np.testing.assert_allclose(x + np.cross(c, x), r, rtol=0, atol=1e-15)
