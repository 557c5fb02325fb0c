"""How far a grain may go in one step beside a mesh: beyond, its centre could jump through the triangles unnoticed.

    |V - v_wall(q)| dt <= s r,      s = 0.2 for closed meshes, 0.1 for open ones (thin sheets)

A mesh acts from the side on which the grain's centre is, so a wall holds as long as the centre stays on its side; within s r
a step the contact begins early enough to send the grain back. Planes and the other analytic walls know their inside and
need no such limit.
"""

import math

import numpy as np

from warpdem.scene.model import Scene
from warpdem.scene.walls import Wall

CLOSED, OPEN = 0.2, 0.1  # radii per step


def max_travel(wall: Wall) -> float:
    """Largest travel per step beside ``wall``, over the grain's radius [-]; inf for analytic walls."""
    return math.inf if wall.mesh is None else OPEN if wall.open else CLOSED


def longest_step(scene: Scene, kind: np.ndarray, radius: np.ndarray, speed: float) -> float:
    """Largest time step [s] for grains of materials ``kind`` and ``radius`` (n,) [m] that meet walls at ``speed`` [m/s]."""
    if not speed > 0.0:
        return math.inf
    met = ((wall, radius[scene.touched(kind, number)]) for number, wall in enumerate(scene.walls))
    return min((max_travel(wall) * float(of.min()) / speed for wall, of in met if len(of)), default=math.inf)
