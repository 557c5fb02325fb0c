"""What the hard scenes of table.py are made of; they themselves are in contacts.py and domains.py.

Each runs and gives a number that must stay within its limit, or is told beforehand why it cannot run.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warpdem import Scene, Simulation

Verdict = Literal["held", "refused", "stopped"]
Tier = Literal["short", "default", "full"]
RADIUS, DENSITY, NU = 1e-3, 2500.0, 0.3
FLOOR = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
DOWN = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Case:
    """A hard scene."""

    scene: str
    invariant: str
    measure: Callable[[], float]
    """Runs the scene and gives the number."""
    limit: float = math.nan
    """What the number must not pass; nan where the scene must not run."""
    expected: Verdict = "held"
    reason: str = ""
    """Why the scene cannot run, where it is expected not to."""
    tier: Tier = "default"


def entering(cases: list[Case]) -> Callable:
    """The decorator ``case(scene, invariant, limit, *arguments, **more)``: enters a function, called so, into ``cases``."""

    def case(scene: str, invariant: str, limit: float = math.nan, *arguments, **more):
        def enter(function):
            cases.append(Case(scene, invariant, lambda: function(*arguments), limit, **more))
            return function

        return enter

    return case


def scene_of(positions, step="auto", radius=RADIUS, young=5e7, restitution=0.5, friction=0.5, walls=(), **keys) -> Scene:
    """A scene of one material; what is not named goes into the scene, ``grains`` into its grains, ``pair`` into its pair."""
    grains = {"material": "g", "positions": np.asarray(positions, float).tolist(), **keys.pop("grains", {})}
    grains["radius" if np.isscalar(radius) else "radii"] = radius
    limits = {"max_speed": keys.pop("max_speed", 1.0), "accuracy": keys.pop("accuracy", "bulk")}
    time = {"end": 1e6 if step != "auto" else 1.0, "step": step, **limits}
    coefficients = {"restitution": restitution, "friction": friction, **keys.pop("pair", {})}
    data = {
        "gravity": (0.0, 0.0, 0.0),
        "materials": {"g": {"density": DENSITY, "young_modulus": young, "poisson_ratio": NU}},
        "pairs": [{"materials": ["g", "g"], **coefficients}],
        "grains": [grains],
        "walls": list(walls),
        "time": time,
    }
    return Scene.model_validate(data | keys)


def simulate(*args, **keys) -> Simulation:
    """A simulation on one CPU thread."""
    return Simulation(scene_of(*args, **keys), device="cpu", threads=1)


def rest_depth(young: float, acceleration: float, radius: float = RADIUS) -> float:
    """Overlap of a grain at rest on a wall of its own material [m], (m a/K)^(2/3)."""
    mass = DENSITY * 4.0 / 3.0 * math.pi * radius**3
    stiffness = 4.0 / 3.0 * young / (2.0 * (1.0 - NU**2)) * math.sqrt(radius)
    return (mass * acceleration / stiffness) ** (2.0 / 3.0)
