"""Sphere that grains are inside or outside of; solid on the other side.

Numbers: 0..2 centre [m], 3 radius [m], 4 side: -1 grains inside, 1 outside.
"""

import warp as wp
from warpdem.kernels.wall.surface import Numbers


@wp.func
def closest(q: wp.vec3d, radius: wp.float64, ball: Numbers):
    """Closest point to body point ``q`` [m], unit normal on the grains' side, signed distance [m] and weight [-], always 1."""
    offset = q - wp.vec3d(ball[0], ball[1], ball[2])
    length = wp.length(offset)
    # at the very centre, which only a grain of the sphere's size could touch from, the first axis stands in
    outwards = offset / length if length > wp.float64(0.0) else wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0))
    normal = outwards * ball[4]
    distance = (length - ball[3]) * ball[4]
    return q - normal * distance, normal, distance, wp.float64(1.0)


@wp.func
def height(q: wp.vec3d, ball: Numbers) -> wp.float64:
    """Signed distance of body point ``q`` [m]."""
    _point, _normal, distance, _weight = closest(q, wp.float64(0.0), ball)
    return distance
