"""The step: forces at t_k, then the integrator takes the grains to t_k+1, over and over.

On a CPU one launch per thread runs many steps and meets the others at a barrier after each phase; on a GPU each phase is a
launch of a captured graph (``step/graph.py``). A scheme of several stages also evaluates the forces between, from the contact
history at the beginning of the step, and discards the history that these give. A run is left with the forces of its present
time evaluated, so reading results never computes anything again. It stops before a force call when a grain has moved further
than the lists allow (or is no longer finite); then new lists are built and the forces come first. A batch of steps also ends
at the force call in which an overlap exceeds the allowed one, so that this step does not depend on how a run is divided into
batches.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain
from warpdem.kernels.field import Numbers
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.measure.budget import Momenta, energies_type
from warpdem.kernels.measure.flow import Plane
from warpdem.kernels.step.barrier import meet
from warpdem.kernels.step.dynamic_walls import DynamicWalls
from warpdem.kernels.step.motion import LEFT
from warpdem.kernels.step.region import Regions
from warpdem.kernels.step.schedule import FrameRow, Placement, Row, gravity, kick_time, past_turn, slip_time
from warpdem.kernels.wall.surface import Surface

SPAN = 16  # numbers per thread in shared arrays: a cache line, so that threads do not disturb each other


@wp.func
def too_deep(extreme: wp.array(dtype=wp.float64), at: int, max_overlap: wp.array(dtype=wp.float64)) -> bool:
    """Whether the largest overlap ratio so far, of pairs or at walls, is above the allowed one [-]."""
    return wp.max(extreme[at], extreme[at + 2]) > max_overlap[0]


@wp.func_native("return false;")
def never() -> bool:
    """False, but not to Warp: what follows is translated, and its types checked, but nothing of it is compiled."""
    ...


@functools.cache
def build(
    pairs, evaluate_lane, sweep, lanes: int, evaluate_wall_contacts, sweep_walls, WallContacts, load, acceleration, travel,
    integrator, border, orientation, budget, flow, wear, dynamic, *,
    stages: int, spins: bool, walls: bool, leave: bool,
):  # fmt: skip
    """Return the CPU kernel ``run``, the readers, and what else is made of its phases.

    That is ``wall_forces_of_grain`` and ``move_phase`` for the GPU's step, and each phase alone (``pair_forces``,
    ``wall_forces``, ``move``), so that it can be timed.

    Args:
        pairs: namespace of ``pairs.build``.
        evaluate_lane: contact law of one lane, of ``thread_contact.build``.
        sweep: of ``contact.sweep.build``; None where the law is evaluated lane by lane.
        lanes: contacts per contact batch.
        evaluate_wall_contacts: of ``wall.evaluate.build``, for one grain, and ``WallContacts``, its struct.
        sweep_walls: of ``wall.sweep.build``, for many; None where they are evaluated one by one.
        load: sum over contacts, ``acceleration`` and ``travel`` of ``motion``.
        integrator: (advance, reading) of the scheme.
        border: periodic images, of ``border.build``.
        orientation: of ``orientation.build``; None when orientations are not requested.
        budget: namespace of ``budget.build`` when energies or momenta are added up, else None.
        flow: of ``flow.build``; None when the flow through no plane is asked for.
        wear: of ``wear.build``; None when what wears walls is not asked for.
        dynamic: namespace of ``dynamic_walls.build``; None where no wall moves by the load on it.
        stages: force calls per step.
        spins: grains spin.
        walls: there are walls.
        leave: grains may leave the domain.
    """
    advance, reading = integrator
    real = pairs.real
    g = grain.build(spins)
    vec6 = wp.types.vector(6, wp.float64)
    Inverse = wp.types.vector(2, wp.float64)
    Energies = energies_type(pairs.law.losses)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.struct
    class Grains:
        """State and constants per grain, in memory order."""

        record: wp.array(dtype=g.Record)
        inverse: wp.array(dtype=Inverse)
        kind: wp.array(dtype=wp.int32)
        orientation: wp.array(dtype=wp.vec4d)
        reference: wp.array2d(dtype=wp.vec3d)
        flight: wp.array(dtype=Flight)  # of size 0 when no grain is in flight
        row_start: wp.array(dtype=wp.int32)
        row: wp.array(dtype=pairs.PairForce)
        store: wp.array2d(dtype=wp.vec3d)  # what the integrator keeps between the stages of a step
        entry: wp.array(dtype=pairs.Entry)  # beside row, when energies are added up
        energies: wp.array(dtype=Energies)
        momenta: wp.array(dtype=Momenta)
        wall_work: wp.array2d(dtype=wp.float64)  # per grain and wall [J]
        flow: wp.array2d(dtype=wp.float64)  # per grain: mass [kg] and number through each plane
        exit: wp.array2d(dtype=wp.int32)  # per grain: 1 + number of the outlet that it left by in this batch, and the step

    @wp.struct
    class ContactBatches:
        """Grain-grain contacts in batches of SIMD lanes."""

        owner: wp.array2d(dtype=wp.int32)  # (batches, lanes)
        partner: wp.array2d(dtype=wp.int32)
        kind: wp.array2d(dtype=wp.int32)
        constants: wp.array3d(dtype=real)  # (batches, numbers, lanes)
        history: wp.array3d(dtype=real)
        trial: wp.array3d(dtype=real)  # history after a stage within the step; it is discarded
        slot_i: wp.array2d(dtype=wp.int32)
        slot_j: wp.array2d(dtype=wp.int32)

    @wp.struct
    class Control:
        """What the host hands to a batch of steps and gets back."""

        row: wp.array(dtype=Row)  # per force call
        frame: wp.array(dtype=FrameRow)  # per force call
        field: wp.array(dtype=Numbers)  # numbers of each external field
        placement: wp.array2d(dtype=Placement)
        origin: wp.array(dtype=wp.int32)  # step that the first row belongs to
        outlet: Regions  # where grains leave
        removes_in_step: wp.array(dtype=wp.int32)  # per outlet: 1 if the step itself removes a grain in it, 0 if the host does
        removed: wp.array(dtype=wp.int32)  # [1]: 1 when a step of this batch of steps removed a grain
        plane: wp.array(dtype=Plane)  # where their flow is measured
        wear: wp.array3d(dtype=wp.int64)  # [thread, sum of a feature, digit]: what wears walls
        wear_from: wp.array(dtype=wp.int32)  # [1]: first step that counts
        cutting: wp.array(dtype=wp.float64)  # [1]: K of Finnie's law [-]
        thread_ranges: wp.array2d(dtype=wp.int32)  # per thread: first and last contact batch, grain, grain at a wall
        moved: wp.array(dtype=wp.int32)
        extreme: wp.array(dtype=wp.float64)  # per thread: largest overlap ratio [-], approach speed [m/s], by pairs and walls
        max_overlap: wp.array(dtype=wp.float64)  # [1]: largest allowed overlap over the radius [-]
        done: wp.array(dtype=wp.int32)
        meeting: wp.array(dtype=wp.int32)
        wait_modes: wp.array(dtype=wp.uint64)  # how a thread waits at the barrier, of ``barrier.wait_modes``
        dynamic: DynamicWalls  # walls that move by the load on them

    @wp.func
    def pair_phase_by_lane(
        first: int, last: int, stride: int, row: Row, history_out: wp.array3d(dtype=real), grains: Grains,
        contacts: ContactBatches, control: Control, coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64,
        at: int,
    ):  # fmt: skip
        turn = pairs.cast_rotation(past_turn(row))
        overlap_ratio = control.extreme[at]
        approach = control.extreme[at + 1]
        for p in range(first, last, stride):
            for k in range(wp.static(lanes)):
                a, b = evaluate_lane(
                    p, k, grains.record, contacts.owner, contacts.partner, grains.inverse, contacts.kind, coefficients,
                    turn, slip_time(row), dt, contacts.history, contacts.slot_i, contacts.slot_j, history_out, grains.row,
                    grains.entry,
                )  # fmt: skip
                overlap_ratio = wp.max(overlap_ratio, a)
                approach = wp.max(approach, b)
        control.extreme[at] = overlap_ratio
        control.extreme[at + 1] = approach

    @wp.func
    def pair_phase(
        first: int, last: int, stride: int, s: int, stage: int, grains: Grains, contacts: ContactBatches,
        control: Control, coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64, at: int,
    ):  # fmt: skip
        row = control.row[s * wp.static(stages) + stage]
        history_out = contacts.history
        if stage > 0:
            history_out = contacts.trial
        if wp.static(sweep is not None):
            sweep(
                first, last, stride, grains.record, contacts.owner, contacts.partner, contacts.constants, contacts.kind,
                coefficients, pairs.cast_rotation(past_turn(row)), slip_time(row), dt, contacts.history, contacts.slot_i,
                contacts.slot_j, history_out, grains.row, grains.entry, control.extreme, at,
            )  # fmt: skip
            if never():
                pair_phase_by_lane(
                    first, last, stride, row, history_out, grains, contacts, control, coefficients, dt, at
                )
        else:
            pair_phase_by_lane(first, last, stride, row, history_out, grains, contacts, control, coefficients, dt, at)

    @wp.func
    def wall_rows(s: int, stage: int, parity: int):
        """Rows of the placements before and now; generations of the contact points that are read and written."""
        now_row = (s + 1) * wp.static(stages) + stage
        before_row = now_row - wp.static(stages)
        old = 1 - parity
        new = int(parity)
        if stage > 0:
            before_row = now_row - stage
            old = parity
            new = 2
        return before_row, now_row, old, new

    @wp.func
    def wall_forces_of_grain(
        r: int, s: int, stage: int, grains: Grains, wall_contacts: WallContacts, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64,
    ):  # fmt: skip
        """Wall contacts of grain number ``r`` of those at walls, at the force call ``stage`` of step ``s``."""
        before_row, now_row, old, new = wall_rows(s, stage, parity)
        a, b = evaluate_wall_contacts(
            r, grains.record, grains.inverse, grains.kind, materials, coefficients, surface, wall_contacts,
            control.placement, before_row, now_row, control.row[s * wp.static(stages) + stage], old, new, dt,
        )  # fmt: skip
        return a, b

    @wp.func
    def wall_phase(
        first: int, last: int, stride: int, s: int, stage: int, grains: Grains, wall_contacts: WallContacts,
        surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64, at: int,
    ):  # fmt: skip
        if wp.static(sweep_walls is not None):
            before_row, now_row, old, new = wall_rows(s, stage, parity)
            sweep_walls(
                first, last, stride, grains.record, grains.inverse, grains.kind, materials, coefficients, surface,
                wall_contacts, control.placement, before_row, now_row, control.row[s * wp.static(stages) + stage], old, new,
                dt, control.extreme, at + 2,
            )  # fmt: skip
        else:
            overlap_ratio = control.extreme[at + 2]
            approach = control.extreme[at + 3]
            for r in range(first, last, stride):
                a, b = wall_forces_of_grain(
                    r, s, stage, grains, wall_contacts, surface, control, coefficients, materials, parity, dt
                )
                overlap_ratio = wp.max(overlap_ratio, a)
                approach = wp.max(approach, b)
            control.extreme[at + 2] = overlap_ratio
            control.extreme[at + 3] = approach

    @wp.func
    def add_to_budget(
        i: int, state: g.Record, total: vec6, v: wp.vec3d, w: wp.vec3d, weight: wp.float64, row: Row, call: int,
        grains: Grains, wall_contacts: WallContacts, control: Control, dt: wp.float64,
    ):  # fmt: skip
        """Add work and impulse of grain ``i`` over ``weight`` [s] to its budgets; momenta turn to the axes of the next call."""
        mass = wp.float64(1.0) / grains.inverse[i][0]
        if wp.static(budget.energy):
            grains.energies[i] = grains.energies[i] + budget.energies(
                i, state, v, w, mass, weight, grains.row_start, grains.entry, wall_contacts.candidates,
                wall_contacts.entry, control.frame,
                call, dt, control.field,
            )  # fmt: skip
            if wp.static(walls):
                budget.wall_works(i, weight, wall_contacts.candidates, wall_contacts.power, grains.wall_work)
        if wp.static(budget.momentum):
            given = budget.momenta(
                i, state, total, mass, weight, row, wall_contacts.candidates, wall_contacts.load, control.frame, call, dt,
                control.field,
            )  # fmt: skip
            grains.momenta[i] = budget.turned(grains.momenta[i] + given, row)

    @wp.func
    def add_image_shift(i: int, state: g.Record, shift: wp.vec3d, row: Row, grains: Grains):
        """Add what a shift by ``shift`` [m] to another periodic image changes in the budgets."""
        mass = wp.float64(1.0) / grains.inverse[i][0]
        if wp.static(budget.energy):
            grains.energies[i] = grains.energies[i] + budget.lifted(shift, gravity(row) * mass)
        if wp.static(budget.momentum):
            grains.momenta[i] = grains.momenta[i] + budget.shifted(shift, g.velocity(state) * mass)

    @wp.func
    def leave_domain(i: int, s: int, grains: Grains, wall_contacts: WallContacts, control: Control) -> bool:
        """Whether grain ``i``, which is in an outlet after step ``s``, is removed from the domain in this step.

        It keeps its slot in the lists and touches nothing there. The host counts it at the end of the batch of steps.
        """
        state = grains.record[i]
        number = travel.outlet_of(
            g.position(state), control.outlet, control.placement, (s + 2) * wp.static(stages)
        )
        if control.removes_in_step[number] == 0:
            return False
        grains.record[i] = g.removed(state, i)
        grains.exit[i, 0] = number + 1
        grains.exit[i, 1] = control.origin[0] + s + 1
        control.removed[0] = 1
        if grains.flight.shape[0] > 0:
            path = grains.flight[i]
            path[11] = wp.float64(-1.0)
            grains.flight[i] = path
        if wp.static(walls):
            wall_contacts.candidates[i] = 0
            for generation in range(wall_contacts.place_count.shape[0]):
                wall_contacts.place_count[generation, i] = 0
        return True

    @wp.func
    def move_phase(
        first: int, last: int, stride: int, s: int, stage: int, grains: Grains, wall_contacts: WallContacts,
        control: Control,
        dt: wp.float64, max_displacement: wp.float64, thread: int,
    ) -> int:  # fmt: skip
        call = s * wp.static(stages) + stage
        row = control.row[call]
        moved = int(0)
        for i in range(first, last, stride):
            if wp.static(leave):
                if g.gone(grains.record[i]):
                    continue
            total = load(i, grains.row_start, grains.row, wall_contacts.candidates, wall_contacts.load)
            state = grains.record[i]
            a, b = acceleration(state, total, grains.inverse[i], row, control.frame, call, dt, control.field)
            if wp.static(budget is not None):
                v, w = reading(state, a, b, row, control.frame, call, dt)
                add_to_budget(i, state, total, v, w, kick_time(row), row, call, grains, wall_contacts, control, dt)
            if wp.static(wear is not None):
                if wall_contacts.candidates[i] > 0 and control.origin[0] + s >= control.wear_from[0]:
                    here, spinning = reading(state, a, b, row, control.frame, call, dt)
                    wear(
                        i, (control.origin[0] + s) & 1, state, here, spinning, wp.float64(1.0) / grains.inverse[i][0],
                        kick_time(row), wall_contacts, control.cutting, thread, control.wear,
                    )  # fmt: skip
            before = g.position(state)
            state = advance(stage, i, state, a, b, row, control.frame, call, dt, grains.store)
            if wp.static(flow is not None):
                flow(
                    i, before, g.position(state), wp.float64(1.0) / grains.inverse[i][0], control.plane, control.frame, call,
                    call + 1, grains.flow,
                )  # fmt: skip
            if wp.static(border.images > 1):
                if stage == wp.static(stages - 1):
                    inside = border.wrapped(g.position(state))
                    if wp.static(budget is not None):
                        add_image_shift(i, state, inside - g.position(state), row, grains)
                    state = g.placed(state, inside)
            grains.record[i] = state
            if wp.static(orientation is not None):
                if stage == wp.static(stages - 1):
                    grains.orientation[i] = orientation(grains.orientation[i], g.spin(state), row, dt)
            if stage == wp.static(stages - 1):
                far = travel.travelled(
                    i, state, grains.reference, grains.flight, control.placement, control.outlet, control.origin,
                    (s + 2) * wp.static(stages), dt, max_displacement,
                )  # fmt: skip
                if wp.static(leave):
                    if (far & wp.static(LEFT)) > 0:
                        if leave_domain(i, s, grains, wall_contacts, control):
                            far = 0
                moved = moved | far
        return moved

    @wp.func
    def force_phase(
        thread: int, s: int, stage: int, grains: Grains, contacts: ContactBatches, wall_contacts: WallContacts,
        surface: Surface,
        control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64, at: int,
    ):  # fmt: skip
        """A thread's part of the force call ``stage`` of step ``s``."""
        pair_phase(
            control.thread_ranges[thread, 0], control.thread_ranges[thread, 1], 1, s, stage, grains, contacts, control,
            coefficients, dt, at,
        )  # fmt: skip
        if wp.static(walls):
            wall_phase(
                control.thread_ranges[thread, 4], control.thread_ranges[thread, 5], 1, s, stage, grains, wall_contacts,
                surface, control,
                coefficients, materials, parity, dt, at,
            )  # fmt: skip

    @kernel
    def run(
        thread: int,
        threads: int,
        base: int,  # row of the present step
        count: int,
        forces_first: int,
        hold: int,  # 1: leave the forces after the last step to the next call
        parity: int,  # of the present step
        grains: Grains,
        contacts: ContactBatches,
        wall_contacts: WallContacts,
        surface: Surface,
        control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients),
        materials: int,
        dt: wp.float64,
        max_displacement: wp.float64,
    ):
        at = thread * wp.static(SPAN)
        target = int(0)
        stop = int(0)
        for s in range(count + 1):
            if stop == 0:
                if s > 0:
                    if wp.static(dynamic is not None):
                        dynamic.add_loads(
                            thread, control.thread_ranges[thread, 4], control.thread_ranges[thread, 5], grains.record,
                            grains.inverse, wall_contacts, control.placement, base + s, (parity + s - 1) & 1, control.dynamic,
                        )  # fmt: skip
                        if threads > 1:
                            target += threads
                            meet(control.meeting, target, control.wait_modes)
                        if thread == 0:
                            dynamic.advance(
                                threads, base + s - 1, control.row, control.placement, dt, control.dynamic
                            )
                        if threads > 1:
                            target += threads
                            meet(control.meeting, target, control.wait_modes)
                    moved = int(0)
                    for stage in range(wp.static(stages)):
                        moved = move_phase(
                            control.thread_ranges[thread, 2], control.thread_ranges[thread, 3], 1, base + s - 1,
                            stage, grains, wall_contacts,
                            control, dt, max_displacement, thread,
                        )  # fmt: skip
                        if wp.static(stages > 1):
                            if stage < wp.static(stages - 1):
                                if threads > 1:
                                    target += threads
                                    meet(control.meeting, target, control.wait_modes)
                                force_phase(
                                    thread, base + s - 1, stage + 1, grains, contacts, wall_contacts, surface, control,
                                    coefficients,
                                    materials, (parity + s - 1) & 1, dt, at,
                                )  # fmt: skip
                                if threads > 1:
                                    target += threads
                                    meet(control.meeting, target, control.wait_modes)
                    control.moved[at] = moved
                    if threads > 1:
                        target += threads
                        meet(control.meeting, target, control.wait_modes)
                    for t in range(threads):
                        stop = stop | control.moved[t * wp.static(SPAN)]
                if thread == 0:
                    control.done[0] = s
                if stop == 0 and (s > 0 or forces_first == 1) and (s < count or hold == 0):
                    force_phase(
                        thread, base + s, 0, grains, contacts, wall_contacts, surface, control, coefficients, materials,
                        (parity + s) & 1, dt, at,
                    )  # fmt: skip
                    if threads > 1:
                        target += threads
                        meet(control.meeting, target, control.wait_modes)
                    for t in range(threads):
                        if too_deep(control.extreme, t * wp.static(SPAN), control.max_overlap):
                            stop = 1

    @kernel
    def pair_forces(
        stride: int, last: int, s: int, stage: int, grains: Grains, contacts: ContactBatches, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        pair_phase(t, last, stride, s, stage, grains, contacts, control, coefficients, dt, t * wp.static(SPAN))

    @kernel
    def wall_forces(
        stride: int, last: int, s: int, stage: int, grains: Grains, wall_contacts: WallContacts, surface: Surface,
        control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        wall_phase(
            t, last, stride, s, stage, grains, wall_contacts, surface, control, coefficients, materials, parity, dt,
            t * wp.static(SPAN),
        )  # fmt: skip

    @kernel
    def move(
        stride: int, last: int, s: int, stage: int, grains: Grains, wall_contacts: WallContacts, control: Control,
        dt: wp.float64,
        max_displacement: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        control.moved[t * wp.static(SPAN)] = move_phase(
            t, last, stride, s, stage, grains, wall_contacts, control, dt, max_displacement, t
        )

    @kernel
    def read(
        s: int, grains: Grains, wall_contacts: WallContacts, control: Control, dt: wp.float64,
        load_out: wp.array(dtype=vec6),
        velocity_out: wp.array(dtype=wp.vec3d), spin_out: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        """Contact force [N] and torque [N m], velocity and spin of each grain at the present instant, step ``s``."""
        i = wp.tid()
        call = s * wp.static(stages)
        total = load(i, grains.row_start, grains.row, wall_contacts.candidates, wall_contacts.load)
        row = control.row[call]
        state = grains.record[i]
        a, b = acceleration(state, total, grains.inverse[i], row, control.frame, call, dt, control.field)
        v, w = reading(state, a, b, row, control.frame, call, dt)
        load_out[i] = total
        velocity_out[i] = v
        spin_out[i] = w

    read_budget = None
    if budget is not None:

        @kernel
        def read_budget(
            s: int, grains: Grains, wall_contacts: WallContacts, control: Control, dt: wp.float64,
            energies_out: wp.array(dtype=Energies),
            momenta_out: wp.array(dtype=Momenta), wall_work_out: wp.array2d(dtype=wp.float64),
        ):  # fmt: skip
            """Budgets of each grain up to the present time, step ``s``; the present forces count for half a step."""
            i = wp.tid()
            row = control.row[s]
            total = load(i, grains.row_start, grains.row, wall_contacts.candidates, wall_contacts.load)
            state = grains.record[i]
            mass = wp.float64(1.0) / grains.inverse[i][0]
            a, b = acceleration(state, total, grains.inverse[i], row, control.frame, s, dt, control.field)
            v, w = reading(state, a, b, row, control.frame, s, dt)
            half = kick_time(row) - wp.float64(0.5) * dt
            if wp.static(budget.energy):
                energies_out[i] = grains.energies[i] + budget.energies(
                    i, state, v, w, mass, half, grains.row_start, grains.entry, wall_contacts.candidates,
                    wall_contacts.entry, control.frame,
                    s, dt, control.field,
                )  # fmt: skip
                for wall in range(grains.wall_work.shape[1]):
                    wall_work_out[i, wall] = grains.wall_work[i, wall]
                if wp.static(walls):
                    budget.wall_works(i, half, wall_contacts.candidates, wall_contacts.power, wall_work_out)
            if wp.static(budget.momentum):
                momenta_out[i] = grains.momenta[i] + budget.momenta(
                    i, state, total, mass, half, row, wall_contacts.candidates, wall_contacts.load, control.frame, s, dt,
                    control.field,
                )  # fmt: skip

    return Built(
        run=run, read_budget=read_budget, pair_forces=pair_forces, wall_forces=wall_forces, move=move, read=read,
        wall_forces_of_grain=wall_forces_of_grain, move_phase=move_phase, Grains=Grains,
        ContactBatches=ContactBatches, Control=Control, Energies=Energies,
    )  # fmt: skip
