"""Sums in four words: exact in any order and over any rows, to 2^-96."""

import math

import numpy as np
import warp as wp
from warpdem.kernels.measure import window_sum
from warpdem.kernels.measure.window_sum import add


@wp.kernel(enable_backward=False)
def _add(values: wp.array(dtype=wp.float64), rows: int, sums_out: wp.array3d(dtype=wp.int64)):
    for k in range(values.shape[0]):
        add(values[k], k % rows, 0, sums_out)


def added(values, rows=1):
    """Digits of the sum of ``values``, added in their order to ``rows`` rows in turn."""
    sums = wp.zeros((rows, 1, window_sum.WIDTH), dtype=wp.int64, device="cpu")
    wp.launch(_add, 1, [wp.array(values, dtype=wp.float64, device="cpu"), rows, sums], device="cpu")
    return sums.numpy()


def test_a_sum_is_that_of_fsum_in_any_order_and_over_any_rows():
    rng = np.random.default_rng(1)
    values = rng.normal(size=2000) * 10.0 ** rng.uniform(-12, 8, 2000)
    found = {float(window_sum.rounded(added(rng.permutation(values), rows))[0]) for rows in (1, 1, 3, 7)}
    assert len(found) == 1
    np.testing.assert_allclose(found.pop(), math.fsum(values), rtol=1e-15)


def test_cancellation_leaves_what_is_left_also_below_zero():
    for small in (1e-15, -1e-15, -3.0, 0.0):
        values = [1e9, 0.1, small, -1e9, -0.1]
        assert abs(window_sum.rounded(added(values))[0] - small) <= 2.0**-96
    # 2^-96 and a half of it, which is cut off
    assert window_sum.rounded(added([-(2.0**-96), -(2.0**-97)]))[0] == -(2.0**-96)


def test_what_is_no_number_or_too_large_is_noticed():
    for strange in (math.nan, math.inf, -math.inf, 2.0**31):
        assert np.isnan(window_sum.rounded(added([1.0, strange]))[0])


def test_one_row_of_digits_stands_for_all():
    rows = added([-1.5, 2.0**-40, 7.25, -9.0], rows=4)
    joined = window_sum.joined(rows)
    assert window_sum.rounded(joined[None])[0] == window_sum.rounded(rows)[0] == -3.25 + 2.0**-40
    assert (joined[:, 1:4] >= 0).all() and (joined[:, 1:4] < 2**32).all()
