"""A meeting point of the threads that share a CPU step.

Warp runs a CPU launch on one thread. warpdem gives each thread of a small pool one launch that runs many steps and meets
the others here between two phases: waking Python threads each phase would cost more than a phase of a small scene.
Warp's CPU atomics are plain reads and writes, hence the compiler's own.

A waiting thread spins, then yields its core, and then sleeps until the last one to arrive wakes it (a futex). Where cores are
free it hardly ever comes to that. Where they are not, threads that only yield wait for the time slices of all other work of
the machine, twice per step; one that sleeps leaves its core to the others, and is run at once when it is woken.
"""

import ctypes
import os

import numpy as np
import warp as wp

SPINS = 2000  # about ten microseconds
YIELDS = 200  # about a hundred microseconds where no other process wants the core
LONG_YIELD = 20_000  # [ns] one that takes longer gave the core to somebody else
SLEEPERS = 16  # place of the number of sleeping threads in the array: not in the cache line of the arrivals
LENGTH = SLEEPERS + 1  # numbers in the array
FUTEX = {"x86_64": 202, "aarch64": 98}  # number of the system call
_WAIT, _WAKE, _ALL = 128, 129, 0x7FFFFFFF  # of threads of one process


def wait_modes() -> np.ndarray:
    """How a thread may wait, shape (4,): addresses of ``sched_yield``, ``clock_gettime`` and ``syscall``, number of futex.

    0 for what is not there: a thread that cannot sleep yields on, and spins if it cannot yield either.
    """
    modes = np.zeros(4, dtype=np.uint64)
    if os.name != "posix":
        return modes
    library = ctypes.CDLL(None)
    modes[0] = ctypes.cast(library.sched_yield, ctypes.c_void_p).value or 0
    system = os.uname()
    if system.sysname == "Linux" and system.machine in FUTEX and ctypes.sizeof(ctypes.c_void_p) == 8:
        modes[1:3] = [ctypes.cast(call, ctypes.c_void_p).value or 0 for call in (library.clock_gettime, library.syscall)]
        modes[3] = FUTEX[system.machine]
    return modes


@wp.func_native(
    f"""
#if !defined(__CUDA_ARCH__)
    typedef wp::int32 (*Yield)();
    typedef wp::int32 (*Clock)(wp::int32, long long*);
    typedef long long (*System)(long long, wp::int32*, long long, long long, void*, void*, long long);
    Yield yield = reinterpret_cast<Yield>(modes.data[0]);
    Clock clock = reinterpret_cast<Clock>(modes.data[1]);
    System system = reinterpret_cast<System>(modes.data[2]);
    wp::int32* arrived = &counter.data[0];
    wp::int32* sleepers = &counter.data[{SLEEPERS}];
    if (__atomic_add_fetch(arrived, 1, __ATOMIC_SEQ_CST) - target >= 0) {{
        if (__atomic_load_n(sleepers, __ATOMIC_SEQ_CST) > 0)
            system(modes.data[3], arrived, {_WAKE}, {_ALL}, nullptr, nullptr, 0);
    }} else {{
        for (wp::int32 n = 0; n < {SPINS} && __atomic_load_n(arrived, __ATOMIC_ACQUIRE) - target < 0; ++n) {{}}
        if (yield != nullptr) {{
            long long now[2] = {{0, 0}};
            if (clock != nullptr)
                clock(1, now);
            for (wp::int32 n = 0; __atomic_load_n(arrived, __ATOMIC_ACQUIRE) - target < 0; ++n) {{
                if (n == {YIELDS} && system != nullptr)
                    break;
                yield();
                if (clock != nullptr) {{
                    long long before = 1000000000 * now[0] + now[1];
                    clock(1, now);
                    if (1000000000 * now[0] + now[1] - before > {LONG_YIELD})
                        n = {YIELDS} - 1;
                }}
            }}
        }}
        if (system != nullptr && __atomic_load_n(arrived, __ATOMIC_ACQUIRE) - target < 0) {{
            __atomic_add_fetch(sleepers, 1, __ATOMIC_SEQ_CST);
            wp::int32 seen = __atomic_load_n(arrived, __ATOMIC_SEQ_CST);
            while (seen - target < 0) {{
                system(modes.data[3], arrived, {_WAIT}, seen, nullptr, nullptr, 0);
                seen = __atomic_load_n(arrived, __ATOMIC_SEQ_CST);
            }}
            __atomic_sub_fetch(sleepers, 1, __ATOMIC_SEQ_CST);
        }}
        while (__atomic_load_n(arrived, __ATOMIC_ACQUIRE) - target < 0) {{}}
    }}
#endif
"""
)
def arrive_and_wait(counter: wp.array(dtype=wp.int32), target: wp.int32, modes: wp.array(dtype=wp.uint64)):
    """Arrive, then wait until ``counter`` has reached ``target`` arrivals.

    Args:
        counter: arrivals, and at `SLEEPERS` the threads that sleep, shape (`LENGTH`,); zero before the first meeting.
        target: arrivals that open the barrier.
        modes: as ``wait_modes``.
    """
    ...
