"""How many times stiffer materials must be for impacts that overlap less, searched by the normal law itself.

No closed form holds for all laws: with adhesion the overlap has a part that no speed gives, d ~ (w^2 R*/E*^2)^(1/3), and the
elastic energy is below 0 over most of it.
"""

import math
from typing import Any

from warpdem.filling.initial_grains import InitialGrains
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import contact_cases, impact_of
from warpdem.scene.model import Scene

LARGEST_FACTOR = 1e9
"""Factor beyond which the key is taken to have no effect [-]."""
CLOSE = 1.002
"""Quotient of the ends of the last interval of the search [-]."""
OF_PAIRS = "pairs[]."
"""What the key of a stiffness begins with where each pair of materials has its own."""


def deepest_overlap(scene: Scene, start: InitialGrains, speed: float) -> float:
    """Deepest overlap of an undamped impact at ``speed`` [m/s] over the radius of the grain [-]; 0 without contacts."""
    law, at = scene.normal_law, coefficient_columns(scene)
    cases = contact_cases(scene, start)
    return max((impact_of(law, at.stiffness, one, speed).overlap / one.radius for one in cases), default=0.0)


def stiffened(scene: Scene, key: str, factor: float) -> Scene:
    """The scene with ``factor`` times the ``key``: "young_modulus" of all materials, or "pairs[].NAME" of all pairs."""
    name = key.removeprefix(OF_PAIRS)

    def scaled(one: Any) -> Any:
        value = getattr(one, name, None)
        return one if value is None else one.model_copy(update={name: factor * value})

    if key.startswith(OF_PAIRS):
        return scene.model_copy(update={"pairs": [scaled(pair) for pair in scene.pairs]})
    return scene.model_copy(update={"materials": {label: scaled(one) for label, one in scene.materials.items()}})


def least_factor(scene: Scene, start: InitialGrains, speed: float, sound: float, key: str) -> float | None:
    """Factor of the stiffness ``key`` at which impacts at ``speed`` [m/s] overlap by at most ``sound`` of the radius [-].

    It is at least 1 and at most ``CLOSE`` times the least one; None where no factor does.
    """

    def deep(factor: float) -> bool:
        return not deepest_overlap(stiffened(scene, key, factor), start, speed) <= sound

    low, high = 1.0, 1.0
    while deep(high):
        low, high = high, 2.0 * high
        if high > LARGEST_FACTOR:
            return None
    while high > CLOSE * low:
        middle = math.sqrt(low * high)
        low, high = (middle, high) if deep(middle) else (low, middle)
    return high
