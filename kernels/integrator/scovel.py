"""Scovel's splitting, eq. 90 of Delacroix et al. 2020 (with 2w in eq. 91): the Coriolis force as an exact rotation.

    v <- v + (dt/2) f(q),     q <- q + M v,  v <- E v,     v <- v + (dt/2) f(q)
    E = I + sin(x)/a O + (1 - cos x)/a^2 O^2,     M = dt I + (1 - cos x)/a^2 O + (x - sin x)/a^3 O^2

O = -2 w x, a = 2|w|, x = a dt; f holds contacts, gravity, fields and the centrifugal, Euler and linear term. Symplectic and
of order 2 for forces of position. Takes over the Coriolis term (for spins, with O = -w x, their whole rotation) and adds the
others, with frame-relative velocities. Dashpots see the velocity before the half kick.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.step import frame_terms
from warpdem.kernels.step.schedule import FrameRow, Row, kick_time

ORDER = 2
STAGES = (0.0,)
RELATIVE = True
STORE = 0


@wp.func
def rotated(axis: wp.vec3d, dt: wp.float64, v: wp.vec3d):
    """E v and M v / dt for O = axis x."""
    one = wp.float64(1.0)
    square = wp.dot(axis, axis) * dt * dt
    x = wp.sqrt(square)
    # series below 0.05: their first missing terms are 1e-17
    s = one - square / wp.float64(6.0) * (one - square / wp.float64(20.0) * (one - square / wp.float64(42.0)))
    c = wp.float64(0.5) - square / wp.float64(24.0) * (one - square / wp.float64(30.0) * (one - square / wp.float64(56.0)))
    d = one / wp.float64(6.0) - square / wp.float64(120.0) * (
        one - square / wp.float64(42.0) * (one - square / wp.float64(72.0))
    )
    if x > wp.float64(0.05):
        h = wp.sin(wp.float64(0.5) * x)
        s = wp.sin(x) / x
        c = wp.float64(2.0) * h * h / square
        d = (x - wp.sin(x)) / (x * square)
    first = wp.cross(axis, v) * dt
    second = wp.cross(axis, first) * dt
    return v + first * s + second * c, v + first * c + second * d


@functools.cache
def build(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    g = grain.build(spins)
    frame = frame_terms.build(moving_frame)

    @wp.func
    def reading(
        state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow), at: int, dt: wp.float64
    ):
        f = frame.read(frames, at)
        half = wp.float64(0.5) * dt
        kick = kick_time(row) - half
        v = g.velocity(state) + g.acceleration(state) * half
        w = g.spin(state) + g.angular_acceleration(state) * half
        omega = frame.spin_before(f)
        v = v + (a + frame.of_place(f, omega, g.position(state))) * kick
        return v, w + (b + frame.of_spin(f, omega, wp.vec3d())) * kick

    @wp.func
    def advance(
        stage: int, i: int, state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow),
        at: int, dt: wp.float64, store: wp.array2d(dtype=wp.vec3d),
    ) -> g.Record:  # fmt: skip
        f = frame.read(frames, at)
        half = wp.float64(0.5) * dt
        q = g.position(state)
        v_now, w_now = reading(state, a, b, row, frames, at, dt)
        omega = frame.spin_after(f)
        v = v_now - frame.velocity_jump(f, q) + (a + frame.of_place(f, omega, q)) * half
        w = w_now - frame.spin_jump(f) + (b + frame.of_spin(f, omega, wp.vec3d())) * half
        middle = omega + frame.angular_acceleration(f) * half
        v_end, v_mean = rotated(middle * wp.float64(-2.0), dt, v)
        w_end, w_mean = rotated(-middle, dt, w)
        rate = wp.float64(2.0) / dt
        return g.record(q + v_mean * dt, state[3], v_mean, (v_end - v_mean) * rate, w_mean, (w_end - w_mean) * rate)

    return advance, reading
