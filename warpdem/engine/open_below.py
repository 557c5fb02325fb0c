"""Whether analytic walls leave a way out, downwards: what falls through it falls on for ever."""

import numpy as np

from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.shapes.plane import Plane


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

    def is_closed(centre: np.ndarray, radius: float, axis: np.ndarray) -> bool:
        return _is_closed(centre, radius, axis, planes, smallest)

    if any(wall.shape is not None and wall.shape.catches(down, is_closed) for wall in scene.walls):
        return []
    return [wall.name for wall in scene.walls]


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
