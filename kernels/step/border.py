"""Periodic borders: the nearest image of a difference of two places, and the place of a grain within the domain.

Along a periodic axis of length L and lower border a, grains are kept in [a, a + L] by one wrap per step, so two of them differ
by less than L, and the nearest image is

    d - L if d > L/2,   d + L if d < -L/2,   else d.

Straight-line code, as contacts need it; nothing is compiled for axes that are not periodic.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet


@functools.cache
def build(period: tuple[float, float, float], lower: tuple[float, float, float]):
    """Return ``nearest``, ``wrapped`` and what else is asked of a place.

    Args:
        period: length of the domain along each axis [m], 0 where it is not periodic.
        lower: lower border along each axis [m].
    """
    x, y, z = period
    a, b, c = lower
    steps = [(0,) if length == 0.0 else (0, 1, -1) for length in period]
    every = [(i * x, j * y, k * z) for i in steps[0] for j in steps[1] for k in steps[2]]
    shifts = wp.types.vector(3 * len(every), wp.float64)(*[number for shift in every for number in shift])

    @wp.func
    def axis_nearest(d: wp.float64, length: wp.float64) -> wp.float64:
        half = length * wp.float64(0.5)
        return d - length if d > half else (d + length if d < -half else d)

    @wp.func
    def nearest(d: wp.vec3d) -> wp.vec3d:
        """The shortest of the differences between images of two places [m]."""
        dx = d[0]
        dy = d[1]
        dz = d[2]
        if wp.static(x > 0.0):
            dx = axis_nearest(d[0], wp.float64(wp.static(x)))
        if wp.static(y > 0.0):
            dy = axis_nearest(d[1], wp.float64(wp.static(y)))
        if wp.static(z > 0.0):
            dz = axis_nearest(d[2], wp.float64(wp.static(z)))
        return wp.vec3d(dx, dy, dz)

    @wp.func
    def axis_wrapped(q: wp.float64, low: wp.float64, length: wp.float64) -> wp.float64:
        return q + length if q < low else (q - length if q >= low + length else q)

    @wp.func
    def wrapped(q: wp.vec3d) -> wp.vec3d:
        """The image within the domain of a place that left it by less than a period [m]."""
        qx = q[0]
        qy = q[1]
        qz = q[2]
        if wp.static(x > 0.0):
            qx = axis_wrapped(q[0], wp.float64(wp.static(a)), wp.float64(wp.static(x)))
        if wp.static(y > 0.0):
            qy = axis_wrapped(q[1], wp.float64(wp.static(b)), wp.float64(wp.static(y)))
        if wp.static(z > 0.0):
            qz = axis_wrapped(q[2], wp.float64(wp.static(c)), wp.float64(wp.static(z)))
        return wp.vec3d(qx, qy, qz)

    @wp.func
    def image(q: wp.vec3d, number: int) -> wp.vec3d:
        """Image ``number`` of a place, 0 the place itself [m]."""
        return q + wp.vec3d(
            wp.static(shifts)[3 * number], wp.static(shifts)[3 * number + 1], wp.static(shifts)[3 * number + 2]
        )

    @wp.func
    def axis_may_cross(q: wp.float64, direction: wp.float64, low: wp.float64, length: wp.float64, travel: wp.float64) -> bool:
        below = direction > wp.float64(0.0) and q - low <= travel
        above = direction < wp.float64(0.0) and low + length - q <= travel
        return direction == wp.float64(0.0) or below or above

    @wp.func
    def may_cross(q: wp.vec3d, number: int, travel: wp.float64) -> bool:
        """Whether a grain that goes up to ``travel`` [m] may come round to image ``number`` of its place."""
        may = True
        if wp.static(x > 0.0):
            direction = wp.static(shifts)[3 * number]
            may = may and axis_may_cross(q[0], direction, wp.float64(wp.static(a)), wp.float64(wp.static(x)), travel)
        if wp.static(y > 0.0):
            direction = wp.static(shifts)[3 * number + 1]
            may = may and axis_may_cross(q[1], direction, wp.float64(wp.static(b)), wp.float64(wp.static(y)), travel)
        if wp.static(z > 0.0):
            direction = wp.static(shifts)[3 * number + 2]
            may = may and axis_may_cross(q[2], direction, wp.float64(wp.static(c)), wp.float64(wp.static(z)), travel)
        return may

    @wp.func
    def within(q: wp.vec3d, distance: wp.float64) -> bool:
        """Whether a place is closer than ``distance`` [m] to the domain."""
        near = True
        if wp.static(x > 0.0):
            near = near and q[0] > wp.float64(wp.static(a)) - distance and q[0] < wp.float64(wp.static(a + x)) + distance
        if wp.static(y > 0.0):
            near = near and q[1] > wp.float64(wp.static(b)) - distance and q[1] < wp.float64(wp.static(b + y)) + distance
        if wp.static(z > 0.0):
            near = near and q[2] > wp.float64(wp.static(c)) - distance and q[2] < wp.float64(wp.static(c + z)) + distance
        return near

    @wp.func
    def crossed(q: wp.vec3d) -> bool:
        """Whether a place is beyond a periodic border after the one wrap that each step makes; the rest is for round-off."""
        far = False
        if wp.static(x > 0.0):
            far = far or wp.abs(q[0] - wp.float64(wp.static(a + 0.5 * x))) > wp.float64(wp.static(0.501 * x))
        if wp.static(y > 0.0):
            far = far or wp.abs(q[1] - wp.float64(wp.static(b + 0.5 * y))) > wp.float64(wp.static(0.501 * y))
        if wp.static(z > 0.0):
            far = far or wp.abs(q[2] - wp.float64(wp.static(c + 0.5 * z))) > wp.float64(wp.static(0.501 * z))
        return far

    return KernelSet(
        nearest=nearest, wrapped=wrapped, crossed=crossed, image=image, may_cross=may_cross, within=within, images=len(every)
    )
