"""The space that a filling may use: a box or the inside of a closed mesh, clipped by a box and by a level."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.open_space import OpenSpace, find_open_space, leak_message
from warpdem.filling.placed_walls import PlacedWall, is_closed
from warpdem.mesh.clipped_volume import clipped_volume
from warpdem.mesh.triangle_mesh import TriangleMesh, build_mesh, inside, require_closed

LEVEL = 1e-9
"""Largest slant of a direction that counts as one of the axes [-]."""
SAMPLES = 200_000
"""Points of a region at which is asked whether walls leave it free."""
CUP = 0.5
"""Volume of a mesh over that of a box around it from which it holds less than it has inside [-]."""
CUP_NODES = 40_000
"""Nodes of the grid that show whether it is a cup."""


Corners = np.ndarray | Sequence[Sequence[float]]
"""Least and greatest corner of a box [m], shape (2, 3)."""
Direction = np.ndarray | Sequence[float]
"""A direction, any length, shape (3,)."""


@dataclass(frozen=True, eq=False)
class FillRegion:
    """A box along its own axes, within a closed mesh if there is one."""

    low: np.ndarray
    """Lowest corner of the box along ``axes`` [m], shape (3,)."""
    high: np.ndarray
    """Highest corner of the box along ``axes`` [m], shape (3,)."""
    axes: np.ndarray
    """Unit vectors of the box's axes in frame axes [-], shape (3, 3), one a row."""
    mesh: TriangleMesh | None
    """Closed mesh in frame axes."""
    volume: float
    """Volume of the box within the mesh, less what other walls take up [m3]."""
    open_space: OpenSpace | None = None
    """The part of the space between walls that it is limited to."""

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest corner in frame axes [m], shape (2, 3), of the smallest box around the region."""
        centre, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        middle, reach = self.axes.T @ centre, np.abs(self.axes.T) @ half
        return np.array([middle - reach, middle + reach])

    def clamp(self, position: np.ndarray, radius: np.ndarray) -> None:
        """Move centres (n, 3) [m] into the box shrunk by each grain's radius (n,) [m], in place."""
        r = radius[:, None]
        if (self.axes == np.eye(3)).all():
            np.clip(position, self.low + r, self.high - r, out=position)
        else:
            local = np.clip(np.einsum("ij,nj->ni", self.axes, position), self.low + r, self.high - r)
            np.einsum("ij,ni->nj", self.axes, local, out=position)

    def random_points(self, generator: np.random.Generator, radius: np.ndarray) -> np.ndarray:
        """Random centres (n, 3) [m] in the box shrunk by each grain's radius (n,) [m]; the mesh is not looked at."""
        if self.open_space is not None:
            points = self.open_space.random_points(generator, len(radius))
            self.clamp(points, radius)
            return points
        low, high = self.low + radius[:, None], self.high - radius[:, None]
        points = low + generator.random((len(radius), 3)) * (high - low)
        return points if (self.axes == np.eye(3)).all() else np.asarray(np.einsum("ij,ni->nj", self.axes, points))


def closed_region(
    mesh: TriangleMesh | None, box: Corners | None, key: str, height: float | None = None, up: Direction = (0.0, 0.0, 1.0)
) -> FillRegion:
    """Region of a closed mesh, a box, or the part of the mesh within the box.

    Args:
        mesh: Closed mesh in frame axes, or None.
        box: Least and greatest corner [m], shape (2, 3), or None for the whole mesh.
        key: Scene key, for messages.
        height: Only what lies less than this above the lowest point [m] of the mesh, or of the box where one is given
            (of both together: the lowest point of the mesh's bounds within the box); None for everything.
        up: Direction in which ``height`` counts, any length.

    Raises:
        SceneError: Nothing is left, the mesh is not closed, or ``up`` is zero, or slants where mesh and box are given.
    """
    if mesh is not None:
        require_closed(mesh, key, "fill a box instead: fill = { box = { min = [...], max = [...] } }")
    low, high = _clipped(mesh, box, key)
    axes = np.eye(3)
    if height is not None:
        up = _direction(up, key)
        k = int(np.abs(up).argmax())
        if 1.0 - abs(up[k]) > LEVEL:
            if mesh is not None and box is not None:
                raise _slants(up, key)
            return _below_slanted_level(mesh or _box_mesh(low, high), up, height)
        if up[k] > 0.0:
            high[k] = min(high[k], low[k] + height)
        else:
            low[k] = max(low[k], high[k] - height)
    volume = float(np.prod(high - low)) if mesh is None else clipped_volume(mesh, (low, high))
    if mesh is not None and volume <= 0.0:
        raise SceneError(f"{key}: the region {[low.tolist(), high.tolist()]} m holds nothing of the inside of {mesh.name}")
    return FillRegion(low, high, axes, mesh, volume)


def open_region(
    mesh: TriangleMesh,
    walls: Sequence[PlacedWall],
    box: Corners | None,
    radius: float,
    key: str,
    height: float | None = None,
    up: Direction = (0.0, 0.0, 1.0),
    point: np.ndarray | None = None,
) -> FillRegion:
    """The space that a mesh holds without being closed around it: of a hopper, a cup, a trough, up to their brim or a level.

    Args:
        mesh: The mesh that holds it, in frame axes.
        walls: All walls that bound it, the mesh among them.
        box: As in ``region``; sides of it that cut through the mesh hold the grains.
        radius: Radius of the smallest grain [m].
        key: Scene key, for messages.
        height: Only what lies less than this above the lowest point of the mesh [m], of a closed one (a cup of solid walls)
            above the lowest point of the space; None for all up to the highest point of the mesh.
        up: Direction in which ``height`` counts, any length.
        point: A point of the space [m], or None for the largest that holds grains, and others that are not much smaller.

    Raises:
        SceneError: Grains would run out, says where; nothing is left; ``up`` is zero with a height, or slants with a box.
    """
    corners, axes, k, top = _clipped(mesh, box, key), np.eye(3), None, 1
    if height is not None or any(up):
        up = _direction(up, key)
        k = int(np.abs(up).argmax())
        top = int(up[k] > 0.0)
        if 1.0 - abs(up[k]) > LEVEL:
            if box is not None and height is not None:
                raise _slants(up, key)
            if box is None:
                axes, k, top = _level_axes(up), 2, 1
                corners = build_mesh(mesh.corners, (axes, np.zeros(3)), mesh.name).bounds.copy()
    leaks = np.ones((2, 3), bool)
    if box is not None:
        cut = 1e-9 * float((mesh.bounds[1] - mesh.bounds[0]).max())
        leaks = np.array([np.asarray(box[0]) < mesh.bounds[0] - cut, np.asarray(box[1]) > mesh.bounds[1] + cut])
    if k is not None:
        leaks[top, k] = False  # grains do not run upwards
    key = f"{key}: {mesh.name}"
    if height is not None:
        floor = corners[1 - top, k]
        if is_closed(mesh) and (open_space := find_open_space(walls, corners, axes, leaks, radius, key, point)) is not None:
            floor = open_space.bounds[1 - top, k]
        corners[top, k] = min(corners[1, k], floor + height) if top else max(corners[0, k], floor - height)
    open_space = find_open_space(walls, corners, axes, leaks, radius, key, point)
    if open_space is None:
        raise SceneError(leak_message(walls, corners, axes, leaks, radius, key))
    low, high = corners
    return FillRegion(low, high, axes, None, open_space.volume, open_space)


def is_cup(mesh: TriangleMesh, up: Direction) -> bool:
    """Whether a closed mesh holds more between its walls than it has inside, as a cup of solid walls or a tube with lids.

    Without gravity, where ``up`` is zero, only what is shut in on all sides is held.
    """
    heavy = any(up)
    axes = _level_axes(_direction(up, "")) if heavy else np.eye(3)
    box = build_mesh(mesh.corners, (axes, np.zeros(3)), mesh.name).bounds
    size = float((box[1] - box[0]).prod())
    if abs(mesh.volume) > CUP * size:
        return False
    wall = PlacedWall(mesh.name, mesh, 1, np.eye(3), np.zeros(3))
    leaks = np.array([[True, True, True], [True, True, not heavy]])
    open_space = find_open_space([wall], box, axes, leaks, (size / CUP_NODES) ** (1.0 / 3.0), "", most_nodes=CUP_NODES)
    return open_space is not None and open_space.volume > abs(mesh.volume)


def with_free_volume(space: FillRegion, walls: Sequence[PlacedWall], key: str) -> FillRegion:
    """The region with the volume that walls leave of it, measured at `SAMPLES` points; the same where they take nothing.

    Raises:
        SceneError: They leave nothing; names them.
    """
    near = [wall for wall in walls if wall.is_near(space.bounds, 0.0)]
    if not near or space.open_space is not None:
        return space
    points = sample_points(space, SAMPLES)
    taken = np.zeros(len(points), bool)
    within = []
    for wall in near:
        behind = wall.distance(points)[0] < 0.0
        within += [wall.name] if behind.any() else []
        taken |= behind
    if taken.all():
        raise SceneError(
            f"{key}: the region lies wholly within or behind {', '.join(map(repr, dict.fromkeys(within)))}: walls are left out "
            "of a filling; give a region beside them"
        )
    return replace(space, volume=space.volume * (1.0 - float(taken.mean()))) if taken.any() else space


def sample_points(space: FillRegion, count: int) -> np.ndarray:
    """Points [m] spread evenly over a region, shape (k, 3): those of ``count`` in its box that are within its mesh."""
    # additive recurrence: its numbers are powers of the root of x^4 = x + 1, which spread best in three dimensions
    fraction = (0.5 + np.outer(np.arange(1, count + 1), 1.2207440846057596 ** -np.arange(1.0, 4.0))) % 1.0
    points = (space.low + fraction * (space.high - space.low)) @ space.axes
    return np.asarray(points if space.mesh is None else points[inside(space.mesh, points)])


def _clipped(mesh: TriangleMesh | None, box: Corners | None, key: str) -> np.ndarray:
    """Least and greatest corner of the box within the bounds of the mesh [m], shape (2, 3)."""
    bounds = np.asarray(mesh.bounds if box is None and mesh is not None else box, float)
    low, high = bounds.copy()
    if mesh is not None:
        low, high = np.maximum(low, mesh.bounds[0]), np.minimum(high, mesh.bounds[1])
    if not (low < high).all():
        what = "is empty: min must be below max" if mesh is None else f"does not meet the mesh {mesh.name}"
        raise SceneError(f"{key}: the region {bounds.tolist()} m {what}")
    return np.array([low, high])


def _slants(up: np.ndarray, key: str) -> SceneError:
    return SceneError(
        f"{key}.height: cannot be combined with a region while gravity slants (up is {up.tolist()}): leave "
        "one of them out, or turn the scene until gravity lies along an axis"
    )


def _direction(up: Direction, key: str) -> np.ndarray:
    """Unit vector."""
    up = np.asarray(up, float)
    length = float(np.linalg.norm(up))
    if length == 0.0:
        raise SceneError(f"{key}.height: counts against gravity, but gravity is zero: give a region or box instead")
    return np.asarray(up / length)


def _below_slanted_level(mesh: TriangleMesh, up: np.ndarray, height: float) -> FillRegion:
    """The inside of a mesh below a level that is not square to the frame's axes."""
    axes = _level_axes(up)
    turned = build_mesh(mesh.corners, (axes, np.zeros(3)), mesh.name)
    low, high = turned.bounds.copy()
    high[2] = min(high[2], low[2] + height)
    return FillRegion(low, high, axes, mesh, clipped_volume(turned, (low, high)))


def _level_axes(up: np.ndarray) -> np.ndarray:
    """Axes of which the last points up, one a row, shape (3, 3)."""
    across = np.eye(3)[int(np.abs(up).argmin())]
    first = np.cross(across, up)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def _box_mesh(low: np.ndarray, high: np.ndarray) -> TriangleMesh:
    """The surface of a box."""
    x, y, z = np.eye(3)
    quads = [(corner, a, b) for a, b, c in ((x, y, z), (y, z, x), (z, x, y)) for corner, a, b in ((0 * x, b, a), (c, a, b))]
    triangles = [t for o, a, b in quads for t in ([o, o + a, o + a + b], [o, o + a + b, o + b])]
    return build_mesh(low + np.array(triangles) * (high - low), name="box")
