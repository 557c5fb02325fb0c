"""Closest point of a triangle in float64 (Ericson 2005, section 5.1.5), and which of its corners span the feature it lies on.

The mask names the corners whose triangle, edge or vertex holds the closest point: bit 0, 1, 2 for corner a, b, c. 7 is the
face, 3, 5, 6 an edge, 1, 2, 4 a vertex.
"""

import warp as wp

FACE = 7


@wp.func
def closest_point(q: wp.vec3d, corners: wp.mat33d):
    """Closest point of the triangle with the rows of ``corners`` [m], and its mask."""
    a = corners[0]
    b = corners[1]
    c = corners[2]
    zero = wp.float64(0.0)
    ab = b - a
    ac = c - a
    ap = q - a
    d1 = wp.dot(ab, ap)
    d2 = wp.dot(ac, ap)
    if d1 <= zero and d2 <= zero:
        return a, 1
    bp = q - b
    d3 = wp.dot(ab, bp)
    d4 = wp.dot(ac, bp)
    if d3 >= zero and d4 <= d3:
        return b, 2
    vc = d1 * d4 - d3 * d2
    if vc <= zero and d1 >= zero and d3 <= zero:
        return a + ab * (d1 / (d1 - d3)), 3
    cp = q - c
    d5 = wp.dot(ab, cp)
    d6 = wp.dot(ac, cp)
    if d6 >= zero and d5 <= d6:
        return c, 4
    vb = d5 * d2 - d1 * d6
    if vb <= zero and d2 >= zero and d6 <= zero:
        return a + ac * (d2 / (d2 - d6)), 5
    va = d3 * d6 - d5 * d4
    if va <= zero and d4 - d3 >= zero and d5 - d6 >= zero:
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), 6
    scale = wp.float64(1.0) / (va + vb + vc)
    return a + ab * (vb * scale) + ac * (vc * scale), 7


@wp.func
def corner_count(mask: int) -> int:
    """How many corners ``mask`` picks: 3 for a face, 2 for an edge, 1 for a vertex."""
    return (mask & 1) + ((mask >> 1) & 1) + ((mask >> 2) & 1)
