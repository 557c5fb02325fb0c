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
from warpdem.kernels.clump import Reading, place_of
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.field import Numbers
from warpdem.kernels.step.free_rotation import free_rotation, product, rotation_matrix, rotation_vector
from warpdem.kernels.step.motion import by_contacts
from warpdem.kernels.step.schedule import FrameRow, Row, kick_time

vec6 = wp.types.vector(6, wp.float64)
vec8 = clump_arrays.inverse_type(True)
BODY = Columns(
    (
        ("center", 3),  # [m]
        ("axes", 9),  # from the principal axes to the frame axes
        ("rotation", 4),  # quaternion of the step, its vector part in frame axes
        ("velocity", 3),  # of the centre over the step [m/s]
        ("spin", 3),  # mean of the step [rad/s]
        ("predicted_velocity", 3),  # of the centre at the time of the next force call [m/s]
        ("predicted_spin", 3),  # [rad/s]
        ("angular", 3),  # acceleration of the members' spin [rad/s2]
        ("inverse_mass", 1),  # [1/kg]
        ("response", 6),  # J = I^-1 in frame axes: xx, xy, xz, yy, yz, zz [1/(kg m2)]
    )
)
"""What all members of a clump are written from."""
Body = BODY.vector(wp.float64)


@functools.cache
def vector_of(name: str):
    """Return the function that takes three numbers of BODY out of it."""
    at = getattr(BODY, name)

    @wp.func
    def vector(body: Body) -> wp.vec3d:
        return wp.vec3d(body[wp.static(at)], body[wp.static(at + 1)], body[wp.static(at + 2)])

    return vector


center, velocity, spin, angular = map(vector_of, ("center", "velocity", "spin", "angular"))
predicted_velocity, predicted_spin = map(vector_of, ("predicted_velocity", "predicted_spin"))


@wp.func
def axes_of(body: Body) -> wp.mat33d:
    """From the principal axes to the frame axes."""
    at = wp.static(BODY.axes)
    return wp.mat33d(
        body[at], body[at + 1], body[at + 2], body[at + 3], body[at + 4], body[at + 5], body[at + 6], body[at + 7], body[at + 8]
    )


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
    rates = principal_rates(rate)
    a = wp.vec3d(axes[0, 0], axes[0, 1], axes[0, 2])
    b = wp.vec3d(axes[1, 0], axes[1, 1], axes[1, 2])
    c = wp.vec3d(axes[2, 0], axes[2, 1], axes[2, 2])
    x = wp.cw_mul(a, rates)
    y = wp.cw_mul(b, rates)
    xx = wp.dot(x, a)
    xy = wp.dot(x, b)
    xz = wp.dot(x, c)
    yy = wp.dot(y, b)
    yz = wp.dot(y, c)
    zz = wp.dot(wp.cw_mul(c, rates), c)
    return wp.mat33d(xx, xy, xz, xy, yy, yz, xz, yz, zz)


@wp.func
def member_response(body: Body, r: wp.vec3d) -> vec6:
    """B of a member at ``r`` [m] from the centre: 1/m + [r]^T J [r], written out."""
    at = wp.static(BODY.response)
    one = body[wp.static(BODY.inverse_mass)]
    xx = body[at]
    xy = body[at + 1]
    xz = body[at + 2]
    yy = body[at + 3]
    yz = body[at + 4]
    zz = body[at + 5]
    x = r[0]
    y = r[1]
    z = r[2]
    a = xy * z - xz * y  # J (r x e) by columns: of e_x the y and z of J, and so on
    b = yy * z - yz * y
    c = yz * z - zz * y
    d = xz * x - xx * z
    f = zz * x - xz * z
    h = xx * y - xy * x
    k = xy * y - yy * x
    return vec6(
        one + (b * z - c * y), c * x - a * z, a * y - b * x, one + (f * x - d * z), d * y - (yz * x - xy * z) * x,
        one + (h * y - k * x),
    )  # fmt: skip


@wp.func
def with_member(total: vec6, axes: wp.mat33d, arm: wp.vec4d, one: vec6) -> vec6:
    """The load ``total`` on a clump about its centre [N, N m] and that of a member, ``one``, at ``arm`` [m] in its axes."""
    torque = wp.cross(axes * place_of(arm), wp.vec3d(one[0], one[1], one[2]))
    return total + vec6(one[0], one[1], one[2], one[3] + torque[0], one[4] + torque[1], one[5] + torque[2])


@wp.func
def what_drives(total: vec6, rate: wp.vec4d, row: Row) -> vec6:
    """Acceleration of the centre [m/s2] and torque [N m] by contacts and gravity."""
    a = by_contacts(total, rate[0], row)
    return vec6(a[0], a[1], a[2], total[3], total[4], total[5])


@functools.cache
def build_motion(drift, with_axes, border):
    """Return what a step does with one clump, as functions of numbers alone, which go into lanes too (``clump_sweep``).

    Args:
        drift: of ``exact_drift.build_drift``.
        with_axes: how a quaternion turns with the axes, of ``orientation.build_axes``.
        border: periodic images, of ``border.build``: a clump comes round with its centre, each member with its own.
    """
    g = grain.build(True)

    @wp.func
    def moved(state: g.Record, turn: wp.vec4d, rate: wp.vec4d, drive: vec6, row: Row, dt: wp.float64):
        """Record, orientation and rotation of a clump after kick and drift by what drives it."""
        a = wp.vec3d(drive[0], drive[1], drive[2])
        torque = wp.vec3d(drive[3], drive[4], drive[5])
        momentum = g.spin(state) + torque * kick_time(row)
        p = free_rotation(wp.transpose(rotation_matrix(turn)) * momentum, principal_rates(rate), dt)
        return drift(state, a, torque, row, dt), with_axes(product(turn, p), row), p

    @wp.func
    def inside(state: g.Record) -> g.Record:
        """The same at its image within the periodic borders."""
        out = state
        if wp.static(border.images > 1):
            out = g.placed(state, border.wrapped(g.position(state)))
        return out

    @wp.func
    def body_of(state: g.Record, turn: wp.vec4d, p: wp.vec4d, rate: wp.vec4d, dt: wp.float64) -> Body:
        """What its members are written from, of a clump after the step that turned it by ``p``."""
        axes = rotation_matrix(turn)
        q = g.position(state)
        v = g.velocity(state)
        half = wp.float64(0.5) * dt
        per_step = wp.float64(1.0) / dt
        w = axes * (rotation_vector(p) * per_step)
        u = axes * wp.vec3d(p[1], p[2], p[3])
        ahead = v + g.acceleration(state) * half
        j = inverse_inertia(axes, rate)
        spin_ahead = j * (g.spin(state) + g.angular_acceleration(state) * half)
        b = (spin_ahead - w) * (wp.float64(2.0) * per_step)
        return Body(
            q[0], q[1], q[2],
            axes[0, 0], axes[0, 1], axes[0, 2], axes[1, 0], axes[1, 1], axes[1, 2], axes[2, 0], axes[2, 1], axes[2, 2],
            wp.float64(1.0) + p[0], u[0], u[1], u[2], v[0], v[1], v[2], w[0], w[1], w[2], ahead[0], ahead[1], ahead[2],
            spin_ahead[0], spin_ahead[1], spin_ahead[2], b[0], b[1], b[2],
            rate[0], j[0, 0], j[0, 1], j[0, 2], j[1, 1], j[1, 2], j[2, 2],
        )  # fmt: skip

    @wp.func
    def member_of(body: Body, arm: wp.vec4d, dt: wp.float64):
        """Record and B of the member of this ``arm``, its place in the principal axes and its radius [m]."""
        r = axes_of(body) * place_of(arm)
        at = wp.static(BODY.rotation)
        u = wp.vec3d(body[at + 1], body[at + 2], body[at + 3])
        across = wp.cross(u, r)
        way = across * (wp.float64(2.0) * body[at]) - wp.cross(u, across) * wp.float64(2.0)  # r - p^-1 r
        v = velocity(body) + way * (wp.float64(1.0) / dt)
        there = predicted_velocity(body) + wp.cross(predicted_spin(body), r)
        a = (there - v) * (wp.float64(2.0) / dt)
        place = center(body) + r
        if wp.static(border.images > 1):
            place = border.wrapped(place)
        return g.record(place, arm[3], v, a, spin(body), angular(body)), member_response(body, r)

    return KernelSet(moved=moved, inside=inside, body_of=body_of, member_of=member_of)


@functools.cache
def build(structs, WallContacts, load, acceleration, integrator, motion):
    """Return the functions of a clump.

    Args:
        structs: namespace of ``structs.build``.
        WallContacts: struct of the wall contacts.
        load: sum over the contacts of a grain, of ``motion.build_load``.
        acceleration: of ``motion.build_acceleration``.
        integrator: (advance, reading) of ``exact_drift``.
        motion: of ``build_motion``.
    """
    g = grain.build(True)
    arrays = clump_arrays.build(True)
    Clumps, arm_of = arrays.Clumps, arrays.arm_of
    _, reading_of_record = integrator
    Grains, PairForce = structs.Grains, structs.PairForce

    @wp.func
    def total_load(
        c: int, clumps: Clumps, slot_start: wp.array(dtype=wp.int32), slot_force: wp.array(dtype=PairForce),
        wall_contacts: WallContacts,
    ) -> vec6:  # fmt: skip
        """Contact force [N] on a clump and torque about its centre [N m]."""
        axes = rotation_matrix(clumps.turn[c])
        total = vec6()
        first = clumps.first[c]
        for m in range(first, first + clumps.count[c]):
            one = load(m, slot_start, slot_force, wall_contacts.candidates, wall_contacts.load)
            total = with_member(total, axes, arm_of(c, m, clumps), one)
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
    def member_motion(c: int, m: int, axes: wp.mat33d, motion: Reading, clumps: Clumps):
        """Velocity and spin of member ``m`` of clump ``c``, which moves like that."""
        w = wp.vec3d(motion[3], motion[4], motion[5])
        return wp.vec3d(motion[0], motion[1], motion[2]) + wp.cross(w, axes * place_of(arm_of(c, m, clumps))), w

    @wp.func
    def advance(c: int, grains: Grains, row: Row, dt: wp.float64) -> wp.vec3d:
        """Kick, drift and rotate a clump by its ``drive``; returns its centre before it comes round a border [m]."""
        clumps = grains.clumps
        state, turn, p = motion.moved(clumps.record[c], clumps.turn[c], clumps.rate[c], clumps.drive[c], row, dt)
        clumps.record[c] = motion.inside(state)
        clumps.turn[c] = turn
        clumps.rotation[c] = p
        return g.position(state)

    @wp.func
    def write_members(c: int, grains: Grains, dt: wp.float64):
        """Write the members of a clump after ``advance``."""
        clumps = grains.clumps
        body = motion.body_of(clumps.record[c], clumps.turn[c], clumps.rotation[c], clumps.rate[c], dt)
        first = clumps.first[c]
        for m in range(first, first + clumps.count[c]):
            record, response = motion.member_of(body, arm_of(c, m, clumps), dt)
            grains.record[m] = record
            inv = grains.inverse[m]
            for k in range(6):
                inv[2 + k] = response[k]
            grains.inverse[m] = inv

    return KernelSet(
        total_load=total_load, accelerations=accelerations, motion_now=motion_now, member_motion=member_motion,
        advance=advance, write_members=write_members, of_numbers=motion, Clumps=Clumps,
    )  # fmt: skip
