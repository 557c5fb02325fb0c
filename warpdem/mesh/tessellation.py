"""Triangles of analytic walls, for drawing only: contacts use the analytic shapes."""

from collections.abc import Mapping, Sequence

import numpy as np

from warpdem.core.snapshot import WallMesh
from warpdem.mesh.plane_patch import MARGIN, RIM, patch
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.shapes.plane import Plane
from warpdem.scene.shapes.shape import Shape
from warpdem.scene.walls import Wall


def drawings(walls: Sequence[Wall], meshes: Mapping[str, TriangleMesh], positions: np.ndarray) -> list[WallMesh]:
    """Meshes for drawing the walls of a scene, each in its body axes.

    Args:
        walls: The walls of the scene.
        meshes: Triangles of the mesh walls, by name.
        positions: Initial positions of the grains [m], shape (n, 3): infinite shapes are drawn around them.
    """
    drawn = [WallMesh(name, mesh.vertices, mesh.triangles) for name, mesh in meshes.items()]
    around = np.concatenate([positions, *(mesh.vertices for mesh in drawn)])
    shapes = [(w.name, w.shape) for w in walls if w.shape is not None and not isinstance(w.shape, Plane)]
    drawn += [tessellated(name, shape, around) for name, shape in shapes]
    around = np.concatenate([positions, *(mesh.vertices for mesh in drawn)])
    planes = {w.name: (np.array(w.shape.normal), w.shape.offset) for w in walls if isinstance(w.shape, Plane)}
    motions = {w.name: (w.fixed_to, w.motion) for w in walls}
    patches = []
    for name, half in planes.items():
        others = [planes[other] for other in planes if other != name and motions[other] == motions[name]]
        patches.append(patch(name, half, others, around, RIM if drawn else MARGIN))
    return drawn + patches


def tessellated(name: str, shape: Shape, around: np.ndarray) -> WallMesh:
    """Triangles of any shape but a plane.

    Args:
        name: Name of the wall.
        shape: The shape.
        around: Points [m], shape (n, 3): an infinite shape is drawn up to them and a little further.
    """
    return WallMesh(name, *shape.triangles(around))
