r"""Sums that do not depend on the order of their numbers, in four words: for many sums of numbers that are not huge.

    x = +-(d_0 + d_1 2^-32 + d_2 2^-64 + d_3 2^-96),   0 <= d_k < 2^32 whole

Each digit is added to a whole number of its own (int64), so that sums are exact and rows that several threads add to may be
added to each other. What is below 2^-96 (1.3e-29) of a number is cut off before it is added. A number that is no number, or not
below 2^31, makes its sum one that is no number. A tenth of the memory of ``exact_sum``, which takes every float64.
"""

import numpy as np
import warp as wp

DIGITS = 4
NOT_FINITE = DIGITS
"""Where the numbers that are not taken are counted."""
WIDTH = DIGITS + 1
LARGEST = 2147483648.0  # 2^31
BASE = 4294967296.0  # 2^32


@wp.func
def add(value: wp.float64, row: int, column: int, sums_out: wp.array3d(dtype=wp.int64)):
    """Add a number to a column of a row; on a CPU no other thread may add to that row."""
    left = wp.abs(value)
    if left < wp.float64(wp.static(LARGEST)):
        if left > wp.float64(0.0):
            sign = wp.int64(1)
            if value < wp.float64(0.0):
                sign = wp.int64(-1)
            for k in range(wp.static(DIGITS)):
                digit = wp.floor(left)
                left = (left - digit) * wp.float64(wp.static(BASE))  # exact: powers of two, and a difference without rounding
                wp.atomic_add(sums_out, row, column, k, sign * wp.int64(digit))
    else:
        wp.atomic_add(sums_out, row, column, wp.static(NOT_FINITE), wp.int64(1))


def joined(rows: np.ndarray) -> np.ndarray:
    """One row of digits for all ``rows`` (rows, columns, WIDTH): shape (columns, WIDTH), digits below the first >= 0."""
    total = rows.sum(axis=0)
    for k in range(DIGITS - 1, 0, -1):
        total[:, k - 1] += total[:, k] >> 32
        total[:, k] &= 0xFFFFFFFF
    return np.asarray(total)


def rounded(rows: np.ndarray) -> np.ndarray:
    """What has been added up by all ``rows`` (rows, columns, WIDTH), float64, shape (columns,)."""
    total = joined(rows)
    negative = total[:, 0] < 0  # whose digits count up from below: turned into those of its size
    total[negative, :DIGITS] = joined(-total[None, negative])[:, :DIGITS]
    value = np.zeros(len(total))
    for k in range(DIGITS - 1, -1, -1):
        value = value / BASE + total[:, k]
    return np.where(total[:, NOT_FINITE] == 0, np.where(negative, -value, value), np.nan)
