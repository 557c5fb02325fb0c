"""A meeting point of the threads that share a CPU step.

Warp runs a CPU launch on one thread. warpdem gives each thread of a small pool one launch that runs many steps and meets
the others here between two phases: waking Python threads each phase would cost more than a phase of a small scene.
Warp's CPU atomics are plain reads and writes, hence the compiler's own. After a short spin a waiting thread yields, so that
a machine with fewer free cores than threads still advances.
"""

import ctypes
import os

import warp as wp

SPINS = 2000  # about ten microseconds


def yield_address() -> int:
    """Address of the C library's ``sched_yield``, 0 where there is none (the wait then spins)."""
    if os.name != "posix":
        return 0
    return ctypes.cast(ctypes.CDLL(None).sched_yield, ctypes.c_void_p).value or 0


@wp.func_native(
    f"""
#if !defined(__CUDA_ARCH__)
    __atomic_fetch_add(&counter.data[0], 1, __ATOMIC_ACQ_REL);
    wp::int32 spins = 0;
    while (__atomic_load_n(&counter.data[0], __ATOMIC_ACQUIRE) - target < 0) {{
        if (++spins > {SPINS} && yield_to != 0)
            reinterpret_cast<wp::int32 (*)()>(yield_to)();
    }}
#endif
"""
)
def meet(counter: wp.array(dtype=wp.int32), target: wp.int32, yield_to: wp.uint64):
    """Arrive, then wait until ``counter`` has reached ``target`` arrivals."""
    ...
