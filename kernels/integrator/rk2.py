"""Heun's Runge-Kutta scheme: order 2 at two force calls; see ``kernels/step/runge_kutta.py``.

Takes over no term of the frame: all are added, with frame-relative velocities. Springs slip once, at the end of the step.
"""

import functools

from warpdem.kernels.step import runge_kutta

ORDER = 2
STAGES = (0.0, 1.0)
WEIGHTS = (0.5, 0.5)
RELATIVE = True
STORE = 6


@functools.cache
def build(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    return runge_kutta.build(STAGES, WEIGHTS, spins=spins, moving_frame=moving_frame)
