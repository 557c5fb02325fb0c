"""What acts on one grain besides its frame, and how far it has moved.

    a = F/m + g + sum of fields/m,     b = M/I

F and M are summed over the grain's contacts in order of partner id, then its wall contacts, so that their bits do not depend
on the order of the lists.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, clump, grain
from warpdem.kernels.contact.pairs import force_width, pair_force_width
from warpdem.kernels.field import Numbers
from warpdem.kernels.lists.path import Flight, bend, in_flight, position_at, velocity_at
from warpdem.kernels.step.region import Regions
from warpdem.kernels.step.schedule import (
    FrameRow,
    Placement,
    Row,
    drift_rotation,
    drift_shift,
    frame_axes,
    frame_origin,
    frame_velocity,
    gravity,
    local,
    time_of,
)

BEYOND, LEFT = 1, 2  # what is said of a grain: beyond what the lists allow, in an outlet
vec6 = wp.types.vector(6, wp.float64)
vec8 = wp.types.vector(8, wp.float64)


# Sum over ``slot_force``, number by number in its order: the bits of the plain loop, in few registers (19 -> 14 ns per grain
# and step)
SUM = """
#if defined(__CUDA_ARCH__)
    for (wp::int32 e = first; e < last; ++e) {{
{plain}    }}
#else
{types}    #pragma clang loop unroll(disable)
    for (wp::int32 e = first; e < last; ++e) {{
        const {number}* force = slot_force.data[e].c;
{adds}    }}
{gives}#endif
    return total;
"""
NUMBER = {wp.float64: "wp::float64", wp.float32: "wp::float32"}


def sum_source(real, columns: list[int]) -> str:
    """C++ of a sum over ``slot_force``, whose numbers are added up to the numbers ``columns`` of the total."""
    width, number = len(columns), NUMBER[real]
    first = width - width % 4 or 2  # registers of 4 and 2 numbers, or of 2 and 1
    starts = [*range(0, first, min(first, 4)), *([first] if first < width else [])]
    types = adds = gives = ""
    for k, (at, end) in enumerate(zip(starts, [*starts[1:], width], strict=True)):
        vector = f"__attribute__((ext_vector_type({end - at})"
        types += f"    typedef {number} stored{k} {vector}, aligned(sizeof({number})), may_alias));\n"
        types += f"    typedef wp::float64 sum{k} {vector}));\n    sum{k} part{k} = 0.0;\n"
        adds += f"        part{k} += __builtin_convertvector(*(const stored{k}*)(force + {at}), sum{k});\n"
        gives += "".join(f"    total.c[{columns[n]}] = part{k}[{n - at}];\n" for n in range(at, end))
    plain = "".join(f"        total.c[{to}] += wp::float64(slot_force.data[e].c[{n}]);\n" for n, to in enumerate(columns))
    return SUM.format(plain=plain, number=number, types=types, adds=adds, gives=gives)


@functools.cache
def build_load(real, *, spins: bool, walls: bool, wet: bool = False):
    """Return ``load``: the float64 sum over the contacts of a grain, whose pair forces are of type ``real``.

    ``wet``: as of ``pairs.pair_force_width``.
    """
    PairForce = wp.types.vector(pair_force_width(spins, wet), real)

    @wp.func_native(sum_source(real, list(range(force_width(spins)))))
    def sum_of_pairs(first: int, last: int, slot_force: wp.array(dtype=PairForce), total: vec6) -> vec6:
        """Add pair forces ``first`` to ``last`` to ``total``, which is zero."""
        ...

    @wp.func
    def load(
        i: int,
        slot_start: wp.array(dtype=wp.int32),
        slot_force: wp.array(dtype=PairForce),
        candidates: wp.array(dtype=wp.int32),
        wall_load: wp.array(dtype=vec6),
    ) -> vec6:
        """Force [N] and torque [N m] on grain ``i``: pairs in order of partner id, then walls in order of contact point."""
        total = sum_of_pairs(slot_start[i], slot_start[i + 1], slot_force, vec6())
        if wp.static(walls):
            if candidates[i] > 0:
                total += wall_load[i]
        return total

    return load


@functools.cache
def build_wet_load(real, *, spins: bool):
    """Return ``load``: as of ``build_load`` without walls, beside it the sum of wishes and gifts (``contact.films``)."""
    width = force_width(spins)
    PairForce = wp.types.vector(pair_force_width(spins, True), real)

    @wp.func_native(sum_source(real, [*range(width), 6, 7]))
    def sum_of_pairs(first: int, last: int, slot_force: wp.array(dtype=PairForce), total: vec8) -> vec8:
        """Add pair forces ``first`` to ``last`` to ``total``, which is zero; wishes [m] and gifts [counts] are the last two."""
        ...

    @wp.func
    def load(i: int, slot_start: wp.array(dtype=wp.int32), slot_force: wp.array(dtype=PairForce)):
        """Force [N] and torque [N m] of pairs on grain ``i``, and a number that is zero where it has no wish and no gift."""
        total = sum_of_pairs(slot_start[i], slot_start[i + 1], slot_force, vec8())
        return vec6(total[0], total[1], total[2], total[3], total[4], total[5]), total[6] + total[7]

    return load


def joined(before, number: int, force, in_laboratory: bool):
    """Function that adds the force of field ``number`` [N] to those before it (None: there are none)."""

    @wp.func
    def fields(
        f: FrameRow, q: wp.vec3d, v: wp.vec3d, mass: wp.float64, radius: wp.float64, numbers: wp.array(dtype=Numbers)
    ) -> wp.vec3d:
        total = wp.vec3d()
        if wp.static(before is not None):
            total = before(f, q, v, mass, radius, numbers)
        if wp.static(in_laboratory):
            axes = frame_axes(f)
            there = force(axes * q + frame_origin(f), axes * v, mass, radius, time_of(f), numbers[number])
            total = total + wp.transpose(axes) * there
        else:
            total = total + force(q, v - frame_velocity(f, q), mass, radius, time_of(f), numbers[number])
        return total

    return fields


@wp.func
def by_contacts(total: vec6, inverse_mass: wp.float64, row: Row) -> wp.vec3d:
    """Acceleration by contacts and gravity [m/s2], from the load on a body and one over its mass."""
    return wp.vec3d(total[0], total[1], total[2]) * inverse_mass + gravity(row)


@functools.cache
def build_acceleration(fields: tuple, *, spins: bool, relative: bool, clumps: bool = False):
    """Return ``acceleration``.

    Args:
        fields: force function of each external field, and whether it lives in laboratory axes.
        spins: grains spin.
        relative: the record holds velocities relative to the frame.
        clumps: there are clumps.
    """
    g = grain.build(spins)
    Inverse = clump.inverse_type(clumps)
    external = None
    for number, (force, in_laboratory) in enumerate(fields):
        external = joined(external, number, force, in_laboratory)

    @wp.func
    def acceleration(
        state: g.Record, total: vec6, inv: Inverse, row: Row, frames: wp.array(dtype=FrameRow), at: int, dt: wp.float64,
        numbers: wp.array(dtype=Numbers),
    ):  # fmt: skip
        """Acceleration [m/s2] and angular acceleration [rad/s2] by contacts, gravity and fields, in frame axes."""
        a = by_contacts(total, inv[0], row)
        if wp.static(external is not None):
            f = frames[at]
            q = g.position(state)
            v = g.velocity(state) + g.acceleration(state) * (wp.float64(0.5) * dt)
            if wp.static(relative):
                v = v + frame_velocity(f, q)
            a = a + external(f, q, v, wp.float64(1.0) / inv[0], state[3], numbers) * inv[0]
        return a, wp.vec3d(total[3], total[4], total[5]) * inv[1]

    return acceleration


@functools.cache
def build_travel(
    border, outlet_of, *, spins: bool, moving: int, in_frame: bool, outlets: int, ahead: float, stages: int
):  # fmt: skip
    """Return ``displaced``, what it is made of, ``left``, ``outlet_of``, and whether the frame axes alone count.

    Neighbor lists hold as long as no grain has moved far in axes common to all grains: those of the frame, or of any wall. So
    where every wall moves, the displacement in frame axes does not count, and grains that turn with a drum have not moved.
    A grain in flight (``flight``) has a path instead of a reference.

    Args:
        border: periodic images, of ``border.build``.
        outlet_of: number of the region, of those in which a grain has left the domain, that a place is in; of ``region.build``.
        outlets: number of these regions.
        spins: grains spin.
        moving: number of wall motions relative to the frame (they come first among the placements).
        in_frame: displacements in frame axes count: a wall rests there, or none moves.
        ahead: steps at the present velocity that the lists must hold beyond the present place.
        stages: force calls per step.
    """
    g = grain.build(spins)

    @wp.func
    def allowed_displacement(state: g.Record, max_displacement: wp.float64, dt: wp.float64) -> wp.float64:
        """Displacement [m] that a grain may have made of ``max_displacement``: a stage looks ahead of its position."""
        left = max_displacement
        if wp.static(ahead > 0.0):
            left = wp.max(max_displacement - wp.length(g.velocity(state)) * dt * wp.float64(wp.static(ahead)), wp.float64(0.0))
        return left

    @wp.func
    def squared_distance(q: wp.vec3d, reference: wp.vec3d) -> wp.float64:
        """Square of the displacement of a grain at ``q`` from its reference in frame axes [m2]."""
        displacement = border.nearest(q - reference)
        return wp.dot(displacement, displacement)

    @wp.func
    def squared_displacement(
        i: int, state: g.Record, reference: wp.array2d(dtype=wp.vec3d), placements: wp.array2d(dtype=Placement), row: int
    ) -> wp.float64:  # fmt: skip
        """Square of the displacement from its reference [m2], the largest in the axes that count; NaN of a NaN state."""
        q = g.position(state)
        square = wp.float64(0.0)
        if wp.static(in_frame):
            square = squared_distance(q, reference[i, 0])
        if wp.static(moving > 0):
            for m in range(wp.static(moving)):
                displacement = local(placements[row, m], q) - reference[i, m + 1]
                longer = wp.dot(displacement, displacement)
                if not (longer <= square):
                    square = longer
        return square

    @wp.func
    def holds(path: Flight, state: g.Record, now: wp.float64, dt: wp.float64) -> bool:
        """Whether a grain is on its path at step ``now``."""
        t = (now - path[10]) * dt
        displacement = border.nearest(g.position(state) - position_at(path, t))
        left = path[9]
        if wp.static(ahead > 0.0):
            off = wp.length(g.velocity(state) - velocity_at(path, t)) + wp.length(bend(path)) * dt
            left = wp.max(left - off * dt * wp.float64(wp.static(ahead)), wp.float64(0.0))
        return now <= path[11] and wp.dot(displacement, displacement) <= left * left

    @wp.func
    def distance_ahead(
        state: g.Record, row: Row, placements: wp.array2d(dtype=Placement), before: int, after: int, dt: wp.float64
    ) -> wp.float64:  # fmt: skip
        """Distance [m] that a grain will go in the next step, the largest in the axes that count.

        ``row`` of the schedule at present; ``before``, ``after``: rows of the placements at present and after the step.
        """
        q = g.position(state)
        ahead = q + g.velocity(state) * dt
        ahead = ahead + drift_rotation(row) * ahead + drift_shift(row)
        distance = wp.float64(0.0)
        if wp.static(in_frame):
            distance = wp.length(ahead - q)
        if wp.static(moving > 0):
            for m in range(wp.static(moving)):
                distance = wp.max(distance, wp.length(local(placements[after, m], ahead) - local(placements[before, m], q)))
        return distance

    @wp.func
    def displaced(
        i: int,
        state: g.Record,
        reference: wp.array2d(dtype=wp.vec3d),
        max_displacement: wp.float64,
        flight: wp.array(dtype=Flight),
        placements: wp.array2d(dtype=Placement),
        origin: wp.array(dtype=wp.int32),  # step of the first row of the schedule
        next_row: int,
        dt: wp.float64,
    ) -> int:
        """BEYOND when the grain is further than ``max_displacement`` [m] from its reference, or off its path, or not finite."""
        left = allowed_displacement(state, max_displacement, dt)
        moved = int(0)
        if not (squared_displacement(i, state, reference, placements, next_row) <= left * left):  # so that NaN is noticed here
            moved = wp.static(BEYOND)
            if in_flight(flight, i):
                now = wp.float64(origin[0] + next_row // wp.static(stages) - 1)
                if holds(flight[i], state, now, dt):
                    moved = 0
        return moved

    @wp.func
    def left(q: wp.vec3d, outlets_at: Regions, placements: wp.array2d(dtype=Placement), next_row: int) -> int:
        """LEFT when a grain or clump at ``q`` [m] is in an outlet."""
        found = int(0)
        if wp.static(outlets > 0):
            if outlet_of(q, outlets_at, placements, next_row) >= 0:
                found = wp.static(LEFT)
        return found

    return KernelSet(
        displaced=displaced, left=left, outlet_of=outlet_of, allowed_displacement=allowed_displacement,
        squared_displacement=squared_displacement, squared_distance=squared_distance, distance_ahead=distance_ahead,
        holds=holds, in_frame_alone=in_frame and moving == 0 and ahead == 0.0,
    )  # fmt: skip
