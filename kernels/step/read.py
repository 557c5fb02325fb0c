"""What is read of the grains between two steps: forces, velocities and budgets of the present time."""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, clump
from warpdem.kernels.measure.budget import Momenta
from warpdem.kernels.measure.window_sum import add_rounded
from warpdem.kernels.step.schedule import kick_time, last_drift_rotation, slip_time
from warpdem.kernels.step.structs import Control

vec6 = wp.types.vector(6, wp.float64)


@functools.cache
def build(
    structs, pairs, WallContacts, load, acceleration, reading, budget, clumps=None, *, stages: int, walls: bool,
    rotating_frame: bool, ranks: bool = False,
):  # fmt: skip
    """Return the kernels ``read``, ``read_budget`` and those of ``losses``; the latter are None without budgets.

    Args:
        structs: namespace of ``structs.build``.
        pairs: namespace of ``pairs.build``.
        WallContacts: of ``wall.evaluate.build``.
        load: sum over contacts, and ``acceleration``, of ``motion``.
        reading: velocities of the present time, of the integrator.
        budget: namespace of ``budget.build``, or None.
        clumps: of ``clump_phase.build``; None without clumps.
        stages: force calls per step.
        walls: there are walls.
        rotating_frame: the axes turn, and what contacts keep with them.
        ranks: some grains belong to other processes.
    """
    Model, Grains, ContactBatches = structs.Model, structs.Grains, structs.ContactBatches
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
        total = load(i, grains.slot_start, grains.slot_force, wall_contacts.candidates, wall_contacts.load)
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
            total = load(i, grains.slot_start, grains.slot_force, wall_contacts.candidates, wall_contacts.load)
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

    settle_losses = None
    read_losses = None
    if pairs.has_parts:
        g, real, at, width = pairs.grain, pairs.real, pairs.memory.impulses_at, pairs.memory.width - pairs.memory.impulses_at
        History, Impulses = pairs.memory.History, pairs.memory.Impulses

        @wp.func
        def is_contact(p: int, k: int, grains: Grains, contacts: ContactBatches) -> bool:
            return contacts.slot_i[p, k] + 1 < grains.slot_force.shape[0]

        @wp.func
        def kept_by(p: int, k: int, contacts: ContactBatches) -> Impulses:
            """Impulses whose work is not known yet."""
            out = Impulses()
            for f in range(wp.static(width)):
                out[f] = contacts.history[p, wp.static(at) + f, k]
            return out

        @wp.func
        def is_any(kept: Impulses) -> bool:
            out = bool(False)
            for f in range(wp.static(width)):
                out = out or kept[f] != real(0.0)
            return out

        @kernel
        def settle_losses(
            batches: int, s: int, model: Model, control: Control, grains: Grains, contacts: ContactBatches,
            losses_out: wp.array3d(dtype=wp.int64),
        ):  # fmt: skip
            """Add up the work of the impulses of the last force call, one step before row ``s``; no contact keeps any then.

            The next force call does the same: this is for contacts that it will not find, since a grain leaves.
            """
            t = wp.tid()
            p = t % batches
            k = t // batches
            if not is_contact(p, k, grains, contacts):
                return
            kept = kept_by(p, k, contacts)
            there = is_any(kept)
            for f in range(wp.static(width)):
                contacts.history[p, wp.static(at) + f, k] = real(0.0)
            memory = pairs.memory.joined(History(), kept)
            row = control.row[s]
            if wp.static(rotating_frame):
                memory = pairs.memory.rotated(memory, pairs.cast_rotation(last_drift_rotation(row)))
            i = contacts.owner[p, k]
            if wp.static(ranks):
                there = there and i < contacts.owned
            if there:
                gi = grains.record[i]
                gj = grains.record[contacts.partner[p, k]]
                lost = pairs.memory.of_impulses_only(
                    pairs.memory.past_work(gi, gj, pairs.memory.impulses_of(memory), slip_time(row), model.dt)
                )
                for f in range(wp.static(pairs.memory.Losses._length_)):
                    add_rounded(lost[f], t % losses_out.shape[0], f, losses_out)

        @kernel
        def read_losses(
            batches: int, s: int, model: Model, control: Control, grains: Grains, contacts: ContactBatches,
            velocity: wp.array(dtype=wp.vec3d), spin: wp.array(dtype=wp.vec3d),  # of ``read``
            sums_out: wp.array3d(dtype=wp.int64),  # of ``window_sum``
        ):  # fmt: skip
            """Work of the impulses of the present force call up to the present time, the middle of their kick."""
            t = wp.tid()
            p = t % batches
            k = t // batches
            if not is_contact(p, k, grains, contacts):
                return
            kept = kept_by(p, k, contacts)
            if not is_any(kept):
                return
            kick = kick_time(control.row[s])
            done = kick - wp.float64(0.5) * model.dt
            i = contacts.owner[p, k]
            if wp.static(ranks):
                if i >= contacts.owned:
                    return
            j = contacts.partner[p, k]
            gi = grains.record[i]
            gj = grains.record[j]
            across = pairs.border.nearest(g.position(gi) - g.position(gj))
            distance = wp.sqrt(wp.dot(across, across))
            depth = wp.float64(0.5) * (gi[3] + gj[3] - distance)
            swept = wp.vec3d()
            if wp.static(pairs.spins):
                swept = spin[i] * (gi[3] - depth) + spin[j] * (gj[3] - depth)
            lost = pairs.memory.of_impulses_only(
                pairs.memory.work(
                    kept, across * (wp.float64(1.0) / distance), velocity[i] - velocity[j], swept, spin[i] - spin[j]
                )
            )
            for f in range(wp.static(pairs.memory.Losses._length_)):
                add_rounded(lost[f] * (done / kick), t % sums_out.shape[0], f, sums_out)

    return KernelSet(read=read, read_budget=read_budget, settle_losses=settle_losses, read_losses=read_losses)
