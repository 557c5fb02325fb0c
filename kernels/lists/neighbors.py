"""The outer list: which grains may touch before it is built again.

The cutoff of a pair is the sum of the radii plus the gap over which the normal law acts (0 for most laws). Each grain has an
allowance, how far it may move from where it was when the list was built: the list holds the pairs that are closer than the
cutoff and both allowances. Per grain it is a row of partner slots in ascending order of partner id, ``count`` of them from
``start`` on. On a CPU the capacity of a row goes by the size of its grain, for a grain ten times as large as most touches
hundreds; a GPU counts first.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, clump, grain
from warpdem.kernels.lists.cells import SizeGrids, box_around, first_in, insert, line_of, next_in


@wp.struct
class NeighborRows:
    """The outer list: of each grain a row of partners in ascending order of id."""

    start: wp.array(dtype=wp.int32)  # (n + 1,) first entry of each row, end of the last; rows may have capacity to spare
    count: wp.array(dtype=wp.int32)  # (n,) partners of each grain
    slot: wp.array(dtype=wp.int32)  # (entries,) memory slot of the partner
    contact: wp.array(dtype=wp.int32)  # (entries,) number of the pair in the inner list or -1, in the row of the lower id
    allowance: wp.array(dtype=wp.float64)  # (n,) how far each grain may move while the list holds [m]


@functools.cache
def build(border, *, spins: bool, gap: float, clumps: bool = False, apart: bool = False, ranks: bool = False):
    """Return the kernels.

    Args:
        border: periodic images, of ``border.build``.
        spins: grains spin.
        gap: how far beyond contact the normal law acts [m].
        clumps: there are clumps; members of one are no neighbors.
        apart: some materials pass through each other.
        ranks: the grains from ``owned`` on belong to other processes, and pairs of two of them are not listed.
    """
    g = grain.build(spins)
    of_clumps = clump.build(clumps)
    Inverse = of_clumps.Inverse

    @wp.struct
    class ListedGrains:
        """What the lists are made of, in memory order; read only."""

        record: wp.array(dtype=g.Record)  # (n,)
        inverse: wp.array(dtype=Inverse)  # (n,) 1/m [1/kg] and 1/I [1/(kg m2)]
        material: wp.array(dtype=wp.int32)  # (n,) material index
        through: wp.array2d(dtype=wp.int32)  # 1 of two materials that pass through each other; of size 0 without any
        id: wp.array(dtype=wp.int64)  # (n,)
        clumps: of_clumps.Clumps  # of empty arrays without clumps
        owned: wp.int32  # grains of this process, which stand first

    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.func
    def sort_by_id(at: int, count: int, id: wp.array(dtype=wp.int64), slot_out: wp.array(dtype=wp.int32)):
        """Put the partners at ``at`` in order of id: Shell's sort, for a large grain has hundreds."""
        stride = int(1)
        while 9 * stride < count:
            stride = 3 * stride + 1
        while stride > 0:
            for e in range(at + stride, at + count):
                j = slot_out[e]
                s = int(e)
                while s - stride >= at and id[slot_out[s - stride]] > id[j]:
                    slot_out[s] = slot_out[s - stride]
                    s -= stride
                slot_out[s] = j
            stride = stride // 3

    @wp.func
    def without_repeats(at: int, count: int, slot_out: wp.array(dtype=wp.int32)) -> int:
        """Number of different partners at ``at``, in order and side by side: two images of one may be near in a thin domain."""
        n = int(0)
        for e in range(at, at + count):
            if n == 0 or slot_out[at + n - 1] != slot_out[e]:
                slot_out[at + n] = slot_out[e]
                n += 1
        return n

    @kernel
    def insert_grains(
        first: int, grids: SizeGrids, grains: wp.array(dtype=g.Record), allowance: wp.array(dtype=wp.float64)
    ):  # fmt: skip
        """Put the grains on the grids; on a CPU one thread does it."""
        i = first + wp.tid()
        insert(grids, i, g.position(grains[i]), grains[i][3] + allowance[i])

    @kernel
    def find_neighbors(
        first: int,
        grids: SizeGrids,
        grains: ListedGrains,
        allowance: wp.array(dtype=wp.float64),
        start: wp.array(dtype=wp.int32),  # of the room for each row; of size 0: they are only counted
        count_out: wp.array(dtype=wp.int32),
        slot_out: wp.array(dtype=wp.int32),
    ):
        """Partners of each grain; a count above its room says that the row did not fit."""
        i = first + wp.tid()
        me = grains.record[i]
        mine = allowance[i]
        at = int(0)
        room = int(0)
        if start.shape[0] > 0:
            at = start[i]
            room = start[i + 1] - at
        n = int(0)
        for image in range(wp.static(border.images)):
            place = border.image(g.position(me), image)
            for size in range(grids.largest.shape[0]):
                cutoff = me[3] + mine + grids.largest[size] + wp.float64(wp.static(gap))
                if border.within(place, cutoff):
                    low, box = box_around(grids, size, place, cutoff)
                    for z in range(box[2]):
                        for y in range(box[1]):
                            line = line_of(grids, size, low, y, z)
                            for x in range(box[0]):
                                j = first_in(grids, size, line, low, x)
                                while j >= 0:
                                    other = grains.record[j]
                                    there = g.position(other)
                                    separation = border.nearest(g.position(me) - there)
                                    touching = me[3] + other[3] + wp.float64(wp.static(gap))
                                    far = touching + (mine + allowance[j])  # so it is the same seen from j
                                    near = wp.dot(separation, separation) < far * far and j != i
                                    if wp.static(clumps):
                                        near = near and not of_clumps.same_clump(grains.clumps.of_grain, i, j)
                                    if wp.static(ranks):
                                        near = near and (i < grains.owned or j < grains.owned)
                                    if wp.static(apart):
                                        near = near and grains.through[grains.material[i], grains.material[j]] == 0
                                    if wp.static(border.images > 1):  # a cell may be seen from several images
                                        seen = place - there
                                        near = near and wp.dot(seen, seen) < wp.float64(1.01) * far * far
                                    if near:
                                        if n < room:
                                            slot_out[at + n] = j
                                        n += 1
                                    j = next_in(grids, j)
        sort_by_id(at, wp.min(n, room), grains.id, slot_out)
        if wp.static(border.images > 1):
            if n <= room:
                n = without_repeats(at, n, slot_out)
        count_out[i] = n

    @kernel
    def carry_contacts(
        first: int,
        id: wp.array(dtype=wp.int64),  # (n,)
        old_slot: wp.array(dtype=wp.int32),  # (n,) slot of each grain in the old list, -1 if it is new; of size 0: the same
        old_id: wp.array(dtype=wp.int64),  # ids by slot of the old list
        old: NeighborRows,
        rows_out: NeighborRows,  # read but for ``contact``
    ):
        """Contact number of each owned pair in the list that is being replaced, -1 if it had none."""
        i = first + wp.tid()
        o = int(i)
        if old_slot.shape[0] > 0:
            o = old_slot[i]
        f = int(0)
        end = int(0)
        if o >= 0:
            f = old.start[o]
            end = f + old.count[o]
        for e in range(rows_out.start[i], rows_out.start[i] + rows_out.count[i]):
            j = rows_out.slot[e]
            found = int(-1)
            if id[j] > id[i]:
                while f < end and old_id[old.slot[f]] < id[j]:
                    f += 1
                if f < end and old_id[old.slot[f]] == id[j]:
                    found = old.contact[f]
            rows_out.contact[e] = found

    return KernelSet(
        insert_grains=insert_grains, find_neighbors=find_neighbors, carry_contacts=carry_contacts, ListedGrains=ListedGrains
    )
