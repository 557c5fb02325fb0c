"""The contact forces of a force call: grain pairs, then walls, of the contacts and grains that a thread takes."""

import functools

import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.step.portions import portion_of, take
from warpdem.kernels.step.schedule import Row, kick_time, last_drift_rotation, slip_time
from warpdem.kernels.step.structs import (
    CONTACTS,
    SPAN,
    WALL_GRAINS,
    Control,
    ForceCall,
    Range,
    Report,
    consecutive,
    range_of,
)


@wp.func_native("return false;")
def never() -> bool:
    """False, but not to Warp: what follows is translated, and its types checked, but nothing of it is compiled."""
    ...


@wp.func
def too_deep(extreme: wp.array(dtype=wp.float64), at: int, max_overlap: wp.array(dtype=wp.float64)) -> bool:
    """Whether the largest overlap ratio so far, of pairs or at walls, is above the allowed one [-]."""
    return wp.max(extreme[at], extreme[at + 2]) > max_overlap[0]


@functools.cache
def build(
    structs, pairs, evaluate_lane, sweep, lanes: int, wall_contacts_of_grain, sweep_walls, WallContacts, *, walls: bool,
    films=None,
):  # fmt: skip
    """Return ``pair_phase``, ``wall_phase``, ``shared_pair_phase``, and ``force_phase`` of walls and shared pairs.

    Args:
        structs: namespace of ``structs.build``.
        pairs: namespace of ``pairs.build``.
        evaluate_lane: contact law of one lane, of ``thread_contact.build``.
        sweep: of ``contact.sweep.build``; None where the law is evaluated lane by lane.
        lanes: contacts per contact batch.
        wall_contacts_of_grain: of ``wall.evaluate.build``, for one grain, and ``WallContacts``, its struct.
        sweep_walls: of ``wall.sweep.build``, for many; None where they are evaluated one by one.
        walls: there are walls.
        films: of ``contact.films.build``; None for a law without bridges.
    """
    Model, Grains, ContactBatches = structs.Model, structs.Grains, structs.ContactBatches

    @wp.func
    def pair_phase_by_lane(
        part: Range, row: Row, history_out: wp.array3d(dtype=pairs.real), model: Model, grains: Grains,
        contacts: ContactBatches, report: Report,
    ):  # fmt: skip
        axes_rotation = pairs.cast_rotation(last_drift_rotation(row))
        overlap_ratio = report.extreme[part.slot]
        approach = report.extreme[part.slot + 1]
        for p in range(part.first, part.last, part.stride):
            for k in range(wp.static(lanes)):
                a, b = evaluate_lane(
                    p, k, axes_rotation, slip_time(row), kick_time(row), model, grains, contacts, history_out, report.losses,
                    part.slot // wp.static(SPAN),
                )  # fmt: skip
                overlap_ratio = wp.max(overlap_ratio, a)
                approach = wp.max(approach, b)
        report.extreme[part.slot] = overlap_ratio
        report.extreme[part.slot + 1] = approach

    @wp.func
    def pair_phase(
        part: Range, call: ForceCall, model: Model, grains: Grains, contacts: ContactBatches, control: Control, report: Report
    ):
        """Contacts between grains: forces to their slots, history, extremes."""
        row = control.row[call.row]
        if wp.static(films is not None):
            for p in range(part.first, part.last, part.stride):
                if films.asks(p, contacts.history):
                    for k in range(wp.static(lanes)):
                        films.settle(
                            p, k, model.quantum, grains.record, contacts.owner, contacts.partner, contacts.kind,
                            model.coefficients, contacts.slot_i, contacts.slot_j, grains.slot_force, contacts.history,
                        )  # fmt: skip
        history_out = contacts.history
        if call.stage > 0:
            history_out = contacts.trial
        if wp.static(sweep is not None):
            axes_rotation = pairs.cast_rotation(last_drift_rotation(row))
            sweep(
                part, axes_rotation, slip_time(row), kick_time(row), model, grains, contacts, history_out, report.extreme,
                report.losses,
            )  # fmt: skip
            if never():
                pair_phase_by_lane(part, row, history_out, model, grains, contacts, report)
        else:
            pair_phase_by_lane(part, row, history_out, model, grains, contacts, report)

    @wp.func
    def wall_phase(
        part: Range, call: ForceCall, model: Model, grains: Grains, wall_contacts: WallContacts, control: Control,
        report: Report,
    ):  # fmt: skip
        """Grains at walls: their sum over the wall contacts, history, extremes."""
        row = control.row[call.row]
        if wp.static(sweep_walls is not None):
            sweep_walls(part, call, row, control.placement, model, grains, wall_contacts, report.extreme)
        else:
            overlap_ratio = report.extreme[part.slot + 2]
            approach = report.extreme[part.slot + 3]
            for r in range(part.first, part.last, part.stride):
                a, b = wall_contacts_of_grain(r, call, row, control.placement, model, grains, wall_contacts)
                overlap_ratio = wp.max(overlap_ratio, a)
                approach = wp.max(approach, b)
            report.extreme[part.slot + 2] = overlap_ratio
            report.extreme[part.slot + 3] = approach

    @wp.func
    def shared_pair_phase(
        thread: int, threads: int, column: int, call: ForceCall, model: Model, grains: Grains, contacts: ContactBatches,
        control: Control, report: Report,
    ):  # fmt: skip
        """A thread's contacts of CONTACTS or BOUNDARY, then portions that other threads have left of theirs."""
        for other in range(threads):
            owner = (thread + other) % threads
            all = range_of(owner, column, control)
            portion = portion_of(all.last - all.first, threads)
            first = int(all.first + take(report.taken, owner * wp.static(SPAN) + column, portion))
            while first < all.last:
                part = consecutive(first, wp.min(first + portion, all.last), thread)
                pair_phase(part, call, model, grains, contacts, control, report)
                first = all.first + take(report.taken, owner * wp.static(SPAN) + column, portion)

    @wp.func
    def force_phase(
        thread: int, threads: int, call: ForceCall, model: Model, grains: Grains, contacts: ContactBatches,
        wall_contacts: WallContacts, control: Control, report: Report,
    ):  # fmt: skip
        """A thread's part of a force call: its grains at walls, its contacts, then portions that other threads have left."""
        if wp.static(walls):
            wall_phase(
                range_of(thread, wp.static(WALL_GRAINS), control), call, model, grains, wall_contacts, control, report
            )  # fmt: skip
        shared_pair_phase(thread, threads, wp.static(CONTACTS), call, model, grains, contacts, control, report)

    return KernelSet(
        pair_phase=pair_phase, wall_phase=wall_phase, shared_pair_phase=shared_pair_phase, force_phase=force_phase
    )
