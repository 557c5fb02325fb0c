"""How far a grain may go in one step beside a mesh: beyond, its centre could jump through the triangles unnoticed.

    |V - v_wall(q)| dt <= s r,      s = 0.2 for closed meshes, 0.1 for open ones (thin sheets)

A mesh acts from the side on which the grain's centre is, so a wall holds as long as the centre stays on its side; within s r
a step the contact begins early enough to turn the grain round. Planes and the other analytic walls know their inside and
need no such limit.
"""

import math

import numpy as np

from warpdem.scene.model import Scene
from warpdem.scene.walls import Wall

CLOSED, OPEN = 0.2, 0.1  # radii per step


def share(wall: Wall) -> float:
    """Largest travel per step beside ``wall``, over the grain's radius [-]; inf for analytic walls."""
    return math.inf if wall.mesh is None else OPEN if wall.open else CLOSED


def longest_step(scene: Scene, radius: np.ndarray, speed: float) -> float:
    """Largest time step [s] for grains of ``radius`` (n,) [m] that meet the scene's walls at ``speed`` [m/s]."""
    least = min((share(wall) for wall in scene.walls), default=math.inf)
    return least * float(radius.min()) / speed if speed > 0.0 and len(radius) else math.inf
