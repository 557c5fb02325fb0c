"""The part of an endless plane that is drawn: around what is seen, and no further than where other planes cut it off."""

from collections.abc import Iterable

import numpy as np

from warpdem.core.snapshot import WallMesh

ROOM = 0.3
"""Room around grains that lie on a plane, over their greatest extent [-]."""
RIM = 0.02
"""Room around equipment that stands at a plane: no wider than that, but for a rim [-]."""

Half = tuple[np.ndarray, float]
"""A half-space by its unit normal, shape (3,), and offset d [m]: n . x >= d is where grains are."""


def patch(name: str, half: Half, others: Iterable[Half], around: np.ndarray, room: float = ROOM) -> WallMesh:
    """Convex patch of the plane n . x = d, wound about n.

    Args:
        name: Name of the wall.
        half: The plane.
        others: Planes that cut it off; one that would leave nothing is passed over.
        around: Points that the patch lies under [m], shape (n, 3).
        room: Room around them, over their greatest extent [-].
    """
    normal, offset = half
    along = np.eye(3)[np.argmin(np.abs(normal))]
    first = along - (along @ normal) * normal
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    points = around if len(around) else np.zeros((1, 3))
    shadow = points @ np.stack([first, second], axis=1)
    low, high = shadow.min(axis=0), shadow.max(axis=0)
    # a single grain has no extent: its height above the plane does
    reach = max(np.max(high - low), np.abs(points @ normal - offset).max())
    low, high = low - room * reach, high + room * reach
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    polygon = offset * normal + corners[:, :1] * first + corners[:, 1:] * second
    for other, limit in others:
        cut = _clipped(polygon, polygon @ other - limit)
        polygon = cut if len(cut) >= 3 else polygon
    fan = np.arange(1, len(polygon) - 1)
    triangles = np.stack([np.zeros_like(fan), fan, fan + 1], axis=1).astype(np.int32)
    return WallMesh(name, polygon, triangles, infinite=True)


def plane_of(mesh: WallMesh) -> Half:
    """The plane that a patch is part of."""
    a, b, c = mesh.vertices[mesh.triangles[0]]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    return normal, float(normal @ a)


def _clipped(polygon: np.ndarray, height: np.ndarray) -> np.ndarray:
    """What of a convex polygon, shape (n, 3), lies where the height of its corners, shape (n,), is positive."""
    kept = []
    for k, corner in enumerate(polygon):
        before = height[k - 1]
        if (before > 0.0) != (height[k] > 0.0):
            share = before / (before - height[k])
            kept.append(polygon[k - 1] + share * (corner - polygon[k - 1]))
        if height[k] > 0.0:
            kept.append(corner)
    return np.array(kept)
