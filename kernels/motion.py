"""Motion of one grain over one step: sum the loads, kick with them, drift exactly in the turning frame.

    a = F/m + g,   V <- V + k a,   q <- y + (R - I)(y - o) with y = q + dt V,   V <- R V,   a <- R a

and the same turn for spin and angular acceleration. q, V, W, a, b are resolved in frame axes; V and W are absolute. R turns
laboratory-fixed directions in frame axes over the step (by minus the frame's angle increment), o is a point of its axis.
R - I is given with 1 - cos a written as 2 sin^2(a/2); applied as an increment it keeps 1e6 steps of free flight within
3e-14 of the path (applied as R: 7e-11). k is dt, and dt/2 at the very first step. The frame's rate never enters.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.pairs import share_width
from warpdem.kernels.schedule import Placement, Row, drift_turn, gravity, local, pivot
from warpdem.kernels.schedule import kick_time as kick_time_of


@functools.cache
def build(*, spins: bool, turning_frame: bool, walls: bool, moving: int):
    """Return ``advance`` and ``load``.

    Args:
        spins: grains spin.
        turning_frame: the frame turns.
        walls: there are wall rows.
        moving: number of wall motions relative to the frame (they come first among the placements).
    """
    g = grain.build(spins)
    vec6 = wp.types.vector(6, wp.float64)
    Share = wp.types.vector(share_width(spins), wp.float64)
    Inverse = wp.types.vector(2, wp.float64)

    @wp.func
    def load(
        i: int,
        row_start: wp.array(dtype=wp.int32),
        rows: wp.array(dtype=Share),
        candidates: wp.array(dtype=wp.int32),
        wall_load: wp.array(dtype=vec6),
    ) -> vec6:
        """Force [N] and torque [N m] on grain ``i``: pairs in order of partner id, then walls in order of place."""
        total = Share()
        for e in range(row_start[i], row_start[i + 1]):
            total += rows[e]
        full = vec6()
        for k in range(wp.static(share_width(spins))):
            full[k] = total[k]
        if wp.static(walls):
            if candidates[i] > 0:
                full += wall_load[i]
        return full

    @wp.func
    def advance(
        i: int,
        # state, read and written
        grains_out: wp.array(dtype=g.Record),
        # read
        total: vec6,
        inverse: wp.array(dtype=Inverse),
        reference: wp.array2d(dtype=wp.vec3d),
        row: Row,
        placements: wp.array2d(dtype=Placement),
        next_row: int,
        dt: wp.float64,
        reach: wp.float64,
    ) -> int:
        """Kick and drift; returns 1 when the grain is further than ``reach`` [m] from its reference, or not finite."""
        state = grains_out[i]
        inv = inverse[i]
        kick = kick_time_of(row)
        a = wp.vec3d(total[0], total[1], total[2]) * inv[0] + gravity(row)
        v = g.velocity(state) + a * kick
        q = g.position(state) + v * dt
        b = wp.vec3d(total[3], total[4], total[5]) * inv[1]
        w = g.spin(state) + b * kick
        if wp.static(turning_frame):
            turn = drift_turn(row)
            q = q + turn * (q - pivot(row))
            v = v + turn * v
            a = a + turn * a
            w = w + turn * w
            b = b + turn * b
        grains_out[i] = g.record(q, state[3], v, a, w, b)
        way = q - reference[i, 0]
        moved = 1
        if wp.dot(way, way) <= reach * reach:  # false for NaN, so that a broken state is noticed here
            moved = 0
        if wp.static(moving > 0):
            for m in range(wp.static(moving)):
                gone = local(placements[next_row, m], q) - reference[i, m + 1]
                if wp.dot(gone, gone) > reach * reach:
                    moved = 1
        return moved

    return load, advance
