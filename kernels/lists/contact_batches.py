"""The inner list: the contacts that the forces go through, in batches of ``lanes``.

Of the pairs of the outer list (``neighbors``) it holds those that are closer than the cutoff and a share of both allowances,
numbered by the slot of their owner (the grain of the lower id) and then by partner id: first those that touch now, then the
others, so that the force loop finds whole batches that it can pass over. A thin second list keeps the branch "touching or not"
out of the force loop and the force slots of a grain few; building it costs a tenth of an outer list. Neither changes a bit of
the result: pairs are evaluated lower id first and summed in order of partner id.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, clump, grain
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.lists.neighbors import NeighborRows
from warpdem.kernels.lists.numbering import Counts, Starts
from warpdem.kernels.lists.path import Flight, in_flight

FEW = 8  # partners of a row that are looked through one by one


@functools.cache
def build(
    real, law, ListedGrains, border, lanes: int, *, spins: bool, stored: Columns, history: int, table: bool,
    inertia_factor: float, gap: float, keep_constants: bool, clumps: bool = False, apart: bool = False,
    force_gap: float | None = None,
):  # fmt: skip
    """Return the list kernels; arguments as in ``pairs.build`` and ``wall.contact.build``.

    ``law`` of ``law.build`` in float64, ``ListedGrains`` of ``neighbors.build``, ``history``: numbers of the contact history;
    the constants of contacts are stored with them where ``keep_constants``, else computed when they are read. ``apart``: some
    materials pass through each other.
    ``force_gap``: how far beyond contact a contact without a liquid bridge has a force [m], ``gap`` if not given: the list
    holds the pairs that are as near and a share of their allowances more, and those with a bridge.
    """
    g = grain.build(spins)
    Coefficients = law.Coefficients
    of_clumps = clump.build(clumps)
    Inverse = of_clumps.Inverse

    @wp.struct
    class ListedContacts:
        """Contacts of the inner list in batches of ``lanes``; written."""

        owner: wp.array2d(dtype=wp.int32)  # (batches, lanes) memory slot of the grain of the lower id
        partner: wp.array2d(dtype=wp.int32)  # (batches, lanes) memory slot of the other
        kind: wp.array2d(dtype=wp.int32)  # (batches, lanes) row of the coefficients; (0, lanes) where there is one row
        constants: wp.array3d(dtype=real)  # (batches, numbers, lanes), or of size 0
        slot_i: wp.array2d(dtype=wp.int32)  # (batches, lanes) force slot of the owner
        slot_j: wp.array2d(dtype=wp.int32)  # (batches, lanes) force slot of the partner
        history: wp.array3d(dtype=real)  # (batches, numbers, lanes) contact history

    acts_within, bridge_at = gap if force_gap is None else force_gap, law.bridge_at
    law_constants_width, rolling = law.Constants._length_, "inertia" in stored
    radius_at, inertia_at = (stored.radius, stored.inertia) if rolling else (0, 0)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.func
    def entry_of(
        wanted: int, start: int, count: int, id: wp.array(dtype=wp.int64), slot: wp.array(dtype=wp.int32)
    ) -> int:  # fmt: skip
        """Entry of the partner in memory slot ``wanted`` in the row at ``start``, which has it."""
        low = int(start)
        high = start + count - 1
        while high - low > wp.static(FEW):  # the row of a large grain
            middle = (low + high) // 2
            if id[slot[middle]] < id[wanted]:
                low = middle + 1
            else:
                high = middle
        while low < high and slot[low] != wanted:
            low += 1
        return low

    @wp.func
    def holds_bridge(
        i: int, e: int, j: int, grains: ListedGrains, rows: NeighborRows, old_history: wp.array3d(dtype=real)
    ) -> bool:  # fmt: skip
        """Whether there is liquid between grain ``i`` and grain ``j``, the partner in entry ``e`` of its row."""
        own = int(e)
        if grains.id[j] < grains.id[i]:
            own = entry_of(i, rows.start[j], rows.count[j], grains.id, rows.slot)
        number = rows.contact[own]
        held = real(0.0)
        if number >= 0:
            held = old_history[number // wp.static(lanes), wp.static(bridge_at), number % wp.static(lanes)]
        return held > real(0.0)

    @wp.func
    def select_row(
        i: int, grains: ListedGrains, rows: NeighborRows, old_history: wp.array3d(dtype=real), inner_share: wp.float64,
        flight: wp.array(dtype=Flight), listed_out: wp.array(dtype=wp.int32), counts_out: Counts,
    ):  # fmt: skip
        """As ``select_contacts``, of grain ``i``."""
        me = grains.record[i]
        mine = rows.allowance[i]
        touching = int(0)
        near = int(0)
        listed = int(0)
        flying = in_flight(flight, i)
        for e in range(rows.start[i], rows.start[i] + rows.count[i]):
            j = rows.slot[e]
            other = grains.record[j]
            separation = border.nearest(g.position(me) - g.position(other))
            square = wp.dot(separation, separation)
            may_move = inner_share * (mine + rows.allowance[j])
            acting = me[3] + other[3] + wp.float64(wp.static(acts_within))
            far = acting + may_move
            near_enough = square < far * far or flying or in_flight(flight, j)
            acts = square < acting * acting
            if wp.static(bridge_at is not None):  # one that holds liquid acts up to its rupture; without, it is as any other
                reach = me[3] + other[3] + wp.float64(wp.static(gap)) + may_move
                if not acts and square < reach * reach:
                    acts = holds_bridge(i, e, j, grains, rows, old_history)
                    near_enough = near_enough or acts
            # arithmetic in place of branches, which a processor cannot foresee: each would cost it 20 cycles
            is_listed = int(near_enough)
            touches = is_listed * int(acts)
            owned = int(grains.id[j] > grains.id[i])
            listed_out[e] = (2 * listed + touches + 1) * is_listed - 1
            listed += is_listed
            touching += owned * touches
            near += owned * (is_listed - touches)
        counts_out.touching[i] = touching
        counts_out.near[i] = near
        counts_out.slots[i] = listed

    @kernel
    def select_contacts(
        first: int, grains: ListedGrains, rows: NeighborRows, old_history: wp.array3d(dtype=real), inner_share: wp.float64,
        flight: wp.array(dtype=Flight), listed_out: wp.array(dtype=wp.int32), counts_out: Counts,
    ):  # fmt: skip
        """Which pairs meet within ``inner_share`` of their allowances, or fly; both grains decide alike, bit for bit.

        ``listed_out`` (entries,) holds -1 for the others, else twice the number of listed ones before it in the row, plus 1 if
        they touch; ``counts_out`` how many there are of each kind. ``flight``: (n,), or of size 0.
        """
        select_row(first + wp.tid(), grains, rows, old_history, inner_share, flight, listed_out, counts_out)

    @wp.func
    def put_constants(
        p: int, k: int, i: int, j: int, record: wp.array(dtype=g.Record), inverse: wp.array(dtype=Inverse),
        kind: wp.array2d(dtype=wp.int32), coefficients: wp.array(dtype=Coefficients), constants_out: wp.array3d(dtype=real),
    ):  # fmt: skip
        """What does not change of the contact of grains ``i`` and ``j`` in lane ``k`` of contact batch ``p``."""
        c = coefficients[0]
        if wp.static(table):
            c = coefficients[kind[p, k]]
        radii = record[i][3] + record[j][3]
        radius = record[i][3] * record[j][3] / radii
        numbers = law.constants(
            c, radius, wp.float64(1.0) / (inverse[i][0] + inverse[j][0]), wp.float64(1.0) / radii
        )  # fmt: skip
        for f in range(wp.static(law_constants_width)):
            constants_out[p, f, k] = real(numbers[f])
        if wp.static(rolling):
            constants_out[p, wp.static(radius_at), k] = real(radius)
            constants_out[p, wp.static(inertia_at), k] = real(
                wp.float64(wp.static(inertia_factor)) / (inverse[i][1] + inverse[j][1])
            )

    @wp.func
    def idle_pair(grains: ListedGrains, rows: NeighborRows) -> wp.vec2i:
        """Grains that lanes without a contact hold: grain 0 and another one, no member of the same clump.

        Where materials pass through each other, two of the outer list: others may be in the same place.
        """
        last = grains.record.shape[0] - 1
        owner = int(0)
        partner = wp.min(1, last)
        if wp.static(clumps):
            while partner < last and of_clumps.same_clump(grains.clumps.of_grain, 0, partner):
                partner += 1
        if wp.static(apart):
            while owner < last and rows.count[owner] == 0:
                owner += 1
            if rows.count[owner] > 0:
                partner = rows.slot[rows.start[owner]]
        return wp.vec2i(owner, partner)

    @wp.func
    def clear_lane(p: int, k: int, pair: wp.vec2i, unused_slot: int, contacts_out: ListedContacts):
        """No contact in lane ``k`` of batch ``p``: a pair of grains with no stiffness."""
        contacts_out.owner[p, k] = pair[0]
        contacts_out.partner[p, k] = pair[1]
        contacts_out.slot_i[p, k] = unused_slot
        contacts_out.slot_j[p, k] = unused_slot
        if wp.static(table):
            contacts_out.kind[p, k] = 0
        if wp.static(keep_constants):
            for f in range(wp.static(stored.width)):
                contacts_out.constants[p, f, k] = real(0.0)

    @kernel
    def clear_contacts(
        first: int,
        grains: ListedGrains,
        rows: NeighborRows,
        unused_slot: int,  # force slot that belongs to no grain
        contacts_out: ListedContacts,
    ):
        """Batches of no contact: those that fill the last one of a class stay such."""
        p = first + wp.tid()
        pair = idle_pair(grains, rows)
        for k in range(wp.static(lanes)):
            clear_lane(p, k, pair, unused_slot, contacts_out)

    @wp.func
    def fill_row(
        i: int, grains: ListedGrains, materials: int, coefficients: wp.array(dtype=Coefficients), rows: NeighborRows,
        listed: wp.array(dtype=wp.int32), starts: Starts, old_history: wp.array3d(dtype=real), contacts_out: ListedContacts,
    ):  # fmt: skip
        """As ``fill_contacts``, of grain ``i``."""
        touching = starts.touching[i]
        near = starts.near[i]
        me = grains.id[i]
        for e in range(rows.start[i], rows.start[i] + rows.count[i]):
            j = rows.slot[e]
            entry = listed[e]
            number = int(-1)
            if int(grains.id[j] > me) * int(entry >= 0) == 1:  # one branch, not two
                old = rows.contact[e]
                touches = entry & 1
                number = wp.where(touches == 1, touching, near)
                touching += touches
                near += 1 - touches
                p = number // wp.static(lanes)
                k = number % wp.static(lanes)
                contacts_out.owner[p, k] = i
                contacts_out.partner[p, k] = j
                contacts_out.slot_i[p, k] = starts.slot[i] + entry // 2
                back = entry_of(i, rows.start[j], rows.count[j], grains.id, rows.slot)
                contacts_out.slot_j[p, k] = starts.slot[j] + listed[back] // 2
                if wp.static(table):
                    contacts_out.kind[p, k] = grains.material[i] * materials + grains.material[j]
                if wp.static(keep_constants):
                    put_constants(
                        p, k, i, j, grains.record, grains.inverse, contacts_out.kind, coefficients, contacts_out.constants
                    )
                if wp.static(history > 0):
                    for f in range(wp.static(history)):
                        value = real(0.0)
                        if old >= 0:
                            value = old_history[old // wp.static(lanes), f, old % wp.static(lanes)]
                        contacts_out.history[p, f, k] = value
            rows.contact[e] = number

    @kernel
    def fill_contacts(
        first: int, grains: ListedGrains, materials: int, coefficients: wp.array(dtype=Coefficients),
        rows: NeighborRows,  # read but for ``contact``
        listed: wp.array(dtype=wp.int32),  # (entries,) of ``select_contacts``
        starts: Starts,
        old_history: wp.array3d(dtype=real),  # (batches, numbers, lanes) of the list that is replaced
        contacts_out: ListedContacts,
    ):  # fmt: skip
        """Write the contacts that each grain owns into their contact batches, with the force slots of both grains."""
        fill_row(first + wp.tid(), grains, materials, coefficients, rows, listed, starts, old_history, contacts_out)

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

    return KernelSet(
        select_contacts=select_contacts,
        clear_contacts=clear_contacts,
        fill_contacts=fill_contacts,
        contact_constants=contact_constants,
        select_row=select_row,
        clear_lane=clear_lane,
        idle_pair=idle_pair,
        fill_row=fill_row,
        Coefficients=Coefficients,
        real=real,
        ListedContacts=ListedContacts,
        constants_width=stored.width,
        keeps_constants=keep_constants,
    )
