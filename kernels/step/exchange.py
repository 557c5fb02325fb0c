"""Where a step of a run over several processes (ranks) calls the host: ghosts get their new state, and all ranks agree.

A call of a Python function from a running kernel costs less than a microsecond; a launch per step would cost ten, and wake all
threads twice. Only thread 0 calls, while the others wait at the barrier.
"""

import warp as wp

TOO_DEEP = 4
"""What ranks agree on besides BEYOND and LEFT of ``motion``: an overlap exceeds the allowed one."""
FLAGS = slice(1, 4)
"""Of ``Report.moved``, where steps are launches: each of these bits as a number of its own, so that their largest over the
ranks says what was found on any."""
ARRIVED = -2
"""In place of a stage: wait for the ghosts of the last one, which are under way while the other contacts are evaluated."""
WALL_LOADS = -1
"""In place of a stage: the sums of the loads on walls that move by them are added up over the ranks, exactly."""


@wp.func_native(
    """
#if !defined(__CUDA_ARCH__)
    typedef wp::int32 (*Exchange)(wp::int32, wp::int32, wp::int32);
    return reinterpret_cast<Exchange>(address)(step, stage, found);
#else
    return found;
#endif
"""
)
def exchange(address: wp.uint64, step: wp.int32, stage: wp.int32, found: wp.int32) -> wp.int32:
    """Call the host; returns what was found on all ranks together, by bits.

    Args:
        address: of a C function of ``step``, ``stage`` and ``found`` that returns an int32.
        step: steps of this launch so far, this one included.
        stage: of the integrator; ghosts are sent after each, and after the last one ranks agree. Or ARRIVED, or WALL_LOADS.
        found: what was found on this rank, by bits.
    """
    ...
