r"""Sums that do not depend on the order of their numbers, in four words: for many sums of numbers that are not huge.

    x = +-(d_0 + d_1 2^-32 + d_2 2^-64 + d_3 2^-96),   0 <= d_k < 2^32 whole

Each digit is added to a whole number of its own (int64), so that sums are exact and rows that several threads add to may be
added to each other. What a whole number beyond 2^62 holds above its digit is carried into the one before it, which leaves the
sum as it is: any number of numbers may be added. A sum beyond 2^62 becomes one that is no number. What is below 2^-96 (1.3e-29)
of a number is cut off before it is added. A number that is no number, or not below 2^31, makes its sum one that is no number. A
tenth of the memory of ``exact_sum``, which takes every float64.
"""

import numpy as np
import warp as wp
from warpdem.kernels.simd.lane_types import INLINE

DIGITS = 4
NOT_FINITE = DIGITS
"""Where the numbers that are not taken are counted."""
WIDTH = DIGITS + 1
LARGEST = 2147483648.0  # 2^31
BASE = 4294967296.0  # 2^32
LOW = 0xFFFFFFFF
FULL = 1 << 62
"""Size of a whole number from which on it is carried: as far from an overflow as 2^30 additions of other GPU threads."""
ROUNDING = tuple(1.5 * 2.0 ** (52 - 32 * k) for k in range(1, DIGITS))
"""A number that is added to one much smaller, and taken off again, to round it to multiples of 2^-32, 2^-64, 2^-96."""
BATCH = 1 << 20
"""Numbers below 1 that ``lanes`` adds up in the 53 binary digits of a register before it gives them to the sums."""


def lanes(lanes: int, columns: int) -> str:
    """C++ members of a local struct with ``LANES`` lanes: ``add_lost`` and ``give_lost``, sums of registers.

    A number is divided among three registers, the multiples of 2^-32, 2^-64 and 2^-96 in it, each of which adds up exactly.
    """
    split = "".join(
        f"                {{ const f64 part = (x + {unit.hex()}) - {unit.hex()}; x -= part; sums[3 * c + {k}] += part; }}\n"
        for k, unit in enumerate(ROUNDING)
    )
    return f"""
        // beyond the registers: to the sums at once, as ``window_sum.add``
        static __attribute__((noinline)) double whole_part(double x, wp::int64* digits) {{
            if (!(x < {LARGEST.hex()} && x > -{LARGEST.hex()})) {{ digits[{NOT_FINITE}] += 1; return 0.0; }}
            const wp::int64 part = (wp::int64)x;
            digits[0] += part;
            if (digits[0] > {FULL}ll || digits[0] < -{FULL}ll) digits[{NOT_FINITE}] += 1;
            return x - (double)part;
        }}
        // numbers of ``columns`` sums, one column after the other, to registers ``sums`` [3 * columns]
        {INLINE} void add_lost(const f64* value, f64* sums, wp::int64* digits) {{
            for (int c = 0; c < {columns}; ++c) {{
                f64 x = value[c];
                if (__builtin_reduce_or(~((x < 1.0) & (x > -1.0)))) {{
                    for (int k = 0; k < {lanes}; ++k)
                        if (!(x[k] < 1.0 && x[k] > -1.0)) x[k] = whole_part(x[k], digits + c * {WIDTH});
                }}
{split}            }}
        }}
        // the registers to the whole numbers of the sums, each of which is then carried
        static __attribute__((noinline)) void give_lost(f64* sums, wp::int64* digits) {{
            for (int c = 0; c < {columns}; ++c) {{
                wp::int64* to = digits + c * {WIDTH};
                for (int d = 3; d > 0; --d) {{
                    const f64 part = sums[3 * c + d - 1] * (d == 1 ? {2.0**32} : d == 2 ? {2.0**64} : {2.0**96});
                    for (int k = 0; k < {lanes}; ++k) to[d] += (wp::int64)part[k];
                    to[d - 1] += to[d] >> 32;
                    to[d] &= {LOW}ll;
                    sums[3 * c + d - 1] = 0.0;
                }}
            }}
        }}
"""


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
                part = sign * wp.int64(digit)
                now = wp.atomic_add(sums_out, row, column, k, part) + part
                if wp.abs(now) > wp.int64(wp.static(FULL)):
                    if k == 0:
                        wp.atomic_add(sums_out, row, column, wp.static(NOT_FINITE), wp.int64(1))
                    else:  # by the one thread that finds it as it left it; where none does, a later addition carries
                        rest = now & wp.int64(wp.static(LOW))
                        if wp.atomic_cas(sums_out, row, column, k, now, rest) == now:
                            wp.atomic_add(sums_out, row, column, k - 1, now >> wp.int64(32))
    else:
        wp.atomic_add(sums_out, row, column, wp.static(NOT_FINITE), wp.int64(1))


@wp.func
def add_rounded(value: wp.float64, row: int, column: int, sums_out: wp.array3d(dtype=wp.int64)):
    """Add a number, rounded to the nearest multiple of 2^-96 first, to even in the middle: what ``lanes`` adds."""
    near = value
    if wp.abs(value) < wp.float64(wp.static(2.0**-32)):  # larger ones end before 2^-96
        first = (value + wp.float64(wp.static(ROUNDING[1]))) - wp.float64(wp.static(ROUNDING[1]))
        rest = value - first
        near = first + ((rest + wp.float64(wp.static(ROUNDING[2]))) - wp.float64(wp.static(ROUNDING[2])))
    add(near, row, column, sums_out)


def carried(rows: np.ndarray) -> np.ndarray:
    """The same sums, shape (..., WIDTH), with digits below the first >= 0 and < 2^32."""
    out = np.array(rows, dtype=np.int64)
    for k in range(DIGITS - 1, 0, -1):
        out[..., k - 1] += out[..., k] >> 32
        out[..., k] &= LOW
    return out


def joined(rows: np.ndarray) -> np.ndarray:
    """One row of digits for all ``rows`` (rows, columns, WIDTH): shape (columns, WIDTH), digits below the first >= 0."""
    digits = carried(rows)  # each row by itself: whole numbers of several, near 2^62, would overflow
    total = carried(digits.sum(axis=0))
    about = digits[..., 0].astype(np.float64).sum(axis=0)
    total[np.abs(about) > FULL, NOT_FINITE] += 1
    return total


def rounded(rows: np.ndarray) -> np.ndarray:
    """What has been added up by all ``rows`` (rows, columns, WIDTH), float64, shape (columns,)."""
    total = joined(rows)
    negative = total[:, 0] < 0  # whose digits count up from below: turned into those of its size
    total[negative, :DIGITS] = carried(-total[negative])[:, :DIGITS]
    value = np.zeros(len(total))
    for k in range(DIGITS - 1, -1, -1):
        value = value / BASE + total[:, k]
    return np.where(total[:, NOT_FINITE] == 0, np.where(negative, -value, value), np.nan)
