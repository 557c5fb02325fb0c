"""Explicit Euler: q^(k+1) = q^k + dt v^k, v^(k+1) = v^k + dt a(q^k, v^k). Order 1; for comparison.

Takes over no term of the frame: all are added, with frame-relative velocities.
"""

import functools

import warp as wp
from warpdem.kernels import frame_terms, grain
from warpdem.kernels.schedule import FrameRow, Row

ORDER = 1
STAGES = (0.0,)
RELATIVE = True
STORE = 0


@functools.cache
def build(*, spins: bool, turning_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    g = grain.build(spins)
    frame = frame_terms.build(moving_frame)

    @wp.func
    def reading(
        state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow), at: int, dt: wp.float64
    ):
        half = wp.float64(0.5) * dt
        return g.velocity(state) + g.acceleration(state) * half, g.spin(state) + g.angular_acceleration(state) * half

    @wp.func
    def advance(
        stage: int, i: int, state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow),
        at: int, dt: wp.float64, store: wp.array2d(dtype=wp.vec3d),
    ) -> g.Record:  # fmt: skip
        f = frame.read(frames, at)
        q = g.position(state)
        v_now, w_now = reading(state, a, b, row, frames, at, dt)
        v = v_now - frame.velocity_jump(f, q)
        w = w_now - frame.spin_jump(f)
        omega = frame.spin_after(f)
        full = a + frame.coriolis(omega, v) + frame.of_place(f, omega, q)
        two = wp.float64(2.0)  # the record's mean velocity is v^k, its end velocity v^k + dt a
        return g.record(q + v * dt, state[3], v, full * two, w, (b + frame.of_spin(f, omega, w)) * two)

    return advance, reading
