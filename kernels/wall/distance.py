"""Signed distance from points to a triangle mesh: the search in float32, the geometry in float64.

`wp.Mesh` holds float32 corners only, so its query finds the *face*; the closest point on that face is computed again
from float64 corners. Sign: negative inside. Where the closest point lies within a face, the plane of the face gives the
sign exactly; where it lies on an edge or corner, the winding number of the whole mesh does (a face alone does not decide).

Source of the closest point: C. Ericson, Real-Time Collision Detection (2005), section 5.1.5.

Limits: the faces must be wound alike (outwards); a face whose float32 image is a needle is never found by the search.
Two faces nearly equally close may be confused by float32 rounding: the distance is then wrong by 1e-7 of the mesh size.
"""

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, SHARED_READERS

wp.set_module_options(MODULE_OPTIONS, module=wp.get_module(SHARED_READERS))


@wp.func
def closest_on_triangle(p: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d) -> wp.vec3d:
    """Barycentric coordinates [-] of the point of triangle abc closest to p; a zero says that it lies on a border."""
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    ab = b - a
    ac = c - a
    d1 = wp.dot(ab, p - a)
    d2 = wp.dot(ac, p - a)
    if d1 <= zero and d2 <= zero:
        return wp.vec3d(one, zero, zero)
    d3 = wp.dot(ab, p - b)
    d4 = wp.dot(ac, p - b)
    if d3 >= zero and d4 <= d3:
        return wp.vec3d(zero, one, zero)
    vc = d1 * d4 - d3 * d2
    if vc <= zero and d1 >= zero and d3 <= zero:
        t = d1 / (d1 - d3)
        return wp.vec3d(one - t, t, zero)
    d5 = wp.dot(ab, p - c)
    d6 = wp.dot(ac, p - c)
    if d6 >= zero and d5 <= d6:
        return wp.vec3d(zero, zero, one)
    vb = d5 * d2 - d1 * d6
    if vb <= zero and d2 >= zero and d6 <= zero:
        t = d2 / (d2 - d6)
        return wp.vec3d(one - t, zero, t)
    va = d3 * d6 - d5 * d4
    if va <= zero and d4 >= d3 and d5 >= d6:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return wp.vec3d(zero, one - t, t)
    total = va + vb + vc
    return wp.vec3d(va / total, vb / total, vc / total)


@wp.func
def signed_from_face(
    mesh: wp.uint64, local: wp.vec3, size: wp.float64, x: wp.vec3d, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d
):  # fmt: skip
    """Distance [m] of x from a closed mesh, negative inside, and its gradient [-]; abc is its face closest to x.

    Args:
        mesh: Search tree in unit coordinates, with winding numbers.
        local: x in unit coordinates.
        size: Metres per unit coordinate.
        x: Point [m].
        a, b, c: Corners of the closest face [m].
    """
    barycentric = closest_on_triangle(x, a, b, c)
    offset = x - (barycentric[0] * a + barycentric[1] * b + barycentric[2] * c)
    gradient = wp.normalize(wp.cross(b - a, c - a))
    distance = wp.length(offset)
    sign = wp.float64(1.0)
    if wp.min(barycentric) > wp.float64(0.0):
        if wp.dot(offset, gradient) < wp.float64(0.0):
            sign = wp.float64(-1.0)
    else:
        sign = wp.float64(wp.mesh_query_point_sign_winding_number(mesh, local, wp.float32(1.0e6)).sign)
        # a point on the surface itself has no direction of its own: the face's normal stands in
        if distance > wp.float64(1.0e-12) * size:
            gradient = offset * (sign / distance)
    return sign * distance, gradient


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def signed_distance(
    # mesh: search tree in unit coordinates (x - centre) / size, and its true corners [m]
    mesh: wp.uint64,
    centre: wp.vec3d,
    size: wp.float64,
    vertex: wp.array[wp.vec3d],
    triangle: wp.array[wp.vec3i],
    # points [m], read
    point: wp.array[wp.vec3d],
    # written: distance [m], negative inside, and its gradient [-] (unit vector that points outwards)
    distance_out: wp.array[wp.float64],
    gradient_out: wp.array[wp.vec3d],
):
    """Signed distance of each point and the direction in which it grows fastest."""
    i = wp.tid()
    x = point[i]
    local = wp.vec3((x - centre) / size)
    # unit coordinates are within [-0.5, 0.5] on the mesh; no point of use is 1e6 sizes away
    query = wp.mesh_query_point_no_sign(mesh, local, wp.float32(1.0e6))
    if not query.result:
        distance_out[i] = wp.float64(wp.inf)
        gradient_out[i] = wp.vec3d()
        return
    corners = triangle[query.face]
    distance, gradient = signed_from_face(
        mesh, local, size, x, vertex[corners[0]], vertex[corners[1]], vertex[corners[2]]
    )
    distance_out[i] = distance
    gradient_out[i] = gradient


@wp.kernel(enable_backward=False, module=SHARED_READERS)
def pierced(
    mesh: wp.uint64,  # its search tree in unit coordinates
    # lines in unit coordinates, read
    start: wp.array[wp.vec3],
    end: wp.array[wp.vec3],
    # written: 1 where a triangle is met between the ends of the line
    hit_out: wp.array[wp.int32],
):
    """Which lines lead through a triangle, and not only along it, at its border, or from or to it."""
    i = wp.tid()
    path = end[i] - start[i]
    length = wp.length(path)
    hit_out[i] = 0
    begin = float(1.0e-3)
    for _k in range(8):  # triangles that the line lies in come before others
        if length > 0.0 and begin < 0.999:
            query = wp.mesh_query_ray(mesh, start[i] + path * begin, path / length, length * (0.999 - begin))
            if query.result:
                within = wp.min(wp.min(query.u, query.v), 1.0 - query.u - query.v)
                if within > 1.0e-4 and wp.abs(wp.dot(query.normal, path)) > 1.0e-3 * length:
                    hit_out[i] = 1
                begin += query.t / length + 1.0e-3
            else:
                begin = 1.0
