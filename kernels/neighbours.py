"""Which grains may touch: the near list (reach + skin, rarely rebuilt) and the contact list (a thin margin, often refreshed).

The reach of a pair is the sum of the radii plus the gap over which the normal law acts (0 for most laws).
Near list: per grain a row (of ``width`` places, ``count`` of them used) of partner slots in ascending order of partner id.
Contact list: the near pairs closer than the margin, numbered by the slot of their owner (the grain of the lower id) and then
by partner id, and laid out in packs of ``lanes``: first those that touch now, then the others, so that the force loop finds
whole packs that it can pass over. A thin second list keeps the branch "touching or not" out of the force
loop and the rows of the summation short; making it costs a tenth of a near list. Neither changes a bit of the result: pairs
are evaluated lower id first and summed in order of partner id.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain

NEAR, TOUCHING = 1, 2  # classes of listed pairs


@functools.cache
def build(
    real, constants, border, lanes: int, *, spins: bool, rolling: bool, history: int, table: bool, lag: float, gap: float
):  # fmt: skip
    """Return the list kernels; arguments as in ``pairs.build`` and ``wall.contact.build``."""
    g = grain.build(spins)
    Coefficients = wp.types.vector(7, wp.float64)
    Inverse = wp.types.vector(2, wp.float64)
    width = 4 if rolling else 2
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @kernel
    def near_rows(
        first: int,
        grid: wp.uint64,
        grains: wp.array(dtype=g.Record),
        id: wp.array(dtype=wp.int64),
        largest: wp.float64,
        skin: wp.float64,
        width: int,  # room per row
        count_out: wp.array(dtype=wp.int32),
        slot_out: wp.array(dtype=wp.int32),
    ):
        """Partners of each grain; a count above ``width`` says that the row did not fit."""
        i = first + wp.tid()
        me = grains[i]
        reach = me[3] + largest + wp.float64(wp.static(gap)) + skin
        n = int(0)
        at = i * width
        for image in range(wp.static(border.images)):
            place = border.image(g.position(me), image)
            if border.within(place, reach):
                query = wp.hash_grid_query(grid, place, reach)
                j = int(0)
                while wp.hash_grid_query_next(query, j):
                    other = grains[j]
                    seen = place - g.position(other)  # the grid wraps around and shows other images too
                    way = border.nearest(g.position(me) - g.position(other))
                    far = me[3] + other[3] + wp.float64(wp.static(gap)) + skin  # in this order it is the same seen from j
                    if wp.dot(way, way) < far * far and j != i and wp.dot(seen, seen) < wp.float64(1.01) * far * far:
                        if n < width:
                            s = at + n  # insertion by partner id: rows are short
                            while s > at and id[slot_out[s - 1]] > id[j]:
                                slot_out[s] = slot_out[s - 1]
                                s -= 1
                            slot_out[s] = j
                        n += 1
        count_out[i] = n

    @kernel
    def carry_contacts(
        first: int,
        id: wp.array(dtype=wp.int64),
        width: int,
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        old_slot: wp.array(dtype=wp.int32),  # slot of this grain in the old list, -1 if it is new
        old_id: wp.array(dtype=wp.int64),
        old_width: int,
        old_count: wp.array(dtype=wp.int32),
        old_partner: wp.array(dtype=wp.int32),
        old_contact: wp.array(dtype=wp.int32),
        contact_out: wp.array(dtype=wp.int32),
    ):
        """Contact number of each owned pair in the list that is being replaced, -1 if it had none."""
        i = first + wp.tid()
        o = old_slot[i]
        for e in range(i * width, i * width + count[i]):
            j = slot[e]
            found = int(-1)
            if id[j] > id[i] and o >= 0:
                for f in range(o * old_width, o * old_width + old_count[o]):
                    if old_id[old_partner[f]] == id[j]:
                        found = old_contact[f]
            contact_out[e] = found

    @kernel
    def select_contacts(
        first: int,
        grains: wp.array(dtype=g.Record),
        id: wp.array(dtype=wp.int64),
        width: int,
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        margin: wp.float64,
        class_out: wp.array(dtype=wp.uint8),
        touching_out: wp.array(dtype=wp.int32),
        near_out: wp.array(dtype=wp.int32),
        listed_out: wp.array(dtype=wp.int32),
    ):
        """Class of each pair: TOUCHING, NEAR (closer than the margin) or neither; both grains decide alike, bit for bit."""
        i = first + wp.tid()
        me = grains[i]
        touching = int(0)
        near = int(0)
        listed = int(0)
        for e in range(i * width, i * width + count[i]):
            j = slot[e]
            other = grains[j]
            way = border.nearest(g.position(me) - g.position(other))
            square = wp.dot(way, way)
            reach = me[3] + other[3] + wp.float64(wp.static(gap))
            far = reach + margin
            kind = wp.uint8(0)
            if square < far * far:
                kind = wp.uint8(NEAR)
                listed += 1
                if square < reach * reach:
                    kind = wp.uint8(TOUCHING)
                if id[j] > id[i]:
                    if kind == wp.uint8(TOUCHING):
                        touching += 1
                    else:
                        near += 1
            class_out[e] = kind
        touching_out[i] = touching
        near_out[i] = near
        listed_out[i] = listed

    @kernel
    def fill_contacts(
        first: int,
        grains: wp.array(dtype=g.Record),
        inverse: wp.array(dtype=Inverse),
        kind: wp.array(dtype=wp.int32),
        materials: int,
        coefficients: wp.array(dtype=Coefficients),
        id: wp.array(dtype=wp.int64),
        width: int,
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        pair_class: wp.array(dtype=wp.uint8),
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
        """Write the contacts that grain ``i`` owns into their packs, and tell all its contacts where its shares go."""
        i = first + wp.tid()
        touching = touching_start[i]
        near = near_start[i]
        row = row_start[i]
        for e in range(i * width, i * width + count[i]):
            j = slot[e]
            if id[j] > id[i]:
                old = contact_out[e]
                contact_out[e] = -1
                if pair_class[e] != wp.uint8(0):
                    at = int(0)
                    if pair_class[e] == wp.uint8(TOUCHING):
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
                    slot_i_out[p, k] = row
                    row += 1
                    c = coefficients[0]
                    if wp.static(table):
                        which = kind[i] * materials + kind[j]
                        kind_out[p, k] = which
                        c = coefficients[which]
                    ri = grains[i][3]
                    rj = grains[j][3]
                    one = wp.float64(1.0)
                    radius = ri * rj / (ri + rj)
                    stiffness, damping = constants(c[0], c[1], radius, one / (inverse[i][0] + inverse[j][0]))
                    constants_out[p, 0, k] = real(stiffness)
                    constants_out[p, 1, k] = real(damping)
                    if wp.static(rolling):
                        constants_out[p, 2, k] = real(radius)
                        constants_out[p, 3, k] = real(wp.float64(wp.static(lag)) / (inverse[i][1] + inverse[j][1]))
                    if wp.static(history > 0):
                        for f in range(wp.static(history)):
                            value = real(0.0)
                            if old >= 0:
                                value = old_memory[old // wp.static(lanes), f, old % wp.static(lanes)]
                            memory_out[p, f, k] = value
            elif pair_class[e] != wp.uint8(0):  # owned by j: its number among those of its class there
                mine = pair_class[e]
                theirs = int(0)
                if mine == wp.uint8(TOUCHING):
                    theirs = touching_start[j]
                else:
                    theirs = near_start[j]
                o = j * width
                while slot[o] != i:
                    if pair_class[o] == mine and id[slot[o]] > id[j]:
                        theirs += 1
                    o += 1
                slot_j_out[theirs // wp.static(lanes), theirs % wp.static(lanes)] = row
                row += 1

    return Built(
        near_rows=near_rows,
        carry_contacts=carry_contacts,
        select_contacts=select_contacts,
        fill_contacts=fill_contacts,
        constants_width=width,
    )
