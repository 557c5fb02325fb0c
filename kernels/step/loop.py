"""The step: forces at t_k, then the integrator takes the grains to t_k+1, over and over.

On a CPU one launch per thread runs many steps and meets the others at a barrier after each phase; on a GPU each phase is a
launch of a captured graph (``resident``). A scheme of several stages calls the forces between as well, from the memory of the
step's beginning, and drops what they make of it. A run rests with the forces of its instant evaluated, so reading results
never computes anything again. It stops before a force call when a grain has moved by more than the lists allow (or is no
longer finite); then new lists are made and the forces come first. A batch also ends at the force call in which an overlap
exceeds the allowed one, so that the step of that does not depend on how a run is divided into batches.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain
from warpdem.kernels.contact.pairs import BLOCK
from warpdem.kernels.field import Numbers
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.measure.budget import Energies, Momenta
from warpdem.kernels.measure.flow import Plane
from warpdem.kernels.step.barrier import meet
from warpdem.kernels.step.motion import LEFT, Box
from warpdem.kernels.step.schedule import FrameRow, Placement, Row, gravity, kick_time, past_turn, slip_time
from warpdem.kernels.wall.surface import Surface

AHEAD = 6  # packs between the prefetch of a contact batch and its use
SPAN = 16  # numbers per thread in shared arrays: a cache line, so that threads do not disturb each other


@wp.func
def too_deep(extreme: wp.array(dtype=wp.float64), at: int, deepest: wp.array(dtype=wp.float64)) -> bool:
    """Whether the largest overlap so far, of pairs or at walls, is over the one allowed [-]."""
    return wp.max(extreme[at], extreme[at + 2]) > deepest[0]


@functools.cache
def build(
    pairs, touch, Rows, load, acceleration, travel, integrator, border, orientation, budget, flow, *, stages: int,
    spins: bool, walls: bool, leave: bool,
):  # fmt: skip
    """Return the CPU kernel ``run``, the readers, and what else is made of its phases.

    That is ``touch_row`` and ``move_phase`` for the GPU's step, and each phase alone (``pair_forces``, ``wall_forces``,
    ``move``), so that it can be timed.

    Args:
        pairs: namespace of ``pairs.build``.
        touch: wall function of ``wall.contact.build``, and ``Rows``, its struct.
        load: sum over contacts, ``acceleration`` and ``travel`` of ``motion``.
        integrator: (advance, reading) of the scheme.
        border: periodic images, of ``border.build``.
        orientation: of ``orientation.build``; None when nobody asks how grains are turned.
        budget: namespace of ``budget.build`` when energies or momenta are added up, else None.
        flow: of ``flow.build``; None when the flow through no plane is asked for.
        stages: force calls per step.
        spins: grains spin.
        walls: there are wall rows.
        leave: grains may leave the domain.
    """
    advance, reading = integrator
    g = grain.build(spins)
    vec6 = wp.types.vector(6, wp.float64)
    Inverse = wp.types.vector(2, wp.float64)
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
        row: wp.array(dtype=pairs.Share)
        store: wp.array2d(dtype=wp.vec3d)  # what the integrator keeps between the stages of a step
        entry: wp.array(dtype=pairs.Entry)  # beside row, when energies are added up
        energies: wp.array(dtype=Energies)
        momenta: wp.array(dtype=Momenta)
        wall_work: wp.array2d(dtype=wp.float64)  # per grain and wall [J]
        flow: wp.array2d(dtype=wp.float64)  # per grain: mass [kg] and number through each plane
        exit: wp.array2d(dtype=wp.int32)  # per grain: 1 + number of the outlet that it left by in this batch, and the step

    @wp.struct
    class Packs:
        """Grain-grain contacts in packs."""

        owner: wp.array(dtype=pairs.LaneInt)
        partner: wp.array(dtype=pairs.LaneInt)
        kind: wp.array(dtype=pairs.LaneInt)
        constants: wp.array2d(dtype=pairs.Lane)
        memory: wp.array2d(dtype=pairs.Lane)
        trial: wp.array2d(dtype=pairs.Lane)  # what a stage within the step makes of the memory, and is dropped
        slot_i: wp.array(dtype=pairs.LaneInt)
        slot_j: wp.array(dtype=pairs.LaneInt)

    @wp.struct
    class Control:
        """What the host hands to a batch of steps and gets back."""

        row: wp.array(dtype=Row)  # per force call
        frame: wp.array(dtype=FrameRow)  # per force call
        field: wp.array(dtype=Numbers)  # numbers of each external field
        placement: wp.array2d(dtype=Placement)
        origin: wp.array(dtype=wp.int32)  # step that the first row belongs to
        outlet: wp.array(dtype=Box)  # where grains leave
        parks: wp.array(dtype=wp.int32)  # per outlet: 1 when the step goes on without a grain that left by it, 0: the host asks
        parked: wp.array(dtype=wp.int32)  # [1]: 1 when a grain has left so in this batch
        plane: wp.array(dtype=Plane)  # where their flow is measured
        share: wp.array2d(dtype=wp.int32)  # per thread: first and last pack, grain, wall row
        moved: wp.array(dtype=wp.int32)
        extreme: wp.array(dtype=wp.float64)  # per thread: largest overlap share [-], approach speed [m/s], by pairs and walls
        deepest: wp.array(dtype=wp.float64)  # [1]: largest overlap over the radius that is allowed [-]
        scratch: wp.array2d(dtype=pairs.Lane)  # per thread: results of a block of packs
        done: wp.array(dtype=wp.int32)
        meeting: wp.array(dtype=wp.int32)
        ways: wp.array(dtype=wp.uint64)  # to wait for the others

    @wp.func
    def pair_phase(
        first: int, last: int, stride: int, s: int, stage: int, grains: Grains, packs: Packs, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64, at: int,
    ):  # fmt: skip
        state = control.row[s * wp.static(stages) + stage]
        memory = packs.memory
        if stage > 0:
            memory = packs.trial
        turn = pairs.cast_rotation(past_turn(state))
        slip_dt = slip_time(state)
        share = control.extreme[at]
        approach = control.extreme[at + 1]
        scratch = (at // wp.static(SPAN)) * wp.static(BLOCK)
        for block in range(first, last, stride * wp.static(BLOCK)):
            end = wp.min(block + stride * wp.static(BLOCK), last)
            row = int(scratch)
            for p in range(block, end, stride):
                pairs.prefetch(
                    wp.min(p + wp.static(AHEAD), last - 1), grains.record, packs.partner, packs.slot_i, packs.slot_j,
                    grains.row,
                )  # fmt: skip
                a, b = pairs.pack(
                    p, grains.record, packs.owner, packs.partner, packs.constants, packs.kind, coefficients, turn,
                    slip_dt, dt, packs.memory, memory, control.scratch, row, packs.slot_i, packs.slot_j, grains.entry,
                )  # fmt: skip
                row += 1
                share = wp.max(share, a)
                approach = wp.max(approach, b)
            row = scratch
            for p in range(block, end, stride):
                pairs.share(p, control.scratch, row, packs.slot_i, packs.slot_j, grains.row)
                row += 1
        control.extreme[at] = share
        control.extreme[at + 1] = approach

    @wp.func
    def touch_row(
        r: int, s: int, stage: int, grains: Grains, rows: Rows, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64,
    ):  # fmt: skip
        """Wall contacts of row ``r`` at the force call ``stage`` of step ``s``."""
        now_row = (s + 1) * wp.static(stages) + stage
        before_row = now_row - wp.static(stages)
        old = 1 - parity
        new = parity
        if stage > 0:
            before_row = now_row - stage
            old = parity
            new = 2
        a, b = touch(
            r, grains.record, grains.inverse, grains.kind, materials, coefficients, surface, rows, control.placement,
            before_row, now_row, control.row[s * wp.static(stages) + stage], old, new, dt,
        )  # fmt: skip
        return a, b

    @wp.func
    def wall_phase(
        first: int, last: int, stride: int, s: int, stage: int, grains: Grains, rows: Rows, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64, at: int,
    ):  # fmt: skip
        share = control.extreme[at + 2]
        approach = control.extreme[at + 3]
        for r in range(first, last, stride):
            a, b = touch_row(r, s, stage, grains, rows, surface, control, coefficients, materials, parity, dt)
            share = wp.max(share, a)
            approach = wp.max(approach, b)
        control.extreme[at + 2] = share
        control.extreme[at + 3] = approach

    @wp.func
    def book(
        i: int, state: g.Record, total: vec6, v: wp.vec3d, w: wp.vec3d, weight: wp.float64, row: Row, call: int,
        grains: Grains, rows: Rows, control: Control, dt: wp.float64,
    ):  # fmt: skip
        """Add what acts on grain ``i`` at this instant for ``weight`` [s]; momenta are turned to the axes of the next one."""
        mass = wp.float64(1.0) / grains.inverse[i][0]
        if wp.static(budget.energy):
            grains.energies[i] = grains.energies[i] + budget.energies(
                i, state, v, w, mass, weight, grains.row_start, grains.entry, rows.candidates, rows.entry, control.frame,
                call, dt, control.field,
            )  # fmt: skip
            if wp.static(walls):
                budget.wall_works(i, weight, rows.candidates, rows.power, grains.wall_work)
        if wp.static(budget.momentum):
            given = budget.momenta(
                i, state, total, mass, weight, row, rows.candidates, rows.load, control.frame, call, dt, control.field
            )
            grains.momenta[i] = budget.turned(grains.momenta[i] + given, row)

    @wp.func
    def carry(i: int, state: g.Record, way: wp.vec3d, row: Row, grains: Grains):
        """Add what a shift by ``way`` [m] to another periodic image changes."""
        mass = wp.float64(1.0) / grains.inverse[i][0]
        if wp.static(budget.energy):
            grains.energies[i] = grains.energies[i] + budget.lifted(way, gravity(row) * mass)
        if wp.static(budget.momentum):
            grains.momenta[i] = grains.momenta[i] + budget.shifted(way, g.velocity(state) * mass)

    @wp.func
    def leave_domain(i: int, s: int, grains: Grains, rows: Rows, control: Control) -> bool:
        """Whether grain ``i``, which is in an outlet after step ``s``, is put out of the domain here and now.

        It keeps its slot in the lists, where it meets nobody. The host counts it when the batch is done.
        """
        state = grains.record[i]
        number = travel.outlet_of(g.position(state), control.outlet)
        if control.parks[number] == 0:
            return False
        grains.record[i] = g.parked(state, i)
        grains.exit[i, 0] = number + 1
        grains.exit[i, 1] = control.origin[0] + s + 1
        control.parked[0] = 1
        if grains.flight.shape[0] > 0:
            path = grains.flight[i]
            path[11] = wp.float64(-1.0)
            grains.flight[i] = path
        if wp.static(walls):
            rows.candidates[i] = 0
            for generation in range(rows.place_count.shape[0]):
                rows.place_count[generation, i] = 0
        return True

    @wp.func
    def move_phase(
        first: int, last: int, stride: int, s: int, stage: int, grains: Grains, rows: Rows, control: Control,
        dt: wp.float64, reach: wp.float64,
    ) -> int:  # fmt: skip
        call = s * wp.static(stages) + stage
        row = control.row[call]
        moved = int(0)
        for i in range(first, last, stride):
            if wp.static(leave):
                if g.gone(grains.record[i]):
                    continue
            total = load(i, grains.row_start, grains.row, rows.candidates, rows.load)
            state = grains.record[i]
            a, b = acceleration(state, total, grains.inverse[i], row, control.frame, call, dt, control.field)
            if wp.static(budget is not None):
                v, w = reading(state, a, b, row, control.frame, call, dt)
                book(i, state, total, v, w, kick_time(row), row, call, grains, rows, control, dt)
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
                        carry(i, state, inside - g.position(state), row, grains)
                    state = g.placed(state, inside)
            grains.record[i] = state
            if wp.static(orientation is not None):
                if stage == wp.static(stages - 1):
                    grains.orientation[i] = orientation(grains.orientation[i], g.spin(state), row, dt)
            if stage == wp.static(stages - 1):
                far = travel.travelled(
                    i, state, grains.reference, grains.flight, control.placement, control.outlet, control.origin,
                    (s + 2) * wp.static(stages), dt, reach,
                )  # fmt: skip
                if wp.static(leave):
                    if (far & wp.static(LEFT)) > 0:
                        if leave_domain(i, s, grains, rows, control):
                            far = 0
                moved = moved | far
        return moved

    @wp.func
    def force_phase(
        thread: int, s: int, stage: int, grains: Grains, packs: Packs, rows: Rows, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64, at: int,
    ):  # fmt: skip
        """A thread's part of the force call ``stage`` of step ``s``."""
        pair_phase(
            control.share[thread, 0], control.share[thread, 1], 1, s, stage, grains, packs, control, coefficients, dt, at
        )
        if wp.static(walls):
            wall_phase(
                control.share[thread, 4], control.share[thread, 5], 1, s, stage, grains, rows, surface, control,
                coefficients, materials, parity, dt, at,
            )  # fmt: skip

    @kernel
    def run(
        thread: int,
        threads: int,
        base: int,  # row of the present step
        count: int,
        forces_first: int,
        hold: int,  # 1: leave the forces of the last step to the next call
        parity: int,  # of the present step
        grains: Grains,
        packs: Packs,
        rows: Rows,
        surface: Surface,
        control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients),
        materials: int,
        dt: wp.float64,
        reach: wp.float64,
    ):
        at = thread * wp.static(SPAN)
        target = int(0)
        stop = int(0)
        for s in range(count + 1):
            if stop == 0:
                if s > 0:
                    moved = int(0)
                    for stage in range(wp.static(stages)):
                        moved = move_phase(
                            control.share[thread, 2], control.share[thread, 3], 1, base + s - 1, stage, grains, rows,
                            control, dt, reach,
                        )  # fmt: skip
                        if wp.static(stages > 1):
                            if stage < wp.static(stages - 1):
                                if threads > 1:
                                    target += threads
                                    meet(control.meeting, target, control.ways)
                                force_phase(
                                    thread, base + s - 1, stage + 1, grains, packs, rows, surface, control, coefficients,
                                    materials, (parity + s - 1) & 1, dt, at,
                                )  # fmt: skip
                                if threads > 1:
                                    target += threads
                                    meet(control.meeting, target, control.ways)
                    control.moved[at] = moved
                    if threads > 1:
                        target += threads
                        meet(control.meeting, target, control.ways)
                    for t in range(threads):
                        stop = stop | control.moved[t * wp.static(SPAN)]
                if thread == 0:
                    control.done[0] = s
                if stop == 0 and (s > 0 or forces_first == 1) and (s < count or hold == 0):
                    force_phase(
                        thread, base + s, 0, grains, packs, rows, surface, control, coefficients, materials,
                        (parity + s) & 1, dt, at,
                    )  # fmt: skip
                    if threads > 1:
                        target += threads
                        meet(control.meeting, target, control.ways)
                    for t in range(threads):
                        if too_deep(control.extreme, t * wp.static(SPAN), control.deepest):
                            stop = 1

    @kernel
    def pair_forces(
        stride: int, last: int, s: int, stage: int, grains: Grains, packs: Packs, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        pair_phase(t, last, stride, s, stage, grains, packs, control, coefficients, dt, t * wp.static(SPAN))

    @kernel
    def wall_forces(
        stride: int, last: int, s: int, stage: int, grains: Grains, rows: Rows, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        wall_phase(
            t, last, stride, s, stage, grains, rows, surface, control, coefficients, materials, parity, dt,
            t * wp.static(SPAN),
        )  # fmt: skip

    @kernel
    def move(
        stride: int, last: int, s: int, stage: int, grains: Grains, rows: Rows, control: Control, dt: wp.float64,
        reach: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        control.moved[t * wp.static(SPAN)] = move_phase(
            t, last, stride, s, stage, grains, rows, control, dt, reach
        )

    @kernel
    def read(
        s: int, grains: Grains, rows: Rows, control: Control, dt: wp.float64, load_out: wp.array(dtype=vec6),
        velocity_out: wp.array(dtype=wp.vec3d), spin_out: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        """Contact force [N] and torque [N m], velocity and spin of each grain at the present instant, step ``s``."""
        i = wp.tid()
        call = s * wp.static(stages)
        total = load(i, grains.row_start, grains.row, rows.candidates, rows.load)
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
            s: int, grains: Grains, rows: Rows, control: Control, dt: wp.float64, energies_out: wp.array(dtype=Energies),
            momenta_out: wp.array(dtype=Momenta), wall_work_out: wp.array2d(dtype=wp.float64),
        ):  # fmt: skip
            """What has been added up of each grain up to the present instant, step ``s``: its forces have half a step of it."""
            i = wp.tid()
            row = control.row[s]
            total = load(i, grains.row_start, grains.row, rows.candidates, rows.load)
            state = grains.record[i]
            mass = wp.float64(1.0) / grains.inverse[i][0]
            a, b = acceleration(state, total, grains.inverse[i], row, control.frame, s, dt, control.field)
            v, w = reading(state, a, b, row, control.frame, s, dt)
            half = kick_time(row) - wp.float64(0.5) * dt
            if wp.static(budget.energy):
                energies_out[i] = grains.energies[i] + budget.energies(
                    i, state, v, w, mass, half, grains.row_start, grains.entry, rows.candidates, rows.entry, control.frame,
                    s, dt, control.field,
                )  # fmt: skip
                for wall in range(grains.wall_work.shape[1]):
                    wall_work_out[i, wall] = grains.wall_work[i, wall]
                if wp.static(walls):
                    budget.wall_works(i, half, rows.candidates, rows.power, wall_work_out)
            if wp.static(budget.momentum):
                momenta_out[i] = grains.momenta[i] + budget.momenta(
                    i, state, total, mass, half, row, rows.candidates, rows.load, control.frame, s, dt, control.field
                )

    return Built(
        run=run, read_budget=read_budget, pair_forces=pair_forces, wall_forces=wall_forces, move=move, read=read,
        touch_row=touch_row, move_phase=move_phase, Grains=Grains, Packs=Packs, Control=Control,
    )  # fmt: skip
