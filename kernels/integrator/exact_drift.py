"""Kick, then drift exactly in the moving frame; the default.

    a = F/m + g,   V <- V + k a,   q <- y + (R - I) y + s with y = q + dt V,   V <- R V,   a <- R a

and the same rotation for spin and angular acceleration. q, V, W, a, b are resolved in frame axes; V and W are absolute. R
rotates laboratory-fixed directions in frame axes over the step, s is the shift of laboratory-fixed points. R - I is given with
1 - cos a written as 2 sin^2(a/2); applied as an increment it keeps 1e6 steps of free flight within 3e-14 of the path
(applied as R: 7e-11). k is dt, and dt/2 at the very first step. The frame's rate never enters: Coriolis, centrifugal, Euler
and linear term and the spin's are all contained in the rotation, so no term is added.

Dashpots see V + (dt/2) a: order 2 with forces that depend on velocity, at one force call.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.step.schedule import FrameRow, Row, drift_rotation, drift_shift, kick_time

ORDER = 2
STAGES = (0.0,)
RELATIVE = False
PREDICTED = True
STORE = 0


@wp.func
def shifted(rotation: wp.mat33d, shift: wp.vec3d, y: wp.vec3d) -> wp.vec3d:
    """Way of a laboratory-fixed point in frame axes [m].

    The shift comes first: it cancels most of the rest while both are exact (added to q last, it is rounded alike in every
    step: 5e-12 of the path after 1e6 steps).
    """
    return wp.vec3d(
        shift[0] + rotation[0, 0] * y[0] + rotation[0, 1] * y[1] + rotation[0, 2] * y[2],
        shift[1] + rotation[1, 0] * y[0] + rotation[1, 1] * y[1] + rotation[1, 2] * y[2],
        shift[2] + rotation[2, 0] * y[0] + rotation[2, 1] * y[1] + rotation[2, 2] * y[2],
    )


@functools.cache
def build_drift(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``drift``: kick and drift of one record; arguments as of ``build``."""
    g = grain.build(spins)

    @wp.func
    def drift(state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, dt: wp.float64) -> g.Record:
        kick = kick_time(row)
        v = g.velocity(state) + a * kick
        q = g.position(state) + v * dt
        w = g.spin(state) + b * kick
        if wp.static(rotating_frame):
            rotation = drift_rotation(row)
            q = q + shifted(rotation, drift_shift(row), q)
            v = v + rotation * v
            a = a + rotation * a
            w = w + rotation * w
            b = b + rotation * b
        elif wp.static(moving_frame):
            q = g.position(state) + (v * dt + drift_shift(row))
        return g.record(q, state[3], v, a, w, b)

    return drift


@functools.cache
def build(*, spins: bool, rotating_frame: bool, moving_frame: bool):
    """Return ``advance`` and ``reading``."""
    g = grain.build(spins)
    drift = build_drift(spins=spins, rotating_frame=rotating_frame, moving_frame=moving_frame)

    @wp.func
    def advance(
        stage: int, i: int, state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow),
        at: int, dt: wp.float64, store: wp.array2d(dtype=wp.vec3d),
    ) -> g.Record:  # fmt: skip
        return drift(state, a, b, row, dt)

    @wp.func
    def reading(
        state: g.Record, a: wp.vec3d, b: wp.vec3d, row: Row, frames: wp.array(dtype=FrameRow), at: int, dt: wp.float64
    ):
        half = kick_time(row) - wp.float64(0.5) * dt
        return g.velocity(state) + a * half, g.spin(state) + b * half

    return advance, reading
