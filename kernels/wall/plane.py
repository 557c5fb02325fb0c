"""Plane n . x = d, solid behind: a grain there is pushed back all the way."""

import warp as wp


@wp.func
def closest(q: wp.vec3d, plane: wp.vec4d):
    """Foot of body point ``q`` [m], unit normal, and signed distance [m], negative behind the plane."""
    normal = wp.vec3d(plane[0], plane[1], plane[2])
    distance = wp.dot(normal, q) - plane[3]
    return q - normal * distance, normal, distance
