"""The outer list: which grains may touch before it is built again.

The cutoff of a pair is the sum of the radii plus the gap over which the normal law acts (0 for most laws). Each grain has an
allowance, how far it may move from where it was when the list was built: the list holds the pairs that are closer than the
cutoff and both allowances. Per grain it is a row of partner slots in ascending order of partner id, ``count`` of them from
``start`` on. On a CPU the capacity of a row goes by the size of its grain, for a grain ten times as large as most touches
hundreds; a GPU counts first. A GPU thread goes through its candidates one by one; a CPU core tests several at a time
(``near_runs``), by the same rule ``near``.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, clump, grain
from warpdem.kernels.lists import cells, near_runs
from warpdem.kernels.lists.cells import SizeGrids


@wp.struct
class NeighborRows:
    """The outer list: of each grain a row of partners in ascending order of id."""

    start: wp.array(dtype=wp.int32)  # (n + 1,) first entry of each row, end of the last; rows may have capacity to spare
    count: wp.array(dtype=wp.int32)  # (n,) partners of each grain
    slot: wp.array(dtype=wp.int32)  # (entries,) memory slot of the partner
    contact: wp.array(dtype=wp.int32)  # (entries,) number of the pair in the inner list or -1, in the row of the lower id
    allowance: wp.array(dtype=wp.float64)  # (n,) how far each grain may move while the list holds [m]


@functools.cache
def build(
    border, *, spins: bool, gap: float, clumps: bool = False, apart: bool = False, ranks: bool = False,
    side_by_side: bool = False,
):  # fmt: skip
    """Return the kernels.

    Args:
        border: periodic images, of ``border.build``.
        spins: grains spin.
        gap: how far beyond contact the normal law acts [m].
        clumps: there are clumps; members of one are no neighbors.
        apart: some materials pass through each other.
        ranks: the grains from ``owned`` on belong to other processes, and pairs of two of them are not listed.
        side_by_side: candidates are tested several at a time, on a CPU; ``SizeGrids.copies`` is needed.
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

    @wp.func
    def near(
        place: wp.vec3d, home: wp.vec3d, radius: wp.float64, allowance: wp.float64, there: wp.vec3d, other: wp.float64,
        allowed: wp.float64,
    ) -> wp.float64:  # fmt: skip
        """1 where two grains may touch while the list holds, else 0.

        Args:
            place, home: image that the second is looked for from, and position of the first [m].
            radius, allowance: of the first [m].
            there, other, allowed: position, radius and allowance of the second [m].
        """
        separation = border.nearest(home - there)
        touching = radius + other + wp.float64(wp.static(gap))
        far = touching + (allowance + allowed)  # so it is the same seen from the other
        within = wp.dot(separation, separation) < far * far
        if wp.static(border.images > 1):  # a cell may be seen from several images
            seen = place - there
            within = within and wp.dot(seen, seen) < wp.float64(1.01) * far * far
        return wp.float64(1.0) if within else wp.float64(0.0)

    @wp.func
    def partners(grains: ListedGrains, i: int, j: int) -> bool:
        """Whether two grains that are near are listed."""
        may = j != i
        if wp.static(clumps):
            may = may and not of_clumps.same_clump(grains.clumps.of_grain, i, j)
        if wp.static(ranks):
            may = may and (i < grains.owned or j < grains.owned)
        if wp.static(apart):
            may = may and grains.through[grains.material[i], grains.material[j]] == 0
        return may

    @wp.func
    def add(i: int, j: int, grains: ListedGrains, at: int, room: int, n: int, slot_out: wp.array(dtype=wp.int32)) -> int:
        """Add a grain that is near to the row at ``at``, behind the ``n`` in it, if they are partners; return how many are."""
        many = int(n)
        if partners(grains, i, j):
            if many < room:
                slot_out[at + many] = j
            many += 1
        return many

    by_lanes = near_runs.build(near) if side_by_side else None
    Found = near_runs.Found if side_by_side else wp.types.vector(1, wp.int32)

    @kernel
    def count_in_cells(
        first: int, grids: SizeGrids, grains: wp.array(dtype=g.Record), allowance: wp.array(dtype=wp.float64)
    ):  # fmt: skip
        """Count the grains in their cells; on a CPU one thread does it."""
        i = first + wp.tid()
        cells.count(grids, i, g.position(grains[i]), grains[i][3] + allowance[i])

    @kernel
    def sort_by_cell(
        first: int, grids: SizeGrids, grains: wp.array(dtype=g.Record), allowance: wp.array(dtype=wp.float64)
    ):  # fmt: skip
        """Put the grains in their places among the sorted ones; on a CPU one thread does it."""
        i = first + wp.tid()
        e = cells.put(grids, i)
        if wp.static(side_by_side):
            for c in range(4):
                grids.copies[c, e] = grains[i][c]
            grids.copies[4, e] = allowance[i]

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
        found = Found()  # near, and not in the row yet; not needed one by one
        kept = int(0)  # how many
        for image in range(wp.static(border.images)):
            place = border.image(g.position(me), image)
            for size in range(grids.largest.shape[0]):
                cutoff = me[3] + mine + grids.largest[size] + wp.float64(wp.static(gap))
                if cells.count_of(grids, size) > 0 and border.within(place, cutoff):
                    low, box = cells.box_around(grids, size, place, cutoff)
                    runs = cells.runs_of(grids, size, low, box)
                    for z in range(box[2]):
                        for y in range(box[1]):
                            line = cells.line_of(grids, size, low, y, z)
                            for part in range(runs):
                                begin, end = cells.run(grids, size, line, low, box, part)
                                e = int(begin)
                                while e < end:
                                    if wp.static(side_by_side):
                                        e = by_lanes.collect(e, end, place, me[3], mine, g.position(me), grids, found, kept)
                                        if kept > wp.static(near_runs.ROOM):
                                            for k in range(kept):
                                                n = add(i, found[k], grains, at, room, n, slot_out)
                                            kept = 0
                                    else:
                                        j = grids.grain[e]
                                        other = grains.record[j]
                                        there = g.position(other)
                                        is_near = near(place, g.position(me), me[3], mine, there, other[3], allowance[j])
                                        if is_near != wp.float64(0.0):
                                            n = add(i, j, grains, at, room, n, slot_out)
                                        e += 1
        if wp.static(side_by_side):
            if n == 0:  # all partners are among those found, as of most grains
                for k in range(kept):
                    j = found[k]
                    found[n] = j
                    n += 1 if partners(grains, i, j) else 0
                if n <= room:
                    by_lanes.write(found, n, grains.id, at, slot_out)
            else:
                for k in range(kept):
                    n = add(i, found[k], grains, at, room, n, slot_out)
                sort_by_id(at, wp.min(n, room), grains.id, slot_out)
        else:
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
        count_in_cells=count_in_cells, sort_by_cell=sort_by_cell, find_neighbors=find_neighbors,
        carry_contacts=carry_contacts, ListedGrains=ListedGrains,
    )
