"""Plane n . x = d, solid behind: a grain there is pushed back all the way.

Numbers: 0..2 unit normal n towards the grains [-], 3 offset d [m].
"""

import warp as wp
from warpdem.kernels.wall.surface import Numbers


@wp.func
def foot(q: wp.vec3d, plane: wp.vec4d):
    """Foot of body point ``q`` [m], unit normal, and signed distance [m], negative behind the plane."""
    normal = wp.vec3d(plane[0], plane[1], plane[2])
    distance = wp.dot(normal, q) - plane[3]
    return q - normal * distance, normal, distance


@wp.func
def closest(q: wp.vec3d, radius: wp.float64, numbers: Numbers):
    """Closest point to body point ``q`` [m], direction, signed distance [m] and weight of the contact [-]."""
    point, normal, distance = foot(q, wp.vec4d(numbers[0], numbers[1], numbers[2], numbers[3]))
    return point, normal, distance, wp.float64(1.0)


@wp.func
def height(q: wp.vec3d, numbers: Numbers) -> wp.float64:
    """Signed distance of body point ``q`` [m]."""
    _foot, _normal, distance = foot(q, wp.vec4d(numbers[0], numbers[1], numbers[2], numbers[3]))
    return distance
