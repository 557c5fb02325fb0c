import numpy as np
import pytest
import warp as wp
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation
from warpdem.kernels.integrator.scovel import rotated

AXIS, V = np.array([1.0, -2.0, 2.0]) / 3.0, np.array([0.3, 0.5, -0.7])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.0499, 0.0501, 0.3, 3.0])  # the series end at 0.05
def test_end_and_mean_are_the_turned_vector_and_its_mean_over_the_step(angle):
    dt = 0.01
    end, mean = rotated(wp.vec3d(*(AXIS * angle / dt)), wp.float64(dt), wp.vec3d(*V))
    np.testing.assert_allclose(np.array(end), Rotation.from_rotvec(AXIS * angle).apply(V), rtol=0, atol=4e-16)
    exact = quad_vec(lambda t: Rotation.from_rotvec(AXIS * angle * t).apply(V), 0.0, 1.0, epsabs=1e-15)[0]
    np.testing.assert_allclose(np.array(mean), exact, rtol=0, atol=4e-16)
