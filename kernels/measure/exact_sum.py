r"""Sums of float64 numbers without rounding: their bits depend neither on the order of the numbers nor on who adds which.

    x = +-m 2^(e - 1074),  m < 2^53 whole       sum = sum_k D_k 2^(32 k - 1074)

A sum is a row of whole numbers D_k (int64), one for each 32 binary digits from the least float64 to the largest. A number adds
to three of them. Whole numbers add up exactly, so any number of rows may be added to side by side, one per thread, and then to
each other: 2^30 numbers in all before one could overflow. ``rounded`` rounds once, at the end, to the nearest float64, as
``math.fsum`` does. A number that is infinite or no number is counted, and its sum is no number.

The method is that of a long accumulator: Kulisch 1971; Collange, Defour, Graillat and Iakymchuk 2015,
doi 10.1016/j.parco.2015.09.001.
"""

import warp as wp

DIGITS = 67
"""32-bit digits: 2098 bits of float64, and some for the carry."""
NOT_FINITE = DIGITS
"""Where the numbers that are not finite are counted."""
WIDTH = 72
"""Numbers of a row: whole cache lines, so that threads do not disturb each other."""
LOW = 0xFFFFFFFF


@wp.func
def add(value: wp.float64, row: int, column: int, sums_out: wp.array3d(dtype=wp.int64)):
    """Add a number to a column of a row; on a CPU no other thread may add to that row."""
    bits = wp.cast(value, wp.int64)
    exponent = int((bits >> wp.int64(52)) & wp.int64(0x7FF))
    mantissa = bits & wp.int64(0xFFFFFFFFFFFFF)
    if exponent == 0x7FF:
        wp.atomic_add(sums_out, row, column, wp.static(NOT_FINITE), wp.int64(1))
    elif (exponent | int(mantissa != wp.int64(0))) != 0:
        if exponent > 0:
            mantissa = mantissa | wp.int64(0x10000000000000)
            exponent = exponent - 1
        digit = exponent >> 5
        shift = wp.int64(exponent & 31)
        low = (mantissa & wp.int64(wp.static(LOW))) << shift
        high = (mantissa >> wp.int64(32)) << shift
        first = low & wp.int64(wp.static(LOW))
        second = (low >> wp.int64(32)) + (high & wp.int64(wp.static(LOW)))
        third = high >> wp.int64(32)
        if bits < wp.int64(0):
            first = -first
            second = -second
            third = -third
        wp.atomic_add(sums_out, row, column, digit, first)
        wp.atomic_add(sums_out, row, column, digit + 1, second)
        wp.atomic_add(sums_out, row, column, digit + 2, third)


@wp.func
def power_of_two(exponent: int) -> wp.float64:
    """2^exponent, of a normal number."""
    return wp.cast(wp.int64(exponent + 1023) << wp.int64(52), wp.float64)


@wp.func
def scaled(x: wp.float64, exponent: int) -> wp.float64:
    """X 2^exponent, of an exponent below the range of one factor too."""
    first = wp.max(exponent, -1000)
    return x * power_of_two(first) * power_of_two(wp.max(exponent - first, -1000))


@wp.func
def rounded(rows: int, column: int, sums: wp.array3d(dtype=wp.int64)) -> wp.float64:
    """Sum of a column over all rows, rounded to the nearest float64, to even in the middle; the first row is used up."""
    strange = wp.int64(0)
    carry = wp.int64(0)
    for k in range(wp.static(DIGITS)):
        total = carry
        for r in range(rows):
            total += sums[r, column, k]
        digit = total & wp.int64(wp.static(LOW))
        carry = (total - digit) >> wp.int64(32)
        sums[0, column, k] = digit
    for r in range(rows):
        strange += sums[r, column, wp.static(NOT_FINITE)]
    sign = wp.float64(1.0)
    if carry < wp.int64(0):  # digits of a negative number count up from below: turn them into those of its size
        sign = wp.float64(-1.0)
        borrow = wp.int64(1)
        for k in range(wp.static(DIGITS)):
            digit = (sums[0, column, k] ^ wp.int64(wp.static(LOW))) + borrow
            borrow = digit >> wp.int64(32)
            sums[0, column, k] = digit & wp.int64(wp.static(LOW))
    top = int(-1)
    for k in range(wp.static(DIGITS)):
        if sums[0, column, k] != wp.int64(0):
            top = k
    value = wp.float64(0.0)
    if top >= 0:
        # 64 bits from the leading one on; the last stands for all that follow
        window = wp.uint64(sums[0, column, top]) << wp.uint64(32)
        if top > 0:
            window = window | wp.uint64(sums[0, column, top - 1])
        shift = int(0)
        while (window >> wp.uint64(63)) == wp.uint64(0):
            window = window << wp.uint64(1)
            shift += 1
        rest = wp.uint64(0)
        if top > 1:
            next = wp.uint64(sums[0, column, top - 2])
            if shift > 0:
                window = window | (next >> wp.uint64(32 - shift))
            rest = (next << wp.uint64(shift)) & wp.uint64(wp.static(LOW))
            for k in range(top - 2):
                rest = rest | wp.uint64(sums[0, column, k])
        if rest != wp.uint64(0):
            window = window | wp.uint64(1)
        value = sign * scaled(wp.float64(window), 32 * (top - 1) - shift - 1074)
    if strange > wp.int64(0):
        value = wp.float64(wp.nan)
    return value
