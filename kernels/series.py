r"""Logarithm and exponential made of arithmetic, for laws in the lanes of registers (``simd``).

A function of the C library is called lane by lane; these are not, and have the same bits in any lane. Powers of two are taken
out of a number and put into one by its bits (``power_of_two``, ``exponent``); what is left is near 1 or near 0:

    ln x = n ln 2 + 2 artanh z,     x = m 2^n,  sqrt(1/2) <= m < sqrt(2),     z = (m - 1)/(m + 1),  |z| <= 0.172
    e^x  = 2^n e^r,                 n = x/ln 2 to the nearest,                r = x - n ln 2,       |r| <= 0.347

with the series of artanh and of e^r, cut where their terms are below round-off. ln 2 is the sum of two numbers, the first of so
few digits that n times it is exact.
"""

import functools
import math
from typing import NamedTuple

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.simd.lane_types import LANE, MASK, NUMBER
from warpdem.kernels.simd.values import in_lanes


class Format(NamedTuple):
    """A number of IEEE 754, and how many terms the series take in it."""

    whole: str
    """Integer of its size."""
    digits: int
    """Of its fraction, in bits."""
    one: int
    """Bits of 1."""
    root: int
    """Bits of sqrt(1/2)."""
    shift: float
    """1.5 2^digits: a whole number added to it stands in its lowest bits."""
    ln2: tuple[float, float]
    """ln 2 in two parts, the first of few bits."""
    log_terms: int
    exp_terms: int


FORMATS = {
    wp.float64: Format(
        "long long", 52, 0x3FF0000000000000, 0x3FE6A09E667F3BCD, 1.5 * 2.0**52,
        (0.6931471803691238, 1.9082149292705877e-10), 11, 13,
    ),
    wp.float32: Format("int", 23, 0x3F800000, 0x3F3504F3, 1.5 * 2.0**23, (0.693115234375, 3.1946184945309415e-05), 6, 7),
}  # fmt: skip
LARGEST = 40.0  # |x| of the exponential: beyond it e^x stands still
POWER_OF_TWO = """
    typedef {number} number;
    typedef {whole} whole;
    union {{ number x; whole n; }} a;
    a.x = {name} + number({shift!r});
    a.n = (a.n << whole({digits})) + whole({one});
    return a.x;
"""
EXPONENT = """
    typedef {number} number;
    typedef {whole} whole;
    union {{ number x; whole n; }} a, b;
    b.x = number({shift!r});
    a.x = {name};
    a.n = ((a.n - whole({root})) >> whole({digits})) + b.n;
    return a.x - b.x;
"""


def by_bits(real, text: str, name: str) -> tuple[str, str]:
    """C++ of a function of the number ``name``: of a number, and of a register of them."""
    of = FORMATS[real]._asdict()
    types = (NUMBER[real], of.pop("whole"), name), (LANE[real], MASK[real], f"{name}_")
    scalar, lanes = (text.format(number=number, whole=whole, name=x, **of) for number, whole, x in types)
    return scalar, lanes


@functools.cache
def build(real):
    """Return ``log`` and ``exp`` of a number in ``real``, ``power_of_two`` and ``exponent``; for kernels, not for Python.

    In double: error of ln x below 4e-15 for x from 1e-12 to 1e12, relative error of e^x below 4e-16 for x from -40 to 40.
    """
    of = FORMATS[real]
    first, rest = of.ln2
    of_power, power_in_lanes = by_bits(real, POWER_OF_TWO, "n")
    of_exponent, exponent_in_lanes = by_bits(real, EXPONENT, "x")

    @wp.func_native(of_power)
    def power_of_two(n: real) -> real:
        """2^n for a whole number n that a number of its kind has as exponent."""
        ...

    @wp.func_native(of_exponent)
    def exponent(x: real) -> real:
        """The n of x = m 2^n with m from sqrt(1/2) to sqrt(2), x > 0."""
        ...

    in_lanes(power_of_two, real, power_in_lanes)
    in_lanes(exponent, real, exponent_in_lanes)

    @wp.func
    def log(x: real) -> real:
        """Natural logarithm of x > 0 [-]."""
        n = exponent(x)
        m = x * power_of_two(-n)
        z = (m - real(1.0)) / (m + real(1.0))
        square = z * z
        total = real(wp.static(1.0 / (2 * of.log_terms - 1)))
        for k in range(1, wp.static(of.log_terms)):
            total = total * square + real(wp.static(1.0)) / real(wp.static(2 * of.log_terms - 1) - 2 * k)
        return n * real(wp.static(first)) + (n * real(wp.static(rest)) + real(2.0) * z * total)

    @wp.func
    def exp(x: real) -> real:
        """Exponential of x [-], x cut to +-LARGEST."""
        low = x if x > real(wp.static(-LARGEST)) else real(wp.static(-LARGEST))
        cut = low if low < real(wp.static(LARGEST)) else real(wp.static(LARGEST))
        n = (cut * real(wp.static(1.0 / math.log(2.0))) + real(wp.static(of.shift))) - real(wp.static(of.shift))
        r = (cut - n * real(wp.static(first))) - n * real(wp.static(rest))
        total = real(1.0)
        for k in range(wp.static(of.exp_terms)):
            total = total * (r * (real(wp.static(1.0)) / real(wp.static(of.exp_terms) - k))) + real(1.0)
        return total * power_of_two(n)

    return KernelSet(log=log, exp=exp, power_of_two=power_of_two, exponent=exponent)
