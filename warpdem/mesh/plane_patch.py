"""The part of an infinite plane that is drawn: around the visible objects, and clipped by other planes."""

from collections.abc import Iterable

import numpy as np

from warpdem.core.snapshot import WallMesh

MARGIN = 0.3
"""Margin around grains on a plane, over their greatest extent [-]."""
RIM = 0.02
"""Margin around equipment at a plane, over its greatest extent [-]."""

Half = tuple[np.ndarray, float]
"""A half-space by its unit normal, shape (3,), and offset d [m]: n . x >= d is where grains are."""


def patch(name: str, half: Half, others: Iterable[Half], around: np.ndarray, margin: float = MARGIN) -> WallMesh:
    """Convex patch of the plane n . x = d, wound about n.

    Args:
        name: Name of the wall.
        half: The plane.
        others: Planes that clip it; a plane that would leave nothing is ignored.
        around: Points whose projections the patch contains [m], shape (n, 3).
        margin: Margin around them, over their greatest extent [-].
    """
    normal, offset = half
    along = np.eye(3)[np.argmin(np.abs(normal))]
    first = along - (along @ normal) * normal
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    points = around if len(around) else np.zeros((1, 3))
    projection = points @ np.stack([first, second], axis=1)
    low, high = projection.min(axis=0), projection.max(axis=0)
    # a single grain has no extent: its height above the plane is used
    extent = max(np.max(high - low), np.abs(points @ normal - offset).max())
    low, high = low - margin * extent, high + margin * extent
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    polygon = offset * normal + corners[:, :1] * first + corners[:, 1:] * second
    for other, limit in others:
        clipped = _clipped(polygon, polygon @ other - limit)
        polygon = clipped if len(clipped) >= 3 else polygon
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
    """Part of a convex polygon, shape (n, 3), where the height of its corners, shape (n,), is positive."""
    kept = []
    for k, corner in enumerate(polygon):
        before = height[k - 1]
        if (before > 0.0) != (height[k] > 0.0):
            fraction = before / (before - height[k])
            kept.append(polygon[k - 1] + fraction * (corner - polygon[k - 1]))
        if height[k] > 0.0:
            kept.append(corner)
    return np.array(kept)
