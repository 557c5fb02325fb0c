"""The classical Runge-Kutta scheme: order 4 for smooth forces at four force calls; see ``kernels/step/runge_kutta.py``.

Takes over no term of the frame: all are added, with frame-relative velocities. Springs slip once, at the end of the step.
"""

import functools

from warpdem.kernels.step import runge_kutta

ORDER = 4
WEIGHS_JUMPS = False
STAGES = (0.0, 0.5, 0.5, 1.0)
WEIGHTS = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)
RELATIVE = True
STORE = 6


@functools.cache
def build(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    return runge_kutta.build(STAGES, WEIGHTS, spins=spins, moving_frame=moving_frame)
