"""Velocity Verlet with the velocities of the half step in the force: eq. 73 of Delacroix et al. 2020, as LIGGGHTS runs it.

    v^k       = v^(k-1/2) + (dt/2) a(q^k, v^(k-1/2))
    v^(k+1/2) = v^k + (dt/2) a(q^k, v^(k-1/2)),     q^(k+1) = q^k + dt v^(k+1/2)

Order 2 with forces of position alone; order 1, and growing energy, as soon as they depend on velocity. Takes over no term
of the frame: Coriolis, centrifugal, Euler and linear term are forces, with frame-relative velocities.
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
        half = kick_time(row) - wp.float64(0.5) * dt
        omega = frame.spin_before(f)
        v = g.velocity(state)
        w = g.spin(state)
        full = a + frame.coriolis(omega, v) + frame.of_place(f, omega, g.position(state))
        return v + full * half, w + (b + frame.of_spin(f, omega, w)) * half

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
        jump = frame.velocity_jump(f, q)
        spin_jump = frame.spin_jump(f)
        full = a + frame.coriolis(omega, g.velocity(state) - jump) + frame.of_place(f, omega, q)
        v = v_now - jump + full * half
        w = w_now - spin_jump + (b + frame.of_spin(f, omega, g.spin(state) - spin_jump)) * half
        return g.record(q + v * dt, state[3], v, wp.vec3d(), w, wp.vec3d())

    return advance, reading
