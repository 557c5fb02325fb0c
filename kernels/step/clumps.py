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
    """J = I^-1 in frame axes [1/(kg m2)]."""
    return axes * wp.diag(principal_rates(rate)) * wp.transpose(axes)


@wp.func
def member_inverse(inv: vec8, j: wp.mat33d, r: wp.vec3d, rate: wp.vec4d) -> vec8:
    """``inverse`` of a member at ``r`` [m] from the centre, with B of these axes; ``j``: J."""
    x = wp.cross(j * wp.vec3d(wp.float64(0.0), r[2], -r[1]), r)  # J (r x e) x r = [r]^T J [r] e
    y = wp.cross(j * wp.vec3d(-r[2], wp.float64(0.0), r[0]), r)
    z = wp.cross(j * wp.vec3d(r[1], -r[0], wp.float64(0.0)), r)
    return vec8(inv[0], inv[1], rate[0] + x[0], x[1], x[2], rate[0] + y[1], y[2], rate[0] + z[2])


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
        c: int, a: wp.vec3d, torque: wp.vec3d, grains: Grains, row: Row, frames: wp.array(dtype=FrameRow), at: int,
        dt: wp.float64,
    ) -> wp.vec3d:  # fmt: skip
        """Kick, drift and rotate a clump, and write its members; returns its centre before it comes round a border [m]."""
        clumps = grains.clumps
        state = clumps.record[c]
        rate = clumps.rate[c]
        turn = clumps.turn[c]
        momentum = g.spin(state) + torque * kick_time(row)
        p = free_rotation(wp.transpose(rotation_matrix(turn)) * momentum, principal_rates(rate), dt)
        state = advance_record(0, c, state, a, torque, row, frames, at, dt, grains.store)
        turn = with_axes(product(turn, p), row)
        reached = g.position(state)
        if wp.static(border.images > 1):
            state = g.placed(state, border.wrapped(reached))
        clumps.record[c] = state
        clumps.turn[c] = turn
        axes = rotation_matrix(turn)
        q = g.position(state)
        v = g.velocity(state)
        half = wp.float64(0.5) * dt
        back = wp.float64(1.0) / half
        spin = axes * rotation_vector(p) / dt
        predicted_velocity = v + g.acceleration(state) * half
        j = inverse_inertia(axes, rate)
        predicted_spin = j * (g.spin(state) + g.angular_acceleration(state) * half)
        angular = (predicted_spin - spin) * back
        scalar = wp.float64(2.0) * (wp.float64(1.0) + p[0])
        u = wp.vec3d(p[1], p[2], p[3])
        first = clumps.first[c]
        per_step = wp.float64(1.0) / dt
        for m in range(first, first + clumps.count[c]):
            arm = clumps.arm[m]
            r = axes * arm
            across = wp.cross(u, arm)
            way = across * scalar - wp.cross(u, across) * wp.float64(2.0)  # r - p^-1 r, in the body's axes
            velocity = v + axes * way * per_step
            there = predicted_velocity + wp.cross(predicted_spin, r)
            place = q + r
            if wp.static(border.images > 1):
                place = border.wrapped(place)
            grains.record[m] = g.record(place, grains.record[m][3], velocity, (there - velocity) * back, spin, angular)
            grains.inverse[m] = member_inverse(grains.inverse[m], j, r, rate)
        return reached

    return KernelSet(
        total_load=total_load, accelerations=accelerations, motion_now=motion_now, member_motion=member_motion,
        advance=advance, Clumps=Clumps,
    )  # fmt: skip
