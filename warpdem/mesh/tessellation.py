"""Triangles of analytic walls, for drawing only: contacts use the analytic shapes."""

from collections.abc import Mapping, Sequence

import numpy as np

from warpdem.core.snapshot import WallMesh
from warpdem.mesh.plane_patch import MARGIN, RIM, patch
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.base import Vec3
from warpdem.scene.wall_shapes import Plane, Revolved, Sphere
from warpdem.scene.walls import Wall

SECTIONS = 96
"""Facets around the axis: chords deviate from the circle by 0.05 % of the radius."""


def drawings(walls: Sequence[Wall], meshes: Mapping[str, TriangleMesh], positions: np.ndarray) -> list[WallMesh]:
    """Meshes for drawing the walls of a scene, each in its body axes.

    Args:
        walls: The walls of the scene.
        meshes: Triangles of the mesh walls, by name.
        positions: Initial positions of the grains [m], shape (n, 3): infinite shapes are drawn around them.
    """
    drawn = [WallMesh(name, mesh.vertices, mesh.triangles) for name, mesh in meshes.items()]
    around = np.concatenate([positions, *(mesh.vertices for mesh in drawn)])
    drawn += [tessellated(w.name, w.shape, around) for w in walls if isinstance(w.shape, Revolved | Sphere)]
    around = np.concatenate([positions, *(mesh.vertices for mesh in drawn)])
    planes = {w.name: (np.array(w.shape.normal), w.shape.offset) for w in walls if isinstance(w.shape, Plane)}
    motions = {w.name: (w.fixed_to, w.motion) for w in walls}
    patches = []
    for name, half in planes.items():
        others = [planes[other] for other in planes if other != name and motions[other] == motions[name]]
        patches.append(patch(name, half, others, around, RIM if drawn else MARGIN))
    return drawn + patches


def tessellated(name: str, shape: Revolved | Sphere, around: np.ndarray) -> WallMesh:
    """Triangles of a cylinder, cone or sphere.

    Args:
        name: Name of the wall.
        shape: The shape.
        around: Points [m], shape (n, 3): an infinite shape is drawn up to them and a little further.
    """
    if isinstance(shape, Sphere):
        polar = np.linspace(0.0, np.pi, SECTIONS // 2 + 1)
        return _lathe(name, shape.centre, (0.0, 0.0, 1.0), -shape.radius * np.cos(polar), shape.radius * np.sin(polar))
    begin, end = _drawn_range(shape, around)
    height, radius = (np.array([begin, end]) * run + foot for run, foot in zip(shape.direction, shape.foot, strict=True))
    return _lathe(name, shape.origin, shape.axis, height, radius)


def _drawn_range(shape: Revolved, around: np.ndarray) -> tuple[float, float]:
    """Start and end of the drawn part of a shape along its generatrix [m]."""
    begin, end = shape.limits
    if np.isfinite([begin, end]).all():
        return begin, end
    along = (around - np.array(shape.origin)) @ np.array(shape.axis) / shape.direction[0] if len(around) else np.zeros(1)
    margin = max(0.05 * np.ptp(along), 0.5 * shape.foot[1])
    low = along.min() - margin if shape.direction[1] == 0.0 else 0.0  # a cone begins at its apex
    return float(low), float(max(along.max() + margin, low + 2.0 * margin))


def _lathe(name: str, origin: Vec3, axis: Vec3, height: np.ndarray, radius: np.ndarray) -> WallMesh:
    """Surface of revolution of a line (height, radius) [m], shapes (k,), about an axis."""
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
    return WallMesh(name, vertices.reshape(-1, 3), sides[keep].astype(np.int32))
