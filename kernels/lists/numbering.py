"""Numbering of contacts, force slots and wall slots: exclusive prefix sums of what each grain has.

Within a block of grains the contacts that touch fill whole contact batches first, then the others do: a batch holds one class,
and both classes of a block find its grains in the cache. Force slots and grains beside a wall are numbered straight through.
Three launches: sums of each block, starts of the blocks (one thread), starts of the grains. Own kernels, because the scan of a
library allocates memory, which a branch of a captured graph may not.

Arrays of size 0 stand for what is not asked for. Sums beyond what 32 bits count stay at their largest number, which no capacity
reaches.
"""

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS

wp.set_module_options(MODULE_OPTIONS)

BLOCK = 256  # grains whose contacts are sorted by class together
AT_ONCE = 8  # blocks that the one thread reads before it writes: it waits for memory once for all
# of a block: touching and near contacts, rounded up to full batches; force slots; grains beside a wall
Sums = wp.types.vector(4, wp.int32)
Chunk = wp.types.matrix((AT_ONCE, 4), wp.int32)


def starts(count: np.ndarray) -> np.ndarray:
    """Exclusive prefix sums of counts (n,) with the total at the end, on the host, shape (n + 1,), int32."""
    out = np.zeros(len(count) + 1, dtype=np.int32)
    np.cumsum(count, out=out[1:])
    return out


@wp.func
def capped(sum: wp.int32) -> wp.int32:
    """A sum of two numbers that are not negative, or the largest number where it wrapped around."""
    return 2147483647 if sum < 0 else sum


@wp.struct
class Counts:
    """How many each grain has; an array of size 0 stands for what is not asked for."""

    touching: wp.array[wp.int32]  # (n,) contacts that it owns and that touch
    near: wp.array[wp.int32]  # (n,) its other contacts
    slots: wp.array[wp.int32]  # (n,) force slots
    candidates: wp.array[wp.int32]  # (n,) wall features that it may reach


@wp.struct
class Starts:
    """Where those of each grain begin; arrays of size 0 where they are not needed."""

    touching: wp.array[wp.int32]  # (n,) number of its first contact that touches
    near: wp.array[wp.int32]  # (n,) number of its first other contact
    slot: wp.array[wp.int32]  # (n + 1,) its first force slot, and the end of the last
    wall_grain: wp.array[wp.int32]  # (n,) memory slots of the grains beside a wall


@wp.func
def block_sums(b: wp.int32, lanes: wp.int32, counts: Counts) -> Sums:
    """Sums of block ``b``."""
    total = Sums()
    for i in range(b * wp.static(BLOCK), wp.min((b + 1) * wp.static(BLOCK), counts.slots.shape[0])):
        if counts.touching.shape[0] > 0:
            total[0] = total[0] + counts.touching[i]
            total[1] = total[1] + counts.near[i]
        total[2] = total[2] + counts.slots[i]
        if counts.candidates.shape[0] > 0:
            if counts.candidates[i] > 0:
                total[3] = total[3] + 1
    total[0] = (total[0] + lanes - 1) // lanes * lanes
    total[1] = (total[1] + lanes - 1) // lanes * lanes
    return total


@wp.func
def joined(a: Sums, b: Sums) -> Sums:
    """Sum of two sums."""
    out = Sums()
    for c in range(4):
        out[c] = capped(a[c] + b[c])
    return out


@wp.func
def start_block(b: wp.int32, lanes: wp.int32, counts: Counts, at: Sums, starts_out: Starts):
    """Where each grain of block ``b`` begins, which grain each wall row belongs to; ``at``: sums of the blocks before."""
    begin = b * wp.static(BLOCK)
    n = counts.slots.shape[0]
    touch = at[0] + at[1]
    slot = at[2]
    wall = at[3]
    last = wp.min(begin + wp.static(BLOCK), n)
    other = wp.int32(0)
    if counts.touching.shape[0] > 0:
        for i in range(begin, last):
            other += counts.touching[i]
    other = touch + (other + lanes - 1) // lanes * lanes
    for i in range(begin, last):
        if counts.touching.shape[0] > 0:
            starts_out.touching[i] = touch
            starts_out.near[i] = other
            touch += counts.touching[i]
            other += counts.near[i]
        starts_out.slot[i] = slot
        slot += counts.slots[i]
        if counts.candidates.shape[0] > 0:
            if counts.candidates[i] > 0:
                starts_out.wall_grain[wall] = i
                wall += 1
    if last == n:
        starts_out.slot[n] = slot


@wp.kernel(enable_backward=False)
def sum_blocks(first: wp.int32, lanes: wp.int32, counts: Counts, sums_out: wp.array[Sums]):
    """Sums of each block, shape (blocks,)."""
    b = first + wp.tid()
    sums_out[b] = block_sums(b, lanes, counts)


@wp.kernel(enable_backward=False)
def start_blocks(
    # read and written: sums of each block, replaced by those before it
    sums_out: wp.array[Sums],
    # written: lanes of the contact batches, force slots and grains beside a wall in all
    total_out: wp.array[wp.int32],
):
    """Where each block begins."""
    running = Sums()
    blocks = sums_out.shape[0]
    here = Chunk()
    for first in range(0, blocks, wp.static(AT_ONCE)):
        for k in range(wp.static(AT_ONCE)):
            here[k] = sums_out[wp.min(first + k, blocks - 1)]
        for k in range(wp.static(AT_ONCE)):
            if first + k < blocks:
                sums_out[first + k] = running
                for c in range(4):
                    running[c] = capped(running[c] + here[k, c])
    total_out[0] = capped(running[0] + running[1])
    total_out[1] = running[2]
    total_out[2] = running[3]


@wp.kernel(enable_backward=False)
def start_grains(first: wp.int32, lanes: wp.int32, counts: Counts, starts: wp.array[Sums], starts_out: Starts):
    """Where each grain begins; ``starts``: sums of the blocks before each block, shape (blocks,)."""
    b = first + wp.tid()
    start_block(b, lanes, counts, starts[b], starts_out)
