"""Triangles of a surface of revolution, for pictures and files."""

import numpy as np

from warpdem.scene.base import Vec3

SECTIONS = 96
"""Facets around the axis: chords deviate from the circle by 0.05 % of the radius."""


def lathe(origin: Vec3, axis: Vec3, height: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [m] and triangles of a line (height, radius) [m], shapes (k,), that is rotated about an axis."""
    along = np.array(axis)
    across = np.eye(3)[np.argmin(np.abs(along))]
    first = np.cross(along, across)
    first /= np.linalg.norm(first)
    angle = 2.0 * np.pi * np.arange(SECTIONS) / SECTIONS
    circle = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * np.cross(along, first)
    vertices = np.array(origin) + height[:, None, None] * along + radius[:, None, None] * circle
    k, s = np.meshgrid(np.arange(len(height) - 1), np.arange(SECTIONS), indexing="ij")
    a, b = k * SECTIONS + s, k * SECTIONS + (s + 1) % SECTIONS
    c, d = b + SECTIONS, a + SECTIONS
    sides = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2)
    # at a pole or an apex one of the two triangles has no area
    flat = np.stack([radius[:-1] <= 1e-12 * radius.max(), radius[1:] <= 1e-12 * radius.max()], axis=1)
    keep = ~np.broadcast_to(flat[:, None, :], sides.shape[:3])
    return vertices.reshape(-1, 3), sides[keep].astype(np.int32)
