"""A clump in the phases of a step: what ``move`` and ``read`` do with a grain of its own, done with a clump and its members.

The thread of its first member does it. Budgets: contacts are booked with the member that they are of, gravity and fields,
which act on the clump, with the first.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, clump, grain
from warpdem.kernels.measure.budget import Momenta
from warpdem.kernels.step import clump_sweep
from warpdem.kernels.step.free_rotation import rotation_matrix
from warpdem.kernels.step.schedule import Row, gravity, kick_time
from warpdem.kernels.step.structs import Control

vec6 = wp.types.vector(6, wp.float64)


@functools.cache
def build(
    structs, WallContacts, clumps, load, travel, border, orientation, budget, flow, *, walls: bool, leave: bool,
    driven: bool, lanes: int,
):  # fmt: skip
    """Return what ``move`` and ``read`` call of a clump.

    ``sweep`` moves several clumps side by side (``clump_sweep``); None where more is asked than their motion, or on a GPU.
    ``drives``: ``drive`` is called before it, or before ``advance``.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: of ``wall.evaluate.build``.
        clumps: of ``clumps.build``.
        load: sum over the contacts of a grain, of ``motion.build_load``.
        travel: of ``motion.build_travel``.
        border: periodic images, of ``border.build``.
        orientation: of ``orientation.build``; None when orientations are not requested.
        budget: namespace of ``budget.build``, or None.
        flow: of ``flow.build``, or None.
        walls: there are walls.
        leave: clumps may leave the domain.
        driven: external fields act.
        lanes: clumps side by side; 1 on a GPU.
    """
    g = grain.build(True)
    arm_of = clump.build(True).arm_of
    Model, Grains, Energies = structs.Model, structs.Grains, structs.Energies

    @wp.func
    def energies(
        c: int, i: int, motion: clump.Reading, weight: wp.float64, at: int, model: Model, grains: Grains,
        wall_contacts: WallContacts, control: Control,
    ) -> Energies:  # fmt: skip
        """Energies of member ``i`` of clump ``c`` over ``weight`` [s]."""
        v, w = clumps.member_motion(c, i, rotation_matrix(grains.clumps.turn[c]), motion, grains.clumps)
        found = budget.contact_energies(i, v, w, weight, wall_contacts)
        if i == grains.clumps.first[c]:
            velocity = wp.vec3d(motion[0], motion[1], motion[2])
            mass = wp.float64(1.0) / grains.clumps.rate[c][0]
            found = budget.field_energies(grains.clumps.record[c], velocity, mass, weight, at, model, control, found)
        return found

    @wp.func
    def momenta(
        c: int, i: int, weight: wp.float64, at: int, model: Model, grains: Grains, wall_contacts: WallContacts,
        control: Control,
    ) -> Momenta:  # fmt: skip
        """Impulses of member ``i`` of clump ``c`` over ``weight`` [s]."""
        total = load(i, grains.slot_start, grains.slot_force, wall_contacts.candidates, wall_contacts.load)
        state = grains.record[i]
        if wp.static(border.images > 1):  # where it is on its clump, not the image of it within the borders
            arm = rotation_matrix(grains.clumps.turn[c]) * clump.place_of(arm_of(c, i, grains.clumps))
            state = g.placed(state, g.position(grains.clumps.record[c]) + arm)
        found = budget.contact_momenta(i, state, total, weight, at, wall_contacts, control)
        if i == grains.clumps.first[c]:
            inverse_mass = grains.clumps.rate[c][0]
            found = budget.field_momenta(
                grains.clumps.record[c], wp.float64(1.0) / inverse_mass, weight, at, model, control, found
            )
        return found

    @wp.func
    def motion_now(
        c: int, at: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control
    ) -> clump.Reading:  # fmt: skip
        """Motion of clump ``c`` at the present time, in row ``at``."""
        total = clumps.total_load(c, grains.clumps, grains.slot_start, grains.slot_force, wall_contacts)
        a, torque = clumps.accelerations(
            c, total, grains.clumps, control.row[at], control.frame, at, model.dt, control.field
        )
        return clumps.motion_now(c, a, torque, grains.clumps, control.row[at], control.frame, at, model.dt)

    @wp.func
    def add_to_budget(
        c: int, motion: clump.Reading, at: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control
    ):
        """As of ``move``, of clump ``c``."""
        row = control.row[at]
        weight = kick_time(row)
        first = grains.clumps.first[c]
        for i in range(first, first + grains.clumps.count[c]):
            if wp.static(budget.energy):
                grains.energies[i] = grains.energies[i] + energies(
                    c, i, motion, weight, at, model, grains, wall_contacts, control
                )
                if wp.static(walls):
                    budget.wall_works(i, weight, wall_contacts, grains.wall_work)
            if wp.static(budget.momentum):
                given = momenta(c, i, weight, at, model, grains, wall_contacts, control)
                grains.momenta[i] = budget.rotated(grains.momenta[i] + given, row)

    @wp.func
    def add_image_shift(c: int, shift: wp.vec3d, row: Row, grains: Grains):
        """As of ``move``, of clump ``c``, whose ``velocity`` is that of the step."""
        first = grains.clumps.first[c]
        mass = wp.float64(1.0) / grains.clumps.rate[c][0]
        if wp.static(budget.energy):
            grains.energies[first] = grains.energies[first] + budget.lifted(shift, gravity(row) * mass)
        if wp.static(budget.momentum):
            grains.momenta[first] = grains.momenta[first] + budget.shifted(
                shift, g.velocity(grains.clumps.record[c]) * mass
            )

    @wp.func
    def drive(
        c: int, s: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control
    ):  # fmt: skip
        """What acts on clump ``c`` over the step in row ``s``, and the budgets."""
        row = control.row[s]
        dt = model.dt
        all = grains.clumps
        total = clumps.total_load(c, all, grains.slot_start, grains.slot_force, wall_contacts)
        a, torque = clumps.accelerations(c, total, all, row, control.frame, s, dt, control.field)
        if wp.static(budget is not None):
            motion = clumps.motion_now(c, a, torque, all, row, control.frame, s, dt)
            add_to_budget(c, motion, s, model, grains, wall_contacts, control)
        all.drive[c] = vec6(a[0], a[1], a[2], torque[0], torque[1], torque[2])

    @wp.func
    def advance(c: int, s: int, model: Model, grains: Grains, control: Control):
        """Move clump ``c`` over the step, by what ``drive`` found."""
        row = control.row[s]
        all = grains.clumps
        before = g.position(all.record[c])
        reached = clumps.advance(c, grains, row, model.dt)
        if wp.static(flow is not None):
            flow(
                all.first[c], before, reached, wp.float64(1.0) / all.rate[c][0], control.plane, control.frame, s, s + 1,
                grains.flow,
            )  # fmt: skip
        if wp.static(border.images > 1):
            if wp.static(budget is not None):
                add_image_shift(c, g.position(all.record[c]) - reached, row, grains)

    @wp.func
    def watch(
        c: int, s: int, model: Model, grains: Grains, control: Control, inner_share: wp.float64
    ) -> int:  # fmt: skip
        """Turn the marks of the members of clump ``c`` after the step; BEYOND of ``motion``, of all of them together."""
        first = grains.clumps.first[c]
        moved = int(0)
        for i in range(first, first + grains.clumps.count[c]):
            state = grains.record[i]
            if wp.static(orientation is not None):
                grains.orientation[i] = orientation(grains.orientation[i], g.spin(state), control.row[s], model.dt)
            moved = moved | travel.displaced(
                i, state, grains.reference, inner_share * grains.allowance[i], grains.flight, control.placement,
                control.origin, s + 2, model.dt,
            )
        return moved

    @wp.func
    def read(
        c: int, s: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control,
        load_out: wp.array(dtype=vec6), velocity_out: wp.array(dtype=wp.vec3d), spin_out: wp.array(dtype=wp.vec3d),
    ):  # fmt: skip
        """As ``read``, of the members of clump ``c``; and its own motion."""
        motion = motion_now(c, s, model, grains, wall_contacts, control)
        grains.clumps.reading[c] = motion
        axes = rotation_matrix(grains.clumps.turn[c])
        first = grains.clumps.first[c]
        for i in range(first, first + grains.clumps.count[c]):
            v, w = clumps.member_motion(c, i, axes, motion, grains.clumps)
            load_out[i] = load(i, grains.slot_start, grains.slot_force, wall_contacts.candidates, wall_contacts.load)
            velocity_out[i] = v
            spin_out[i] = w

    @wp.func
    def read_budget(
        c: int, i: int, s: int, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control,
        energies_out: wp.array(dtype=Energies), momenta_out: wp.array(dtype=Momenta),
        wall_work_out: wp.array2d(dtype=wp.float64),
    ):  # fmt: skip
        """As ``read_budget``, of member ``i`` of clump ``c``."""
        half = kick_time(control.row[s]) - wp.float64(0.5) * model.dt
        motion = motion_now(c, s, model, grains, wall_contacts, control)
        if wp.static(budget.energy):
            energies_out[i] = grains.energies[i] + energies(c, i, motion, half, s, model, grains, wall_contacts, control)
            for wall in range(grains.wall_work.shape[1]):
                wall_work_out[i, wall] = grains.wall_work[i, wall]
            if wp.static(walls):
                budget.wall_works(i, half, wall_contacts, wall_work_out)
        if wp.static(budget.momentum):
            momenta_out[i] = grains.momenta[i] + momenta(c, i, half, s, model, grains, wall_contacts, control)

    plain = flow is None and (border.images == 1 or budget is None)
    sweep = None
    if lanes > 1 and plain:
        sweep = clump_sweep.build(
            structs, WallContacts, clumps, travel, lanes, walls=walls, leave=leave, driven=driven or budget is not None
        )
    return KernelSet(
        drive=drive, advance=advance, write_members=clumps.write_members, watch=watch, read=read, read_budget=read_budget,
        sweep=sweep, drives=sweep is None or driven or budget is not None, turns_marks=orientation is not None,
    )  # fmt: skip
