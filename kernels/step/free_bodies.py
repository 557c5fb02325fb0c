r"""Free bodies with six degrees of freedom among the walls that move by the load on them.

    M V' = F + M g + F_0 + sum f_s,            x' = V
    L' = T + T_0 + sum (p_s - x) x f_s,        L = Q I Q^T W,      Q' = W x Q
    f_s = -k_s (p_s - a_s) - c_s (V + W x (p_s - x))

    x, V       center of mass and its velocity                               [m, m/s]
    Q          from the principal axes to those that the body is free in
    L, W       angular momentum about the center, angular velocity           [N m s, rad/s]
    F, T       of the grains on the body, T about its center                 [N, N m]
    F_0, T_0   given, constant                                               [N, N m]
    k_s, c_s   mount: a spring of no length, and a damper, between the body's point p_s and the fixed point a_s  [N/m, N s/m]

All in the axes of the carrier, which are inertial. The kick at t_k takes V and L over the kick time h, the drift is exact
(``free_rotation``): x <- x + dt V, L stays. The mean rates of the kick, (V + V_new)/2 and Q I^-1 Q^T (L + L_new)/2, are those
by which it changes (1/2) M V^2 + (1/2) L . Q I^-1 Q^T L exactly. Contacts and dampers see V and W predicted for their time,
with the accelerations of the step before.
"""

import warp as wp
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.step.free_rotation import free_rotation, product, rotation_matrix
from warpdem.kernels.step.schedule import Placement, axes, placed, surface_circulation, surface_vector, wall_spin

MOUNTS = 8
"""Largest number of mounts of a body."""
MOUNT = Columns(
    (
        ("point", 3),  # p in the axes of the wall [m]
        ("anchor", 3),  # a in those of the carrier [m]
        ("stiffness", 1),  # [N/m]
        ("damping", 1),  # [N s/m]
    )
)
"""A mount."""
BODY = Columns(
    (
        ("mass", 1),  # M [kg]
        ("center", 3),  # center of mass in the axes of the wall, where it begins [m]
        ("orientation", 4),  # Q at the start, unit quaternion
        ("rates", 3),  # one over each principal moment of inertia [1/(kg m2)]
        ("force", 3),  # F_0 [N]
        ("torque", 3),  # T_0 [N m]
        ("mounts", MOUNTS * MOUNT.width),  # MOUNT of one after the other, those that there are not with zeros
    )
)
"""What does not change of a body."""
MOTION = Columns(
    (
        ("place", 3),  # x [m]
        ("orientation", 4),  # Q, unit quaternion
        ("velocity", 3),  # V in the middle of the last step [m/s]
        ("momentum", 3),  # L there [N m s]
        ("seen_velocity", 3),  # V and W that the contacts of this time see
        ("seen_spin", 3),
        ("correction", 1),  # work on the grains beyond that of these [J]
        ("driven", 1),  # work of F_0 and T_0 [J]
        ("lost", 1),  # to the dampers [J]
    )
)
"""What changes."""


@wp.func
def vector_at(values: wp.array2d(dtype=wp.float64), d: int, at: int) -> wp.vec3d:
    """Three numbers of row ``d``."""
    return wp.vec3d(values[d, at], values[d, at + 1], values[d, at + 2])


@wp.func
def quaternion_at(values: wp.array2d(dtype=wp.float64), d: int, at: int) -> wp.vec4d:
    """Four numbers of row ``d``."""
    return wp.vec4d(values[d, at], values[d, at + 1], values[d, at + 2], values[d, at + 3])


@wp.func
def rotation_since(q: wp.vec4d, start: wp.vec4d) -> wp.vec4d:
    """The quaternion q start^-1, less 1: how the body has turned."""
    back = wp.vec4d(start[0] - wp.float64(1.0), -start[1], -start[2], -start[3])
    made = product(q, back)
    return wp.vec4d(made[0] - wp.float64(1.0), made[1], made[2], made[3])


@wp.func
def placement_of(carrier: Placement, rotation: wp.mat33d, x: wp.vec3d, center: wp.vec3d, v: wp.vec3d, w: wp.vec3d) -> Placement:
    """Placement of a body, from that of its carrier.

    Args:
        carrier: placement of the axes that the body is free in.
        rotation: R, from body axes to those.
        x: its center there [m].
        center: its center in body axes [m].
        v: velocity of the center there [m/s].
        w: angular velocity there [rad/s].
    """
    out = carrier
    outer = axes(carrier)
    axes_now = outer * rotation
    shift = placed(carrier, x - rotation * center)
    spin = outer * w
    velocity = outer * v - wp.cross(spin, placed(carrier, x))
    back = wp.transpose(outer)
    vector = axes_now * (back * surface_vector(carrier))
    circulation = axes_now * (back * surface_circulation(carrier))
    spin = spin + wall_spin(carrier)
    for i in range(3):
        for j in range(3):
            out[3 * i + j] = axes_now[i, j]
        out[9 + i] = shift[i]
        out[12 + i] = spin[i]
        out[15 + i] = carrier[15 + i] + velocity[i]
        out[18 + i] = vector[i]
        out[21 + i] = circulation[i]
    return out


@wp.func
def advance_body(
    d: int, force: wp.vec3d, moment: wp.vec3d, pull: wp.vec3d, now: Placement, carrier: Placement, kick: wp.float64,
    dt: wp.float64, bodies: wp.array2d(dtype=wp.float64), motions: wp.array2d(dtype=wp.float64),
) -> Placement:  # fmt: skip
    """Kick and drift of body ``d``, and its placement at the next step.

    Args:
        d: number of the body.
        force: of the grains on it, in frame axes [N].
        moment: of these about the origin of the frame axes, with their torques [N m].
        pull: gravity in frame axes [m/s2].
        now: its placement at present.
        carrier: that of its carrier at the next step.
        kick: time of the kick [s].
        dt: time step [s].
        bodies: BODY of each.
        motions: MOTION of each.
    """
    mass = bodies[d, wp.static(BODY.mass)]
    center = vector_at(bodies, d, wp.static(BODY.center))
    start = quaternion_at(bodies, d, wp.static(BODY.orientation))
    rates = vector_at(bodies, d, wp.static(BODY.rates))
    x = vector_at(motions, d, wp.static(MOTION.place))
    q = quaternion_at(motions, d, wp.static(MOTION.orientation))
    v = vector_at(motions, d, wp.static(MOTION.velocity))
    l = vector_at(motions, d, wp.static(MOTION.momentum))
    seen_v = vector_at(motions, d, wp.static(MOTION.seen_velocity))
    seen_w = vector_at(motions, d, wp.static(MOTION.seen_spin))
    since = rotation_since(q, start)
    own = rotation_matrix(wp.vec4d(since[0] + wp.float64(1.0), since[1], since[2], since[3]))
    back = own * wp.transpose(axes(now))  # from frame axes to those of the carrier
    load = back * force
    torque = back * (moment - wp.cross(placed(now, center), force))
    given_force = vector_at(bodies, d, wp.static(BODY.force))
    given_torque = vector_at(bodies, d, wp.static(BODY.torque))
    push = load + given_force + (back * pull) * mass
    twist = torque + given_torque
    brake = wp.vec3d()  # what the dampers do
    braking = wp.vec3d()
    for k in range(wp.static(MOUNTS)):
        at = wp.static(BODY.mounts) + k * wp.static(MOUNT.width)
        arm = own * (vector_at(bodies, d, at + wp.static(MOUNT.point)) - center)
        pulled = (x + arm - vector_at(bodies, d, at + wp.static(MOUNT.anchor))) * -bodies[d, at + wp.static(MOUNT.stiffness)]
        slowed = (seen_v + wp.cross(seen_w, arm)) * -bodies[d, at + wp.static(MOUNT.damping)]
        push = push + pulled
        twist = twist + wp.cross(arm, pulled)
        brake = brake + slowed
        braking = braking + wp.cross(arm, slowed)
    v_next = v + (push + brake) * (kick / mass)
    l_next = l + (twist + braking) * kick
    v_mean = (v + v_next) * wp.float64(0.5)
    principal = rotation_matrix(q)
    w_mean = principal * wp.cw_mul(rates, wp.transpose(principal) * ((l + l_next) * wp.float64(0.5)))
    given = kick * (wp.dot(given_force, v_mean) + wp.dot(given_torque, w_mean))
    lost = -kick * (wp.dot(brake, v_mean) + wp.dot(braking, w_mean))
    correction = -kick * (wp.dot(load, v_mean - seen_v) + wp.dot(torque, w_mean - seen_w))
    x = x + v_next * dt
    q = product(q, free_rotation(wp.transpose(principal) * l_next, rates, dt))
    ahead = wp.float64(0.5) * dt / kick
    seen_v = v_next + (v_next - v) * ahead
    principal = rotation_matrix(q)
    seen_w = principal * wp.cw_mul(rates, wp.transpose(principal) * (l_next + (l_next - l) * ahead))
    for k in range(3):
        motions[d, wp.static(MOTION.place) + k] = x[k]
        motions[d, wp.static(MOTION.velocity) + k] = v_next[k]
        motions[d, wp.static(MOTION.momentum) + k] = l_next[k]
        motions[d, wp.static(MOTION.seen_velocity) + k] = seen_v[k]
        motions[d, wp.static(MOTION.seen_spin) + k] = seen_w[k]
    for k in range(4):
        motions[d, wp.static(MOTION.orientation) + k] = q[k]
    motions[d, wp.static(MOTION.correction)] = motions[d, wp.static(MOTION.correction)] + correction
    motions[d, wp.static(MOTION.driven)] = motions[d, wp.static(MOTION.driven)] + given
    motions[d, wp.static(MOTION.lost)] = motions[d, wp.static(MOTION.lost)] + lost
    since = rotation_since(q, start)
    own = rotation_matrix(wp.vec4d(since[0] + wp.float64(1.0), since[1], since[2], since[3]))
    return placement_of(carrier, own, x, center, seen_v, seen_w)
