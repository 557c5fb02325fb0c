"""The step as launches with a thread per contact or grain: what a captured graph is made of (``warpdem.engine.graph``).

The graph is a loop that runs while clock[RUN] is set. Its body is a few steps without a look back, then ``advance_clock``. When
a grain has moved too far, the launches that follow in the body do nothing, and a branch of the graph checks the lists, builds
the outer list if it is out of date, then the inner list, and evaluates the forces. What changes with time is in device memory:
the rows of the schedule, and the clock (``clock``) that says which of them is now. The host is asked when the steps are done,
when a list is longer than its arrays or the grains are to be sorted in memory, and when a grain needs it (``displacement``).

The largest overlap and speed are kept by atomic maxima, which are the same in any order; the only other atomics link grains
into cells, in an order that ``find_neighbors`` sorts away. So two runs have equal bits. A maximum is compared before it is
raised: nearly all threads only read.

In a run over several processes (ranks) ghosts get their new state between the stages of each step, and a batch of steps ends
for all ranks at once: no launch decides by itself that a step is not taken. Either the host stands between the stages and ends
the batch, or messages from GPU to GPU do (``warpdem.engine.graph_of_steps``): there the largest of all ranks' flags, which
``found`` writes, ends it by ``agreed``, and the launches that follow in the graph do nothing.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet
from warpdem.kernels.step.clock import (
    ASK_HOST,
    BEYOND_LISTS,
    BUILD_INNER,
    BUILD_OUTER,
    CHECK_LISTS,
    CONTACT_LANES,
    DEEP_AT,
    FORCE_SLOTS,
    INNER_BUILDS,
    LATEST_BUILD,
    MOVED_AT,
    PARITY,
    RUN,
    SCHEDULE_ROW,
    STEPS_DONE,
    STEPS_LEFT,
    WALL_GRAINS,
    forces_due,
)
from warpdem.kernels.step.exchange import FLAGS, TOO_DEEP
from warpdem.kernels.step.forces import too_deep
from warpdem.kernels.step.motion import BEYOND, LEFT
from warpdem.kernels.step.schedule import Placement, kick_time, last_drift_rotation, slip_time
from warpdem.kernels.step.structs import Control, Report, build_call, one


@wp.func
def raise_to(extreme_out: wp.array(dtype=wp.float64), at: int, value: wp.float64):
    """Keep the larger of the value and the one there."""
    if value > extreme_out[at]:
        wp.atomic_max(extreme_out, at, value)


@functools.cache
def build(
    structs, pairs, evaluate, wall_contacts_of_grain, WallContacts, move_phase, *, history: int, stages: int, lanes: int,
    films=None, dynamic=None, ranks: bool = False,
):  # fmt: skip
    """Return the kernels of the graph.

    Args:
        structs: namespace of ``structs.build``.
        pairs: namespace of ``pairs.build``.
        evaluate: of ``thread_contact.build``.
        wall_contacts_of_grain: of ``wall.evaluate.build``, and ``WallContacts``, its struct.
        move_phase: of ``move.build``.
        history: numbers remembered per contact.
        stages: force calls per step.
        lanes: contacts per contact batch.
        films: of ``contact.films.build``; None for a law without bridges.
        dynamic: namespace of ``dynamic_walls.build``; None where no wall moves by the load on it.
        ranks: the run is over several processes.
    """
    real, force_call = pairs.real, build_call(stages)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @kernel
    def pair_forces(
        first: int, ahead: int, stage: int, model: structs.Model, control: Control, grains: structs.Grains,
        contacts: structs.ContactBatches, report: Report, clock: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        t = first + wp.tid()
        if t >= clock[CONTACT_LANES] or not forces_due(clock, ahead, stage):
            return
        row = control.row[(clock[SCHEDULE_ROW] + ahead) * wp.static(stages) + stage]
        if wp.static(films is not None):
            films.settle(
                t // wp.static(lanes), t % wp.static(lanes), model.quantum, grains.record, contacts.owner, contacts.partner,
                contacts.kind, model.coefficients, contacts.slot_i, contacts.slot_j, grains.slot_force, contacts.history,
            )  # fmt: skip
        history_out = contacts.history
        if stage > 0:
            history_out = contacts.trial
        overlap_ratio, approach = evaluate(
            t // wp.static(lanes), t % wp.static(lanes), pairs.cast_rotation(last_drift_rotation(row)), slip_time(row),
            kick_time(row), model, grains, contacts, history_out, report.losses, t % wp.max(report.losses.shape[0], 1),
        )  # fmt: skip
        raise_to(report.extreme, 0, overlap_ratio)
        raise_to(report.extreme, 1, approach)

    @kernel
    def wall_forces(
        first: int, ahead: int, stage: int, model: structs.Model, control: Control, grains: structs.Grains,
        wall_contacts: WallContacts, report: Report, clock: wp.array(dtype=wp.int32),
    ):  # fmt: skip
        r = first + wp.tid()
        if r >= clock[WALL_GRAINS] or not forces_due(clock, ahead, stage):
            return
        call = force_call(clock[SCHEDULE_ROW] + ahead, stage, (clock[PARITY] + ahead) & 1)
        overlap_ratio, approach = wall_contacts_of_grain(
            r, call, control.row[call.row], control.placement, model, grains, wall_contacts
        )
        raise_to(report.extreme, 2, overlap_ratio)
        raise_to(report.extreme, 3, approach)

    @wp.func
    def ends_here(control: Control, report: Report) -> bool:
        """Whether an overlap ends the batch before the next step; over several ranks it ends after it (``found``)."""
        return wp.static(not ranks) and too_deep(report.extreme, 0, control.max_overlap)

    add_wall_loads = advance_walls = None
    if dynamic is not None:

        @wp.func
        def is_taken(ahead: int, control: Control, report: Report, clock: wp.array(dtype=wp.int32)) -> bool:
            """Whether the step that begins ``ahead`` steps from now is taken, as ``move`` decides."""
            return (
                ahead < clock[STEPS_LEFT] and clock[MOVED_AT] == 0 and clock[DEEP_AT] == 0
                and not ends_here(control, report)
            )

        @kernel
        def add_wall_loads(
            first: int, ahead: int, control: Control, grains: structs.Grains, wall_contacts: WallContacts, report: Report,
            clock: wp.array(dtype=wp.int32),
        ):  # fmt: skip
            r = first + wp.tid()
            if r < clock[WALL_GRAINS] and is_taken(ahead, control, report, clock):
                dynamic.add_loads(
                    0, r, r + 1, grains.record, grains.inverse, wall_contacts, control.placement,
                    clock[SCHEDULE_ROW] + ahead + 1, (clock[PARITY] + ahead) & 1, control.dynamic,
                )  # fmt: skip

        @kernel
        def advance_walls(
            ahead: int, model: structs.Model, control: Control, report: Report, clock: wp.array(dtype=wp.int32)
        ):  # fmt: skip
            """One thread."""
            if is_taken(ahead, control, report, clock):
                dynamic.advance(
                    1, clock[SCHEDULE_ROW] + ahead, control.row, control.placement, model.dt, control.dynamic
                )

    @kernel
    def move(
        first: int, ahead: int, stage: int, model: structs.Model, control: Control, grains: structs.Grains,
        wall_contacts: WallContacts, report: Report, clock_out: wp.array(dtype=wp.int32), inner_share: wp.float64,
    ):  # fmt: skip
        # a thread of this very launch may have found its grain beyond what it is allowed already
        if ahead >= clock_out[STEPS_LEFT] or (clock_out[MOVED_AT] != 0 and clock_out[MOVED_AT] <= ahead):
            return
        if clock_out[DEEP_AT] != 0 and (clock_out[DEEP_AT] <= ahead or stage > 0):
            return
        if stage == 0 and ends_here(control, report):
            clock_out[DEEP_AT] = ahead + 1
            return
        s = clock_out[SCHEDULE_ROW] + ahead
        moved = move_phase(
            one(first + wp.tid()), s, stage, model, grains, wall_contacts, control, report, inner_share
        )
        if moved > 0:
            clock_out[MOVED_AT] = ahead + 1
        if (moved & wp.static(BEYOND)) > 0:
            clock_out[BEYOND_LISTS] = 1

    @kernel
    def advance_clock(
        count: int, motions: int, control: Control, clock_out: wp.array(dtype=wp.int32),
        placement_out: wp.array(dtype=Placement),
    ):  # fmt: skip
        """One thread: the ``count`` steps of a body are done, or those before a grain had moved too far."""
        done = wp.min(count, clock_out[STEPS_LEFT])
        clock_out[CHECK_LISTS] = 0
        clock_out[BUILD_OUTER] = 0
        if clock_out[MOVED_AT] > 0:
            done = clock_out[MOVED_AT]
            clock_out[CHECK_LISTS] = 1
        if clock_out[DEEP_AT] > 0:
            done = clock_out[DEEP_AT] - 1
        clock_out[MOVED_AT] = 0
        clock_out[SCHEDULE_ROW] = clock_out[SCHEDULE_ROW] + done
        clock_out[STEPS_DONE] = clock_out[STEPS_DONE] + done
        clock_out[STEPS_LEFT] = clock_out[STEPS_LEFT] - done
        clock_out[PARITY] = (clock_out[PARITY] + done) & 1
        clock_out[RUN] = wp.min(clock_out[STEPS_LEFT], 1)
        if clock_out[DEEP_AT] > 0:
            clock_out[RUN] = 0
        if clock_out[CHECK_LISTS] > 0:
            for m in range(motions):
                placement_out[m] = control.placement[(clock_out[SCHEDULE_ROW] + 1) * wp.static(stages), m]

    @kernel
    def resume(clock_out: wp.array(dtype=wp.int32)):
        """One thread: whether the inner list is built here; else all stays as the last forces left it, for the host."""
        clock_out[BUILD_INNER] = 1 - clock_out[ASK_HOST]
        if clock_out[ASK_HOST] > 0:
            clock_out[RUN] = 0

    @kernel
    def check_capacity(lane_capacity: int, slot_capacity: int, clock_out: wp.array(dtype=wp.int32)):
        """One thread: whether the arrays hold the inner list, else the host is asked."""
        if clock_out[CONTACT_LANES] > lane_capacity or clock_out[FORCE_SLOTS] > slot_capacity:
            clock_out[ASK_HOST] = 1
        clock_out[BUILD_INNER] = 1 - clock_out[ASK_HOST]
        if clock_out[BUILD_INNER] > 0:
            clock_out[INNER_BUILDS] = clock_out[INNER_BUILDS] + 1
            clock_out[LATEST_BUILD] = clock_out[STEPS_DONE]
            clock_out[BEYOND_LISTS] = 0
        else:
            clock_out[RUN] = 0

    @kernel
    def adopt_history(
        first: int, of_new_list: wp.array3d(dtype=real), clock: wp.array(dtype=wp.int32), history_out: wp.array3d(dtype=real)
    ):  # fmt: skip
        """The contact history of the new list, where the launches of the step expect it."""
        t = first + wp.tid()
        if t < clock[CONTACT_LANES]:
            p = t // wp.static(lanes)
            k = t % wp.static(lanes)
            for f in range(wp.static(history)):
                history_out[p, f, k] = of_new_list[p, f, k]

    found = agreed = None
    if ranks:

        @wp.func
        def was_taken(ahead: int, clock: wp.array(dtype=wp.int32)) -> bool:
            """Whether the step that began ``ahead`` steps from now was taken: none had ended the batch before."""
            return ahead < clock[STEPS_LEFT] and (clock[MOVED_AT] == 0 or clock[MOVED_AT] > ahead)

        @kernel
        def found(ahead: int, control: Control, report: Report, clock: wp.array(dtype=wp.int32)):
            """One thread: what was found in the step, which all ranks agree on; that a grain left is looked for again."""
            if not was_taken(ahead, clock):
                return
            bits = int(0)
            if clock[MOVED_AT] > 0:
                bits = wp.static(LEFT)
                if clock[BEYOND_LISTS] > 0:
                    bits = wp.static(BEYOND)
            if too_deep(report.extreme, 0, control.max_overlap):
                bits = bits | wp.static(TOO_DEEP)
            report.moved[0] = bits
            for k in range(wp.static(FLAGS.stop - FLAGS.start)):
                report.moved[wp.static(FLAGS.start) + k] = (bits >> k) & 1

        @kernel
        def agreed(ahead: int, report: Report, clock_out: wp.array(dtype=wp.int32)):
            """One thread: what was found on any rank, whose flags are the largest of all; it ends the batch after this step."""
            if not was_taken(ahead, clock_out):
                return
            bits = int(0)
            for k in range(wp.static(FLAGS.stop - FLAGS.start)):
                bits = bits | (report.moved[wp.static(FLAGS.start) + k] << k)
            report.moved[0] = bits
            clock_out[MOVED_AT] = wp.where(bits > 0, ahead + 1, 0)

    return KernelSet(
        pair_forces=pair_forces, wall_forces=wall_forces, move=move, advance_clock=advance_clock, resume=resume,
        check_capacity=check_capacity, adopt_history=adopt_history, add_wall_loads=add_wall_loads,
        advance_walls=advance_walls, found=found, agreed=agreed,
    )  # fmt: skip
