"""The walls of a scene as the kernels see them: triangles of meshes first, then analytic shapes, one numbering for all."""

import warp as wp
from warpdem.kernels.wall.mobility import Mobility

WIDTH = 13
"""Numbers of the shape that needs most."""
Numbers = wp.types.vector(WIDTH, wp.float64)
"""What a shape is made of, as its file says; the rest is zero."""
NO_SIDE = 1.0e300
"""Distance [m] from the solid side of a shape that has none."""


@wp.struct
class Surface:
    """Features (triangles, then analytic shapes in the order of ``shapes.SHAPES``) in the body axes of their wall."""

    triangles: wp.int32
    """Number of triangles; features from here on are analytic shapes."""
    analytic: wp.int32
    """Number of analytic shapes."""
    corner: wp.array(dtype=wp.mat33d)
    """Corners of each triangle, one per row [m]."""
    vertex: wp.array(dtype=wp.vec3i)
    """Corner numbers of each triangle, unique over all walls."""
    piece: wp.array(dtype=wp.int32)
    """Connected smooth piece of each feature."""
    plane: wp.array(dtype=wp.vec4d)
    """Unit normal and offset [m] of each triangle's flat piece: n . x = offset."""
    shape: wp.array(dtype=wp.int32)
    """What each analytic shape is: its number in ``shapes.SHAPES``."""
    numbers: wp.array(dtype=Numbers)
    """Numbers of each analytic shape."""
    wall: wp.array(dtype=wp.int32)
    """Wall of each feature."""
    motion: wp.array(dtype=wp.int32)
    """Placement of each wall."""
    mobility: wp.array(dtype=Mobility)
    """How walls yield, by placement; of size 0 where none is free."""
    images: wp.array(dtype=wp.int32)
    """Images of a grain from which each wall is seen, a bit for each number; see ``images``."""
    material: wp.array(dtype=wp.int32)
    """Material of each wall."""
    rounding: wp.array(dtype=wp.float64)
    """How far corners of each wall's file are off the planes they belong to [m]."""


@wp.struct
class MeshTrees:
    """Search trees of the mesh walls, in the body axes of their wall."""

    tree: wp.array(dtype=wp.uint64)
    """``wp.Mesh`` of each, shape (meshes,)."""
    wall: wp.array(dtype=wp.int32)
    """Its wall."""
    first: wp.array(dtype=wp.int32)
    """Number of its first triangle."""


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
