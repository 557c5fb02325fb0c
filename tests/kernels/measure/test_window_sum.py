"""Sums in four words: exact in any order and over any rows, to 2^-96."""

import math
from fractions import Fraction

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.measure import window_sum
from warpdem.kernels.measure.window_sum import add, add_rounded
from warpdem.kernels.simd.lane_types import declarations


@wp.kernel(enable_backward=False)
def _add(values: wp.array(dtype=wp.float64), rows: int, sums_out: wp.array3d(dtype=wp.int64)):
    for k in range(values.shape[0]):
        add(values[k], k % rows, 0, sums_out)


def added(values, rows=1, start=(0, 0, 0, 0, 0)):
    """Digits of the sum of ``values``, added in their order to ``rows`` rows in turn, each of which holds ``start``."""
    sums = wp.array(np.tile(np.array(start, dtype=np.int64), (rows, 1, 1)), device="cpu")
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


FULL = 2**62


def exact(rows):
    """What rows of digits hold, without rounding."""
    return sum(Fraction(int(digit), 2 ** (32 * k)) for row in rows for k, digit in enumerate(row[0, :4].tolist()))


@pytest.mark.parametrize("sign", [1, -1])
def test_digits_are_carried_before_they_overflow(sign):
    """As after some 2^31 additions: each digit but the first about to pass 2^62; none may stay beyond it."""
    start = [sign * 7, *(sign * (FULL - 3 * k) for k in (1, 2, 3)), 0]
    values = [sign * x for x in (0.7, 3.0 + 2.0**-33, 0.9 * 2.0**-30, 0.9 * 2.0**-62, 1.0 / 3.0 * 2.0**-20)] * 3
    rows = added(values, start=start)
    cut = [Fraction(int(Fraction(x) * 2**96), 2**96) for x in values]
    assert exact(rows) == exact(np.array([[start]])) + sum(cut)
    assert (np.abs(rows[0, 0, 1:4]) < 2**40).all()
    assert rows[0, 0, 4] == 0
    assert window_sum.rounded(rows)[0] == pytest.approx(float(exact(rows)), rel=1e-15)


@pytest.mark.parametrize("sign", [1, -1])
def test_rows_whose_digits_overflow_together_are_joined(sign):
    rows = np.tile(sign * np.array([3, FULL, FULL - 1, FULL - 5, 0]), (6, 1, 1))
    joined = window_sum.joined(rows)
    assert exact(joined[None]) == exact(rows)
    assert (joined[:, 1:4] >= 0).all() and (joined[:, 1:4] < 2**32).all() and joined[0, 4] == 0
    assert window_sum.rounded(rows)[0] == pytest.approx(float(exact(rows)), rel=1e-15)


def test_a_sum_beyond_the_first_digit_is_no_number():
    below = added([1.5], start=(FULL - 2, 0, 0, 0, 0))
    assert window_sum.rounded(below)[0] == float(FULL)
    for sign in (1, -1):
        assert np.isnan(window_sum.rounded(added([sign * 4.0], start=(sign * (FULL - 2), 0, 0, 0, 0)))[0])
        assert np.isnan(window_sum.rounded(np.tile([sign * (FULL // 2), 0, 0, 0, 0], (3, 1, 1)))[0])
    mixed = np.array([[[FULL, 0, 0, 0, 0]], [[FULL, 0, 0, 0, 0]], [[-FULL, 0, 0, 0, 0]]])
    assert window_sum.rounded(mixed)[0] == float(FULL)


# --- in registers ------------------------------------------------------------------------------------------------------

LANES = 8
REGISTERS = f"""{declarations(LANES)}
    struct batch {{{window_sum.lanes(LANES, 1)}    }};
    f64 sums[3] = {{}};
    wp::int64* const digits = wp::address(sums_out, 0, 0, 0);
    for (int p = 0; p < values.shape[0] / {LANES}; ++p) {{
        f64 value;
        for (int k = 0; k < {LANES}; ++k) value[k] = values.data[p * {LANES} + k];
        batch::add_lost(&value, sums, digits);
        if (p % 100 == 99) batch::give_lost(sums, digits);
    }}
    batch::give_lost(sums, digits);
"""


@wp.func_native(REGISTERS)
def add_in_registers(values: wp.array(dtype=wp.float64), sums_out: wp.array3d(dtype=wp.int64)): ...


@wp.kernel(enable_backward=False)
def _rounded(values: wp.array(dtype=wp.float64), plain_out: wp.array3d(dtype=wp.int64), lanes_out: wp.array3d(dtype=wp.int64)):
    for k in range(values.shape[0]):
        add_rounded(values[k], 0, 0, plain_out)
    add_in_registers(values, lanes_out)


def both(values):
    """Digits of the sum, number by number and in registers."""
    plain, lanes = (wp.zeros((1, 1, window_sum.WIDTH), dtype=wp.int64, device="cpu") for _ in range(2))
    wp.launch(_rounded, 1, [wp.array(values, dtype=wp.float64, device="cpu"), plain, lanes], device="cpu")
    return window_sum.joined(plain.numpy()), window_sum.joined(lanes.numpy())


@pytest.mark.parametrize("decades", [(-32, 6), (-30, -24), (-14, -9), (-1, 1)])
def test_registers_add_the_same_whole_numbers(decades):
    rng = np.random.default_rng(3)
    values = rng.choice([-1.0, 0.7], 8000) * rng.uniform(1, 10, 8000) * 10.0 ** rng.uniform(*decades, 8000)
    plain, lanes = both(values)
    np.testing.assert_array_equal(lanes, plain)
    nearest = [round(Fraction(value) * 2**96) for value in values.tolist()]
    assert exact(plain[None]) == Fraction(sum(nearest), 2**96)


def test_registers_notice_what_is_no_number_and_take_what_is_large():
    plain, lanes = both([1e-12] * 7 + [math.nan])
    assert np.isnan(window_sum.rounded(lanes[None])[0]) and np.isnan(window_sum.rounded(plain[None])[0])
    plain, lanes = both([1e-12, -3.0, 1e9, 1.0, -1.0, 0.5, 0.0, 2.0**-97])
    np.testing.assert_array_equal(lanes, plain)
    assert window_sum.rounded(lanes[None])[0] == 1e9 - 2.5 + 1e-12
