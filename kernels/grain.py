"""The record of one grain: its whole moving state in consecutive numbers, so that a contact reads two cache lines.

    index   0..2        3        4..6         7..9             10..12       13..15
    field   position    radius   velocity     acceleration     spin         angular acceleration
    unit    [m]         [m]      [m/s]        [m/s2]           [rad/s]      [rad/s2]

Position in frame axes; velocity and spin are absolute, resolved in frame axes, and belong to the middle of the last step
(design: kicks at t_k, drifts between); the accelerations are those of the last force call, rotated with the axes. Without
friction the record ends after the acceleration.

A grain that has left the domain keeps its memory slot until the lists are rebuilt, at rest at x = REMOVED_X, where no other
grain is: none is carried so far, and no moving position takes exactly this value.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet

WIDTH = {True: 16, False: 10}  # numbers per grain, by whether grains spin
REMOVED_X = 1048583.0  # x of what has left [m]: the law stays finite so far apart, in float32 too
REMOVED_SPACING = 16.0  # y of what has left over its memory slot [m]
POSITION, RADIUS, VELOCITY, SPIN = slice(0, 3), 3, slice(4, 7), slice(10, 13)  # places in the record


@functools.cache
def build(spins: bool):
    """Return the record type and the functions that read and make it."""
    Record = wp.types.vector(WIDTH[spins], wp.float64)

    @wp.func
    def position(g: Record) -> wp.vec3d:
        return wp.vec3d(g[0], g[1], g[2])

    @wp.func
    def is_removed(g: Record) -> bool:
        """Whether the grain has left the domain."""
        return g[0] == wp.float64(wp.static(REMOVED_X))

    @wp.func
    def removed(g: Record, slot: int) -> Record:
        """The same grain out of the domain, at rest at a place of its own."""
        out = Record()
        out[0] = wp.float64(wp.static(REMOVED_X))
        out[1] = wp.float64(wp.static(REMOVED_SPACING)) * wp.float64(slot)
        out[3] = g[3]
        return out

    @wp.func
    def placed(g: Record, q: wp.vec3d) -> Record:
        """The same grain at another position [m]."""
        out = g
        out[0] = q[0]
        out[1] = q[1]
        out[2] = q[2]
        return out

    @wp.func
    def velocity(g: Record) -> wp.vec3d:
        return wp.vec3d(g[4], g[5], g[6])

    @wp.func
    def acceleration(g: Record) -> wp.vec3d:
        return wp.vec3d(g[7], g[8], g[9])

    if spins:

        @wp.func
        def spin(g: Record) -> wp.vec3d:
            return wp.vec3d(g[10], g[11], g[12])

        @wp.func
        def angular_acceleration(g: Record) -> wp.vec3d:
            return wp.vec3d(g[13], g[14], g[15])

        @wp.func
        def record(
            q: wp.vec3d, r: wp.float64, v: wp.vec3d, a: wp.vec3d, w: wp.vec3d, b: wp.vec3d
        ) -> Record:
            return Record(
                q[0], q[1], q[2], r, v[0], v[1], v[2], a[0], a[1], a[2], w[0], w[1], w[2], b[0], b[1], b[2]
            )

    else:

        @wp.func
        def spin(g: Record) -> wp.vec3d:
            return wp.vec3d()

        @wp.func
        def angular_acceleration(g: Record) -> wp.vec3d:
            return wp.vec3d()

        @wp.func
        def record(
            q: wp.vec3d, r: wp.float64, v: wp.vec3d, a: wp.vec3d, w: wp.vec3d, b: wp.vec3d
        ) -> Record:
            return Record(q[0], q[1], q[2], r, v[0], v[1], v[2], a[0], a[1], a[2])

    return KernelSet(
        Record=Record,
        position=position,
        is_removed=is_removed,
        removed=removed,
        placed=placed,
        velocity=velocity,
        acceleration=acceleration,
        spin=spin,
        angular_acceleration=angular_acceleration,
        record=record,
    )
