"""The step on a GPU: each phase one launch with a thread per contact or grain, many steps in one captured graph.

The graph is a loop that runs while clock[GO] is set. Its body is a few steps without a look back, then ``tick``; when a grain
has moved too far the launches that follow in the body do nothing, and a branch of the graph makes the contact list anew (the
kernels of ``neighbours`` and ``numbering``) and evaluates the forces; where the near list is out of date too, another branch
makes that first (``renewal``). What changes with time is in device memory: the schedule's rows, and the clock that says which
of them is now. The host is asked when the steps are done, when there is too little room for a list or the grains want to be
sorted in memory, when a grain left the domain or is no number, and when its speed beside a mesh is too high.

    GO, NEAR, REFRESH, FRESH   conditions of the loop and of its branches
    ROW                        of the schedule: the present step
    LEFT, DONE                 steps to do and done
    PARITY, HOLD               of the present step; as in ``run``
    MOVED                      steps of the body after which a grain had moved too far, 0 when none has
    FAR                        whether it was that, and not only that a grain left the domain
    DEEP                       1 + steps of the body after which a contact was too deep, 0 when none was
    STALE                      the host is next
    LANES, SHARES, ROWS        of the packs, of the rows that are summed, and grains beside a wall
    REFRESHES, LATEST          contact lists made, and the steps done at the last
    RENEWALS                   near lists that may still be made before the host sorts the grains
    SOON                       steps done before which the host wants to be asked for a near list; 0: not at all

The largest overlap and speed are kept by atomic maxima, which are the same in any order; the only other atomics link grains
into cells, in an order that ``near_rows`` sorts away. So two runs have equal bits. A maximum is compared before it is raised:
nearly all threads only read.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain
from warpdem.kernels.lists.flight import Watched
from warpdem.kernels.lists.path import Flight, in_flight
from warpdem.kernels.step.loop import too_deep
from warpdem.kernels.step.motion import BEYOND
from warpdem.kernels.step.schedule import Placement, local, past_turn, slip_time, wall_velocity
from warpdem.kernels.wall.surface import Surface

CLOCK = 20
(
    GO, NEAR, REFRESH, FRESH, ROW, LEFT, DONE, PARITY, HOLD, MOVED, FAR, DEEP, STALE, LANES, SHARES, ROWS, REFRESHES, LATEST,
    RENEWALS, SOON,
) = range(CLOCK)  # fmt: skip


@wp.func
def raise_to(extreme_out: wp.array(dtype=wp.float64), at: int, value: wp.float64):
    """Keep the larger of the value and the one there."""
    if value > extreme_out[at]:
        wp.atomic_max(extreme_out, at, value)


@wp.func
def forces_due(clock: wp.array(dtype=wp.int32), ahead: int, stage: int) -> bool:
    """Whether the forces ``ahead`` steps from now are wanted; those of a stage belong to the step that begins there."""
    if clock[MOVED] != 0 or clock[DEEP] != 0:
        return False
    if stage > 0:
        return ahead < clock[LEFT]
    return ahead < clock[LEFT] or (ahead == clock[LEFT] and clock[HOLD] == 0)


@functools.cache
def build(
    step, pairs, evaluate, Rows, travel, border, real, *, spins: bool, history: int, stages: int, lanes: int, moving: int,
    table: bool, leave: bool,
):  # fmt: skip
    """Return the kernels of the graph.

    Args:
        step: namespace of ``loop.build``.
        pairs: namespace of ``pairs.build``.
        evaluate: of ``thread_contact.build``.
        Rows: struct of the wall rows.
        travel: namespace of ``motion.build_travel``.
        border: periodic images, of ``border.build``.
        real: precision of the contact law.
        spins: grains spin.
        history: numbers remembered per contact.
        stages: force calls per step.
        lanes: contacts per pack.
        moving: wall motions relative to the frame.
        table: coefficients differ between contacts.
        leave: grains may leave the domain.
    """
    g = grain.build(spins)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.struct
    class Contacts:
        """Grain-grain contacts in packs, as ``loop.Packs``, number by number."""

        owner: wp.array2d(dtype=wp.int32)
        partner: wp.array2d(dtype=wp.int32)
        kind: wp.array2d(dtype=wp.int32)
        slot_i: wp.array2d(dtype=wp.int32)
        slot_j: wp.array2d(dtype=wp.int32)
        memory: wp.array3d(dtype=real)
        trial: wp.array3d(dtype=real)
        next: wp.array3d(dtype=real)  # memory in the list that is being made

    @kernel
    def pair_forces(
        ahead: int, stage: int, grains: step.Grains, contacts: Contacts, control: step.Control,
        coefficients: wp.array(dtype=pairs.Coefficients), clock: wp.array(dtype=wp.int32), dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        if t >= clock[LANES] or not forces_due(clock, ahead, stage):
            return
        row = control.row[(clock[ROW] + ahead) * wp.static(stages) + stage]
        memory = contacts.memory
        if stage > 0:
            memory = contacts.trial
        share, approach = evaluate(
            t // wp.static(lanes), t % wp.static(lanes), grains.record, contacts.owner, contacts.partner, grains.inverse,
            contacts.kind, coefficients, pairs.narrow_turn(past_turn(row)), slip_time(row), dt, contacts.memory,
            contacts.slot_i, contacts.slot_j, memory, grains.row, grains.entry,
        )  # fmt: skip
        raise_to(control.extreme, 0, share)
        raise_to(control.extreme, 1, approach)

    @kernel
    def wall_forces(
        ahead: int, stage: int, grains: step.Grains, rows: Rows, surface: Surface, control: step.Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, clock: wp.array(dtype=wp.int32), dt: wp.float64,
    ):  # fmt: skip
        r = wp.tid()
        if r >= clock[ROWS] or not forces_due(clock, ahead, stage):
            return
        share, approach = step.touch_row(
            r, clock[ROW] + ahead, stage, grains, rows, surface, control, coefficients, materials,
            (clock[PARITY] + ahead) & 1, dt,
        )  # fmt: skip
        raise_to(control.extreme, 2, share)
        raise_to(control.extreme, 3, approach)

    @kernel
    def move(
        ahead: int, stage: int, grains: step.Grains, rows: Rows, control: step.Control, clock_out: wp.array(dtype=wp.int32),
        dt: wp.float64, reach: wp.float64,
    ):  # fmt: skip
        i = wp.tid()
        # a thread of this very launch may have seen its grain beyond reach already
        if ahead >= clock_out[LEFT] or (clock_out[MOVED] != 0 and clock_out[MOVED] <= ahead):
            return
        if clock_out[DEEP] != 0 and (clock_out[DEEP] <= ahead or stage > 0):
            return
        if stage == 0 and too_deep(control.extreme, 0, control.deepest):
            clock_out[DEEP] = ahead + 1
            return
        moved = step.move_phase(i, i + 1, 1, clock_out[ROW] + ahead, stage, grains, rows, control, dt, reach)
        if moved > 0:
            clock_out[MOVED] = ahead + 1
        if (moved & wp.static(BEYOND)) > 0:
            clock_out[FAR] = 1

    @kernel
    def tick(
        count: int, motions: int, control: step.Control, clock_out: wp.array(dtype=wp.int32),
        placement_out: wp.array(dtype=Placement),
    ):  # fmt: skip
        """One thread: the ``count`` steps of a body, or those before the lists ran out, are done."""
        done = wp.min(count, clock_out[LEFT])
        clock_out[REFRESH] = 0
        clock_out[NEAR] = 0
        if clock_out[MOVED] > 0:
            done = clock_out[MOVED]
            clock_out[REFRESH] = 1
        if clock_out[DEEP] > 0:
            done = clock_out[DEEP] - 1
        clock_out[MOVED] = 0
        clock_out[ROW] = clock_out[ROW] + done
        clock_out[DONE] = clock_out[DONE] + done
        clock_out[LEFT] = clock_out[LEFT] - done
        clock_out[PARITY] = (clock_out[PARITY] + done) & 1
        clock_out[GO] = wp.min(clock_out[LEFT], 1)
        if clock_out[DEEP] > 0:
            clock_out[GO] = 0
        if clock_out[REFRESH] > 0:
            for m in range(motions):
                placement_out[m] = control.placement[(clock_out[ROW] + 1) * wp.static(stages), m]

    @kernel
    def look(
        grains: step.Grains, reference: wp.array2d(dtype=wp.vec3d), control: step.Control, watched: Watched,
        placements: wp.array(dtype=Placement), dt: wp.float64, reach: wp.float64, clock_out: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        """Whether the near list is out of date: a grain is further than ``reach`` [m] from where it was made.

        The host must look when a grain is no longer in the domain, is no number, or is fast beside a mesh.
        """
        i = wp.tid()
        state = grains.record[i]
        if wp.static(leave):
            if g.gone(state):
                return
        q = g.position(state)
        at = (clock_out[ROW] + 1) * wp.static(stages)
        moved = travel.travelled(
            i, state, reference, grains.flight, control.placement, control.outlet, control.origin, at, dt, reach
        )
        if (moved & BEYOND) > 0:
            clock_out[NEAR] = 1
        stale = travel.left_domain(q, control.outlet)
        if border.thrown(q) or not wp.isfinite(wp.length_sq(q)):
            stale = 1
        for w in range(watched.motion.shape[0]):
            p = placements[watched.motion[w]]
            way = wp.length(g.velocity(state) - wall_velocity(p, q)) * dt
            if not (way <= watched.share[w] * state[3]):
                body = local(p, q)
                room = state[3] + way
                low = body - watched.low[w] + wp.vec3d(room, room, room)
                high = watched.high[w] - body + wp.vec3d(room, room, room)
                if wp.min(low) > wp.float64(0.0) and wp.min(high) > wp.float64(0.0):
                    stale = 1
        if stale > 0:
            clock_out[STALE] = 1

    @kernel
    def go_on(clock_out: wp.array(dtype=wp.int32)):
        """One thread: whether the contact list is made here; else all is left as the last forces left it, for the host."""
        clock_out[FRESH] = 1 - clock_out[STALE]
        if clock_out[STALE] > 0:
            clock_out[GO] = 0

    @kernel
    def judge(lanes_room: int, shares_room: int, clock_out: wp.array(dtype=wp.int32)):
        """One thread: whether the contact list can be made here, else the host is asked."""
        if clock_out[LANES] > lanes_room or clock_out[SHARES] > shares_room:
            clock_out[STALE] = 1
        clock_out[FRESH] = 1 - clock_out[STALE]
        if clock_out[FRESH] > 0:
            clock_out[REFRESHES] = clock_out[REFRESHES] + 1
            clock_out[LATEST] = clock_out[DONE]
            clock_out[FAR] = 0
        else:
            clock_out[GO] = 0

    @kernel
    def clear(partner: int, filler: int, contacts: Contacts):
        """Lanes that no contact fills: their shares would go to a row that nobody reads."""
        t = wp.tid()
        p = t // wp.static(lanes)
        k = t % wp.static(lanes)
        contacts.owner[p, k] = 0
        contacts.partner[p, k] = partner
        contacts.slot_i[p, k] = filler
        contacts.slot_j[p, k] = filler
        if wp.static(table):
            contacts.kind[p, k] = 0

    @kernel
    def take_over(contacts: Contacts, clock: wp.array(dtype=wp.int32)):
        """The memory of the new list, where the graph's launches expect it."""
        t = wp.tid()
        if t < clock[LANES]:
            for f in range(wp.static(history)):
                contacts.memory[t // wp.static(lanes), f, t % wp.static(lanes)] = contacts.next[
                    t // wp.static(lanes), f, t % wp.static(lanes)
                ]

    @kernel
    def mark(
        record: wp.array(dtype=g.Record), placements: wp.array(dtype=Placement), flight: wp.array(dtype=Flight),
        reference_out: wp.array2d(dtype=wp.vec3d),
    ):  # fmt: skip
        """Where grains are now: the place from which their way is counted. Those in flight have none."""
        i = wp.tid()
        if in_flight(flight, i):
            return
        q = g.position(record[i])
        reference_out[i, 0] = q
        for m in range(wp.static(moving)):
            reference_out[i, m + 1] = local(placements[m], q)

    return Built(
        pair_forces=pair_forces, wall_forces=wall_forces, move=move, tick=tick, look=look, go_on=go_on, judge=judge,
        clear=clear, take_over=take_over, mark=mark, Contacts=Contacts,
    )  # fmt: skip
