"""Orientation of grains: the unit quaternion (w, x, y, z) that takes a grain's body axes to the frame axes.

    p_grain = (cos h, sin h w/|w|),  h = |w| dt/2,     p_axes = quaternion of R,     p <- p_grain p_axes p

w is the mean spin over the step as the integrator left it, in the axes of the step's end: it rotates the grain exactly. R
rotates laboratory-fixed directions in frame axes over the step, for a scheme that holds absolute spins (the axes rotate away
under the grain); one that holds spins relative to the frame has no such factor. Both are applied as increments, with 1 - cos h
written as 2 sin^2(h/2) and p_axes taken from R - I, so that small angles keep all their digits; the length is put right after
each step. A grain's quaternion is its own: its bits depend on nothing but its spins.
"""

import functools

import warp as wp
from warpdem.kernels.step.schedule import Row, drift_rotation


@wp.func
def rotated(q: wp.vec4d, less: wp.float64, v: wp.vec3d) -> wp.vec4d:
    """The product p q, where p is the unit quaternion of scalar part 1 + ``less`` and vector part ``v``."""
    return wp.vec4d(
        q[0] + (less * q[0] - (v[0] * q[1] + v[1] * q[2] + v[2] * q[3])),
        q[1] + (less * q[1] + v[0] * q[0] + (v[1] * q[3] - v[2] * q[2])),
        q[2] + (less * q[2] + v[1] * q[0] + (v[2] * q[1] - v[0] * q[3])),
        q[3] + (less * q[3] + v[2] * q[0] + (v[0] * q[2] - v[1] * q[1])),
    )


@functools.cache
def build_axes(*, rotating_axes: bool):
    """Return ``with_axes(q, row)``: the quaternion of what is at rest, at the end of the step; arguments as of ``build``."""

    @wp.func
    def with_axes(q: wp.vec4d, row: Row) -> wp.vec4d:
        p = q
        if wp.static(rotating_axes):
            m = drift_rotation(row)  # R - I, whose trace is -4 sin^2 of half the angle
            quarter = wp.float64(0.25) * (m[0, 0] + m[1, 1] + m[2, 2])
            scalar = wp.sqrt(wp.float64(1.0) + quarter)
            axis = wp.vec3d(m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])
            p = rotated(p, quarter / (wp.float64(1.0) + scalar), axis * (wp.float64(0.25) / scalar))
        return p

    return with_axes


@functools.cache
def build(*, rotating_axes: bool):
    """Return ``orientation(q, spin, row, dt)``: the quaternion at the end of the step.

    Args:
        rotating_axes: spins are absolute, and the axes that they are resolved in rotate.
    """
    with_axes = build_axes(rotating_axes=rotating_axes)

    @wp.func
    def orientation(q: wp.vec4d, spin: wp.vec3d, row: Row, dt: wp.float64) -> wp.vec4d:
        p = with_axes(q, row)
        rate = wp.length(spin)
        half = wp.float64(0.5) * dt
        fraction = wp.sin(half * rate) / rate
        sine = wp.sin(wp.float64(0.5) * half * rate)
        p = rotated(p, wp.float64(-2.0) * sine * sine, spin * (fraction if rate > wp.float64(0.0) else half))
        # |p|^2 - 1 is some roundings: one step of Newton's method for 1/|p| is exact
        return p * (wp.float64(1.5) - wp.float64(0.5) * wp.dot(p, p))

    return orientation
