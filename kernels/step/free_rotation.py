r"""Free rotation of a rigid body over a step: the unit quaternion p that its orientation is multiplied by, Q <- Q p.

The angular momentum L is constant, so its part in the body's axes, l, only turns. The kinetic energy is split into

    l_1^2/(2 I_1) + l_2^2/(2 I_2) + l_3^2/(2 I_3)

each of which turns the body about one principal axis at the rate l_k/I_k (Dullweber et al. 1997, 10.1063/1.474310). Turns about
2, 3, 1, 3, 2 for a half, a half, the whole, a half and a half of a time are of order 2; moments ascend, and of the six orders
of the axes this one errs least, up to ten times less than others. Nine times w_1 ... w_4, w_0, w_4 ... w_1 (Kahan and Li 1997,
10.1090/S0025-5718-97-00873-9) make it order 6, and (w, 1 - 2 w, w) with w = 1/(2 - 2^(1/3)) order 4. Each turn keeps |l|.
The seven times of Yoshida (1990) would err 30 times as much as these nine.

    order 6    |W| dt above ``QUICK``     error after 20 rad: 1e-10 at |W| dt = 0.1 (6e-10 of any top), 1e-12 at 0.05
    order 4    above ``SLOW``             2e-12
    series     below                      5e-13: the rotation vector a_1 t + a_2 t^2 + a_3 t^3 + a_4 t^4, from
                                          phi' = w + phi x w/2 + phi x (phi x w)/12 (Bortz 1971) and l' = l x w:
                                          a_1 = w, a_2 = w'/2, a_3 = w''/6 + w x w'/12, a_4 = (w''' + w x w'')/24

A body of revolution (I_1 = I_2) needs two turns, exact at any step: about l by |l| dt/I_1, then about axis 3 by
(1/I_3 - 1/I_1) l_3 dt.

Quaternions are (w, x, y, z) with 1 less in w, so that small angles keep all their digits.
"""

import warp as wp

ORDER_6 = (0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023)
ORDER_4 = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
QUICK = 2.0e-3  # angle per step above which order 6 is taken [rad]
SLOW = 5.0e-4  # and order 4 [rad]: the series costs a fifth of it
SMALL = 0.05  # half angle below which a series gives the sine to round-off [rad]


@wp.struct
class Turned:
    """Rotation since the step began, and the angular momentum in the body's axes."""

    p: wp.vec4d  # unit quaternion less 1
    l: wp.vec3d  # [kg m2/s]


@wp.func
def half_angle(h: wp.float64):
    """sin(h) and cos(h) - 1."""
    sine = wp.float64(0.0)
    less = wp.float64(0.0)
    if wp.abs(h) < wp.float64(wp.static(SMALL)):
        s = h * h
        one = wp.float64(1.0)  # times 1/6 ..., as divisions take as long as all the rest
        sine = h * (
            one
            - s * wp.float64(wp.static(1.0 / 6.0))
            * (one - s * wp.float64(wp.static(1.0 / 20.0)) * (one - s * wp.float64(wp.static(1.0 / 42.0))))
        )  # fmt: skip
        less = (
            s * wp.float64(-0.5)
            * (
                one
                - s * wp.float64(wp.static(1.0 / 12.0))
                * (one - s * wp.float64(wp.static(1.0 / 30.0)) * (one - s * wp.float64(wp.static(1.0 / 56.0))))
            )
        )  # fmt: skip
    else:
        sine = wp.sin(h)
        quarter = wp.sin(wp.float64(0.5) * h)
        less = wp.float64(-2.0) * quarter * quarter
    return sine, less


@wp.func
def times(p: wp.vec4d, less: wp.float64, v: wp.vec3d) -> wp.vec4d:
    """The product p q less 1, where q is the unit quaternion of scalar part 1 + ``less`` and vector part ``v``."""
    one = wp.float64(1.0)
    u = wp.vec3d(p[1], p[2], p[3])
    out = u + (u * less + (v * (one + p[0]) + wp.cross(u, v)))
    return wp.vec4d(p[0] + (less + p[0] * less - wp.dot(u, v)), out[0], out[1], out[2])


@wp.func
def about(state: Turned, axis: int, angle: wp.float64) -> Turned:
    """Turn the body about a principal axis."""
    sine, less = half_angle(wp.float64(0.5) * angle)
    v = wp.vec3d()
    v[axis] = sine
    out = Turned()
    out.p = times(state.p, less, v)
    a = (axis + 1) % 3
    b = (axis + 2) % 3
    sine_of_all = wp.float64(2.0) * sine * (wp.float64(1.0) + less)
    fall = wp.float64(2.0) * sine * sine  # 1 - cos
    out.l = state.l
    out.l[a] = state.l[a] + (sine_of_all * state.l[b] - fall * state.l[a])
    out.l[b] = state.l[b] - (sine_of_all * state.l[a] + fall * state.l[b])
    return out


@wp.func
def order_2(state: Turned, rate: wp.vec3d, t: wp.float64) -> Turned:
    """Turns of order 2 over the time ``t`` [s]; ``rate`` holds 1/I_k [1/(kg m2)]."""
    half = wp.float64(0.5) * t
    s = about(state, 1, half * rate[1] * state.l[1])
    s = about(s, 2, half * rate[2] * s.l[2])
    s = about(s, 0, t * rate[0] * s.l[0])
    s = about(s, 2, half * rate[2] * s.l[2])
    return about(s, 1, half * rate[1] * s.l[1])


@wp.func
def by_series(l: wp.vec3d, rate: wp.vec3d, t: wp.float64) -> wp.vec4d:
    """As ``free_rotation``, for small angles."""
    w = wp.cw_mul(rate, l)
    one = wp.float64(1.0)
    x = one / rate[0]
    y = one / rate[1]
    z = one / rate[2]
    k = wp.vec3d((y - z) * rate[0], (z - x) * rate[1], (x - y) * rate[2])  # Euler: w' = k (w_2 w_3, w_3 w_1, w_1 w_2)
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


@wp.func
def free_rotation(l: wp.vec3d, rate: wp.vec3d, dt: wp.float64) -> wp.vec4d:
    """Quaternion less 1 that turns a body over ``dt`` [s].

    Args:
        l: angular momentum in the body's principal axes [kg m2/s].
        rate: one over each principal moment of inertia [1/(kg m2)]; the first two are equal for a body of revolution.
        dt: time [s].
    """
    state = Turned()
    state.l = l
    if rate[0] == rate[1]:
        size = wp.length(l)
        if size > wp.float64(0.0):
            sine, less = half_angle(wp.float64(0.5) * dt * rate[0] * size)
            state.p = times(state.p, less, l * (sine / size))
            sine, less = half_angle(wp.float64(0.5) * dt * (rate[2] - rate[0]) * l[2])
            state.p = times(state.p, less, wp.vec3d(wp.float64(0.0), wp.float64(0.0), sine))
        return state.p
    quickest = wp.max(wp.max(wp.abs(rate[0] * l[0]), wp.abs(rate[1] * l[1])), wp.abs(rate[2] * l[2]))
    if quickest * dt < wp.float64(wp.static(SLOW)):
        return by_series(l, rate, dt)
    if quickest * dt > wp.float64(wp.static(QUICK)):
        rest = wp.float64(wp.static(1.0 - 2.0 * sum(ORDER_6)))
        for k in range(9):
            share = rest
            if k == 0 or k == 8:
                share = wp.float64(wp.static(ORDER_6[0]))
            elif k == 1 or k == 7:
                share = wp.float64(wp.static(ORDER_6[1]))
            elif k == 2 or k == 6:
                share = wp.float64(wp.static(ORDER_6[2]))
            elif k == 3 or k == 5:
                share = wp.float64(wp.static(ORDER_6[3]))
            state = order_2(state, rate, share * dt)
    else:
        state = order_2(state, rate, wp.float64(wp.static(ORDER_4)) * dt)
        state = order_2(state, rate, wp.float64(wp.static(1.0 - 2.0 * ORDER_4)) * dt)
        state = order_2(state, rate, wp.float64(wp.static(ORDER_4)) * dt)
    return state.p


@wp.func
def rotation_vector(p: wp.vec4d) -> wp.vec3d:
    """Angle times axis [rad] of a unit quaternion less 1, of less than half a turn."""
    v = wp.vec3d(p[1], p[2], p[3])
    square = wp.dot(v, v)
    factor = wp.float64(2.0)
    if square < wp.float64(1.0e-6):  # asin(s)/s
        factor = wp.float64(2.0) + square * wp.float64(wp.static(1.0 / 3.0)) * (
            wp.float64(1.0) + square * wp.float64(0.45)
        )
    else:
        size = wp.sqrt(square)
        factor = wp.float64(2.0) * wp.atan2(size, wp.float64(1.0) + p[0]) / size
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
