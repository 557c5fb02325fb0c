"""Walls that fillings and streams keep clear of: distance of grains from each, and its gradient."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import frame_chain, wall_chain
from warpdem.scene.shapes.shape import Shape

TOUCH = 1e-5
"""Largest overlap of a grain and a wall that counts as touching, in radii [-]: more than rounding makes of a box that ends at a
wall, far less than a contact is resolved to."""
WHOLE = 0.999
"""Share of a region inside a closed mesh from which the mesh holds all of it [-]."""
FITTING = 0.1
"""Volume over that of a mesh around it below which a body is a fitting of it, not a vessel of its own [-]."""
STRADDLED = 0.02
"""Share of a region on the wrong side of a closed mesh above which a note is given [-]."""
PROBES = 200
"""Corners of a mesh that are looked at to tell what it lies in."""

WallPose = tuple[np.ndarray, np.ndarray]
"""Axes (3, 3) of a wall's body in frame axes [-], and its origin there [m], shape (3,)."""


@dataclass(frozen=True, eq=False)
class PlacedWall:
    """A wall at its pose, with the side of it that grains are on."""

    name: str
    """Name of the wall."""
    surface: TriangleMesh | Shape
    """What it is, in the axes of its body."""
    side: int
    """Of a mesh: 1 grains are outside, -1 inside, 0 on both sides (an open one); of a shape 0, which knows it itself."""
    axes: np.ndarray
    """Axes of the body in frame axes [-], shape (3, 3)."""
    origin: np.ndarray
    """Origin of the body in frame axes [m], shape (3,)."""

    @property
    def mesh(self) -> TriangleMesh:
        """The mesh; only of a mesh wall."""
        assert isinstance(self.surface, TriangleMesh)
        return self.surface

    @property
    def is_closed(self) -> bool:
        """Whether it is a closed mesh."""
        return self.side != 0

    def distance(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance of points (n, 3) [m] from the surface [m], (n,), negative where no grain may be; its gradient, (n, 3)."""
        body = (position - self.origin) @ self.axes
        if isinstance(self.surface, TriangleMesh):
            distance, gradient = signed_distance(self.surface, body)
            sign = np.where(distance < 0.0, -1.0, 1.0) if self.side == 0 else float(self.side)
            distance, gradient = sign * distance, (sign * gradient.T).T
        else:
            nearest, distance = self.surface.nearest(body)
            gradient = (body - nearest) / np.where(distance == 0.0, np.inf, distance)[:, None]
        return distance, gradient @ self.axes.T

    def gap(self, position: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
        """Gap between grains [m], (n, 3) and (n,), and the wall [m], shape (n,); negative when they overlap."""
        return self.distance(position)[0] - radius

    def is_near(self, bounds: np.ndarray, reach: float) -> bool:
        """Whether it may come nearer than ``reach`` [m] to a box (2, 3) [m], or the box is on its wrong side."""
        if self.side >= 0 and isinstance(self.surface, TriangleMesh):
            low, high = self.bounds
            if (low > bounds[1] + reach).any() or (bounds[0] - reach > high).any():
                return False
        middle, half = 0.5 * (bounds[0] + bounds[1]), 0.5 * (bounds[1] - bounds[0])
        return bool(self.distance(middle[None])[0][0] < np.linalg.norm(half) + reach)

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest corner of a mesh in frame axes [m], shape (2, 3), of a box around it."""
        low, high = self.mesh.bounds
        middle, reach = self.axes @ (0.5 * (low + high)) + self.origin, np.abs(self.axes) @ (0.5 * (high - low))
        return np.array([middle - reach, middle + reach])


def wall_poses_at_start(scene: Scene) -> list[WallPose]:
    """Where the body of each wall of a scene is at time 0."""
    begin = np.zeros(1)
    frame = frame_chain(scene).pose(begin)
    rotation, shift = frame.axes[0].astype(float), frame.origin[0].astype(float)
    found = []
    for number, wall in enumerate(scene.walls):
        own = wall_chain(scene, number).pose(begin)
        axes, origin = own.axes[0].astype(float), own.origin[0].astype(float)
        if wall.fixed_to == "laboratory":
            axes, origin = rotation.T @ axes, rotation.T @ (origin - shift)
        found.append((axes, origin))
    return found


def place_walls(scene: Scene, meshes: dict[str, TriangleMesh], poses: Sequence[WallPose]) -> list[PlacedWall]:
    """All walls of a scene, and the images of meshes across its periodic borders; grains are outside of closed meshes.

    Args:
        scene: Validated scene.
        meshes: Mesh walls by name.
        poses: Where the body of each wall is.
    """
    found = []
    images = _images(scene)
    for wall, (axes, origin) in zip(scene.walls, poses, strict=True):
        surface = wall.shape if wall.shape is not None else meshes[wall.name]
        side = int(isinstance(surface, TriangleMesh) and is_closed(surface))
        one = PlacedWall(wall.name, surface, side, axes, origin)
        found += [replace(one, origin=origin + shift) for shift in (images if wall.shape is None else images[:1])]
    return found


def is_closed(mesh: TriangleMesh) -> bool:
    """Whether a mesh has an inside, whatever the scene says of it."""
    return mesh.is_closed and mesh.mismatched_edges == 0


def _images(scene: Scene) -> np.ndarray:
    """Shifts to the periodic images next to the domain [m], none first, shape (k, 3)."""
    borders = getattr(scene, "borders", None)
    sides = [getattr(borders, axis, None) for axis in "xyz"]
    periods = [b.max - b.min if b is not None and b.kind == "periodic" else 0.0 for b in sides]
    return np.array(list(itertools.product(*((0.0, p, -p) if p else (0.0,) for p in periods))))


def assign_sides(
    walls: Sequence[PlacedWall],
    points: np.ndarray,
    filled: TriangleMesh | None = None,
    is_body: Callable[[PlacedWall], bool] = lambda wall: False,
) -> tuple[list[PlacedWall], list[str]]:
    """The walls, with grains inside those closed meshes that are vessels of a region; and the names of these.

    A region without a mesh of its own lies in a closed mesh that holds most of it and reaches as far on all sides: a box may
    poke out of a round vessel; but not in a fitting within another mesh, as a blade that takes up most of a box around it.
    Around a mesh that is filled only a mesh that holds it whole is a vessel.

    Args:
        walls: Walls, outside of which the grains are.
        points: Points of the region [m], shape (n, 3).
        filled: Mesh that the region is bounded by, which is none of the walls.
        is_body: Whether a closed mesh is a body that has no grains inside, though the region is there.
    """
    closed = [wall for wall in walls if wall.is_closed]
    share = {id(wall): float((wall.distance(points)[0] < 0.0).mean()) for wall in closed}
    vessels = []
    inner = np.array([points.min(axis=0), points.max(axis=0)]) if filled is None else filled.bounds
    for wall in closed:
        held, (low, high) = share[id(wall)], wall.bounds
        if held <= (0.5 if filled is None else WHOLE) or (low > inner[0]).any() or (inner[1] > high).any():
            continue
        if filled is not None:
            vessels.append(wall)
        else:
            around = [other for other in closed if other is not wall and share[id(other)] > 0.5 and _lies_in(wall, other)]
            small = any(abs(wall.mesh.volume) < FITTING * abs(other.mesh.volume) for other in around)
            if (not around or (held > WHOLE and not small)) and not is_body(wall):
                vessels.append(wall)
    return [replace(wall, side=-1) if wall in vessels else wall for wall in walls], [wall.name for wall in vessels]


def straddle_notes(walls: Sequence[PlacedWall], points: np.ndarray, key: str) -> list[str]:
    """Notes on closed meshes that hold a part of a region that is not theirs, or lack a part of one that is.

    Args:
        walls: Walls with the sides that grains are on.
        points: Points of the region [m], shape (n, 3).
        key: Scene key of the region, for messages.
    """
    notes = []
    for wall in walls:
        within = float((wall.distance(points)[0] < 0.0).mean()) if wall.is_closed else 0.0
        if within > STRADDLED:
            what = "inside" if wall.side > 0 else "outside"
            notes.append(f"{key}: {within:.0%} of it is {what} the closed mesh {wall.name!r} and left out")
    return notes


def _lies_in(inner: PlacedWall, outer: PlacedWall) -> bool:
    """Whether most of the corners of one closed mesh are inside another."""
    corners = inner.mesh.vertices
    corners = corners[:: max(1, len(corners) // PROBES)] @ inner.axes.T + inner.origin
    return float((outer.distance(corners)[0] < 0.0).mean()) > 0.5


def smallest_gap(walls: Sequence[PlacedWall], position: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
    """Smallest gap between grains, (n, 3) [m] and (n,) [m], and any of the walls [m], shape (n,)."""
    gaps = [np.full(len(position), np.inf), *(wall.gap(position, radius) for wall in walls)]
    return np.asarray(np.min(gaps, axis=0))


def in_body_axes(scene: Scene, number: int, position: np.ndarray) -> np.ndarray:
    """Positions (n, 3) [m] at time 0 in the axes of a wall's body; the same ones unless something has been moving before."""
    wall, begin = scene.walls[number], np.zeros(1)
    frame, own = frame_chain(scene).pose(begin), wall_chain(scene, number).pose(begin)
    if wall.fixed_to == "laboratory":
        position = position @ frame.axes[0].T.astype(float) + frame.origin[0].astype(float)
    return np.asarray((position - own.origin[0].astype(float)) @ own.axes[0].astype(float))
