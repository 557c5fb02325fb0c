"""Explicit Runge-Kutta steps whose stages each start from the one before: shared by ``integrator/rk2`` and ``integrator/rk4``.

    k_s = f(t + c_s dt, y_s),     y_(s+1) = y + c_(s+1) dt k_s,     y' = y + dt sum_s b_s k_s,     y = (q, v, w)

All terms of the frame are added, with frame-relative velocities. The tangential and rolling springs are part of a stage's
state: a stage starts from the springs of the step's beginning and stretches them by its own way; what it makes of them is
dropped, and the way of the whole step is applied at its end, in the first force call of the next.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.step import frame_terms
from warpdem.kernels.step.schedule import FrameRow, Row


@functools.cache
def build(times: tuple[float, ...], weights: tuple[float, ...], *, spins: bool, moving_frame: bool):
    """Return ``advance`` and ``reading`` of the scheme with nodes ``times`` (c) and ``weights`` (b)."""
    g = grain.build(spins)
    frame = frame_terms.build(moving_frame)
    Nodes = wp.types.vector(len(times) + 1, wp.float64)
    Weights = wp.types.vector(len(weights), wp.float64)

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
        v, w = reading(state, a, b, row, frames, at, dt)
        if stage == 0:
            v = v - frame.velocity_jump(f, q)
            w = w - frame.spin_jump(f)
            store[i, 0] = q
            store[i, 1] = v
            store[i, 2] = w
            store[i, 3] = wp.vec3d()
            store[i, 4] = wp.vec3d()
            store[i, 5] = wp.vec3d()
        omega = frame.spin_after(f)
        full = a + frame.coriolis(omega, v) + frame.of_place(f, omega, q)
        change = b + frame.of_spin(f, omega, w)
        weight = wp.static(Weights(*weights))[stage]
        store[i, 3] = store[i, 3] + v * weight
        store[i, 4] = store[i, 4] + full * weight
        store[i, 5] = store[i, 5] + change * weight
        span = wp.static(Nodes(*times, 1.0))[stage + 1] * dt
        mean_v = v  # over the way from the step's beginning to the next stage
        mean_w = w
        if stage == wp.static(len(times) - 1):
            mean_v = store[i, 3]
            full = store[i, 4]
            change = store[i, 5]
        end_v = store[i, 1] + full * span
        end_w = store[i, 2] + change * span
        if stage == wp.static(len(times) - 1):  # spins have no way of their own to sum up: the trapezoidal rule
            mean_w = (store[i, 2] + end_w) * wp.float64(0.5)
        rate = wp.float64(2.0) / dt  # the record's end velocity is mean + (dt/2) acceleration
        return g.record(
            store[i, 0] + mean_v * span, state[3], mean_v, (end_v - mean_v) * rate, mean_w, (end_w - mean_w) * rate
        )

    return advance, reading
