"""Regions in which grains leave the domain: which of them a place is in.

A region is at rest in the frame, or a placement carries it (the laboratory in frame axes, or a wall): the place is then
taken in those axes. The test knows the place and the placements of one step, nothing of the steps before.

    box        low <= x < high
    cylinder   |x - p - h a| <= R,  start <= h <= end,  h = (x - p) . a     a plane: R and end infinite
    sphere     |x - p| <= R
    mesh       inside, by the nearest triangle, or the winding number where the nearest point is an edge or a corner
"""

import functools

import warp as wp
from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.step.schedule import Placement, local
from warpdem.kernels.wall.distance import signed_from_face

BOX, CYLINDER, SPHERE, MESH = range(4)
"""Kinds of regions."""
REGION_AT = Columns(
    (
        ("kind", 1),
        ("motion", 1),  # number of the placement that carries it, -1: it is at rest in the frame
        ("point", 3),  # low corner, or point of the axis, or centre [m]
        ("axis", 3),  # high corner [m], or unit vector of the axis
        ("radius", 1),  # [m]
        ("start", 1),  # height of the first end [m]
        ("end", 1),  # height of the other end [m]
        ("mesh", 1),  # number of the mesh
    )
)
Region = REGION_AT.vector(wp.float64)


@wp.struct
class Regions:
    """Regions in the order of their numbers, and the meshes of those that are one."""

    region: wp.array(dtype=Region)
    tree: wp.array(dtype=wp.uint64)  # (meshes,) search tree in unit coordinates (x - centre) / size
    centre: wp.array(dtype=wp.vec3d)  # (meshes,) [m]
    size: wp.array(dtype=wp.float64)  # (meshes,) [m]
    first: wp.array(dtype=wp.int32)  # (meshes,) number of the first triangle
    corner: wp.array(dtype=wp.mat33d)  # corners of each triangle, one a row [m]
    low: wp.array(dtype=wp.vec3d)  # (meshes,) corners of the bounding box [m]
    high: wp.array(dtype=wp.vec3d)


@wp.func
def vector_of(region: Region, first: int) -> wp.vec3d:
    """Vector of a region from this column on."""
    return wp.vec3d(region[first], region[first + 1], region[first + 2])


@wp.func
def in_box(q: wp.vec3d, region: Region) -> bool:
    """Whether a place [m] is in a box."""
    low = vector_of(region, wp.static(REGION_AT.point))
    high = vector_of(region, wp.static(REGION_AT.axis))
    return q[0] >= low[0] and q[1] >= low[1] and q[2] >= low[2] and q[0] < high[0] and q[1] < high[1] and q[2] < high[2]


@wp.func
def in_cylinder(q: wp.vec3d, region: Region) -> bool:
    """Whether a place [m] is in a cylinder, or beyond a plane."""
    axis = vector_of(region, wp.static(REGION_AT.axis))
    arm = q - vector_of(region, wp.static(REGION_AT.point))
    height = wp.dot(arm, axis)
    across = wp.length(arm - axis * height)
    between = height >= region[wp.static(REGION_AT.start)] and height <= region[wp.static(REGION_AT.end)]
    return between and across <= region[wp.static(REGION_AT.radius)]


@wp.func
def in_sphere(q: wp.vec3d, region: Region) -> bool:
    """Whether a place [m] is in a sphere."""
    return wp.length(q - vector_of(region, wp.static(REGION_AT.point))) <= region[wp.static(REGION_AT.radius)]


@wp.func
def in_mesh(q: wp.vec3d, region: Region, regions: Regions) -> bool:
    """Whether a place [m] is inside a closed mesh."""
    m = int(region[wp.static(REGION_AT.mesh)])
    zero = wp.float64(0.0)
    inside = wp.min(wp.min(q - regions.low[m]), wp.min(regions.high[m] - q)) >= zero
    if inside:
        at = wp.vec3((q - regions.centre[m]) / regions.size[m])
        # within the box, nothing is further than its diagonal
        query = wp.mesh_query_point_no_sign(regions.tree[m], at, wp.float32(2.0))
        corners = regions.corner[regions.first[m] + query.face]
        distance, gradient = signed_from_face(
            regions.tree[m], at, regions.size[m], q, corners[0], corners[1], corners[2]
        )
        inside = query.result and distance < zero
    return inside


@functools.cache
def build(*, count: int, kinds: tuple[int, ...], placed: bool):
    """Return ``region_of``.

    Args:
        count: number of regions.
        kinds: kinds that are among them.
        placed: a placement carries some of them.
    """

    @wp.func
    def region_of(q: wp.vec3d, regions: Regions, placements: wp.array2d(dtype=Placement), row: int) -> int:
        """Number of the first region that a place [m] in frame axes is in, -1 in none; ``row``: placements of its step."""
        number = int(-1)
        for e in range(wp.static(count)):
            if number < 0:
                region = regions.region[e]
                place = q
                if wp.static(placed):
                    motion = int(region[wp.static(REGION_AT.motion)])
                    if motion >= 0:
                        place = local(placements[row, motion], q)
                kind = int(region[wp.static(REGION_AT.kind)])
                inside = bool(False)
                if wp.static(BOX in kinds):
                    if kind == wp.static(BOX):
                        inside = in_box(place, region)
                if wp.static(CYLINDER in kinds):
                    if kind == wp.static(CYLINDER):
                        inside = in_cylinder(place, region)
                if wp.static(SPHERE in kinds):
                    if kind == wp.static(SPHERE):
                        inside = in_sphere(place, region)
                if wp.static(MESH in kinds):
                    if kind == wp.static(MESH):
                        inside = in_mesh(place, region, regions)
                if inside:
                    number = e
        return number

    return region_of
