"""Portions of the contact batches, which threads take one after the other: first of their own range, then of the others'.

Ranges of equally many batches are not equally much work: in some of them most pairs touch, in others hardly any, and a core
may be slower than another, or taken by other work for a while. A thread that is done with its own range goes on with what
others have left of theirs, in place of waiting for them at the barrier. Its own range it takes in order at each force call, so
that its contacts stay in the caches of its core. Which thread evaluates a contact changes no bit.
"""

import warp as wp

PORTIONS = 24
"""Portions of the range of a thread: the longest wait at the end is one of them."""
LEAST = 8
"""Contact batches of a portion, at least: with fewer, taking them costs more than waiting."""


@wp.func_native(
    """
#if !defined(__CUDA_ARCH__)
    return __atomic_fetch_add(&taken.data[at], count, __ATOMIC_RELAXED);
#else
    return 0;
#endif
"""
)
def take(taken: wp.array(dtype=wp.int32), at: wp.int32, count: wp.int32) -> wp.int32:
    """Add ``count`` to a number that other threads add to as well, and return what it was.

    Warp's CPU atomics are plain reads and writes, hence the compiler's own.
    """
    ...


@wp.func
def portion_of(batches: int, threads: int) -> int:
    """Contact batches that a thread takes at once of a range: all of it where it is alone."""
    if threads == 1:
        return batches
    return wp.max(wp.static(LEAST), (batches + wp.static(PORTIONS - 1)) // wp.static(PORTIONS))
