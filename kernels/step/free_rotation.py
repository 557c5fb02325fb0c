r"""Free rotation of a rigid body over a step: the unit quaternion p that its orientation is multiplied by, Q <- Q p.

The angular momentum L is constant, so its part in the body's axes only turns with the body. In these axes, with the spin w,

    w_1' = (I_2 - I_3)/I_1 w_2 w_3 and so on,     p' = p (0, w)/2,     p = 1 at first

(Euler), whose power series in time follows term by term from products of the terms before:

    u_n+1 = k sum (u_i,2 u_n-i,3) / (n + 1),      u_0 = w dt,          k_1 = (I_2 - I_3)/I_1
    p_n+1 = sum p_i (0, u_n-i) / (2 (n + 1)),     p_0 = 1

    order 8           |W| dt above ``SLOW``: error after 20 rad 5e-14 at |W| dt = 0.02, 1e-11 at 0.1, 5e-9 at 0.2
    rotation vector   below: 1e-12; a_1 t + a_2 t^2 + a_3 t^3 + a_4 t^4 from phi' = w + phi x w/2 + phi x (phi x w)/12
                      (Bortz 1971): a_1 = w, a_2 = w'/2, a_3 = w''/6 + w x w'/12, a_4 = (w''' + w x w'')/24;
                      a quarter of the operations

A body of revolution (I_1 = I_2) needs two turns, exact at any step: about l by |l| dt/I_1, then about axis 3 by
(1/I_3 - 1/I_1) l_3 dt.

Without branches that depend on the body, so that several bodies fit in the lanes of registers (``step.clump_sweep``); what few
of them need is evaluated where one of them does. Quaternions are (w, x, y, z) with 1 less in w, so that small angles keep all
their digits.
"""

import warp as wp
from warpdem.kernels.simd.values import only_where_needed

ORDER = 8
SLOW = 5.0e-4  # angle per step up to which the short series is as good [rad]
SMALL = 0.05  # half angle below which a series gives the sine to round-off [rad]
NEAR = 1.0e-3  # square of the sine of a half angle below which a series gives the angle to round-off
Spins = wp.types.matrix((ORDER, 3), wp.float64)
Turns = wp.types.matrix((ORDER + 1, 4), wp.float64)


@only_where_needed
@wp.func
def sine_ratio_of_wide(needed: wp.float64, s: wp.float64) -> wp.float64:
    """sin(h)/h with h^2 = ``s``, where ``needed`` is not 0."""
    h = wp.sqrt(s)
    return wp.sin(h) / h


@only_where_needed
@wp.func
def cosine_less_of_wide(needed: wp.float64, s: wp.float64) -> wp.float64:
    """cos(h) - 1 with h^2 = ``s``, where ``needed`` is not 0."""
    half = wp.sin(wp.float64(0.5) * wp.sqrt(s))
    return wp.float64(-2.0) * half * half


@wp.func
def of_half_angle(s: wp.float64):
    """sin(h)/h and cos(h) - 1 of a half angle h by its square ``s``."""
    one = wp.float64(1.0)  # times 1/6 ..., as divisions take as long as all the rest
    ratio = one - s * wp.float64(wp.static(1.0 / 6.0)) * (
        one - s * wp.float64(wp.static(1.0 / 20.0)) * (one - s * wp.float64(wp.static(1.0 / 42.0)))
    )
    less = (
        s * wp.float64(-0.5)
        * (
            one
            - s * wp.float64(wp.static(1.0 / 12.0))
            * (one - s * wp.float64(wp.static(1.0 / 30.0)) * (one - s * wp.float64(wp.static(1.0 / 56.0))))
        )
    )  # fmt: skip
    wide = wp.float64(0.0)
    if s >= wp.float64(wp.static(SMALL * SMALL)):
        wide = one
    if wide > wp.float64(0.0):
        ratio = sine_ratio_of_wide(wide, s)
        less = cosine_less_of_wide(wide, s)
    return ratio, less


@wp.func
def times(p: wp.vec4d, less: wp.float64, v: wp.vec3d) -> wp.vec4d:
    """The product p q less 1, where q is the unit quaternion of scalar part 1 + ``less`` and vector part ``v``."""
    one = wp.float64(1.0)
    u = wp.vec3d(p[1], p[2], p[3])
    out = u + (u * less + (v * (one + p[0]) + wp.cross(u, v)))
    return wp.vec4d(p[0] + (less + p[0] * less - wp.dot(u, v)), out[0], out[1], out[2])


@wp.func
def euler_factors(rate: wp.vec3d) -> wp.vec3d:
    """(I_2 - I_3)/I_1 and so on [-], from one over each moment."""
    over = wp.float64(1.0) / (rate[0] * rate[1] * rate[2])
    return wp.vec3d(
        (rate[2] - rate[1]) * rate[0] * rate[0] * over,
        (rate[0] - rate[2]) * rate[1] * rate[1] * over,
        (rate[1] - rate[0]) * rate[2] * rate[2] * over,
    )


@only_where_needed
@wp.func
def by_rotation_vector(needed: wp.float64, w: wp.vec3d, rate: wp.vec3d, t: wp.float64) -> wp.vec4d:
    """As ``free_rotation``, for small angles, from the spin ``w`` [rad/s], where ``needed`` is not 0."""
    k = euler_factors(rate)
    one = wp.float64(1.0)
    two = wp.float64(2.0)
    w_1 = wp.vec3d(k[0] * (w[1] * w[2]), k[1] * (w[2] * w[0]), k[2] * (w[0] * w[1]))
    w_2 = wp.vec3d(
        k[0] * (w_1[1] * w[2] + w[1] * w_1[2]), k[1] * (w_1[2] * w[0] + w[2] * w_1[0]), k[2] * (w_1[0] * w[1] + w[0] * w_1[1])
    )
    w_3 = wp.vec3d(
        k[0] * (w_2[1] * w[2] + w[1] * w_2[2] + two * (w_1[1] * w_1[2])),
        k[1] * (w_2[2] * w[0] + w[2] * w_2[0] + two * (w_1[2] * w_1[0])),
        k[2] * (w_2[0] * w[1] + w[0] * w_2[1] + two * (w_1[0] * w_1[1])),
    )  # fmt: skip
    third = w_2 * wp.float64(wp.static(1.0 / 6.0)) + wp.cross(w, w_1) * wp.float64(wp.static(1.0 / 12.0))
    fourth = (w_3 + wp.cross(w, w_2)) * wp.float64(wp.static(1.0 / 24.0))
    half = (w + (w_1 * wp.float64(0.5) + (third + fourth * t) * t) * t) * (wp.float64(0.5) * t)
    s = wp.dot(half, half)
    less = s * wp.float64(-0.5) * (one - s * wp.float64(wp.static(1.0 / 12.0)))
    v = half * (one - s * wp.float64(wp.static(1.0 / 6.0)) * (one - s * wp.float64(wp.static(1.0 / 20.0))))
    return wp.vec4d(less, v[0], v[1], v[2])


@only_where_needed
@wp.func
def by_power_series(needed: wp.float64, turn: wp.vec3d, rate: wp.vec3d) -> wp.vec4d:
    """As ``free_rotation``, where ``needed`` is not 0; ``turn`` is the spin times the step [rad].

    Its length is put right by a root, so that a body that turns by radians per step is lost, but stays a body.
    """
    k = euler_factors(rate)
    u = Spins()
    p = Turns()
    for c in range(3):
        u[0, c] = turn[c]
    p[0, 0] = wp.float64(1.0)
    for n in range(wp.static(ORDER - 1)):
        x = wp.float64(0.0)
        y = wp.float64(0.0)
        z = wp.float64(0.0)
        for i in range(n + 1):
            x = x + u[i, 1] * u[n - i, 2]
            y = y + u[i, 2] * u[n - i, 0]
            z = z + u[i, 0] * u[n - i, 1]
        over = wp.float64(1.0) / wp.float64(n + 1)
        u[n + 1, 0] = k[0] * x * over
        u[n + 1, 1] = k[1] * y * over
        u[n + 1, 2] = k[2] * z * over
    out = wp.vec4d()
    for n in range(wp.static(ORDER)):
        a = wp.float64(0.0)
        x = u[n, 0]  # of p_0 = 1
        y = u[n, 1]
        z = u[n, 2]
        for m in range(n):
            i = n - m  # the smallest first
            a = a - (p[i, 1] * u[m, 0] + p[i, 2] * u[m, 1] + p[i, 3] * u[m, 2])
            x = x + (p[i, 0] * u[m, 0] + (p[i, 2] * u[m, 2] - p[i, 3] * u[m, 1]))
            y = y + (p[i, 0] * u[m, 1] + (p[i, 3] * u[m, 0] - p[i, 1] * u[m, 2]))
            z = z + (p[i, 0] * u[m, 2] + (p[i, 1] * u[m, 1] - p[i, 2] * u[m, 0]))
        half = wp.float64(0.5) / wp.float64(n + 1)
        p[n + 1, 0] = a * half
        p[n + 1, 1] = x * half
        p[n + 1, 2] = y * half
        p[n + 1, 3] = z * half
    for m in range(wp.static(ORDER)):
        n = wp.static(ORDER) - m
        out = out + wp.vec4d(p[n, 0], p[n, 1], p[n, 2], p[n, 3])
    beyond = wp.float64(2.0) * out[0] + wp.dot(out, out)  # of the square of its length over 1
    length = wp.sqrt(wp.float64(1.0) + beyond)
    less = -beyond / (length * (wp.float64(1.0) + length))
    out = out + out * less
    return wp.vec4d(out[0] + less, out[1], out[2], out[3])


@only_where_needed
@wp.func
def of_revolution(needed: wp.float64, l: wp.vec3d, rate: wp.vec3d, dt: wp.float64) -> wp.vec4d:
    """As ``free_rotation``, of a body of revolution, where ``needed`` is not 0."""
    half = l * (wp.float64(0.5) * dt * rate[0])
    ratio, less = of_half_angle(wp.dot(half, half))
    v = half * ratio
    p = wp.vec4d(less, v[0], v[1], v[2])
    own = wp.float64(0.5) * dt * (rate[2] - rate[0]) * l[2]
    own_ratio, own_less = of_half_angle(own * own)
    return times(p, own_less, wp.vec3d(wp.float64(0.0), wp.float64(0.0), own * own_ratio))


@wp.func
def free_rotation(l: wp.vec3d, rate: wp.vec3d, dt: wp.float64) -> wp.vec4d:
    """Quaternion less 1 that turns a body over ``dt`` [s].

    Args:
        l: angular momentum in the body's principal axes [kg m2/s].
        rate: one over each principal moment of inertia [1/(kg m2)]; the first two are equal for a body of revolution.
        dt: time [s].
    """
    w = wp.cw_mul(rate, l)
    turn = w * dt
    round = wp.float64(0.0)
    quick = wp.float64(0.0)
    slow = wp.float64(0.0)
    if rate[0] == rate[1]:
        round = wp.float64(1.0)
    elif wp.max(wp.max(wp.abs(turn[0]), wp.abs(turn[1])), wp.abs(turn[2])) >= wp.float64(wp.static(SLOW)):
        quick = wp.float64(1.0)
    else:
        slow = wp.float64(1.0)
    p = wp.vec4d()
    if slow > wp.float64(0.0):
        p = by_rotation_vector(slow, w, rate, dt)
    if round > wp.float64(0.0):
        p = of_revolution(round, l, rate, dt)
    if quick > wp.float64(0.0):
        p = by_power_series(quick, turn, rate)
    return p


@only_where_needed
@wp.func
def wide_angle(needed: wp.float64, sine: wp.float64, cosine: wp.float64) -> wp.float64:
    """The angle of this sine and cosine [rad], where ``needed`` is not 0."""
    return wp.atan2(sine, cosine)


@wp.func
def rotation_vector(p: wp.vec4d) -> wp.vec3d:
    """Angle times axis [rad] of a unit quaternion less 1, of less than half a turn."""
    v = wp.vec3d(p[1], p[2], p[3])
    s = wp.dot(v, v)
    one = wp.float64(1.0)
    factor = wp.float64(2.0) + s * wp.float64(wp.static(1.0 / 3.0)) * (  # 2 asin(x)/x
        one
        + s * wp.float64(0.45)
        * (one + s * wp.float64(wp.static(25.0 / 42.0)) * (one + s * wp.float64(wp.static(49.0 / 72.0))))
    )  # fmt: skip
    wide = wp.float64(0.0)
    if s > wp.float64(wp.static(NEAR)):
        wide = one
    if wide > wp.float64(0.0):
        size = wp.sqrt(s)
        factor = wp.float64(2.0) * wide_angle(wide, size, one + p[0]) / size
    return v * factor


@wp.func
def rotation_matrix(q: wp.vec4d) -> wp.mat33d:
    """Matrix of a unit quaternion (w, x, y, z)."""
    two = wp.float64(2.0)
    one = wp.float64(1.0)
    return wp.mat33d(
        one - two * (q[2] * q[2] + q[3] * q[3]), two * (q[1] * q[2] - q[0] * q[3]), two * (q[1] * q[3] + q[0] * q[2]),
        two * (q[1] * q[2] + q[0] * q[3]), one - two * (q[1] * q[1] + q[3] * q[3]), two * (q[2] * q[3] - q[0] * q[1]),
        two * (q[1] * q[3] - q[0] * q[2]), two * (q[2] * q[3] + q[0] * q[1]), one - two * (q[1] * q[1] + q[2] * q[2]),
    )  # fmt: skip


@wp.func
def product(q: wp.vec4d, p: wp.vec4d) -> wp.vec4d:
    """The unit quaternion q (1 + p), where ``p`` has 1 less in w; its length is put right."""
    v = wp.vec3d(p[1], p[2], p[3])
    u = wp.vec3d(q[1], q[2], q[3])
    out = u + (u * p[0] + (v * q[0] + wp.cross(u, v)))
    made = wp.vec4d(q[0] + (q[0] * p[0] - wp.dot(u, v)), out[0], out[1], out[2])
    return made * (wp.float64(1.5) - wp.float64(0.5) * wp.dot(made, made))
