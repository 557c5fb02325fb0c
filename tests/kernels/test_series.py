import numpy as np
import pytest
import warp as wp
from warpdem.kernels import series

from lane_probes import assert_same_bits


@pytest.mark.parametrize(("real", "lanes", "of_log", "of_exp"), [(wp.float64, 8, 2e-14, 3e-14), (wp.float32, 8, 1e-5, 1e-5)])
def test_logarithm_and_exponential_in_lanes(real, lanes, of_log, of_exp):
    x = np.linspace(-27.0, 27.0, 4096).astype(np.float32 if real is wp.float32 else float)
    (log,) = assert_same_bits(series.build(real).log, {"x": (real, np.exp(x))}, (real,), lanes)
    (exp,) = assert_same_bits(series.build(real).exp, {"x": (real, x)}, (real,), lanes)
    np.testing.assert_allclose(log[:, 0], np.log(np.exp(x).astype(x.dtype)), rtol=0, atol=of_log)
    np.testing.assert_allclose(exp[:, 0], np.exp(x.astype(float)), rtol=of_exp)


def test_the_exponential_stands_still_beyond_its_range():
    exp = series.build(wp.float64).exp
    assert float(exp(wp.float64(-1e300))) == float(exp(wp.float64(-series.LARGEST)))
