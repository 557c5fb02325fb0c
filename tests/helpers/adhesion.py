"""The reference pair of the adhesion tests, spheres of 1 mm of a soft material, and its impacts, or those on a plane."""

import math

import numpy as np

from law_probe import Contacts
from warpdem import Scene

RADIUS, DENSITY, YOUNG, POISSON, ENERGY = 1e-3, 2500.0, 1e7, 0.3, 0.1
REDUCED = 0.5 * RADIUS
MASS = 0.5 * DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
"""m* of the pair [kg]."""
PULL, PULL_OFF = 2.35619449019e-4, 8.83484169187e-7
"""F_c [N] and d_c [m] of the pair."""


def meeting(speed, step, phase=0.5, *, normal="jkr", restitution=1.0, wall=False, energy=ENERGY, **changes) -> Scene:
    """Two grains, or a grain and a plane, a little apart, that meet at ``speed`` [m/s]; ``phase``: of the step of the touch."""
    gap = 2.0 * PULL_OFF + phase * speed * step
    grains = {"positions": [[0, 0, 0.5 * gap + RADIUS], [0, 0, -0.5 * gap - RADIUS]]}
    grains["velocities"] = [[0, 0, -0.5 * speed], [0, 0, 0.5 * speed]]
    if wall:
        grains = {"positions": [[0, 0, gap + RADIUS]], "velocities": [[0, 0, -speed]]}
    floor = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    data = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": DENSITY, "young_modulus": YOUNG, "poisson_ratio": POISSON}},
        "contact": {"normal": normal, "tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": restitution, "surface_energy": energy}],
        "grains": [{"material": "g", "radius": RADIUS, **grains}],
        "walls": [floor] if wall else [],
        "time": {"end": 1.0, "step": step, "max_speed": speed},
    }
    return Scene.model_validate({**data, **changes})


def contacts(law, real, overlap, before, history, *, stiffness, pull_off, speed=0.0, damping=0.0) -> dict[str, np.ndarray]:
    """As of ``Contacts.force``, of contacts with these K, C, d_c and d_e remembered: what a JKR law gives for each."""
    made = Contacts(law, [0.0] * 5, 1.0, real=real)
    made.constants = np.array([stiffness, damping * (pull_off / 3.0) ** 0.25, 1.0, pull_off])
    found = made.force(overlap, before, speed, np.reshape(history, (-1, 1)))
    return found | {"history": found["history"][:, 0]}
