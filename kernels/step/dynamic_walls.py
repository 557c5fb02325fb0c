r"""Walls whose motion follows from the load on them: a coordinate s along or about an axis, one number per wall.

    M u' = D + T(u) + G - L - k (s - s0) - c u,      s' = u,      L = F . a  or  ((x - o) x F + M_r) . a

    s    displacement along the axis a [m], or angle about it through the point o [rad]
    D    drive: what acts on the wall by the scene, against time           [N or N m]
    T    motor, straight between the points of its curve                   [N or N m]
    G    weight, m g . a  or  ((x_c - o) x m g) . a                        [N or N m]
    L    what the wall does to the grains along a, summed over its contact points: F, M_r force and rolling torque on a grain
    k, c spring and damper                                                 [N/m, N s/m or N m/rad, N m s/rad]
    M    mass, or moment of inertia about the axis                         [kg or kg m2]

A free wall has an M of its own, and stops dead at the ends of its range, if it has one. A servo has none, no motor, weight,
spring or damper, and a largest speed, |u| <= u_max: its drive is the load that it is to hold, and its M is sum m, or sum m r^2,
the mass of the grains that it touches, r their distance from the axis, at least that of the largest grain.

So a servo is a wall of that mass, which the drive pushes against the grains. Each grain meets a wall of its own mass: what
bounds the step of two grains bounds that of a servo, and no constant is to be tuned. At rest, and in the mean where u goes
neither up nor down, L = D whatever M is. What rings in the bed is damped by the bed. (Tried on 64 grains: a damper
sum sqrt(F_n m / overlap) in the servo takes a tenth off the first peak of the load, and off the load in the mean as long as the
wall moves.)

Kicks and drifts are those of the grains: the load at t_k over the kick time h, then the drift to t_k+1. Damper and motor take
the mean rate of the kick, the motor along its slope at the rate before it:

    M (u_k+1/2 - u_k-1/2)/h = Q(t_k) + T(u_k-1/2) + T' (u_k - u_k-1/2) - c u_k,      u_k = (u_k-1/2 + u_k+1/2)/2

So a kick changes (1/2) M u^2 by exactly the work h (...) u_k; where the end of the range stops the wall, u_k is that of the
stop, and what the motion does not keep of the work is lost: nothing where the wall rests there. At t_k+1 contacts see the
velocity predicted, u_k+1/2 + (dt/2) u'. The sums are exact (``kernels.measure.exact_sum``), so the path of a wall has the
same bits on any number of threads. A drive that is no number holds the wall.

Bodies with six degrees of freedom have no axis: ``free_bodies``.

The placement that the host has written is where the wall would be at s = 0; the step moves it from there.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, grain
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.measure.exact_sum import WIDTH, add, rounded
from warpdem.kernels.measure.readings import WALL_SUMS, add_wall_contact
from warpdem.kernels.step.free_bodies import advance_body, vector_at
from warpdem.kernels.step.schedule import (
    Placement,
    Row,
    axes,
    gravity,
    kick_time,
    placed,
    rotated,
    surface_circulation,
    surface_vector,
    wall_spin,
)
from warpdem.kernels.wall.mobility import MOBILITY, Mobility
from warpdem.kernels.wall.record import RESULT

NUMBERS = Columns(
    (
        ("rotates", 1),  # 1 about the axis, 0 along it; 2 of a body with six degrees of freedom
        ("axis", 3),  # unit vector, in the axes of the wall at s = 0
        ("origin", 3),  # a point on it [m]
        ("least", 1),  # least M of a servo; of a free wall 0
        ("max_rate", 1),  # largest speed [m/s or rad/s]
        ("inertia", 1),  # M of a free wall; of a servo 0
        ("mass", 1),  # m that gravity pulls [kg]
        ("center", 3),  # x_c in the axes of the wall [m]
        ("stiffness", 1),
        ("rest", 1),  # s0 [m or rad]
        ("damping", 1),
        ("low", 1),  # ends of the range of s [m or rad]
        ("high", 1),
    )
)
"""What does not change of a wall."""
STATE = Columns(
    (
        ("position", 1),  # s [m or rad]
        ("rate", 1),  # u in the middle of the last step [m/s or rad/s]
        ("predicted", 1),  # u that the contacts of this time see
        ("correction", 1),  # work on the grains beyond that of the predicted velocity [J]
        ("driven", 1),  # work of drive and motor on the wall [J]
        ("lost", 1),  # to the damper and the ends of the range [J]
        ("held", 1),  # 1 if it did not move by the load in the last step: held, or on the end of its range
    )
)
"""What changes."""
SUMS = Columns((*WALL_SUMS.sizes, ("mass", 1)))
"""Sums over the contact points of a wall: ``readings.WALL_SUMS`` and M."""


@wp.struct
class DynamicWalls:
    """The walls of a scene whose motion follows from the load on them."""

    number: wp.array(dtype=wp.int32)
    """Of each wall of the scene: its number among these, -1 for others."""
    motion: wp.array(dtype=wp.int32)
    """Of each of these: its placement."""
    numbers: wp.array2d(dtype=wp.float64)
    """NUMBERS of each."""
    state: wp.array2d(dtype=wp.float64)
    """STATE of each."""
    curve: wp.array2d(dtype=wp.vec2d)
    """Rate and load of the motor of each at the points of its curve, ascending; the last point may stand several times."""
    drive: wp.array2d(dtype=wp.float64)
    """Drive at each force call of the schedule [N or N m], of each wall; NaN holds it."""
    bodies: wp.array2d(dtype=wp.float64)
    """``free_bodies.BODY`` of each, if one has six degrees of freedom."""
    motions: wp.array2d(dtype=wp.float64)
    """``free_bodies.MOTION`` of each."""
    sums: wp.array3d(dtype=wp.int64)
    """Exact sums of each thread, SUMS of one wall after the other."""
    mobility: wp.array(dtype=Mobility)
    """How contacts see walls yield, by placement; of size 0 where all are servos."""


@wp.func
def motor(walls: DynamicWalls, d: int, rate: wp.float64):
    """Load of the motor of a wall at a rate [N or N m], and its slope there."""
    value = walls.curve[d, 0][1]
    slope = wp.float64(0.0)
    for k in range(walls.curve.shape[1] - 1):
        left = walls.curve[d, k]
        right = walls.curve[d, k + 1]
        if rate >= left[0] and right[0] > left[0]:
            slope = (right[1] - left[1]) / (right[0] - left[0])
            value = left[1] + slope * (rate - left[0])
            if rate >= right[0]:
                value = right[1]
                slope = wp.float64(0.0)
    return value, slope


@wp.func
def rotation_about(axis: wp.vec3d, angle: wp.float64) -> wp.mat33d:
    """R - I = sin(angle) [a]x + 2 sin^2(angle/2) ([a]x)^2."""
    half = wp.sin(wp.float64(0.5) * angle)
    s = wp.sin(angle)
    c = wp.float64(2.0) * half * half
    across = wp.skew(axis)
    return across * s + across * across * c


@wp.func
def displaced(p: Placement, rotates: wp.float64, axis: wp.vec3d, origin: wp.vec3d, s: wp.float64, u: wp.float64) -> Placement:
    """Placement of a wall at ``s`` moving at ``u``, from that at s = 0.

    Args:
        p: placement at s = 0, with the velocities of the axes that the wall moves in.
        rotates: 1 about the axis, 0 along it.
        axis: unit vector a in axes of the wall.
        origin: point o on the axis, in axes of the wall [m].
        s: displacement [m] or angle [rad].
        u: its rate.
    """
    out = p
    along = rotated(p, axis)
    if rotates > wp.float64(0.0):
        outer = axes(p)
        change = rotation_about(axis, s)
        axes_now = outer + outer * change
        shift = wp.vec3d(p[9], p[10], p[11]) - outer * (change * origin)
        spin = wall_spin(p) + along * u
        velocity = wp.vec3d(p[15], p[16], p[17]) - wp.cross(along, placed(p, origin)) * u
        vector = axes_now * (wp.transpose(outer) * surface_vector(p))
        circulation = axes_now * (wp.transpose(outer) * surface_circulation(p))
        for i in range(3):
            for j in range(3):
                out[3 * i + j] = axes_now[i, j]
            out[9 + i] = shift[i]
            out[12 + i] = spin[i]
            out[15 + i] = velocity[i]
            out[18 + i] = vector[i]
            out[21 + i] = circulation[i]
    else:
        for i in range(3):
            out[9 + i] = p[9 + i] + along[i] * s
            out[15 + i] = p[15 + i] + along[i] * u
    return out


@functools.cache
def build(one, WallContacts, bodies: bool):
    """Return ``add_loads`` of one thread, and ``advance``, which one thread calls when all have added.

    Args:
        bodies: some have six degrees of freedom.
        one: namespace of ``wall.contact.build``.
        WallContacts: struct of ``wall.evaluate.build``.
    """
    g, at = grain.build(one.spins), one.at
    Inverse = one.Inverse

    @wp.func
    def add_loads(
        thread: int, first: int, last: int, record: wp.array(dtype=g.Record), inverse: wp.array(dtype=Inverse),
        wall_contacts: WallContacts, placements: wp.array2d(dtype=Placement), now_row: int, parity: int, walls: DynamicWalls,
    ):  # fmt: skip
        """Add the contact points of grains ``first`` to ``last`` of those at walls to the sums of a thread."""
        for r in range(first, last):
            i = wall_contacts.grain[r]
            state = record[i]
            if g.is_removed(state):
                continue
            start = wall_contacts.first[i]
            for slot in range(start, start + wall_contacts.point_count[parity, i]):
                memory = wall_contacts.point[parity, slot]
                d = walls.number[int(memory[wp.static(at.wall)])]
                if d < 0:
                    continue
                result = wall_contacts.result[slot]
                force = one.force_in(result)
                torque = wp.vec3d()
                if wp.static(one.rolling):
                    torque = wp.vec3d(
                        result[wp.static(RESULT.moment)], result[wp.static(RESULT.moment + 1)],
                        result[wp.static(RESULT.moment + 2)],
                    )  # fmt: skip
                n = one.normal_in(memory)
                overlap = memory[wp.static(at.overlap)]
                point = g.position(state) - n * (state[3] - overlap)
                column = d * wp.static(SUMS.width)
                add_wall_contact(point, force, torque, thread, column, walls.sums)
                if overlap > wp.float64(0.0):
                    arm = wp.float64(1.0)
                    if walls.numbers[d, wp.static(NUMBERS.rotates)] > wp.float64(0.0):
                        p = placements[now_row, walls.motion[d]]
                        along = rotated(p, vector_at(walls.numbers, d, wp.static(NUMBERS.axis)))
                        out = point - placed(p, vector_at(walls.numbers, d, wp.static(NUMBERS.origin)))
                        out = out - along * wp.dot(along, out)
                        arm = wp.dot(out, out)
                    mass = memory[wp.static(at.weight)] / inverse[i][0]
                    add(mass * arm, thread, column + wp.static(SUMS.mass), walls.sums)

    @wp.func
    def total(threads: int, column: int, walls: DynamicWalls) -> wp.float64:
        """A column of the sums of all threads, which is then zero."""
        value = rounded(threads, column, walls.sums)
        for r in range(threads):
            for k in range(wp.static(WIDTH)):
                walls.sums[r, column, k] = wp.int64(0)
        return value

    @wp.func
    def total_vector(threads: int, column: int, walls: DynamicWalls) -> wp.vec3d:
        """Three columns."""
        return wp.vec3d(
            total(threads, column, walls), total(threads, column + 1, walls), total(threads, column + 2, walls)
        )

    @wp.func
    def advance(
        threads: int, k: int, rows: wp.array(dtype=Row), placements: wp.array2d(dtype=Placement), dt: wp.float64,
        walls: DynamicWalls,
    ):  # fmt: skip
        """Kick and drift of each wall from step ``k`` of the schedule to the next, and its placement there."""
        for d in range(walls.motion.shape[0]):
            motion = walls.motion[d]
            now = placements[k + 1, motion]
            axis = vector_at(walls.numbers, d, wp.static(NUMBERS.axis))
            origin = vector_at(walls.numbers, d, wp.static(NUMBERS.origin))
            rotates = walls.numbers[d, wp.static(NUMBERS.rotates)]
            column = d * wp.static(SUMS.width)
            force = total_vector(threads, column + wp.static(SUMS.force), walls)
            moment = total_vector(threads, column + wp.static(SUMS.moment), walls)
            torque = total_vector(threads, column + wp.static(SUMS.torque), walls)
            touched = total(threads, column + wp.static(SUMS.mass), walls)
            inertia = walls.numbers[d, wp.static(NUMBERS.inertia)]
            if inertia == wp.float64(0.0):
                inertia = wp.max(touched, walls.numbers[d, wp.static(NUMBERS.least)])
            along = rotated(now, axis)
            if wp.static(bodies):
                if rotates > wp.float64(1.0):
                    placements[k + 2, motion] = advance_body(
                        d, -force, -(moment + torque), gravity(rows[k]), now, placements[k + 2, motion], kick_time(rows[k]),
                        dt, walls.bodies, walls.motions,
                    )  # fmt: skip
                    continue
            pull = gravity(rows[k]) * walls.numbers[d, wp.static(NUMBERS.mass)]
            load = wp.dot(force, along)
            weight = wp.dot(pull, along)
            if rotates > wp.float64(0.0):
                load = wp.dot(moment - wp.cross(placed(now, origin), force) + torque, along)
                center = vector_at(walls.numbers, d, wp.static(NUMBERS.center))
                weight = wp.dot(wp.cross(rotated(now, center - origin), pull), along)
            drive = walls.drive[k, d]
            kick = kick_time(rows[k])
            before = walls.state[d, wp.static(STATE.rate)]
            most = walls.numbers[d, wp.static(NUMBERS.max_rate)]
            low = walls.numbers[d, wp.static(NUMBERS.low)]
            high = walls.numbers[d, wp.static(NUMBERS.high)]
            damping = walls.numbers[d, wp.static(NUMBERS.damping)]
            position = walls.state[d, wp.static(STATE.position)]
            rate = wp.float64(0.0)
            predicted = wp.float64(0.0)
            held = wp.float64(1.0)
            if not wp.isnan(drive):
                spring = walls.numbers[d, wp.static(NUMBERS.stiffness)] * (
                    walls.numbers[d, wp.static(NUMBERS.rest)] - position
                )
                push, slope = motor(walls, d, before)
                push = push - slope * before  # at rate 0, along the slope
                half = wp.float64(0.5) * kick * (damping - slope)
                acting = drive + push + weight + spring - load
                rate = (before * (inertia - half) + kick * acting) / (inertia + half)
                rate = wp.clamp(rate, -most, most)
                predicted = wp.clamp(rate + wp.float64(0.5) * dt * ((rate - before) / kick), -most, most)
                end = position + dt * rate
                stops = end < low or end > high
                held = wp.where(stops, wp.float64(1.0), wp.float64(0.0))
                if stops:
                    rate = (wp.clamp(end, low, high) - position) / dt
                    predicted = rate
                mean = wp.float64(0.5) * (before + rate)
                work = kick * (drive + push + slope * mean) * mean
                loss = kick * damping * mean * mean
                if stops:  # of all work at the mean rate, the damper's included, what the motion has not kept
                    loss = kick * (acting + slope * mean) * mean + wp.float64(0.5) * inertia * (before * before - rate * rate)
                walls.state[d, wp.static(STATE.driven)] = walls.state[d, wp.static(STATE.driven)] + work
                walls.state[d, wp.static(STATE.lost)] = walls.state[d, wp.static(STATE.lost)] + loss
            position = position + dt * rate
            seen = walls.state[d, wp.static(STATE.predicted)]
            walls.state[d, wp.static(STATE.correction)] = (
                walls.state[d, wp.static(STATE.correction)] + kick * load * (wp.float64(0.5) * (before + rate) - seen)
            )
            walls.state[d, wp.static(STATE.position)] = position
            walls.state[d, wp.static(STATE.rate)] = rate
            walls.state[d, wp.static(STATE.predicted)] = predicted
            walls.state[d, wp.static(STATE.held)] = held
            if wp.static(one.yielding):
                mobility = walls.mobility[motion]
                mobility[wp.static(MOBILITY.yields)] = wp.float64(1.0) - held
                walls.mobility[motion] = mobility
            placements[k + 2, motion] = displaced(placements[k + 2, motion], rotates, axis, origin, position, predicted)

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def advance_alone(
        base: int, count: int, rows: wp.array(dtype=Row), placements: wp.array2d(dtype=Placement), dt: wp.float64,
        walls: DynamicWalls,
    ):  # fmt: skip
        """``count`` steps from step ``base`` of the schedule on without grains: one thread."""
        for k in range(base, base + count):
            advance(1, k, rows, placements, dt, walls)

    return KernelSet(add_loads=add_loads, advance=advance, advance_alone=advance_alone)
