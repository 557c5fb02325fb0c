"""The near list made anew inside a captured graph, with the grains where they are in memory.

Neighbours are counted first, and only when there is room for them are the rows written, beside the old ones; then the
contacts are carried over and the rows put in their place: so that the host, when it is asked, finds the old lists whole. The
slots beside walls are numbered anew, and the places that touch move to theirs by way of the generation that the next forces
will write.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.step.graph import DONE, NEAR, PARITY, RENEWALS, SOON, STALE

HASTY = 16  # steps between two near lists below which the host is to look for a remedy


@functools.cache
def build(Rows):
    """Return the kernels; ``Rows`` is the struct of the wall rows."""
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @kernel
    def ask(clock_out: wp.array(dtype=wp.int32)):
        """One thread: whether the near list may be made here, where it is out of date, else the host is asked.

        As it is before step SOON: a few fast grains may fly along paths (``flight``).
        """
        soon = clock_out[DONE] < clock_out[SOON]
        if clock_out[NEAR] > 0 and (clock_out[STALE] > 0 or clock_out[RENEWALS] < 1 or soon):
            clock_out[NEAR] = 0
            clock_out[STALE] = 1

    @kernel
    def judge_room(
        entries: wp.array(dtype=wp.int32), entries_room: int, slots: wp.array(dtype=wp.int32), slots_room: int,
        clock_out: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        """One thread: whether there is room for ``entries[1]`` neighbours and ``slots[1]`` slots beside walls."""
        if entries[1] > entries_room or slots[1] > slots_room:
            clock_out[STALE] = 1
        clock_out[NEAR] = 1 - clock_out[STALE]
        clock_out[RENEWALS] = clock_out[RENEWALS] - clock_out[NEAR]
        if clock_out[NEAR] > 0 and clock_out[SOON] > 0:
            clock_out[SOON] = clock_out[DONE] + wp.static(HASTY)

    @kernel
    def put_in_place(
        # the new rows
        start: wp.array(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        contact: wp.array(dtype=wp.int32),
        # where the others were
        start_out: wp.array(dtype=wp.int32),
        count_out: wp.array(dtype=wp.int32),
        slot_out: wp.array(dtype=wp.int32),
        contact_out: wp.array(dtype=wp.int32),
        flight_out: wp.array(dtype=Flight),
    ):
        """The new rows take the place of the others. The paths were laid against those, and end."""
        i = wp.tid()
        if flight_out.shape[0] > 0:
            path = flight_out[i]
            path[11] = wp.float64(-1.0)
            flight_out[i] = path
        start_out[i] = start[i]
        if i + 1 == count.shape[0]:
            start_out[i + 1] = start[i + 1]
        count_out[i] = count[i]
        for e in range(start[i], start[i] + count[i]):
            slot_out[e] = slot[e]
            contact_out[e] = contact[e]

    @kernel
    def move_places(first: wp.array(dtype=wp.int32), clock: wp.array(dtype=wp.int32), rows: Rows):
        """Copy the places of the last force call to the grain's slots from ``first`` on, in the other generation."""
        i = wp.tid()
        new = clock[PARITY]
        old = 1 - new
        n = wp.min(rows.place_count[old, i], first[i + 1] - first[i])
        rows.place_count[new, i] = n
        for k in range(n):
            rows.place[new, first[i] + k] = rows.place[old, rows.first[i] + k]

    @kernel
    def settle_places(first: wp.array(dtype=wp.int32), clock: wp.array(dtype=wp.int32), rows: Rows):
        """Copy them back to the generation that the next force call reads."""
        i = wp.tid()
        new = clock[PARITY]
        old = 1 - new
        rows.first[i] = first[i]
        if i + 1 == rows.place_count.shape[1]:
            rows.first[i + 1] = first[i + 1]
        n = rows.place_count[new, i]
        rows.place_count[old, i] = n
        for k in range(n):
            rows.place[old, first[i] + k] = rows.place[new, first[i] + k]

    return Built(
        ask=ask, judge_room=judge_room, put_in_place=put_in_place, move_places=move_places,
        settle_places=settle_places,
    )  # fmt: skip
