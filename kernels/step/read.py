"""What is read of the grains between two steps: forces, velocities and budgets of the present time."""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, clump
from warpdem.kernels.measure.budget import Momenta
from warpdem.kernels.step.schedule import kick_time
from warpdem.kernels.step.structs import Control

vec6 = wp.types.vector(6, wp.float64)


@functools.cache
def build(structs, WallContacts, load, acceleration, reading, budget, clumps=None, *, stages: int, walls: bool):
    """Return the kernels ``read`` and ``read_budget``; the latter is None without budgets.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: of ``wall.evaluate.build``.
        load: sum over contacts, and ``acceleration``, of ``motion``.
        reading: velocities of the present time, of the integrator.
        budget: namespace of ``budget.build``, or None.
        clumps: of ``clump_phase.build``; None without clumps.
        stages: force calls per step.
        walls: there are walls.
    """
    Model, Grains = structs.Model, structs.Grains
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @kernel
    def read(
        s: int,  # row of the present step
        model: Model,
        control: Control,
        grains: Grains,
        wall_contacts: WallContacts,
        # written
        load_out: wp.array(dtype=vec6),  # (n,)
        velocity_out: wp.array(dtype=wp.vec3d),  # (n,)
        spin_out: wp.array(dtype=wp.vec3d),  # (n,)
    ):
        """Contact force [N] and torque [N m], velocity [m/s] and spin [rad/s] of each grain at the present time."""
        i = wp.tid()
        if wp.static(clumps is not None):
            c = grains.clumps.of_grain[i]
            if c != wp.static(clump.NONE):
                if grains.clumps.first[c] == i:
                    clumps.read(c, s, model, grains, wall_contacts, control, load_out, velocity_out, spin_out)
                return
        at = s * wp.static(stages)
        total = load(i, grains.row_start, grains.row, wall_contacts.candidates, wall_contacts.load)
        row = control.row[at]
        state = grains.record[i]
        a, b = acceleration(state, total, grains.inverse[i], row, control.frame, at, model.dt, control.field)
        v, w = reading(state, a, b, row, control.frame, at, model.dt)
        load_out[i] = total
        velocity_out[i] = v
        spin_out[i] = w

    read_budget = None
    if budget is not None:

        @kernel
        def read_budget(
            s: int,  # row of the present step
            model: Model,
            control: Control,
            grains: Grains,
            wall_contacts: WallContacts,
            # written
            energies_out: wp.array(dtype=structs.Energies),  # (n,)
            momenta_out: wp.array(dtype=Momenta),  # (n,)
            wall_work_out: wp.array2d(dtype=wp.float64),  # (n, walls)
        ):
            """Budgets of each grain up to the present time; the present forces count for half a step."""
            i = wp.tid()
            if wp.static(clumps is not None):
                c = grains.clumps.of_grain[i]
                if c != wp.static(clump.NONE):
                    clumps.read_budget(
                        c, i, s, model, grains, wall_contacts, control, energies_out, momenta_out, wall_work_out
                    )
                    return
            row = control.row[s]
            total = load(i, grains.row_start, grains.row, wall_contacts.candidates, wall_contacts.load)
            state = grains.record[i]
            a, b = acceleration(state, total, grains.inverse[i], row, control.frame, s, model.dt, control.field)
            v, w = reading(state, a, b, row, control.frame, s, model.dt)
            half = kick_time(row) - wp.float64(0.5) * model.dt
            if wp.static(budget.energy):
                energies_out[i] = grains.energies[i] + budget.energies(
                    i, state, v, w, half, s, model, grains, wall_contacts, control
                )
                for wall in range(grains.wall_work.shape[1]):
                    wall_work_out[i, wall] = grains.wall_work[i, wall]
                if wp.static(walls):
                    budget.wall_works(i, half, wall_contacts, wall_work_out)
            if wp.static(budget.momentum):
                momenta_out[i] = grains.momenta[i] + budget.momenta(
                    i, state, total, half, s, model, grains, wall_contacts, control
                )

    return KernelSet(read=read, read_budget=read_budget)
