"""Explicit Euler: q^(k+1) = q^k + dt v^k, v^(k+1) = v^k + dt a(q^k, v^k). Order 1; for comparison.

It is the Runge-Kutta scheme of one stage (``step/runge_kutta.py``). Takes over no term of the frame: all are added, with
frame-relative velocities.
"""

import functools

from warpdem.kernels.step import runge_kutta

ORDER = 1
STAGES = (0.0,)
WEIGHTS = (1.0,)
RELATIVE = True
STORE = 6


@functools.cache
def build(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    return runge_kutta.build(STAGES, WEIGHTS, spins=spins, moving_frame=moving_frame)
