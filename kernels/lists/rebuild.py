"""What takes the place of the outer list in a captured graph, with the grains where they are in memory.

Neighbors are counted first (``neighbors``, ``numbering``), and only where the arrays can hold them the rows are written, beside
the old ones; then the contact numbers are carried over and the rows replace the old ones: until then the host can still use
the old lists. The slots beside walls are numbered again, and the contact points move to theirs by way of the generation
that the next forces will write.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet
from warpdem.kernels.lists.neighbors import NeighborRows
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.step.clock import ASK_HOST, BUILD_OUTER, OUTER_BUILDS_LEFT, OUTER_NOT_BEFORE, PARITY, STEPS_DONE

HASTY = 16  # steps between two outer lists below which the host is to look for a remedy


@functools.cache
def build(WallContacts, wetting=None):
    """Return the kernels; ``WallContacts``: struct of the wall contacts; ``wetting``: of ``wall.films.build``, or None."""
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @kernel
    def ask_outer(clock_out: wp.array(dtype=wp.int32)):
        """One thread: whether the outer list may be built here, where it is out of date; else control returns to the host.

        As it is before step OUTER_NOT_BEFORE: a few fast grains may fly along paths (``flight``).
        """
        soon = clock_out[STEPS_DONE] < clock_out[OUTER_NOT_BEFORE]
        if clock_out[BUILD_OUTER] > 0 and (clock_out[ASK_HOST] > 0 or clock_out[OUTER_BUILDS_LEFT] < 1 or soon):
            clock_out[BUILD_OUTER] = 0
            clock_out[ASK_HOST] = 1

    @kernel
    def check_outer_capacity(
        entries: wp.array(dtype=wp.int32), entry_capacity: int, slots: wp.array(dtype=wp.int32), slot_capacity: int,
        clock_out: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        """One thread: whether the arrays hold ``entries[1]`` neighbors and ``slots[1]`` slots beside walls."""
        if entries[1] > entry_capacity or slots[1] > slot_capacity:
            clock_out[ASK_HOST] = 1
        clock_out[BUILD_OUTER] = 1 - clock_out[ASK_HOST]
        clock_out[OUTER_BUILDS_LEFT] = clock_out[OUTER_BUILDS_LEFT] - clock_out[BUILD_OUTER]
        if clock_out[BUILD_OUTER] > 0 and clock_out[OUTER_NOT_BEFORE] > 0:
            clock_out[OUTER_NOT_BEFORE] = clock_out[STEPS_DONE] + wp.static(HASTY)

    @kernel
    def replace_outer(
        first: int,
        rows: NeighborRows,  # the new ones
        # replaced
        rows_out: NeighborRows,
        flight_out: wp.array(dtype=Flight),  # (n,), or of size 0
    ):
        """The new rows replace the old ones. Paths of flight were laid against those, and end."""
        i = first + wp.tid()
        if flight_out.shape[0] > 0:
            path = flight_out[i]
            path[11] = wp.float64(-1.0)
            flight_out[i] = path
        rows_out.start[i] = rows.start[i]
        if i + 1 == rows.count.shape[0]:
            rows_out.start[i + 1] = rows.start[i + 1]
        rows_out.count[i] = rows.count[i]
        rows_out.allowance[i] = rows.allowance[i]
        for e in range(rows.start[i], rows.start[i] + rows.count[i]):
            rows_out.slot[e] = rows.slot[e]
            rows_out.contact[e] = rows.contact[e]

    @kernel
    def move_wall_contacts(
        first: int, slots: wp.array(dtype=wp.int32), clock: wp.array(dtype=wp.int32), wall_contacts: WallContacts
    ):
        """Copy the contact points of the last force call to the grain's slots from ``slots`` on, in the other generation."""
        i = first + wp.tid()
        new = clock[PARITY]
        old = 1 - new
        n = wp.min(wall_contacts.point_count[old, i], slots[i + 1] - slots[i])
        wall_contacts.point_count[new, i] = n
        if wp.static(wetting is not None):
            wetting.give_all_back(i, old, i, n, wall_contacts, wall_contacts)
        for k in range(n):
            wall_contacts.point[new, slots[i] + k] = wall_contacts.point[old, wall_contacts.first[i] + k]

    @kernel
    def settle_wall_contacts(
        first: int, slots: wp.array(dtype=wp.int32), clock: wp.array(dtype=wp.int32), wall_contacts: WallContacts
    ):
        """Copy them back to the generation that the next force call reads."""
        i = first + wp.tid()
        new = clock[PARITY]
        old = 1 - new
        wall_contacts.first[i] = slots[i]
        if i + 1 == wall_contacts.point_count.shape[1]:
            wall_contacts.first[i + 1] = slots[i + 1]
        n = wall_contacts.point_count[new, i]
        wall_contacts.point_count[old, i] = n
        for k in range(n):
            wall_contacts.point[old, slots[i] + k] = wall_contacts.point[new, slots[i] + k]
        if wp.static(wetting is not None):
            wetting.forget(i, new, wall_contacts)

    return KernelSet(
        ask_outer=ask_outer, check_outer_capacity=check_outer_capacity, replace_outer=replace_outer,
        move_wall_contacts=move_wall_contacts, settle_wall_contacts=settle_wall_contacts,
    )  # fmt: skip
