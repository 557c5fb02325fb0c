"""Velocity Verlet with the force called again at the start of each step (section 6 of Delacroix et al. 2020).

    v^k = v^(k-1/2) + (dt/2) a(q^k, v^(k-1/2)),     v^(k+1/2) = v^k + (dt/2) a(q^k, v^k),     q^(k+1) = q^k + dt v^(k+1/2)

Two force calls for half the error of velocity Verlet: order 1 all the same when forces depend on velocity. Takes over no
term of the frame: all are added, with frame-relative velocities.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.integrator import velocity_verlet
from warpdem.kernels.step import frame_terms
from warpdem.kernels.step.schedule import FrameRow, Row

ORDER = 2
WEIGHS_JUMPS = False
STAGES = (0.0, 0.0)
RELATIVE = True
STORE = 0


@functools.cache
def build(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    g = grain.build(spins)
    frame = frame_terms.build(moving_frame)
    _, reading = velocity_verlet.build(spins=spins, rotating_frame=rotating_frame, moving_frame=moving_frame)

    @wp.func
    def advance(
        stage: int, i: int, state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow),
        at: int, dt: wp.float64, store: wp.array2d(dtype=wp.vec3d),
    ) -> g.Record:  # fmt: skip
        f = frame.read(frames, at)
        q = g.position(state)
        v_now, w_now = reading(state, a, b, row, frames, at, dt)
        omega = frame.spin_after(f)
        half = wp.float64(0.5) * dt
        v = g.velocity(state)
        w = g.spin(state)
        v_half = v + (a + frame.coriolis(omega, v) + frame.of_place(f, omega, q)) * half
        w_half = w + (b + frame.of_spin(f, omega, w)) * half
        if stage == 0:  # the step before is complete; the jump comes between the two calls
            v_half = v_now - frame.velocity_jump(f, q)
            w_half = w_now - frame.spin_jump(f)
        else:
            q = q + v_half * dt
        return g.record(q, state[3], v_half, wp.vec3d(), w_half, wp.vec3d())

    return advance, reading
