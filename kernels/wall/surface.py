"""The walls of a scene as the kernels see them: triangles of meshes first, then analytic planes, one numbering for both."""

import warp as wp


@wp.struct
class Surface:
    """Features (triangles, then planes) in the body axes of their wall."""

    triangles: wp.int32
    """Number of triangles; features from here on are planes."""
    corner: wp.array(dtype=wp.mat33d)
    """Corners of each triangle, one per row [m]."""
    vertex: wp.array(dtype=wp.vec3i)
    """Corner numbers of each triangle, unique over all walls."""
    piece: wp.array(dtype=wp.int32)
    """Connected smooth piece of each feature."""
    plane: wp.array(dtype=wp.vec4d)
    """Unit normal and offset [m] of each feature's flat piece: n . x = offset."""
    wall: wp.array(dtype=wp.int32)
    """Wall of each feature."""
    motion: wp.array(dtype=wp.int32)
    """Placement of each wall."""
    material: wp.array(dtype=wp.int32)
    """Material of each wall."""


@wp.func
def is_corner_set_within(vertices: wp.vec3i, mask: int, other: wp.vec3i) -> bool:
    """Whether all corners that ``mask`` picks of one triangle are corners of the other."""
    within = bool(True)
    for k in range(3):
        if (mask >> k) & 1 == 1:
            v = vertices[k]
            if v != other[0] and v != other[1] and v != other[2]:
                within = False
    return within
