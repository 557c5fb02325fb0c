"""The space that a filling may use: a box or the inside of a closed mesh, clipped by a box and by a level."""

from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh.geometry import TriangleMesh, build_mesh, clipped_volume, require_closed

LEVEL = 1e-9
"""Largest slant of a direction that counts as one of the axes [-]."""


@dataclass(frozen=True, eq=False)
class Region:
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
    """Volume of the box within the mesh [m3]."""

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
        low, high = self.low + radius[:, None], self.high - radius[:, None]
        points = low + generator.random((len(radius), 3)) * (high - low)
        return points if (self.axes == np.eye(3)).all() else np.einsum("ij,ni->nj", self.axes, points)


def region(mesh: TriangleMesh | None, box, key: str, height: float | None = None, up=(0.0, 0.0, 1.0)) -> Region:
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
    bounds = np.asarray(mesh.bounds if box is None else box, float)
    low, high = bounds.copy()
    if mesh is not None:
        low, high = np.maximum(low, mesh.bounds[0]), np.minimum(high, mesh.bounds[1])
    if not (low < high).all():
        what = "is empty: min must be below max" if mesh is None else f"does not meet the mesh {mesh.name}"
        raise SceneError(f"{key}: the region {bounds.tolist()} m {what}")
    axes = np.eye(3)
    if height is not None:
        up = _direction(up, key)
        k = int(np.abs(up).argmax())
        if 1.0 - abs(up[k]) > LEVEL:
            if mesh is not None and box is not None:
                raise SceneError(
                    f"{key}.height: cannot be combined with a region while gravity slants (up is {up.tolist()}): leave "
                    "one of them out, or turn the scene until gravity lies along an axis"
                )
            return _below_slanted_level(mesh or _box_mesh(low, high), up, height)
        if up[k] > 0.0:
            high[k] = min(high[k], low[k] + height)
        else:
            low[k] = max(low[k], high[k] - height)
    volume = float(np.prod(high - low)) if mesh is None else clipped_volume(mesh, (low, high))
    if volume <= 0.0:
        raise SceneError(f"{key}: the region {[low.tolist(), high.tolist()]} m holds nothing of the inside of {mesh.name}")
    return Region(low, high, axes, mesh, volume)


def _direction(up, key: str) -> np.ndarray:
    """Unit vector."""
    up = np.asarray(up, float)
    length = float(np.linalg.norm(up))
    if length == 0.0:
        raise SceneError(f"{key}.height: counts against gravity, but gravity is zero: give a region or box instead")
    return up / length


def _below_slanted_level(mesh: TriangleMesh, up: np.ndarray, height: float) -> Region:
    """The inside of a mesh below a level that is not square to the frame's axes."""
    across = np.eye(3)[int(np.abs(up).argmin())]
    first = np.cross(across, up)
    first /= np.linalg.norm(first)
    axes = np.array([first, np.cross(up, first), up])
    turned = build_mesh(mesh.corners, (axes, np.zeros(3)), mesh.name)
    low, high = turned.bounds.copy()
    high[2] = min(high[2], low[2] + height)
    return Region(low, high, axes, mesh, clipped_volume(turned, (low, high)))


def _box_mesh(low: np.ndarray, high: np.ndarray) -> TriangleMesh:
    """The surface of a box."""
    x, y, z = np.eye(3)
    quads = [(corner, a, b) for a, b, c in ((x, y, z), (y, z, x), (z, x, y)) for corner, a, b in ((0 * x, b, a), (c, a, b))]
    triangles = [t for o, a, b in quads for t in ([o, o + a, o + a + b], [o, o + a + b, o + b])]
    return build_mesh(low + np.array(triangles) * (high - low), name="box")
