"""Cylinder or cone: a straight line, the generatrix, rotated about an axis.

Numbers: 0..2 point of the axis [m], 3..5 its unit direction, 6, 7 a point of the generatrix (height along the axis, distance
from it) [m], 8, 9 its unit direction in the same two coordinates, 10, 11 where it begins and ends [m] (may be infinite),
12 side: -1 or 1 when grains belong on one side and the other is solid (-1 left of the generatrix, as seen along it with the
axis to the right of the height), 0 for a thin sheet that is solid from both sides.

A grain in a meridian plane meets two lines, the generatrix on its own side and the one opposite. Touching only the first it
has one contact, as with a plane. Held by both at once (a grain seated in a cone or on the rim of a tube) it touches all
around: one contact point still, whose direction leans from the near side to the axis as the overlap with the far side grows,

    n = n_axial + g n_radial,   g = s (3 - s^2)/2,   s = (overlap_near - overlap_far)/overlap_near in [0, 1],

so that it is carried along the axis and the force across it goes to zero with the distance from the axis, where the closest
point alone would throw it from side to side. The length of n < 1 scales the force.
"""

import warp as wp
from warpdem.kernels.wall.surface import NO_SIDE, Numbers


@wp.func
def from_line(height: wp.float64, across: wp.float64, shape: Numbers):
    """Unit direction (axial, radial) from the line's closest point to (height, across) [m], and the distance [m]."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    h = height - shape[6]
    r = across - shape[7]
    along = h * shape[8] + r * shape[9]
    left = r * shape[8] - h * shape[9]
    beyond = along - wp.clamp(along, shape[10], shape[11])
    side = shape[12] if shape[12] != zero else (one if left >= zero else -one)
    distance = left * side
    axial = -shape[9] * side
    radial = shape[8] * side
    if beyond != zero:
        distance = wp.sqrt(left * left + beyond * beyond)
        axial = (beyond * shape[8] - left * shape[9]) / distance
        radial = (beyond * shape[9] + left * shape[8]) / distance
    return axial, radial, distance


@wp.func
def closest(q: wp.vec3d, radius: wp.float64, shape: Numbers):
    """Closest point to body point ``q`` [m], direction, signed distance [m] and weight of the contact [-], 1 for a full one."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    axis = wp.vec3d(shape[3], shape[4], shape[5])
    offset = q - wp.vec3d(shape[0], shape[1], shape[2])
    height = wp.dot(offset, axis)
    outwards = offset - axis * height
    across = wp.length(outwards)
    outwards = outwards / across if across > zero else wp.vec3d()
    axial, radial, distance = from_line(height, across, shape)
    weight = one
    if radial < zero and distance < radius:
        _, _, far = from_line(height, -across, shape)
        s = (far - distance) / (radius - distance)
        if s < one:
            radial *= s * (wp.float64(3.0) - s * s) * wp.float64(0.5)
            weight = wp.sqrt(axial * axial + radial * radial)
    direction = (axis * axial + outwards * radial) / (weight if weight > zero else one)
    return q - direction * distance, direction, distance, weight


@wp.func
def height(q: wp.vec3d, shape: Numbers) -> wp.float64:
    """Signed distance of body point ``q`` [m] from a wall with a solid side; ``NO_SIDE`` from a thin sheet."""
    distance = wp.float64(wp.static(NO_SIDE))
    if shape[12] != wp.float64(0.0):
        axis = wp.vec3d(shape[3], shape[4], shape[5])
        offset = q - wp.vec3d(shape[0], shape[1], shape[2])
        along = wp.dot(offset, axis)
        _axial, _radial, from_side = from_line(along, wp.length(offset - axis * along), shape)
        distance = from_side
    return distance
