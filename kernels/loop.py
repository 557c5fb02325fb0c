"""The step: forces at t_k, then kick and drift to t_k+1, over and over.

On a CPU one launch per thread runs many steps and meets the others at a barrier after each phase; on a GPU each phase is a
launch. A run rests with the forces of its instant evaluated, so reading results never computes anything again. It
stops before a force call when a grain has moved by more than the lists allow (or is no longer finite); the host then makes
new lists and calls again with ``forces_first``.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, Built, grain
from warpdem.kernels.barrier import meet
from warpdem.kernels.pairs import BLOCK
from warpdem.kernels.schedule import Placement, Row, past_turn, slip_time
from warpdem.kernels.wall.surface import Surface

AHEAD = 6  # packs between the announcement of a pack's memory and its use
SPAN = 16  # numbers per thread in shared arrays: a cache line, so that threads do not disturb each other


@functools.cache
def build(pairs, touch, Rows, load, advance, *, spins: bool, walls: bool):
    """Return the CPU kernel ``run`` and the GPU kernels ``pair_forces``, ``wall_forces`` and ``move``."""
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
        reference: wp.array2d(dtype=wp.vec3d)
        row_start: wp.array(dtype=wp.int32)
        row: wp.array(dtype=pairs.Share)

    @wp.struct
    class Packs:
        """Grain-grain contacts in packs."""

        owner: wp.array(dtype=pairs.LaneInt)
        partner: wp.array(dtype=pairs.LaneInt)
        kind: wp.array(dtype=pairs.LaneInt)
        constants: wp.array2d(dtype=pairs.Lane)
        memory: wp.array2d(dtype=pairs.Lane)
        slot_i: wp.array(dtype=pairs.LaneInt)
        slot_j: wp.array(dtype=pairs.LaneInt)

    @wp.struct
    class Control:
        """What the host hands to a batch of steps and gets back."""

        row: wp.array(dtype=Row)
        placement: wp.array2d(dtype=Placement)
        share: wp.array2d(dtype=wp.int32)  # per thread: first and last pack, grain, wall row
        moved: wp.array(dtype=wp.int32)
        extreme: wp.array(dtype=wp.float64)  # per thread: largest overlap share [-], approach speed [m/s], by pairs and walls
        scratch: wp.array2d(dtype=pairs.Lane)  # per thread: results of a block of packs
        done: wp.array(dtype=wp.int32)
        meeting: wp.array(dtype=wp.int32)

    @wp.func
    def pair_phase(
        first: int, last: int, stride: int, s: int, grains: Grains, packs: Packs, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64, at: int,
    ):  # fmt: skip
        state = control.row[s]
        turn = past_turn(state)
        slip_dt = slip_time(state)
        share = control.extreme[at]
        approach = control.extreme[at + 1]
        scratch = (at // wp.static(SPAN)) * wp.static(BLOCK)
        for block in range(first, last, stride * wp.static(BLOCK)):
            end = wp.min(block + stride * wp.static(BLOCK), last)
            row = int(scratch)
            for p in range(block, end, stride):
                pairs.announce(
                    wp.min(p + wp.static(AHEAD), last - 1), grains.record, packs.partner, packs.slot_i, packs.slot_j,
                    grains.row,
                )  # fmt: skip
                a, b = pairs.pack(
                    p, grains.record, packs.owner, packs.partner, packs.constants, packs.kind, coefficients, turn,
                    slip_dt, dt, packs.memory, control.scratch, row,
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
    def wall_phase(
        first: int, last: int, stride: int, s: int, grains: Grains, rows: Rows, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64, at: int,
    ):  # fmt: skip
        share = control.extreme[at + 2]
        approach = control.extreme[at + 3]
        for r in range(first, last, stride):
            a, b = touch(
                r, grains.record, grains.inverse, grains.kind, materials, coefficients, surface, rows,
                control.placement, s, control.row[s], parity, dt,
            )  # fmt: skip
            share = wp.max(share, a)
            approach = wp.max(approach, b)
        control.extreme[at + 2] = share
        control.extreme[at + 3] = approach

    @wp.func
    def move_phase(
        first: int, last: int, stride: int, s: int, grains: Grains, rows: Rows, control: Control, dt: wp.float64,
        reach: wp.float64,
    ) -> int:  # fmt: skip
        state = control.row[s]
        moved = int(0)
        for i in range(first, last, stride):
            total = load(i, grains.row_start, grains.row, rows.candidates, rows.load)
            far = advance(
                i, grains.record, total, grains.inverse, grains.reference, state, control.placement, s + 2, dt, reach
            )
            moved = wp.max(moved, far)
        return moved

    @kernel
    def run(
        thread: int,
        threads: int,
        base: int,  # row of the present step
        count: int,
        forces_first: int,
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
        yield_to: wp.uint64,
    ):
        at = thread * wp.static(SPAN)
        target = int(0)
        stop = int(0)
        for s in range(count + 1):
            if stop == 0:
                if s > 0:
                    moved = move_phase(
                        control.share[thread, 2], control.share[thread, 3], 1, base + s - 1, grains, rows, control, dt, reach,
                    )  # fmt: skip
                    control.moved[at] = moved
                    if threads > 1:
                        target += threads
                        meet(control.meeting, target, yield_to)
                    for t in range(threads):
                        stop = wp.max(stop, control.moved[t * wp.static(SPAN)])
                    if thread == 0:
                        control.done[0] = s
                if stop == 0 and (s > 0 or forces_first == 1):
                    pair_phase(
                        control.share[thread, 0], control.share[thread, 1], 1, base + s, grains, packs, control,
                        coefficients, dt, at,
                    )  # fmt: skip
                    if wp.static(walls):
                        wall_phase(
                            control.share[thread, 4], control.share[thread, 5], 1, base + s, grains, rows, surface, control,
                            coefficients, materials, (parity + s) & 1, dt, at,
                        )  # fmt: skip
                    if threads > 1:
                        target += threads
                        meet(control.meeting, target, yield_to)

    @kernel
    def pair_forces(
        stride: int, last: int, s: int, grains: Grains, packs: Packs, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        pair_phase(t, last, stride, s, grains, packs, control, coefficients, dt, t * wp.static(SPAN))

    @kernel
    def wall_forces(
        stride: int, last: int, s: int, grains: Grains, rows: Rows, surface: Surface, control: Control,
        coefficients: wp.array(dtype=pairs.Coefficients), materials: int, parity: int, dt: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        wall_phase(
            t, last, stride, s, grains, rows, surface, control, coefficients, materials, parity, dt,
            t * wp.static(SPAN),
        )  # fmt: skip

    @kernel
    def move(
        stride: int, last: int, s: int, grains: Grains, rows: Rows, control: Control, dt: wp.float64,
        reach: wp.float64,
    ):  # fmt: skip
        t = wp.tid()
        control.moved[t * wp.static(SPAN)] = move_phase(
            t, last, stride, s, grains, rows, control, dt, reach
        )

    @kernel
    def gather(grains: Grains, rows: Rows, load_out: wp.array(dtype=vec6)):
        """Contact force [N] and torque [N m] on each grain at the present instant."""
        i = wp.tid()
        load_out[i] = load(i, grains.row_start, grains.row, rows.candidates, rows.load)

    return Built(
        run=run, pair_forces=pair_forces, wall_forces=wall_forces, move=move, gather=gather,
        Grains=Grains, Packs=Packs, Control=Control,
    )  # fmt: skip
