"""The motion of a step: what acts on a grain, kick and drift, and what follows from its new position.

In this order, for each grain that a thread takes: sum of its contact forces, acceleration, budgets, wear, the integrator's
stage, flow through planes, periodic image, orientation, displacement since the lists were built, outlets.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, clump, grain
from warpdem.kernels.contact.films import FILM_AT
from warpdem.kernels.step.motion import LEFT
from warpdem.kernels.step.motion_sweep import BLOCK
from warpdem.kernels.step.schedule import Row, gravity, kick_time
from warpdem.kernels.step.structs import SPAN, Control, Range, Report

vec6 = wp.types.vector(6, wp.float64)


@functools.cache
def build(
    structs, WallContacts, load, acceleration, travel, integrator, border, orientation, budget, flow, wear, clumps=None, *,
    stages: int, spins: bool, walls: bool, leave: bool, films=None, wetting=None, wet_load=None, sweep=None,
):  # fmt: skip
    """Return ``move_phase``.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: of ``wall.evaluate.build``.
        load: sum over contacts, ``acceleration`` and ``travel`` of ``motion``.
        integrator: (advance, reading) of the scheme.
        border: periodic images, of ``border.build``.
        orientation: of ``orientation.build``; None when orientations are not requested.
        budget: namespace of ``budget.build`` when energies or momenta are added up, else None.
        flow: of ``flow.build``; None when no flow through a plane is measured.
        wear: of ``wear.build``; None when wear is not measured.
        clumps: of ``clump_phase.build``; None without clumps.
        stages: force calls per step.
        spins: grains spin.
        walls: there are walls.
        leave: grains may leave the domain.
        films: of ``contact.films.build``, ``wetting`` of ``wall.films.build`` and ``wet_load`` of ``motion.build_wet_load``;
            None for a law without bridges.
        sweep: of ``motion_sweep.build``, the motion of several grains in SIMD lanes; None where they are moved one by one.
    """
    advance, reading = integrator
    g = grain.build(spins)
    Model, Grains = structs.Model, structs.Grains

    @wp.func
    def add_to_budget(
        i: int, state: g.Record, total: vec6, v: wp.vec3d, w: wp.vec3d, at: int, model: Model, grains: Grains,
        wall_contacts: WallContacts, control: Control,
    ):  # fmt: skip
        """Add work and impulse of grain ``i`` at the call in row ``at``; momenta turn to the axes of the next call."""
        row = control.row[at]
        weight = kick_time(row)
        if wp.static(budget.energy):
            if budget.acts(i, wall_contacts):
                grains.energies[i] = grains.energies[i] + budget.energies(
                    i, state, v, w, weight, at, model, grains, wall_contacts, control
                )
            if wp.static(walls):
                budget.wall_works(i, weight, wall_contacts, grains.wall_work)
        if wp.static(budget.momentum):
            given = budget.momenta(i, state, total, weight, at, model, grains, wall_contacts, control)
            grains.momenta[i] = budget.rotated(grains.momenta[i] + given, row)

    @wp.func
    def add_image_shift(i: int, state: g.Record, shift: wp.vec3d, row: Row, grains: Grains):
        """Add what a shift by ``shift`` [m] to another periodic image changes in the budgets."""
        mass = wp.float64(1.0) / grains.inverse[i][0]
        if wp.static(budget.energy):
            grains.energies[i] = grains.energies[i] + budget.lifted(shift, gravity(row) * mass)
        if wp.static(budget.momentum):
            grains.momenta[i] = grains.momenta[i] + budget.shifted(shift, g.velocity(state) * mass)

    @wp.func
    def remove(
        i: int, number: int, s: int, grains: Grains, wall_contacts: WallContacts, control: Control, report: Report
    ):  # fmt: skip
        """Take grain ``i``, which is in outlet ``number`` after step ``s``, out of the domain.

        It keeps its slot in the lists and touches nothing there. The host counts it at the end of the batch of steps.
        """
        grains.record[i] = g.removed(grains.record[i], i)
        grains.exit[i, 0] = number + 1
        grains.exit[i, 1] = control.origin[0] + s + 1
        report.removed[0] = 1
        if grains.flight.shape[0] > 0:
            path = grains.flight[i]
            path[11] = wp.float64(-1.0)
            grains.flight[i] = path
        if wp.static(walls):
            if wp.static(wetting is not None):
                wetting.give_all_back(i, (control.origin[0] + s) & 1, i, 0, wall_contacts, wall_contacts)
            wall_contacts.candidates[i] = 0
            for generation in range(wall_contacts.point_count.shape[0]):
                wall_contacts.point_count[generation, i] = 0

    @wp.func
    def leave_domain(
        first: int, count: int, q: wp.vec3d, s: int, grains: Grains, wall_contacts: WallContacts, control: Control,
        report: Report,
    ) -> bool:  # fmt: skip
        """Whether grain ``first``, or a clump with ``count`` members from there on, is removed from the domain in this step.

        Its centre ``q`` [m] is in an outlet after step ``s``.
        """
        number = travel.outlet_of(q, control.outlet, control.placement, (s + 2) * wp.static(stages))
        if control.removes_in_step[number] == 0:
            return False
        for i in range(first, first + count):
            remove(i, number, s, grains, wall_contacts, control, report)
        return True

    @wp.func
    def leads_clump(i: int, grains: Grains) -> bool:
        """Whether grain ``i`` is the first member of a clump that is there."""
        c = grains.clumps.of_grain[i]
        leads = bool(False)
        if c != wp.static(clump.NONE):
            leads = grains.clumps.first[c] == i
            if wp.static(leave):
                leads = leads and not g.is_removed(grains.record[i])
        return leads

    @wp.func
    def settle(
        c: int, far: int, s: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control, report: Report,
        inner_share: wp.float64,
    ) -> int:  # fmt: skip
        """After the motion of clump ``c``: as ``move_phase``. Where its centre is decides on outlets."""
        found = int(0)
        if far != 0:
            found = clumps.watch(c, s, model, grains, control, inner_share)
        if wp.static(leave):
            centre = g.position(grains.clumps.record[c])
            found = found | travel.left(centre, control.outlet, control.placement, s + 2)
            if (found & wp.static(LEFT)) > 0:
                first = grains.clumps.first[c]
                if leave_domain(first, grains.clumps.count[c], centre, s, grains, wall_contacts, control, report):
                    grains.clumps.record[c] = g.removed(grains.clumps.record[c], first)
                    found = 0
        return found

    @wp.func
    def move_clumps(
        part: Range, s: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control, report: Report,
        inner_share: wp.float64,
    ) -> int:  # fmt: skip
        """The clumps whose first member is among the grains ``part``: as ``move_phase``."""
        moved = int(0)
        if wp.static(clumps.sweep is not None):  # those of consecutive grains are consecutive
            end = clump.clumps_before(grains.clumps.first, part.last)
            for begin in range(clump.clumps_before(grains.clumps.first, part.first), end, wp.static(BLOCK)):
                block_end = wp.min(begin + wp.static(BLOCK), end)
                far = clumps.sweep(begin, block_end, control.row[s], model.dt, inner_share, wall_contacts, grains)
                if far != 0 or wp.static(leave or clumps.turns_marks):
                    if wp.static(clumps.turns_marks):
                        far = 1
                    for c in range(begin, block_end):
                        if leads_clump(grains.clumps.first[c], grains):
                            moved = moved | settle(
                                c, far, s, model, grains, wall_contacts, control, report, inner_share
                            )
        else:  # one loop after another: the long sums of several clumps overlap
            for i in range(part.first, part.last, part.stride):
                if leads_clump(i, grains):
                    clumps.advance(grains.clumps.of_grain[i], s, model, grains, control)
            for i in range(part.first, part.last, part.stride):
                if leads_clump(i, grains):
                    c = grains.clumps.of_grain[i]
                    clumps.write_members(c, grains, model.dt)
                    moved = moved | settle(c, 1, s, model, grains, wall_contacts, control, report, inner_share)
        return moved

    @wp.func
    def watch(
        i: int, state: g.Record, s: int, dt: wp.float64, grains: Grains, wall_contacts: WallContacts, control: Control,
        report: Report, inner_share: wp.float64,
    ) -> int:  # fmt: skip
        """BEYOND and LEFT of grain ``i`` after step ``s``; an outlet may remove it."""
        next_row = (s + 2) * wp.static(stages)
        far = travel.displaced(
            i, state, grains.reference, inner_share * grains.allowance[i], grains.flight, control.placement,
            control.origin, next_row, dt,
        )
        if wp.static(leave):
            far = far | travel.left(g.position(state), control.outlet, control.placement, next_row)
            if (far & wp.static(LEFT)) > 0:
                if leave_domain(i, 1, g.position(state), s, grains, wall_contacts, control, report):
                    far = 0
        return far

    @wp.func
    def move_in_lanes(
        part: Range, s: int, row: Row, dt: wp.float64, grains: Grains, wall_contacts: WallContacts, control: Control,
        report: Report, inner_share: wp.float64,
    ) -> int:  # fmt: skip
        """As ``move_phase``, by ``sweep``; what else there is to do is done grain by grain, while it is in the caches."""
        moved = int(0)
        for begin in range(part.first, part.last, wp.static(BLOCK)):
            end = wp.min(begin + wp.static(BLOCK), part.last)
            far = sweep(begin, end, row, dt, inner_share, wall_contacts, grains)
            if wp.static(orientation is not None) or wp.static(leave) or far != 0:
                for i in range(begin, end):
                    state = grains.record[i]
                    if wp.static(leave):
                        if g.is_removed(state):
                            continue
                    if wp.static(orientation is not None):
                        grains.orientation[i] = orientation(grains.orientation[i], g.spin(state), row, dt)
                    moved = moved | watch(i, state, s, dt, grains, wall_contacts, control, report, inner_share)
        return moved

    @wp.func
    def move_one_by_one(
        part: Range, s: int, stage: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control,
        report: Report, inner_share: wp.float64,
    ) -> int:  # fmt: skip
        """The grains and clumps of ``part`` one after another: as ``move_phase``."""
        at = s * wp.static(stages) + stage
        row = control.row[at]
        dt = model.dt
        moved = int(0)
        last = int(part.last)
        if wp.static(clumps is not None and not clumps.drives and films is None):
            if grains.clumps.spheres == 0:  # ``move_clumps`` does it all
                last = part.first
        for i in range(part.first, last, part.stride):
            total = vec6()
            if wp.static(films is not None):
                total, asked = wet_load(i, grains.slot_start, grains.slot_force)
                if asked > wp.float64(0.0) or grains.film[i, wp.static(FILM_AT.returned)] != wp.int64(0):
                    films.exchange(
                        i, grains.record[i][3], grains.slot_start[i], grains.slot_start[i + 1], model.most_from_film,
                        grains.slot_force, grains.film,
                    )  # fmt: skip
                if wp.static(walls):
                    if wall_contacts.candidates[i] > 0:
                        total += wall_contacts.load[i]
                        wetting.forget(i, 1 - ((control.origin[0] + s) & 1), wall_contacts)
            if wp.static(clumps is not None):
                c = grains.clumps.of_grain[i]
                if c != wp.static(clump.NONE):
                    if wp.static(clumps.drives):
                        if leads_clump(i, grains):
                            clumps.drive(c, s, model, grains, wall_contacts, control)
                    continue
            if wp.static(leave):
                if g.is_removed(grains.record[i]):
                    continue
            if wp.static(films is None):
                total = load(i, grains.slot_start, grains.slot_force, wall_contacts.candidates, wall_contacts.load)
            state = grains.record[i]
            a, b = acceleration(state, total, grains.inverse[i], row, control.frame, at, dt, control.field)
            if wp.static(budget is not None):
                v, w = reading(state, a, b, row, control.frame, at, dt)
                add_to_budget(i, state, total, v, w, at, model, grains, wall_contacts, control)
            if wp.static(wear is not None):
                if wall_contacts.candidates[i] > 0 and control.origin[0] + s >= control.wear_from[0]:
                    here, spinning = reading(state, a, b, row, control.frame, at, dt)
                    wear(
                        i, (control.origin[0] + s) & 1, state, here, spinning, wp.float64(1.0) / grains.inverse[i][0],
                        kick_time(row), wall_contacts, control.cutting, part.slot // wp.static(SPAN), report.wear,
                    )  # fmt: skip
            before = g.position(state)
            state = advance(stage, i, state, a, b, row, control.frame, at, dt, grains.store)
            if wp.static(flow is not None):
                flow(
                    i, before, g.position(state), wp.float64(1.0) / grains.inverse[i][0], control.plane, control.frame, at,
                    at + 1, grains.flow,
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
                moved = moved | watch(i, state, s, dt, grains, wall_contacts, control, report, inner_share)
        if wp.static(clumps is not None):
            moved = moved | move_clumps(part, s, model, grains, wall_contacts, control, report, inner_share)
        return moved

    @wp.func
    def move_phase(
        part: Range, s: int, stage: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control,
        report: Report, inner_share: wp.float64,
    ) -> int:  # fmt: skip
        """Stage ``stage`` of the step in row ``s``; BEYOND and LEFT of ``motion``, of all its grains together."""
        moved = int(0)
        if wp.static(sweep is not None):
            moved = move_in_lanes(part, s, control.row[s], model.dt, grains, wall_contacts, control, report, inner_share)
        else:
            moved = move_one_by_one(part, s, stage, model, grains, wall_contacts, control, report, inner_share)
        return moved

    return KernelSet(move_phase=move_phase)
