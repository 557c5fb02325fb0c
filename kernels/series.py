r"""Logarithm and exponential made of arithmetic and square roots, for laws in the lanes of registers (``simd``).

A function of the C library is called lane by lane; these are not, and have the same bits in any lane.

    ln x = 64 ln y = 128 artanh z,      y = x^(1/64) by six square roots,   z = (y - 1)/(y + 1)
    e^|x| = 1 + p,   p <- p (2 + p) eight times from p = e^r - 1,           r = |x|/256;   e^-|x| is its inverse
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet

ROOTS, SQUARINGS = 6, 8
LOG_TERMS, EXP_TERMS = 13, 10
LARGEST = 40.0  # |x| of the exponential: beyond it e^x stands still


@functools.cache
def build(real):
    """Return ``log`` and ``exp`` of a number in ``real``.

    In double: error of ln x below 2e-14 for x from 1e-12 to 1e12, relative error of e^x below 3e-14 for x from -40 to 40.
    """

    @wp.func
    def log(x: real) -> real:
        """Natural logarithm of x [-], x from 1e-12 to 1e12."""
        y = x
        for _k in range(wp.static(ROOTS)):
            y = wp.sqrt(y)
        z = (y - real(1.0)) / (y + real(1.0))
        square = z * z
        total = real(wp.static(1.0 / (2 * LOG_TERMS - 1)))
        for n in range(1, wp.static(LOG_TERMS)):
            total = total * square + real(wp.static(1.0)) / real(wp.static(2 * LOG_TERMS - 1) - 2 * n)
        return total * z * real(wp.static(2.0 * 2.0**ROOTS))

    @wp.func
    def exp(x: real) -> real:
        """Exponential of x [-], x cut to +-LARGEST."""
        size = wp.abs(x)
        size = size if size < real(wp.static(LARGEST)) else real(wp.static(LARGEST))
        r = size * real(wp.static(1.0 / 2.0**SQUARINGS))
        p = r * real(wp.static(1.0 / EXP_TERMS))
        for n in range(1, wp.static(EXP_TERMS)):
            p = (p + real(1.0)) * r * (real(1.0) / real(wp.static(EXP_TERMS) - n))
        for _k in range(wp.static(SQUARINGS)):
            p = p * (p + real(2.0))
        whole = p + real(1.0)
        return whole if x > real(0.0) else real(1.0) / whole

    return KernelSet(log=log, exp=exp)
