"""Which grains may touch: the outer list (cutoff + skin, rarely rebuilt) and the inner list (a thin skin, rebuilt often).

The cutoff of a pair is the sum of the radii plus the gap over which the normal law acts (0 for most laws).
Outer list: per grain a row of partner slots in ascending order of partner id, ``count`` of them from ``start`` on. On a CPU the
capacity of a row goes by the size of its grain, for a grain ten times as large as most touches hundreds; a GPU counts first.
Inner list: the pairs of it closer than the inner skin, numbered by the slot of their owner (the grain of the lower id) and then
by partner id, and laid out in batches of ``lanes``: first those that touch now, then the others, so that the force loop finds
whole batches that it can pass over. A thin second list keeps the branch "touching or not" out of the force loop and the force
slots of a grain few; building it costs a tenth of an outer list. Neither changes a bit of the result: pairs are evaluated lower
id first and summed in order of partner id.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.lists.cells import SizeGrids, box_around, first_in, insert, line_of, next_in
from warpdem.kernels.lists.path import Flight, in_flight


@functools.cache
def build(
    real, law, border, lanes: int, *, spins: bool, stored: Columns, history: int, table: bool, inertia_factor: float,
    gap: float, keep_constants: bool,
):  # fmt: skip
    """Return the list kernels; arguments as in ``pairs.build`` and ``wall.contact.build``.

    ``law`` of ``law.build`` in float64, ``history``: numbers of the contact history; the constants of contacts are stored with
    them where ``keep_constants``, else computed when they are read.
    """
    g = grain.build(spins)
    Coefficients = law.Coefficients
    Inverse = wp.types.vector(2, wp.float64)
    law_constants_width, rolling = law.Constants._length_, "inertia" in stored
    radius_at, inertia_at = (stored.radius, stored.inertia) if rolling else (0, 0)
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
    def place_of(
        wanted: wp.int64, start: int, count: int, id: wp.array(dtype=wp.int64), slot: wp.array(dtype=wp.int32)
    ) -> int:  # fmt: skip
        """Place of the partner of that id in the row at ``start``, where it is."""
        low = int(start)
        high = start + count - 1
        while low < high:
            middle = (low + high) // 2
            if id[slot[middle]] < wanted:
                low = middle + 1
            else:
                high = middle
        return low

    @kernel
    def insert_grains(first: int, grids: SizeGrids, grains: wp.array(dtype=g.Record)):
        """Put the grains on the grids; on a CPU one thread does it."""
        i = first + wp.tid()
        insert(grids, i, g.position(grains[i]), grains[i][3])

    @kernel
    def find_neighbors(
        first: int,
        grids: SizeGrids,
        grains: wp.array(dtype=g.Record),
        id: wp.array(dtype=wp.int64),
        skin: wp.float64,
        start: wp.array(dtype=wp.int32),  # of the room for each row; of size 0: they are only counted
        count_out: wp.array(dtype=wp.int32),
        slot_out: wp.array(dtype=wp.int32),
    ):
        """Partners of each grain; a count above its room says that the row did not fit."""
        i = first + wp.tid()
        me = grains[i]
        at = int(0)
        room = int(0)
        if start.shape[0] > 0:
            at = start[i]
            room = start[i + 1] - at
        n = int(0)
        for image in range(wp.static(border.images)):
            place = border.image(g.position(me), image)
            for size in range(grids.largest.shape[0]):
                cutoff = me[3] + grids.largest[size] + wp.float64(wp.static(gap)) + skin
                if border.within(place, cutoff):
                    low, box = box_around(grids, size, place, cutoff)
                    for z in range(box[2]):
                        for y in range(box[1]):
                            line = line_of(grids, size, low, y, z)
                            for x in range(box[0]):
                                j = first_in(grids, size, line, low, x)
                                while j >= 0:
                                    other = grains[j]
                                    there = g.position(other)
                                    way = border.nearest(g.position(me) - there)
                                    far = me[3] + other[3] + wp.float64(wp.static(gap)) + skin  # so it is the same seen from j
                                    near = wp.dot(way, way) < far * far and j != i
                                    if wp.static(border.images > 1):  # a cell may be seen from several images
                                        seen = place - there
                                        near = near and wp.dot(seen, seen) < wp.float64(1.01) * far * far
                                    if near:
                                        if n < room:
                                            slot_out[at + n] = j
                                        n += 1
                                    j = next_in(grids, j)
        count_out[i] = n
        sort_by_id(at, wp.min(n, room), id, slot_out)

    @kernel
    def carry_contacts(
        first: int,
        id: wp.array(dtype=wp.int64),
        start: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        old_slot: wp.array(dtype=wp.int32),  # slot of this grain in the old list, -1 if it is new; of size 0: the same
        old_id: wp.array(dtype=wp.int64),
        old_start: wp.array(dtype=wp.int32),
        old_count: wp.array(dtype=wp.int32),
        old_partner: wp.array(dtype=wp.int32),
        old_contact: wp.array(dtype=wp.int32),
        contact_out: wp.array(dtype=wp.int32),
    ):
        """Contact number of each owned pair in the list that is being replaced, -1 if it had none."""
        i = first + wp.tid()
        o = int(i)
        if old_slot.shape[0] > 0:
            o = old_slot[i]
        f = int(0)
        end = int(0)
        if o >= 0:
            f = old_start[o]
            end = f + old_count[o]
        for e in range(start[i], start[i] + count[i]):
            j = slot[e]
            found = int(-1)
            if id[j] > id[i]:
                while f < end and old_id[old_partner[f]] < id[j]:
                    f += 1
                if f < end and old_id[old_partner[f]] == id[j]:
                    found = old_contact[f]
            contact_out[e] = found

    @kernel
    def select_contacts(
        first: int,
        grains: wp.array(dtype=g.Record),
        id: wp.array(dtype=wp.int64),
        start: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        inner_skin: wp.float64,
        flight: wp.array(dtype=Flight),
        listed_out: wp.array(dtype=wp.int32),
        touching_count_out: wp.array(dtype=wp.int32),
        near_count_out: wp.array(dtype=wp.int32),
        listed_count_out: wp.array(dtype=wp.int32),
    ):
        """Which pairs are closer than the inner skin, or in flight; both grains decide alike, bit for bit.

        ``listed_out`` holds -1 for the others, else twice the number of listed ones before it in the row, plus 1 if they touch.
        """
        i = first + wp.tid()
        me = grains[i]
        touching = int(0)
        near = int(0)
        listed = int(0)
        flying = in_flight(flight, i)
        for e in range(start[i], start[i] + count[i]):
            j = slot[e]
            other = grains[j]
            way = border.nearest(g.position(me) - g.position(other))
            square = wp.dot(way, way)
            cutoff = me[3] + other[3] + wp.float64(wp.static(gap))
            far = cutoff + inner_skin
            entry = int(-1)
            if square < far * far or flying or in_flight(flight, j):
                entry = 2 * listed
                listed += 1
                if square < cutoff * cutoff:
                    entry += 1
                if id[j] > id[i]:
                    if entry & 1:
                        touching += 1
                    else:
                        near += 1
            listed_out[e] = entry
        touching_count_out[i] = touching
        near_count_out[i] = near
        listed_count_out[i] = listed

    @wp.func
    def put_constants(
        p: int, k: int, i: int, j: int, grains: wp.array(dtype=g.Record), inverse: wp.array(dtype=Inverse),
        kind: wp.array2d(dtype=wp.int32), coefficients: wp.array(dtype=Coefficients), constants_out: wp.array3d(dtype=real),
    ):  # fmt: skip
        """What does not change of the contact of grains ``i`` and ``j`` in lane ``k`` of contact batch ``p``."""
        c = coefficients[0]
        if wp.static(table):
            c = coefficients[kind[p, k]]
        radius = grains[i][3] * grains[j][3] / (grains[i][3] + grains[j][3])
        numbers = law.constants(c, radius, wp.float64(1.0) / (inverse[i][0] + inverse[j][0]))
        for f in range(wp.static(law_constants_width)):
            constants_out[p, f, k] = real(numbers[f])
        if wp.static(rolling):
            constants_out[p, wp.static(radius_at), k] = real(radius)
            constants_out[p, wp.static(inertia_at), k] = real(
                wp.float64(wp.static(inertia_factor)) / (inverse[i][1] + inverse[j][1])
            )

    @kernel
    def clear_contacts(
        first: int,
        partner: int,  # a grain that is not grain 0, if there is one
        unused_slot: int,  # force slot that belongs to no grain
        # per lane, written
        owner_out: wp.array2d(dtype=wp.int32),
        partner_out: wp.array2d(dtype=wp.int32),
        kind_out: wp.array2d(dtype=wp.int32),
        constants_out: wp.array3d(dtype=real),
        slot_i_out: wp.array2d(dtype=wp.int32),
        slot_j_out: wp.array2d(dtype=wp.int32),
    ):
        """Batches of no contact: what fills the last one of a class is a pair of grains with no stiffness."""
        p = first + wp.tid()
        for k in range(wp.static(lanes)):
            owner_out[p, k] = 0
            partner_out[p, k] = partner
            slot_i_out[p, k] = unused_slot
            slot_j_out[p, k] = unused_slot
            if wp.static(table):
                kind_out[p, k] = 0
            if wp.static(keep_constants):
                for f in range(wp.static(stored.width)):
                    constants_out[p, f, k] = real(0.0)

    @kernel
    def fill_contacts(
        first: int,
        grains: wp.array(dtype=g.Record),
        inverse: wp.array(dtype=Inverse),
        kind: wp.array(dtype=wp.int32),
        materials: int,
        coefficients: wp.array(dtype=Coefficients),
        id: wp.array(dtype=wp.int64),
        start: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        listed: wp.array(dtype=wp.int32),
        touching_start: wp.array(dtype=wp.int32),
        near_start: wp.array(dtype=wp.int32),
        row_start: wp.array(dtype=wp.int32),
        old_memory: wp.array3d(dtype=real),
        contact_out: wp.array(dtype=wp.int32),
        owner_out: wp.array2d(dtype=wp.int32),
        partner_out: wp.array2d(dtype=wp.int32),
        kind_out: wp.array2d(dtype=wp.int32),
        constants_out: wp.array3d(dtype=real),
        slot_i_out: wp.array2d(dtype=wp.int32),
        slot_j_out: wp.array2d(dtype=wp.int32),
        memory_out: wp.array3d(dtype=real),
    ):
        """Write the contacts that grain ``i`` owns into their contact batches, with the force slots of both grains."""
        i = first + wp.tid()
        touching = touching_start[i]
        near = near_start[i]
        for e in range(start[i], start[i] + count[i]):
            j = slot[e]
            if id[j] > id[i]:
                old = contact_out[e]
                contact_out[e] = -1
                if listed[e] >= 0:
                    at = int(0)
                    if listed[e] & 1:
                        at = touching
                        touching += 1
                    else:
                        at = near
                        near += 1
                    contact_out[e] = at
                    p = at // wp.static(lanes)
                    k = at % wp.static(lanes)
                    owner_out[p, k] = i
                    partner_out[p, k] = j
                    slot_i_out[p, k] = row_start[i] + listed[e] // 2
                    slot_j_out[p, k] = row_start[j] + listed[place_of(id[i], start[j], count[j], id, slot)] // 2
                    if wp.static(table):
                        kind_out[p, k] = kind[i] * materials + kind[j]
                    if wp.static(keep_constants):
                        put_constants(p, k, i, j, grains, inverse, kind_out, coefficients, constants_out)
                    if wp.static(history > 0):
                        for f in range(wp.static(history)):
                            value = real(0.0)
                            if old >= 0:
                                value = old_memory[old // wp.static(lanes), f, old % wp.static(lanes)]
                            memory_out[p, f, k] = value

    @kernel
    def contact_constants(
        grains: wp.array(dtype=g.Record),
        inverse: wp.array(dtype=Inverse),
        coefficients: wp.array(dtype=Coefficients),
        owner: wp.array2d(dtype=wp.int32),
        partner: wp.array2d(dtype=wp.int32),
        kind: wp.array2d(dtype=wp.int32),
        constants_out: wp.array3d(dtype=real),
    ):
        """The constants of all lanes, also of those that hold no contact."""
        t = wp.tid()
        p = t // wp.static(lanes)
        k = t % wp.static(lanes)
        put_constants(p, k, owner[p, k], partner[p, k], grains, inverse, kind, coefficients, constants_out)

    return Built(
        insert_grains=insert_grains,
        find_neighbors=find_neighbors,
        carry_contacts=carry_contacts,
        select_contacts=select_contacts,
        clear_contacts=clear_contacts,
        fill_contacts=fill_contacts,
        contact_constants=contact_constants,
        constants_width=stored.width,
        keeps_constants=keep_constants,
    )
