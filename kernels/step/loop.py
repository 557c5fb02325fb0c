"""The step: forces at t_k, then the integrator takes the grains to t_k+1, over and over.

On a CPU one launch per thread runs many steps and meets the others at a barrier after each phase; on a GPU each phase is a
launch of a captured graph (``step/graph.py``). A scheme of several stages also evaluates the forces between, from the contact
history at the beginning of the step, and discards the history that these give. A run is left with the forces of its present
time evaluated, so reading results never computes anything again. It stops before a force call when a grain has moved further
than the lists allow (or is no longer finite); then new lists are built and the forces come first. A batch of steps also ends
at the force call in which an overlap exceeds the allowed one, so that this step does not depend on how a run is divided into
batches.

In a run over several processes (ranks) thread 0 calls the host after each stage, between two meetings of the threads: there the
new state of the grains that other ranks see (ghosts) is sent, and all ranks agree on whether to stop (``step/exchange.py``). So
they stop after the same step. While ghosts are under way the threads evaluate walls and the contact batches without ghosts;
then thread 0 waits for the ghosts, and the batches of the boundary follow. Loads on walls that move by them are added up over
all ranks before, exactly, so that each rank moves these walls alike.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet
from warpdem.kernels.step.barrier import arrive_and_wait
from warpdem.kernels.step.exchange import ARRIVED, TOO_DEEP, WALL_LOADS, exchange
from warpdem.kernels.step.forces import too_deep
from warpdem.kernels.step.structs import (
    BOUNDARY,
    CONTACTS,
    GRAINS,
    SPAN,
    WALL_GRAINS,
    Control,
    ForceCall,
    Report,
    Steps,
    build_call,
    every,
    range_of,
)


@functools.cache
def build(structs, forces, move_phase, dynamic, WallContacts, *, stages: int, ranks: bool = False):
    """Return the CPU kernel ``run``, and kernels of each phase alone, so that it can be timed.

    Args:
        structs: namespace of ``structs.build``.
        forces: of ``forces.build``.
        move_phase: of ``move.build``.
        dynamic: namespace of ``dynamic_walls.build``; None where no wall moves by the load on it.
        WallContacts: of ``wall.evaluate.build``.
        stages: force calls per step.
        ranks: the run is over several processes.
    """
    Model, Grains, ContactBatches = structs.Model, structs.Grains, structs.ContactBatches
    force_call = build_call(stages)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.func
    def wait_for_all(target: int, threads: int, control: Control, report: Report) -> int:
        """Wait until all threads are here; returns how often they have arrived since the launch, all together."""
        if threads > 1:
            arrive_and_wait(report.arrivals, target + threads, control.wait_modes)
        return target + threads

    @wp.func
    def agreed(threads: int, step: int, steps: Steps, control: Control, report: Report) -> int:
        """What was found of the grains of all ranks after ``step`` steps, that in ``report`` on this one."""
        found = int(0)
        for t in range(threads):
            found = found | report.moved[t * wp.static(SPAN)]
            if too_deep(report.extreme, t * wp.static(SPAN), control.max_overlap):
                found = found | wp.static(TOO_DEEP)
        return exchange(steps.exchange, step, wp.static(stages - 1), found)

    @wp.func
    def wall_motion_phase(
        thread: int, threads: int, target: int, k: int, steps: Steps, model: Model, grains: Grains,
        wall_contacts: WallContacts, control: Control, report: Report,
    ) -> int:  # fmt: skip
        """Walls that move by the load on them, over the ``k``-th step; returns as ``wait_for_all``."""
        s = steps.row + k - 1
        parity = (steps.parity + k - 1) & 1
        part = range_of(thread, wp.static(WALL_GRAINS), control)
        dynamic.add_loads(
            thread, part.first, part.last, grains.record, grains.inverse, wall_contacts, control.placement, s + 1, parity,
            control.dynamic,
        )  # fmt: skip
        added = wait_for_all(target, threads, control, report)
        if thread == 0:
            if wp.static(ranks):
                exchange(steps.exchange, k, wp.static(WALL_LOADS), 0)
            dynamic.advance(threads, s, control.row, control.placement, model.dt, control.dynamic)
        return wait_for_all(added, threads, control, report)

    @wp.func
    def forces_of_all(
        thread: int, threads: int, target: int, k: int, call: ForceCall, steps: Steps, model: Model, grains: Grains,
        contacts: ContactBatches, wall_contacts: WallContacts, control: Control, report: Report,
    ) -> int:  # fmt: skip
        """A force call of the ``k``-th step; returns as ``wait_for_all``."""
        forces.force_phase(thread, threads, call, model, grains, contacts, wall_contacts, control, report)
        met = wait_for_all(target, threads, control, report)
        report.taken[thread * wp.static(SPAN) + wp.static(CONTACTS)] = 0  # nobody takes any before the next meeting
        if wp.static(ranks):
            if thread == 0 and k > 0:  # before the first step ghosts are there
                exchange(steps.exchange, k, wp.static(ARRIVED), 0)
            met = wait_for_all(met, threads, control, report)
            forces.shared_pair_phase(
                thread, threads, wp.static(BOUNDARY), call, model, grains, contacts, control, report
            )  # fmt: skip
            met = wait_for_all(met, threads, control, report)
            report.taken[thread * wp.static(SPAN) + wp.static(BOUNDARY)] = 0
        return met

    @kernel
    def run(
        thread: int,
        threads: int,
        steps: Steps,
        model: Model,
        control: Control,
        # read and written
        grains: Grains,
        contacts: ContactBatches,
        wall_contacts: WallContacts,
        # written
        report: Report,
    ):
        """The steps of a batch, on one thread of a CPU."""
        slot = thread * wp.static(SPAN)
        target = int(0)
        stop = int(0)
        for k in range(steps.count + 1):
            if stop == 0:
                if k > 0:
                    s = steps.row + k - 1
                    if wp.static(dynamic is not None):
                        target = wall_motion_phase(
                            thread, threads, target, k, steps, model, grains, wall_contacts, control, report
                        )  # fmt: skip
                    moved = int(0)
                    for stage in range(wp.static(stages)):
                        moved = move_phase(
                            range_of(thread, wp.static(GRAINS), control), s, stage, model, grains, wall_contacts, control,
                            report, steps.inner_share,
                        )  # fmt: skip
                        if wp.static(stages > 1):
                            if stage < wp.static(stages - 1):
                                target = wait_for_all(target, threads, control, report)
                                if wp.static(ranks):
                                    if thread == 0:
                                        exchange(steps.exchange, k, stage, 0)
                                    target = wait_for_all(target, threads, control, report)
                                target = forces_of_all(
                                    thread, threads, target, k, force_call(s, stage + 1, (steps.parity + k - 1) & 1), steps,
                                    model, grains, contacts, wall_contacts, control, report,
                                )  # fmt: skip
                    report.moved[slot] = moved
                    target = wait_for_all(target, threads, control, report)
                    if wp.static(ranks):
                        if thread == 0:
                            report.moved[0] = agreed(threads, k, steps, control, report)
                        target = wait_for_all(target, threads, control, report)
                        stop = report.moved[0]
                    else:
                        for t in range(threads):
                            stop = stop | report.moved[t * wp.static(SPAN)]
                if thread == 0:
                    report.done[0] = k
                if stop == 0 and (k > 0 or steps.forces_first == 1) and (k < steps.count or steps.hold == 0):
                    target = forces_of_all(
                        thread, threads, target, k, force_call(steps.row + k, 0, (steps.parity + k) & 1), steps, model, grains,
                        contacts, wall_contacts, control, report,
                    )  # fmt: skip
                    if wp.static(not ranks):  # else all stop after the next step: ``agreed``
                        for t in range(threads):
                            if too_deep(report.extreme, t * wp.static(SPAN), control.max_overlap):
                                stop = 1

    @kernel
    def pair_forces(
        stride: int, last: int, s: int, stage: int, model: Model, control: Control, grains: Grains, contacts: ContactBatches,
        report: Report,
    ):  # fmt: skip
        part = every(stride, last, wp.tid())
        forces.pair_phase(part, force_call(s, stage, 0), model, grains, contacts, control, report)

    @kernel
    def wall_forces(
        stride: int, last: int, s: int, stage: int, parity: int, model: Model, control: Control, grains: Grains,
        wall_contacts: WallContacts, report: Report,
    ):  # fmt: skip
        part = every(stride, last, wp.tid())
        forces.wall_phase(part, force_call(s, stage, parity), model, grains, wall_contacts, control, report)

    @kernel
    def move(
        last: int, s: int, stage: int, model: Model, control: Control, grains: Grains, wall_contacts: WallContacts,
        report: Report, inner_share: wp.float64,
    ):  # fmt: skip
        part = every(1, last, wp.tid())  # all on one thread: grains are moved several at once
        report.moved[part.slot] = move_phase(
            part, s, stage, model, grains, wall_contacts, control, report, inner_share
        )

    return KernelSet(run=run, pair_forces=pair_forces, wall_forces=wall_forces, move=move)
