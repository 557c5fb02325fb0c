"""What is read off all grains and contacts at one time: sums that depend on no order, and largest values.

A launch takes a range of the indices. It adds to row ``row`` of the sums, or, on a GPU, to one of ``spread`` rows from there
on, so that few threads meet in the same place. On a CPU each thread has a row of its own, and ``spread`` is 1.

Arrays come as plain numbers, whatever vectors the scene's kernels have made of them: these kernels are the same for all scenes,
and one module.
"""

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, SHARED_READERS
from warpdem.kernels.clump import NONE, Reading
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.grain import RADIUS, REMOVED_X
from warpdem.kernels.measure.exact_sum import add, rounded
from warpdem.kernels.step.schedule import Placement, local
from warpdem.kernels.wall.record import GEOMETRY, RESULT
from warpdem.kernels.wall.shapes import height
from warpdem.kernels.wall.surface import Surface

GRAIN_SUMS = Columns(
    (
        ("mass", 1),  # sum m [kg]
        ("moment", 3),  # sum m q [kg m]
        ("momentum", 3),  # sum m V [N s]
        ("angular_momentum", 3),  # sum (m q x V + I W) [N m s]
        ("kinetic", 1),  # sum (1/2) m V^2 [J]
        ("rotational", 1),  # sum (1/2) I W^2 [J]
    )
)
"""Sums over the grains; vectors in frame axes, about the frame's origin."""
WALL_SUMS = Columns(
    (
        ("force", 3),  # on the grains [N]
        ("moment", 3),  # of these forces about the frame's origin [N m]
        ("torque", 3),  # rolling torque on the grains [N m]
    )
)
"""Sums over the contact points of each wall; vectors in frame axes."""
Motion = wp.types.vector(6, wp.float64)
"""Angular velocity [rad/s] and velocity of the origin [m/s] of axes, resolved in frame axes."""
NOT_LISTED = -1.0e300
"""Overlap of a lane without a contact of grains that are present [m]."""

wp.set_module_options(MODULE_OPTIONS, module=wp.get_module(SHARED_READERS))


@wp.func
def part(row: int, spread: int, i: int) -> int:
    """Row that index ``i`` adds to."""
    return row + i % spread


@wp.func
def position(record: wp.array2d(dtype=wp.float64), i: int) -> wp.vec3d:
    """Position of a grain [m]."""
    return wp.vec3d(record[i, 0], record[i, 1], record[i, 2])


@wp.func
def add_vector(value: wp.vec3d, row: int, column: int, sums_out: wp.array3d(dtype=wp.int64)):
    """Add a vector to three columns."""
    for k in range(3):
        add(value[k], row, column + k, sums_out)


@wp.func
def add_wall_contact(
    point: wp.vec3d, force: wp.vec3d, torque: wp.vec3d, row: int, column: int, sums_out: wp.array3d(dtype=wp.int64)
):  # fmt: skip
    """Add a contact point to the ``WALL_SUMS`` from ``column`` on: force [N] and rolling torque [N m] on the grain."""
    add_vector(force, row, column + wp.static(WALL_SUMS.force), sums_out)
    add_vector(wp.cross(point, force), row, column + wp.static(WALL_SUMS.moment), sums_out)
    add_vector(torque, row, column + wp.static(WALL_SUMS.torque), sums_out)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def grain_sums(
    first: int, row: int, spread: int,
    record: wp.array2d(dtype=wp.float64), inverse: wp.array2d(dtype=wp.float64), velocity: wp.array(dtype=wp.vec3d),
    spin: wp.array(dtype=wp.vec3d),
    axes: Motion,  # that velocity and spin are relative to; zeros if they are absolute
    spins: int,  # 0: grains have no spin, whatever ``spin`` holds
    clump: wp.array(dtype=wp.int32),  # of ``kernels.clump``, whose members ``clump_sums`` counts; of size 0 without clumps
    sums_out: wp.array3d(dtype=wp.int64),
):  # fmt: skip
    """``GRAIN_SUMS`` of the grains that are present."""
    i = first + wp.tid()
    if record[i, 0] == wp.float64(wp.static(REMOVED_X)):
        return
    if clump.shape[0] > 0:
        if clump[i] != wp.static(NONE):
            return
    p = part(row, spread, i)
    q = position(record, i)
    mass = wp.float64(1.0) / inverse[i, 0]
    frame_spin = wp.vec3d(axes[0], axes[1], axes[2])
    v = velocity[i] + (wp.vec3d(axes[3], axes[4], axes[5]) + wp.cross(frame_spin, q))
    add(mass, p, wp.static(GRAIN_SUMS.mass), sums_out)
    add_vector(mass * q, p, wp.static(GRAIN_SUMS.moment), sums_out)
    add_vector(mass * v, p, wp.static(GRAIN_SUMS.momentum), sums_out)
    add(wp.float64(0.5) * mass * wp.dot(v, v), p, wp.static(GRAIN_SUMS.kinetic), sums_out)
    angular = mass * wp.cross(q, v)
    if spins > 0:
        w = spin[i] + frame_spin
        inertia = wp.float64(1.0) / inverse[i, 1]
        angular = angular + inertia * w
        add(wp.float64(0.5) * inertia * wp.dot(w, w), p, wp.static(GRAIN_SUMS.rotational), sums_out)
    add_vector(angular, p, wp.static(GRAIN_SUMS.angular_momentum), sums_out)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def clump_sums(
    first: int, row: int, spread: int,
    record: wp.array2d(dtype=wp.float64),  # of the clumps
    rate: wp.array(dtype=wp.vec4d),  # 1/m first
    reading: wp.array(dtype=Reading),  # velocity, spin and angular momentum at the present time
    sums_out: wp.array3d(dtype=wp.int64),
):  # fmt: skip
    """``GRAIN_SUMS`` of the clumps that are present."""
    c = first + wp.tid()
    if record[c, 0] == wp.float64(wp.static(REMOVED_X)):
        return
    p = part(row, spread, c)
    q = position(record, c)
    mass = wp.float64(1.0) / rate[c][0]
    motion = reading[c]
    v = wp.vec3d(motion[0], motion[1], motion[2])
    momentum = wp.vec3d(motion[6], motion[7], motion[8])
    add(mass, p, wp.static(GRAIN_SUMS.mass), sums_out)
    add_vector(mass * q, p, wp.static(GRAIN_SUMS.moment), sums_out)
    add_vector(mass * v, p, wp.static(GRAIN_SUMS.momentum), sums_out)
    add(wp.float64(0.5) * mass * wp.dot(v, v), p, wp.static(GRAIN_SUMS.kinetic), sums_out)
    rotational = wp.float64(0.5) * wp.dot(wp.vec3d(motion[3], motion[4], motion[5]), momentum)
    add(rotational, p, wp.static(GRAIN_SUMS.rotational), sums_out)
    add_vector(mass * wp.cross(q, v) + momentum, p, wp.static(GRAIN_SUMS.angular_momentum), sums_out)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def column_sums(
    first: int, row: int, spread: int,
    value: wp.array2d(dtype=wp.float64),
    record: wp.array2d(dtype=wp.float64),  # of the grains that the rows of ``value`` belong to; of size 0: all count
    column: int,  # of the sums, where the first goes to
    sums_out: wp.array3d(dtype=wp.int64),
):  # fmt: skip
    """Sums of the columns of an array."""
    i = first + wp.tid()
    if record.shape[0] > 0:
        if record[i, 0] == wp.float64(wp.static(REMOVED_X)):
            return
    for k in range(value.shape[1]):
        add(value[i, k], part(row, spread, i), column + k, sums_out)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def wall_sums(
    first: int, row: int, spread: int,
    record: wp.array2d(dtype=wp.float64),
    grain: wp.array(dtype=wp.int32), slot: wp.array(dtype=wp.int32), point_count: wp.array2d(dtype=wp.int32),
    point: wp.array3d(dtype=wp.float64), result: wp.array2d(dtype=wp.float64), parity: int,
    column: int,  # of the sums, where those of the first wall begin
    sums_out: wp.array3d(dtype=wp.int64),
):  # fmt: skip
    """``WALL_SUMS`` of each wall, over the contact points of the last force call."""
    r = first + wp.tid()
    i = grain[r]
    if record[i, 0] == wp.float64(wp.static(REMOVED_X)):
        return
    p = part(row, spread, r)
    for s in range(slot[i], slot[i] + point_count[parity, i]):
        force = wp.vec3d(
            result[s, wp.static(RESULT.force)], result[s, wp.static(RESULT.force + 1)], result[s, wp.static(RESULT.force + 2)]
        )
        normal = wp.vec3d(
            point[parity, s, wp.static(GEOMETRY.normal)], point[parity, s, wp.static(GEOMETRY.normal + 1)],
            point[parity, s, wp.static(GEOMETRY.normal + 2)],
        )  # fmt: skip
        arm = record[i, wp.static(RADIUS)] - point[parity, s, wp.static(GEOMETRY.overlap)]
        at = column + int(point[parity, s, wp.static(GEOMETRY.wall)]) * wp.static(WALL_SUMS.width)
        torque = wp.vec3d()
        if result.shape[1] > wp.static(RESULT.moment):
            torque = wp.vec3d(
                result[s, wp.static(RESULT.moment)], result[s, wp.static(RESULT.moment + 1)],
                result[s, wp.static(RESULT.moment + 2)],
            )  # fmt: skip
        add_wall_contact(position(record, i) - normal * arm, force, torque, p, at, sums_out)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def furthest_behind(
    first: int, row: int, spread: int,
    record: wp.array2d(dtype=wp.float64), surface: Surface,
    bodies: wp.array(dtype=Placement),  # of each wall at present
    most_out: wp.array2d(dtype=wp.float64),  # one column
):  # fmt: skip
    """The most that a grain's centre is behind an analytic wall that has a solid side, in radii; below 0 in front of all."""
    i = first + wp.tid()
    if record[i, 0] == wp.float64(wp.static(REMOVED_X)):
        return
    q = position(record, i)
    radius = record[i, wp.static(RADIUS)]
    most = wp.float64(-1.0e300)
    for k in range(surface.analytic):
        at = local(bodies[surface.wall[surface.triangles + k]], q)
        most = wp.max(most, -height(surface.shape[k], at, surface.numbers[k]) / radius)
    wp.atomic_max(most_out, part(row, spread, i), 0, most)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def joined_sums(
    rows: int, sums: wp.array3d(dtype=wp.int64), digits_out: wp.array2d(dtype=wp.int64)
):
    """The digits of each sum, those of all rows added up, shape (columns, digits); all rows are then zero again."""
    c = wp.tid()
    for k in range(sums.shape[2]):
        total = wp.int64(0)
        for r in range(rows):
            total += sums[r, c, k]
            sums[r, c, k] = wp.int64(0)
        digits_out[c, k] = total


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def rounded_sums(
    parts: int, sums: wp.array3d(dtype=wp.int64), value_out: wp.array(dtype=wp.float64)
):
    """Each sum, over the digits of all ``parts`` of a run, rounded; they are used up."""
    c = wp.tid()
    value_out[c] = rounded(parts, c, sums)


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def pair_overlaps(
    first: int,
    record: wp.array2d(dtype=wp.float64),
    owner: wp.array(dtype=wp.int32), partner: wp.array(dtype=wp.int32), slot: wp.array(dtype=wp.int32),
    no_slot: int,  # force slot of lanes that only fill a batch
    period: wp.vec3d,  # 0 where an axis is not periodic
    overlap_out: wp.array(dtype=wp.float64), normal_out: wp.array(dtype=wp.vec3d),
):  # fmt: skip
    """Overlap [m] and unit normal of each lane of the contact batches; ``NOT_LISTED`` where there is no contact."""
    t = first + wp.tid()
    overlap_out[t] = wp.float64(wp.static(NOT_LISTED))
    if slot[t] >= no_slot:
        return
    i = owner[t]
    j = partner[t]
    if record[i, 0] == wp.float64(wp.static(REMOVED_X)) or record[j, 0] == wp.float64(wp.static(REMOVED_X)):
        return
    across = position(record, i) - position(record, j)
    for k in range(3):
        if period[k] > wp.float64(0.0):
            if across[k] > wp.float64(0.5) * period[k]:
                across[k] = across[k] - period[k]
            elif across[k] < wp.float64(-0.5) * period[k]:
                across[k] = across[k] + period[k]
    distance = wp.sqrt(wp.dot(across, across))
    overlap_out[t] = record[i, wp.static(RADIUS)] + record[j, wp.static(RADIUS)] - distance
    normal_out[t] = across / distance
