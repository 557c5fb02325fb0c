"""The inner list as the threads of a CPU build it: one launch per thread, which meet the others after each phase.

The phases are those of the launches of a graph (``warpdem.engine.program.ListBuild``), and their functions are the same:

    check            what has become of each grain (``displacement.check_lists``)
    select           contacts and wall features within the share (``contact_batches.select_contacts``,
                     ``candidates.close_features``), added up by block of grains (``numbering.sum_blocks``)
    number           where those of each block and grain begin (``numbering.start_blocks``, ``start_grains``)
    fill             contact batches with the contact history carried over (``contact_batches.fill_contacts``); lanes without a
                     contact (``clear_contacts``); reference positions (``displacement.save_reference``)

Where only the inner list is out of date, check and build are one launch, and the host reads a few numbers of its report. It is
asked where the check finds anything else, and where the arrays are too short for the list: then nothing is filled.

A thread takes whole blocks of grains, so that its batches of contacts are its own.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, grain
from warpdem.kernels.lists.displacement import FOR_THE_HOST, INNER, OUT_OF_DATE, References, Watched
from warpdem.kernels.lists.neighbors import NeighborRows
from warpdem.kernels.lists.numbering import BLOCK, Counts, Starts, Sums, block_sums, joined, start_block
from warpdem.kernels.step.barrier import arrive_and_wait
from warpdem.kernels.step.structs import Control, Report

CHECK, BUILD = 1, 2
"""Work of a launch; with both, the list is built if the check finds it out of date and nothing else wrong."""
FOUND, CHOSEN, FILLED, LANES, FORCE_SLOTS, WALL_GRAINS = range(6)
"""Places in the report: what was found of all grains, by bits of ``displacement``; 1 where the list was to be built; 1 where it
was; lanes of its contact batches, force slots and grains beside a wall that it needs."""
TOTALS = slice(LANES, WALL_GRAINS + 1)
SPAN = 16  # numbers per thread in the report: a cache line, so that threads do not disturb each other


@wp.struct
class Scratch:
    """What is kept of a build for the next one's memory only, and what the host reads."""

    listed: wp.array(dtype=wp.int32)  # (entries,) of ``contact_batches.select_contacts``
    sums: wp.array(dtype=Sums)  # (blocks,) of ``numbering``
    found: wp.array(dtype=wp.int32)  # (n,) what was found of each grain
    report: wp.array(dtype=wp.int32)  # (SPAN * (1 + threads),) for the host, then what each thread found


@functools.cache
def build(structs, ListedGrains, batches, displacement, walls, WallContacts, *, spins: bool, lanes: int, stages: int):
    """Return the kernel.

    Args:
        structs: of ``step.structs.build``.
        ListedGrains: struct of ``neighbors.build``.
        batches: namespace of ``contact_batches.build``.
        displacement: of ``displacement.build``.
        walls: of ``candidates.build``; None without walls.
        WallContacts: struct of the wall contacts.
        spins: grains spin.
        lanes: of a contact batch.
        stages: force calls per step.
    """
    g = grain.build(spins)
    ListedContacts = batches.ListedContacts

    @wp.struct
    class Work:
        """What a launch is to do, and the arrays that only it reads."""

        mode: wp.int32
        schedule_row: wp.int32  # of the present step
        inner_share: wp.float64  # of the allowances [-]
        unused_slot: wp.int32  # force slot that belongs to no grain, behind all others
        near_feature: wp.array(dtype=wp.int32)  # (wall slots,) features within the allowance
        old_history: wp.array3d(dtype=batches.real)  # (batches, numbers, lanes) of the list before

    @wp.func
    def clear_rest(begin: int, count: int, pair: wp.vec2i, unused_slot: int, contacts: ListedContacts):
        """Clear the lanes behind ``count`` contacts from lane ``begin`` on, up to the end of their last batch."""
        last = begin + (count + wp.static(lanes - 1)) // wp.static(lanes) * wp.static(lanes)
        for lane in range(begin + count, last):
            batches.clear_lane(lane // wp.static(lanes), lane % wp.static(lanes), pair, unused_slot, contacts)

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def build_inner(
        thread: int,
        threads: int,
        work: Work,
        model: structs.Model,
        control: Control,
        watched: Watched,
        grains: ListedGrains,
        rows: NeighborRows,
        references: References,  # ``inner`` is written
        # written
        steps: Report,  # only the meeting of its threads
        scratch: Scratch,
        counts: Counts,
        starts: Starts,
        contacts: ListedContacts,
        wall_contacts: WallContacts,
    ):
        n = grains.record.shape[0]
        blocks = scratch.sums.shape[0]
        first_block = blocks * thread // threads
        last_block = blocks * (thread + 1) // threads
        first = first_block * wp.static(BLOCK)
        last = wp.min(last_block * wp.static(BLOCK), n)
        target = int(0)
        report = scratch.report

        found = int(0)
        mode = work.mode
        schedule_row = work.schedule_row
        inner_share = work.inner_share
        if mode & wp.static(CHECK):
            for i in range(first, last):
                one = displacement.check_grain(
                    i, grains.record[i], grains.clumps, references, control, schedule_row, watched, model.dt
                )
                scratch.found[i] = one
                found = found | one
            report[(thread + 1) * wp.static(SPAN)] = found
            if threads > 1:
                target += threads
                arrive_and_wait(steps.arrivals, target, control.wait_modes)
            for t in range(threads):
                found = found | report[(t + 1) * wp.static(SPAN)]
        chosen = mode & wp.static(BUILD)
        if mode & wp.static(CHECK):
            if (found & wp.static(INNER)) == 0 or (found & wp.static(OUT_OF_DATE | FOR_THE_HOST)) > 0:
                chosen = 0
        if thread == 0:
            report[wp.static(FOUND)] = found
            report[wp.static(CHOSEN)] = wp.min(chosen, 1)
            report[wp.static(FILLED)] = 0
        if chosen == 0:
            return

        now = (schedule_row + 1) * wp.static(stages)
        for b in range(first_block, last_block):
            for i in range(b * wp.static(BLOCK), wp.min((b + 1) * wp.static(BLOCK), n)):
                batches.select_row(
                    i, grains, rows, work.old_history, inner_share, references.flight, scratch.listed, counts
                )
                if wp.static(walls is not None):
                    walls.select_features(
                        i, grains.record[i], inner_share * rows.allowance[i], model.surface, control.placement[now],
                        work.near_feature, references.flight, wall_contacts,
                    )  # fmt: skip
            scratch.sums[b] = block_sums(b, wp.static(lanes), counts)
        if threads > 1:
            target += threads
            arrive_and_wait(steps.arrivals, target, control.wait_modes)

        before = Sums()
        total = Sums()
        for b in range(blocks):
            if b == first_block:
                before = total
            total = joined(total, scratch.sums[b])
        held = joined(Sums(total[0], 0, 0, 0), Sums(total[1], 0, 0, 0))
        fits = held[0] <= contacts.owner.shape[0] * wp.static(lanes) and total[2] <= work.unused_slot
        if thread == 0:
            report[wp.static(LANES)] = held[0]
            report[wp.static(FORCE_SLOTS)] = total[2]
            report[wp.static(WALL_GRAINS)] = total[3]
            if fits:
                report[wp.static(FILLED)] = 1
        if not fits:
            return
        at = before
        for b in range(first_block, last_block):
            start_block(b, wp.static(lanes), counts, at, starts)
            at = joined(at, scratch.sums[b])
        if threads > 1:
            target += threads
            arrive_and_wait(steps.arrivals, target, control.wait_modes)

        pair = batches.idle_pair(grains, rows)
        for b in range(first_block, last_block):
            touching = int(0)
            near = int(0)
            end = wp.min((b + 1) * wp.static(BLOCK), n)
            for i in range(b * wp.static(BLOCK), end):
                batches.fill_row(
                    i, grains, model.materials, model.coefficients, rows, scratch.listed, starts, work.old_history, contacts
                )
                displacement.put_reference(
                    i, g.position(grains.record[i]), control.placement[now], references.flight, references.inner
                )
                touching += counts.touching[i]
                near += counts.near[i]
            clear_rest(starts.touching[b * wp.static(BLOCK)], touching, pair, work.unused_slot, contacts)
            clear_rest(starts.near[b * wp.static(BLOCK)], near, pair, work.unused_slot, contacts)

    return KernelSet(build_inner=build_inner, Work=Work)
