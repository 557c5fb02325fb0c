"""Partitioned Runge-Kutta pair Lobatto IIIA-IIIB, implicit in the frame terms only (section 7 of Delacroix et al. 2020).

    v^(k+1/2) = v^k + (dt/2) a(q^k, v^(k+1/2)),     q^(k+1) = q^k + dt v^(k+1/2)
    v^(k+1)   = v^(k+1/2) + (dt/2) a(q^(k+1), v^(k+1/2))

The Coriolis term of the first half kick is solved for, (I + dt w x) v = r, in closed form; contacts and fields see v^(k-1/2) as
in velocity Verlet. Order 2 in a frame. Takes over no term: all are added, with frame-relative velocities.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.integrator import velocity_verlet
from warpdem.kernels.step import frame_terms
from warpdem.kernels.step.schedule import FrameRow, Row

ORDER = 2
STAGES = (0.0,)
RELATIVE = True
STORE = 0


@wp.func
def solved(c: wp.vec3d, r: wp.vec3d) -> wp.vec3d:
    """X with x + c x x = r."""
    return (r + c * wp.dot(c, r) - wp.cross(c, r)) / (wp.float64(1.0) + wp.dot(c, c))


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
        half = wp.float64(0.5) * dt
        q = g.position(state)
        v_now, w_now = reading(state, a, b, row, frames, at, dt)
        omega = frame.spin_after(f)
        known = v_now - frame.velocity_jump(f, q) + (a + frame.of_place(f, omega, q)) * half
        v = solved(omega * dt, known)
        w = solved(omega * half, w_now - frame.spin_jump(f) + (b + frame.of_spin(f, omega, wp.vec3d())) * half)
        return g.record(q + v * dt, state[3], v, wp.vec3d(), w, wp.vec3d())

    return advance, reading
