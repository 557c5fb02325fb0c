"""The inside of a closed mesh as a region, as the box, cylinder and sphere of ``warpdem.scene.regions``."""

from collections.abc import Callable

import numpy as np

from warpdem.mesh.triangle_mesh import TriangleMesh, build_mesh, load_mesh, require_closed, signed_distance
from warpdem.scene.model import Scene
from warpdem.scene.regions import (
    Box,
    CylinderRegion,
    DiskFace,
    MeshFace,
    MeshRegion,
    PlaneRegion,
    Shape,
    SphereRegion,
    across,
)

ROUNDS = 50
"""Rounds in which random points are drawn until one is deep enough [-]."""
FACETS = 96
"""Facets of a cylinder or sphere around its axis [-]."""
AT_ONCE = 64
"""Points that are drawn in a round at least [-]."""


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
        """Random points [m], shape (n, 3), at least ``radius`` [m], shape (n,), inside; any where none is found."""
        low, high = self.bounds

        def draw(radius: np.ndarray) -> np.ndarray:
            r = np.minimum(radius[:, None], 0.5 * (high - low))
            return np.asarray(low + r + generator.random((len(radius), 3)) * (high - low - 2.0 * r))

        return _deep_enough(draw, self.depth, radius)


class FaceSolid:
    """An open surface, on which grains are inserted.

    Args:
        mesh: Its triangles.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self._corners, self.bounds = mesh.corners, mesh.bounds
        edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        kinds, count = np.unique(edges, axis=0, return_counts=True)
        self._rim = mesh.vertices[kinds[count == 1]]
        sides = self._corners[:, 1:] - self._corners[:, :1]
        self._reached = np.cumsum(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Distance of points of the surface [m], shape (n, 3), from its rim [m], shape (n,); infinite without a rim."""
        start, way = self._rim[:, 0], self._rim[:, 1] - self._rim[:, 0]
        arm = points[:, None] - start
        along = np.clip(np.einsum("nks,ks->nk", arm, way) / np.einsum("ks,ks->k", way, way), 0.0, 1.0)
        return np.asarray(np.linalg.norm(arm - along[..., None] * way, axis=2).min(axis=1, initial=np.inf))

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """Random points [m], shape (n, 3), at least ``radius`` [m], shape (n,), from the rim; any where none is found."""

        def draw(radius: np.ndarray) -> np.ndarray:
            part, first, second = generator.random((3, len(radius)))
            a, b, c = np.swapaxes(self._corners[np.searchsorted(self._reached, part * self._reached[-1], side="right")], 0, 1)
            beyond = first + second > 1.0
            first, second = np.where(beyond, 1.0 - first, first), np.where(beyond, 1.0 - second, second)
            return np.asarray(a + first[:, None] * (b - a) + second[:, None] * (c - a))

        return _deep_enough(draw, self.depth, radius)


def _deep_enough(
    draw: Callable[[np.ndarray], np.ndarray], depth: Callable[[np.ndarray], np.ndarray], radius: np.ndarray
) -> np.ndarray:
    """A random point for each radius [m] that is as deep as that; the last one drawn where none is found.

    Args:
        draw: Gives a random point [m] for each of some radii [m], shape (k, 3).
        depth: How deep points are [m], shape (k,).
        radius: Shape (n,).
    """
    points, open_still = np.zeros((len(radius), 3)), np.arange(len(radius))
    for _ in range(ROUNDS):
        if not len(open_still):
            break
        # some for each at once, as many as a launch takes no longer for
        each = np.repeat(open_still, max(1, AT_ONCE // len(open_still)))
        drawn = draw(radius[each])
        good = depth(drawn) >= radius[each]
        points[each] = drawn
        first = np.unique(each[good], return_index=True)
        points[first[0]] = drawn[good][first[1]]
        open_still = np.setdiff1d(open_still, first[0])
    return points


def facets(shape: CylinderRegion | SphereRegion) -> TriangleMesh:
    """A closed mesh with its corners on a cylinder of a length, or on a sphere; its volume is smaller by up to 0.2 %."""
    angle = 2.0 * np.pi * np.arange(FACETS) / FACETS
    if isinstance(shape, CylinderRegion):
        assert shape.length is not None  # a filling has an end
        (first, second), axis, origin = across(np.array(shape.axis)), np.array(shape.axis), np.array(shape.point)
        level = np.array([[0.0, 0.0], [0.0, shape.radius], [shape.length, shape.radius], [shape.length, 0.0]])
    else:
        first, second, axis = np.eye(3)
        origin, rise = np.array(shape.centre), np.pi * np.arange(FACETS // 2 + 1) / (FACETS // 2)
        level = shape.radius * np.stack([-np.cos(rise), np.sin(rise)], axis=1)
        level[[0, -1], 1] = 0.0
    radial = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
    ring = origin + level[:, None, :1] * axis + level[:, None, 1:] * radial  # (levels, FACETS, 3)
    below, above = ring[:-1], ring[1:]
    one, other = np.roll(below, -1, axis=1), np.roll(above, -1, axis=1)
    triangles = np.concatenate([np.stack([below, one, other], axis=2), np.stack([below, other, above], axis=2)])
    return build_mesh(triangles.reshape(-1, 3, 3), name="region")


Bounded = Box | CylinderRegion | SphereRegion | MeshSolid
"""A bounded region in its own axes."""
Face = DiskFace | FaceSolid
"""A face."""
Inserted = Bounded | Face
"""Where grains are inserted."""


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
    mesh = _loaded(scene, shape, key)
    remedy = "close it in the program that made it, or take a box, cylinder or sphere"
    require_closed(mesh, f"{scene.source}: {key}.file", remedy)
    return MeshSolid(mesh)


def face_of(scene: Scene, face: DiskFace | MeshFace, key: str) -> Face:
    """A face of a scene; arguments as of ``shape_of``.

    Raises:
        SceneError: The mesh is missing or damaged.
    """
    return FaceSolid(_loaded(scene, face, key)) if isinstance(face, MeshFace) else face


def _loaded(scene: Scene, shape: MeshRegion | MeshFace, key: str) -> TriangleMesh:
    """The mesh of a region or face."""
    file, folders = scene.resolve(shape.file), scene.access.folders
    return load_mesh(file, shape.scale, shape.rotate, shape.translate, "", f"{scene.source}: {key}.file", folders)
