"""The inside of a closed mesh as a region, as the box, cylinder and sphere of ``warpdem.scene.regions``."""

import numpy as np

from warpdem.mesh.triangle_mesh import TriangleMesh, load_mesh, require_closed, signed_distance
from warpdem.scene.model import Scene
from warpdem.scene.regions import Box, CylinderRegion, MeshRegion, PlaneRegion, Shape, SphereRegion

ATTEMPTS = 1000
"""Random points of the box around a mesh that are tried for one inside [-]."""


class MeshSolid:
    """The inside of a closed mesh; a ``Solid``.

    Args:
        mesh: Closed mesh.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest corner [m], shape (2, 3)."""
        return np.asarray(self.mesh.bounds)

    @property
    def volume(self) -> float:
        """Volume [m3]."""
        return abs(self.mesh.volume)

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance of points [m], shape (n, 3), from the surface [m], shape (n,), positive inside."""
        return np.asarray(-signed_distance(self.mesh, points)[0])

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are inside; bool, shape (n,)."""
        near = ((points >= self.bounds[0]) & (points <= self.bounds[1])).all(axis=1)
        near[near] = self.depth(points[near]) > 0.0
        return np.asarray(near)

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """Random points [m], shape (n, 3), at least ``radius`` [m], shape (n,), inside; in the box where none is found."""
        low, high = self.bounds
        return np.array([self._random_point(generator, low + r, high - r, r) for r in radius]).reshape(-1, 3)

    def _random_point(self, generator: np.random.Generator, low: np.ndarray, high: np.ndarray, r: float) -> np.ndarray:
        point = low
        for _ in range(ATTEMPTS):
            point = low + generator.random(3) * (high - low)
            if self.depth(point[None])[0] >= r:
                break
        return point


Bounded = Box | CylinderRegion | SphereRegion | MeshSolid
"""A bounded region in its own axes."""


def shape_of(scene: Scene, shape: Shape, key: str) -> Bounded | PlaneRegion:
    """A shape of a scene, with its mesh loaded if it is one.

    Args:
        scene: Validated scene.
        shape: Shape of one of its regions.
        key: Key of that shape, for messages.

    Raises:
        SceneError: The mesh is missing, damaged, or not closed.
    """
    if not isinstance(shape, MeshRegion):
        return shape
    key = f"{scene.source}: {key}.file"
    file, folders = scene.resolve(shape.file), scene.access.folders
    mesh = load_mesh(file, shape.scale, shape.rotate, shape.translate, "", key, folders)
    require_closed(mesh, key, "close it in the program that made it, or take a box, cylinder or sphere")
    return MeshSolid(mesh)
