"""Clumps in a step: forces of their members summed, kick, exact drift, free rotation, and the members written from them.

    F = sum F_m + m g,   M = sum (r_m x F_m + M_m),   r_m = Q r_body          members in the order of their template
    V <- V + k F/m,      L <- L + k M                                         the kick
    centre by the integrator,   Q <- Q p          the drift, p by ``free_rotation``; L is constant
    V, L, M, Q turn with the axes

So a clump flies and turns freely to round-off, whatever the frame does. Members at the end of the step, in its axes:

    position q + r_m,   velocity V + (r_m - R r_m before)/dt: their mean velocity, so that a contact finds them where they were
    spin: mean spin, the rotation vector of p over dt
    accelerations such that velocity + (dt/2) acceleration is the predicted V + W x r_m with W = I^-1 (L + (dt/2) M), and the
    same of the spin: what dashpots see

and B (``kernels.clump``). Energy: a kick changes (1/2) L . I^-1 L by dt M . W_k exactly, W_k = I^-1 L_k, and M . W + F . V is
the sum of the members' F_m . v_m + M_m . W: the books of single grains hold for members.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels import clump as clump_arrays
from warpdem.kernels.clump import Reading
from warpdem.kernels.field import Numbers
from warpdem.kernels.step.free_rotation import free_rotation, product, rotation_matrix, rotation_vector
from warpdem.kernels.step.schedule import FrameRow, Row, kick_time

vec6 = wp.types.vector(6, wp.float64)
vec8 = clump_arrays.inverse_type(True)


@wp.func
def principal_rates(rate: wp.vec4d) -> wp.vec3d:
    """1/I_k [1/(kg m2)]."""
    return wp.vec3d(rate[1], rate[2], rate[3])


@wp.func
def spin_of(axes: wp.mat33d, momentum: wp.vec3d, rate: wp.vec4d) -> wp.vec3d:
    """I^-1 L [rad/s]."""
    return axes * wp.cw_mul(principal_rates(rate), wp.transpose(axes) * momentum)


@wp.func
def inverse_inertia(axes: wp.mat33d, rate: wp.vec4d) -> wp.mat33d:
    """J = I^-1 in frame axes [1/(kg m2)], which is symmetric."""
    x = wp.cw_mul(axes[0], principal_rates(rate))
    y = wp.cw_mul(axes[1], principal_rates(rate))
    xx = wp.dot(x, axes[0])
    xy = wp.dot(x, axes[1])
    xz = wp.dot(x, axes[2])
    yy = wp.dot(y, axes[1])
    yz = wp.dot(y, axes[2])
    zz = wp.dot(wp.cw_mul(axes[2], principal_rates(rate)), axes[2])
    return wp.mat33d(xx, xy, xz, xy, yy, yz, xz, yz, zz)


@wp.func
def member_inverse(inv: vec8, j: wp.mat33d, r: wp.vec3d, rate: wp.vec4d) -> vec8:
    """``inverse`` of a member at ``r`` [m] from the centre, with B of these axes, [r]^T J [r] written out; ``j``: J."""
    x = r[0]
    y = r[1]
    z = r[2]
    a = j[0, 1] * z - j[0, 2] * y  # J (r x e) by columns: of e_x the y and z of J, and so on
    b = j[1, 1] * z - j[1, 2] * y
    c = j[1, 2] * z - j[2, 2] * y
    d = j[0, 2] * x - j[0, 0] * z
    f = j[2, 2] * x - j[0, 2] * z
    h = j[0, 0] * y - j[0, 1] * x
    k = j[0, 1] * y - j[1, 1] * x
    return vec8(
        inv[0], inv[1], rate[0] + (b * z - c * y), c * x - a * z, a * y - b * x, rate[0] + (f * x - d * z),
        d * y - (j[1, 2] * x - j[0, 1] * z) * x, rate[0] + (h * y - k * x),
    )  # fmt: skip


@functools.cache
def build(structs, WallContacts, load, acceleration, integrator, with_axes, border):
    """Return the functions of a clump.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: struct of the wall contacts.
        load: sum over the contacts of a grain, of ``motion.build_load``.
        acceleration: of ``motion.build_acceleration``.
        integrator: (advance, reading) of ``exact_drift``.
        with_axes: how a quaternion turns with the axes, of ``orientation.build_axes``.
        border: periodic images, of ``border.build``: a clump comes round with its centre, each member with its own.
    """
    g = grain.build(True)
    Clumps = clump_arrays.build(True).Clumps
    advance_record, reading_of_record = integrator
    Grains, PairForce = structs.Grains, structs.PairForce

    @wp.func
    def total_load(
        c: int, clumps: Clumps, row_start: wp.array(dtype=wp.int32), row: wp.array(dtype=PairForce),
        wall_contacts: WallContacts,
    ) -> vec6:  # fmt: skip
        """Contact force [N] on a clump and torque about its centre [N m]."""
        axes = rotation_matrix(clumps.turn[c])
        total = vec6()
        first = clumps.first[c]
        for m in range(first, first + clumps.count[c]):
            one = load(m, row_start, row, wall_contacts.candidates, wall_contacts.load)
            torque = wp.cross(axes * clumps.arm[m], wp.vec3d(one[0], one[1], one[2]))
            total = total + vec6(one[0], one[1], one[2], one[3] + torque[0], one[4] + torque[1], one[5] + torque[2])
        return total

    @wp.func
    def accelerations(
        c: int, total: vec6, clumps: Clumps, row: Row, frames: wp.array(dtype=FrameRow), at: int, dt: wp.float64,
        numbers: wp.array(dtype=Numbers),
    ):  # fmt: skip
        """Acceleration of the centre [m/s2] and torque [N m]; fields act as on a sphere of equal mass and volume there."""
        inv = vec8()
        inv[0] = clumps.rate[c][0]
        inv[1] = wp.float64(1.0)
        a, torque = acceleration(clumps.record[c], total, inv, row, frames, at, dt, numbers)
        return a, torque

    @wp.func
    def motion_now(
        c: int, a: wp.vec3d, torque: wp.vec3d, clumps: Clumps, row: Row, frames: wp.array(dtype=FrameRow), at: int,
        dt: wp.float64,
    ) -> Reading:  # fmt: skip
        """Velocity, spin and angular momentum at the present time."""
        v, momentum = reading_of_record(clumps.record[c], a, torque, row, frames, at, dt)
        w = spin_of(rotation_matrix(clumps.turn[c]), momentum, clumps.rate[c])
        return Reading(v[0], v[1], v[2], w[0], w[1], w[2], momentum[0], momentum[1], momentum[2])

    @wp.func
    def member_motion(m: int, axes: wp.mat33d, motion: Reading, clumps: Clumps):
        """Velocity and spin of member ``m`` of a clump that moves like that."""
        w = wp.vec3d(motion[3], motion[4], motion[5])
        return wp.vec3d(motion[0], motion[1], motion[2]) + wp.cross(w, axes * clumps.arm[m]), w

    @wp.func
    def advance(
        c: int, grains: Grains, row: Row, frames: wp.array(dtype=FrameRow), at: int, dt: wp.float64
    ) -> wp.vec3d:  # fmt: skip
        """Kick, drift and rotate a clump by its ``drive``; returns its centre before it comes round a border [m]."""
        clumps = grains.clumps
        drive = clumps.drive[c]
        a = wp.vec3d(drive[0], drive[1], drive[2])
        torque = wp.vec3d(drive[3], drive[4], drive[5])
        state = clumps.record[c]
        turn = clumps.turn[c]
        momentum = g.spin(state) + torque * kick_time(row)
        p = free_rotation(wp.transpose(rotation_matrix(turn)) * momentum, principal_rates(clumps.rate[c]), dt)
        state = advance_record(0, c, state, a, torque, row, frames, at, dt, grains.store)
        reached = g.position(state)
        if wp.static(border.images > 1):
            state = g.placed(state, border.wrapped(reached))
        clumps.record[c] = state
        clumps.turn[c] = with_axes(product(turn, p), row)
        clumps.rotation[c] = p
        return reached

    @wp.func
    def write_members(c: int, grains: Grains, dt: wp.float64):
        """Write the members of a clump after ``advance``."""
        clumps = grains.clumps
        state = clumps.record[c]
        rate = clumps.rate[c]
        p = clumps.rotation[c]
        axes = rotation_matrix(clumps.turn[c])
        q = g.position(state)
        v = g.velocity(state)
        half = wp.float64(0.5) * dt
        per_step = wp.float64(1.0) / dt
        back = wp.float64(2.0) * per_step
        spin = axes * (rotation_vector(p) * per_step)
        u = axes * wp.vec3d(p[1], p[2], p[3])
        predicted_velocity = v + g.acceleration(state) * half
        j = inverse_inertia(axes, rate)
        predicted_spin = j * (g.spin(state) + g.angular_acceleration(state) * half)
        angular = (predicted_spin - spin) * back
        scalar = wp.float64(2.0) * (wp.float64(1.0) + p[0])
        first = clumps.first[c]
        for m in range(first, first + clumps.count[c]):
            r = axes * clumps.arm[m]
            across = wp.cross(u, r)
            way = across * scalar - wp.cross(u, across) * wp.float64(2.0)  # r - p^-1 r
            velocity = v + way * per_step
            there = predicted_velocity + wp.cross(predicted_spin, r)
            place = q + r
            if wp.static(border.images > 1):
                place = border.wrapped(place)
            grains.record[m] = g.record(place, grains.record[m][3], velocity, (there - velocity) * back, spin, angular)
            grains.inverse[m] = member_inverse(grains.inverse[m], j, r, rate)

    return KernelSet(
        total_load=total_load, accelerations=accelerations, motion_now=motion_now, member_motion=member_motion,
        advance=advance, write_members=write_members, Clumps=Clumps,
    )  # fmt: skip
