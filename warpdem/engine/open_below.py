"""Whether analytic walls leave a way out, downwards: what falls through it falls on for ever."""

from typing import Any

import numpy as np

from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.wall_shapes import Cone, Cylinder, Plane, Sphere

LEVEL = 1.0e-9  # sine of an angle below which a direction counts as level, or as along another


def walls_open_below(scene: Scene, smallest: float) -> list[str]:
    """Names of the walls that a grain of diameter ``smallest`` [m] falls past, all of the scene; none if one of them holds it.

    Known are the walls that hold by themselves whatever falls: a plane that is no ceiling and no side wall, a sphere or a cone
    round its grains, a bore that is closed at its lower end, by planes too. Not looked at: meshes, a frame that rotates.
    """
    gravity = np.asarray(scene.gravity, float)
    pull = np.linalg.norm(gravity)
    if not scene.walls or not pull or any(wall.mesh is not None for wall in scene.walls) or frame_chain(scene).rotates:
        return []
    down = gravity / pull
    planes = [wall.shape for wall in scene.walls if isinstance(wall.shape, Plane)]
    if any(_holds(wall.shape, down, planes, smallest) for wall in scene.walls):
        return []
    return [wall.name for wall in scene.walls]


def _holds(shape: Any, down: np.ndarray, planes: list[Plane], smallest: float) -> bool:
    """Whether a wall by itself, with planes for its ends, holds whatever falls onto it."""
    if isinstance(shape, Plane):
        return float(np.dot(shape.normal, down)) < -LEVEL
    if isinstance(shape, Sphere):
        return shape.inside
    if not shape.has_ends and not shape.inside:
        return False
    axis = np.asarray(shape.axis)
    along = float(axis @ down)
    across = np.sqrt(max(1.0 - along * along, 0.0))
    if not shape.has_ends:
        angle = shape.half_angle if isinstance(shape, Cone) else 0.0
        return float(np.arctan2(across, along)) > angle + LEVEL if isinstance(shape, Cone) else across > LEVEL
    mouths = _mouths(shape)
    depth = [float(centre @ down) for centre, _ in mouths]
    lowest = max(depth) - LEVEL * np.ptp(depth)
    return all(_is_closed(centre, radius, axis, planes, smallest)
               for (centre, radius), deep in zip(mouths, depth, strict=True) if deep >= lowest)  # fmt: skip


def _mouths(shape: Cylinder | Cone) -> list[tuple[np.ndarray, float]]:
    """Centre and radius [m] of both ends."""
    axis = np.asarray(shape.axis)
    if isinstance(shape, Cylinder):
        return [(np.asarray(shape.point) + h * axis, shape.radius) for h in (0.0, shape.length)]
    wide = np.tan(shape.half_angle)
    return [(np.asarray(shape.apex) + h * axis, h * wide) for h in (shape.start, shape.end)]


def _is_closed(centre: np.ndarray, radius: float, axis: np.ndarray, planes: list[Plane], smallest: float) -> bool:
    """Whether an end is too narrow for a grain, or a plane leaves no gap there that is wide enough."""
    if 2.0 * radius <= smallest:
        return True
    for plane in planes:
        normal = np.asarray(plane.normal)
        rise = radius * np.sqrt(max(1.0 - float(normal @ axis) ** 2, 0.0))  # of the rim above its centre, seen from the plane
        if float(normal @ centre) + rise - plane.offset < smallest:
            return True
    return False
