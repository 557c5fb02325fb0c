"""How far grains have moved since the lists were built, and whether they are still what the lists assume.

A list holds as long as no grain has moved further than it allows from its reference, the position at which the list was built.
The inner list is checked at every step (``step.motion``); this kernel checks both when that finds a grain too far, and sorts
out what only the host can settle: a grain in an outlet, one that crossed a whole periodic domain, one that is no number, one
that is fast beside a mesh.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, clump, grain
from warpdem.kernels.lists.path import FAR, Flight, in_flight
from warpdem.kernels.step.clock import ASK_HOST, BUILD_OUTER, SCHEDULE_ROW
from warpdem.kernels.step.schedule import Placement, local, wall_velocity
from warpdem.kernels.step.structs import Control

INNER_HALF, INNER, OUTER_HALF, OUTER, OFF_PATH, IN_OUTLET, CROSSED, NOT_FINITE, FAST = (1 << bit for bit in range(9))
"""What ``check_lists`` finds of a grain, added up: beyond half of what the inner list allows, and all of it; the same of the
outer list; off its path (``flight``); in an outlet; across a whole periodic domain; not finite; fast beside a mesh."""
OUTLET_NUMBER = 9
"""Bit from which on the number of the outlet stands that a grain is in."""
OUT_OF_DATE = OUTER | OFF_PATH
"""With it the outer list must be built again."""
FOR_THE_HOST = IN_OUTLET | CROSSED | NOT_FINITE | FAST
"""With it the host must look."""


@wp.struct
class Watched:
    """Mesh walls beside which the travel per step is bounded; boxes in body axes."""

    motion: wp.array(dtype=wp.int32)  # (meshes,) number of the wall's motion
    max_travel: wp.array(dtype=wp.float64)  # (meshes,) largest travel per step over the radius [-]
    low: wp.array(dtype=wp.vec3d)  # (meshes,) corners of the bounding box [m]
    high: wp.array(dtype=wp.vec3d)


@wp.struct
class References:
    """Where grains were when the lists were built, and how far from there they may be."""

    inner: wp.array2d(dtype=wp.vec3d)  # (known, 1 + motions) of the inner list; grains beyond were inserted since
    outer: wp.array2d(dtype=wp.vec3d)  # (known, 1 + motions) of the outer list
    flight: wp.array(dtype=Flight)  # (known,), or of size 0
    allowance: wp.array(dtype=wp.float64)  # (known,) of the outer list, of ``neighbors`` [m]
    inner_share: wp.float64  # of it, that a grain may move while the inner list holds [-]
    outer_share: wp.float64  # while the outer list holds [-]


@functools.cache
def build(travel, border, *, spins: bool, moving: int, stages: int, leave: bool, clumps: bool = False):
    """Return the kernels.

    Args:
        travel: namespace of ``motion.build_travel``.
        border: periodic images, of ``border.build``.
        spins: grains spin.
        moving: number of wall motions relative to the frame.
        stages: force calls per step.
        leave: grains may leave the domain.
        clumps: there are clumps, which leave as a whole, where their centre does.
    """
    Clumps = clump.build(clumps).Clumps
    g = grain.build(spins)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.func
    def is_fast(state: g.Record, control: Control, row: int, watched: Watched, dt: wp.float64) -> bool:
        """Whether a grain beside a mesh, or beside an image of it, travels further in a step than that allows."""
        q = g.position(state)
        fast = bool(False)
        for w in range(watched.motion.shape[0]):
            p = control.placement[row, watched.motion[w]]
            distance = wp.length(g.velocity(state) - wall_velocity(p, q)) * dt
            if not (distance <= watched.max_travel[w] * state[3]):
                room = state[3] + distance
                corner = wp.vec3d(room, room, room)
                for image in range(wp.static(border.images)):
                    body = local(p, border.image(q, image))
                    inside = wp.min(wp.min(body - watched.low[w] + corner), wp.min(watched.high[w] - body + corner))
                    fast = fast or inside > wp.float64(0.0)
        return fast

    @wp.func
    def check_grain(
        i: int, state: g.Record, of_clumps: Clumps, references: References, control: Control, schedule_row: int,
        watched: Watched, dt: wp.float64,
    ) -> int:  # fmt: skip
        """What has become of grain ``i`` at the present step, that of row ``schedule_row`` of the schedule."""
        found = int(0)
        if not g.is_removed(state):
            q = g.position(state)
            row = (schedule_row + 1) * wp.static(stages)
            if i < references.outer.shape[0]:
                if in_flight(references.flight, i):
                    now = wp.float64(control.origin[0] + schedule_row)
                    if not travel.holds(references.flight[i], state, now, dt):
                        found = wp.static(OFF_PATH)
                else:
                    left = travel.allowed_displacement(state, references.inner_share * references.allowance[i], dt)
                    square = travel.squared_displacement(i, state, references.inner, control.placement, row)
                    if not (square <= wp.float64(0.25) * left * left):
                        found = found | wp.static(INNER_HALF)
                    if not (square <= left * left):
                        found = found | wp.static(INNER)
                    left = references.outer_share * references.allowance[i]
                    square = travel.squared_displacement(i, state, references.outer, control.placement, row)
                    if not (square <= wp.float64(0.25) * left * left):
                        found = found | wp.static(OUTER_HALF)
                    if not (square <= left * left):
                        found = found | wp.static(OUTER)
            centre = q
            if wp.static(clumps):
                c = of_clumps.of_grain[i]
                if c != wp.static(clump.NONE):
                    centre = g.position(of_clumps.record[c])
            number = travel.outlet_of(centre, control.outlet, control.placement, row)
            if number >= 0:
                found = found | wp.static(IN_OUTLET) | (number << wp.static(OUTLET_NUMBER))
            if border.crossed(q):
                found = found | wp.static(CROSSED)
            if not (wp.isfinite(q[0]) and wp.isfinite(q[1]) and wp.isfinite(q[2])):
                found = found | wp.static(NOT_FINITE)
            if is_fast(state, control, row, watched, dt):
                found = found | wp.static(FAST)
        return found

    @kernel
    def check_lists(
        first: int,
        grains: wp.array(dtype=g.Record),  # (n,)
        of_clumps: Clumps,  # of empty arrays without clumps
        references: References,
        control: Control,
        watched: Watched,
        dt: wp.float64,
        # written
        found_out: wp.array(dtype=wp.int32),  # (n,) what was found of each grain; of size 0: only the conditions are asked for
        clock_out: wp.array(dtype=wp.int32),
    ):
        """What has become of each grain; conditions BUILD_OUTER and ASK_HOST of the clock."""
        i = first + wp.tid()
        found = check_grain(i, grains[i], of_clumps, references, control, clock_out[SCHEDULE_ROW], watched, dt)
        if found_out.shape[0] > 0:
            found_out[i] = found
        if (found & wp.static(OUT_OF_DATE)) > 0:
            clock_out[BUILD_OUTER] = 1
        if (found & wp.static(FOR_THE_HOST)) > 0:
            clock_out[ASK_HOST] = 1

    @kernel
    def set_allowances(
        first: int,
        grains: wp.array(dtype=g.Record),  # (n,)
        control: Control,
        clock: wp.array(dtype=wp.int32),
        dt: wp.float64,
        horizon: wp.float64,  # steps that a list shall hold [-]
        least: wp.float64,  # [m]
        most: wp.float64,  # [m]
        allowance_out: wp.array(dtype=wp.float64),  # (n,) [m]
    ):
        """How far each grain may move while the list holds that is built now: as far as it goes in ``horizon`` steps."""
        i = first + wp.tid()
        now = clock[SCHEDULE_ROW] * wp.static(stages)
        distance = travel.distance_ahead(
            grains[i], control.row[now], control.placement, now + wp.static(stages), now + wp.static(2 * stages), dt
        )
        allowance_out[i] = wp.max(wp.min(horizon * distance, most), least)

    @wp.func
    def put_reference(
        i: int, q_now: wp.vec3d, placements: wp.array(dtype=Placement), flight: wp.array(dtype=Flight),
        reference_out: wp.array2d(dtype=wp.vec3d),
    ):  # fmt: skip
        """As ``save_reference``, of grain ``i`` at ``q_now`` [m]."""
        far = wp.float64(FAR)
        q = q_now
        flying = in_flight(flight, i)
        if flying:
            q = wp.vec3d(far, far, far)
        reference_out[i, 0] = q
        for m in range(wp.static(moving)):
            body = q
            if not flying:
                body = local(placements[m], q)
            reference_out[i, m + 1] = body

    @kernel
    def save_reference(
        first: int,
        grains: wp.array(dtype=g.Record),  # (n,)
        placements: wp.array(dtype=Placement),  # (motions,) at present
        flight: wp.array(dtype=Flight),  # (n,), or of size 0
        reference_out: wp.array2d(dtype=wp.vec3d),  # (n, 1 + motions): in frame axes, and in the body axes of each motion
    ):
        """Where grains are when a list is built. Those in flight are far from their reference: it is the path that counts."""
        i = first + wp.tid()
        put_reference(i, g.position(grains[i]), placements, flight, reference_out)

    return KernelSet(
        check_lists=check_lists, set_allowances=set_allowances, save_reference=save_reference, check_grain=check_grain,
        put_reference=put_reference,
    )  # fmt: skip
