"""Head-on impacts of grains on each other and on a plane, under any normal law.

The reference grain: radius 1 mm, 2500 kg/m3, 10 MPa, Poisson's ratio 0.3, so for two of them R* = 0.5 mm and
K = (4/3) E* sqrt(R*).
"""

import math

import numpy as np

from warpdem import Scene, Simulation
from warpdem.scene.file import scene_from_dict

RADIUS, DENSITY, YOUNG, POISSON = 1.0e-3, 2500.0, 1.0e7, 0.3
MASS = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3  # [kg], of one grain
ELASTIC = YOUNG / (2.0 * (1.0 - POISSON**2))  # E* [Pa]
HERTZ = 4.0 / 3.0 * ELASTIC * math.sqrt(0.5 * RADIUS)  # K of two grains [N/m^1.5]
ASIDE = 10.0 * RADIUS


def contact_time(speed: float) -> float:
    """Of an undamped Hertz impact of two reference grains [s]."""
    return 2.943275184 * (5.0 * 0.5 * MASS * speed**2 / (4.0 * HERTZ)) ** 0.4 / speed


def impacts(
    normal: str, pair: dict, speed: float, step: float, *, phases: int = 8, across: float = 0.0, spins=(0.0, 0.0, 0.0),
    contact: dict | None = None, base=".", **changes,
) -> Scene:  # fmt: skip
    """As many pairs as ``phases`` that meet along x at ``speed`` [m/s], then as many grains that meet the plane z = 0.

    The k-th of each touches (k + 1/2)/phases of a step after the start. No gravity.

    Args:
        normal: normal law.
        pair: coefficients.
        speed: approach speed [m/s].
        step: time step [s].
        phases: pairs, and grains at the plane.
        across: speed along the contact, of one grain of each pair and of the grains at the plane [m/s].
        spins: of one grain of each pair and of those at the plane [rad/s].
        contact: other contact laws.
        base: folder of the scene, for laws in files.
        changes: keys of the scene in place of those here.
    """
    before = speed * step * (np.arange(phases) + 0.5) / phases
    aside = ASIDE * np.arange(phases)
    left, right, above = np.zeros((3, phases, 3))
    left[:, 0], right[:, 0] = -RADIUS - 0.5 * before, RADIUS + 0.5 * before
    left[:, 1] = right[:, 1] = above[:, 1] = aside
    left[:, 2] = right[:, 2] = 0.1
    above[:, 2] = RADIUS + before
    velocity = np.zeros((3, phases, 3))
    velocity[0, :, 0], velocity[1, :, 0], velocity[2, :, 2] = 0.5 * speed, -0.5 * speed, -speed
    velocity[0, :, 1] = velocity[2, :, 1] = across
    spin = np.zeros((3, phases, 3))
    spin[0] = spin[2] = spins
    data = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": DENSITY, "young_modulus": YOUNG, "poisson_ratio": POISSON}},
        "contact": {"normal": normal, "tangential": "none", "rolling": "none"} | (contact or {}),
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0} | pair],
        "grains": [
            {
                "material": "g", "radius": RADIUS, "positions": np.concatenate([left, right, above]).tolist(),
                "velocities": velocity.reshape(-1, 3).tolist(), "spins": spin.reshape(-1, 3).tolist(),
            }
        ],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
        "time": {"end": 1.0, "step": step, "max_speed": speed},
    }  # fmt: skip
    return scene_from_dict(data | changes, base)


def parting_speeds(sim: Simulation, phases: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed at which the pairs, and the grains and the plane, part [m/s], shapes (phases,); negative while they approach."""
    v = sim.particles.velocity
    return v[phases : 2 * phases, 0] - v[:phases, 0], v[2 * phases :, 2]
