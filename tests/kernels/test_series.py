import numpy as np
import pytest
import warp as wp
from warpdem.kernels import series

from lane_probes import assert_same_bits


@pytest.mark.parametrize(("real", "lanes", "of_log", "of_exp"), [(wp.float64, 8, 4e-15, 4e-16), (wp.float32, 8, 2e-6, 3e-7)])
def test_logarithm_and_exponential_in_lanes(real, lanes, of_log, of_exp):
    x = np.linspace(-27.0, 27.0, 4096).astype(np.float32 if real is wp.float32 else float)
    (log,) = assert_same_bits(series.build(real).log, {"x": (real, np.exp(x))}, (real,), lanes)
    (exp,) = assert_same_bits(series.build(real).exp, {"x": (real, x)}, (real,), lanes)
    np.testing.assert_allclose(log[:, 0], np.log(np.exp(x).astype(x.dtype)), rtol=0, atol=of_log)
    np.testing.assert_allclose(exp[:, 0], np.exp(x.astype(float)), rtol=of_exp)


def test_the_exponential_stands_still_beyond_its_range():
    x = np.repeat([-1e300, -series.LARGEST, 1e300, series.LARGEST], 2)
    (found,) = assert_same_bits(series.build(wp.float64).exp, {"x": (wp.float64, x)}, (wp.float64,), 8)
    assert found[0] == found[2] > 0.0 and found[4] == found[6] < np.inf


@pytest.mark.parametrize(("real", "lanes"), [(wp.float64, 4), (wp.float32, 8)])
def test_powers_of_two_go_in_and_out_of_a_number_exactly(real, lanes):
    of, edge = series.build(real), np.sqrt(0.5)
    n = np.arange(-120.0, 120.0)
    (power,) = assert_same_bits(of.power_of_two, {"n": (real, n)}, (real,), lanes)
    np.testing.assert_array_equal(power[:, 0], 2.0**n)
    below, above = edge * (1.0 - 1e-6), edge * (1.0 + 1e-6)
    for part, exponent in ((below, n - 1.0), (above, n), (1.0, n), (1.9 * edge, n), (2.0 * below, n)):
        (found,) = assert_same_bits(of.exponent, {"x": (real, part * 2.0**n)}, (real,), lanes)
        np.testing.assert_array_equal(found[:, 0], exponent)
