"""The stiffest contacts that a scene may have: the smallest grain of each material with another grain, or a wall."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpdem.filling.clump_grains import NONE
from warpdem.filling.initial_grains import InitialGrains
from warpdem.model.coefficients import coefficient_columns, coefficient_table
from warpdem.model.impact import Impact, Own, damping_coefficient, dashpot_slope, impact, own_of, stiffness
from warpdem.model.stability_limit import Spring, across, along, contact_limit, packing_limit, rolling_limit
from warpdem.scene.model import Scene


@dataclass(frozen=True)
class ContactCase:
    """Two bodies that may touch: the smallest grain of a material with itself, another or a wall."""

    materials: tuple[str, str]
    radius: float
    """Of the grain [m]."""
    reduced_radius: float
    """R* [m]."""
    reduced_mass: float
    """m* [kg]."""
    restitution: float
    row: np.ndarray
    """Of the table of coefficients."""
    own: Own
    """The normal law's own coefficients."""

    @property
    def wall(self) -> bool:
        """Whether the other body is a wall."""
        return self.reduced_radius == self.radius


def contact_cases(scene: Scene, start: InitialGrains) -> Iterator[ContactCase]:
    """What may touch, of grains that the scene starts with or that come."""
    names, materials = list(scene.materials), list(scene.materials.values())
    law, at = scene.normal_law, coefficient_columns(scene)
    table = coefficient_table(scene).reshape(len(names), len(names), at.width)
    walls = {names.index(w.material) for w in scene.walls}
    apart = scene.apart
    alone = len(start.id) < 2 and not scene.streams
    for t in np.unique(start.type):
        radius = float(start.radius[start.type == t].min())
        mass = materials[t].density * 4.0 / 3.0 * math.pi * radius**3 * _lightness(start, int(t), materials[t].density)
        partners = [(int(o), 0.5 * mass, 0.5 * radius) for o in np.unique(start.type) if not alone]
        partners += [(o, mass, radius) for o in walls]
        for other, reduced_mass, reduced_radius in partners:
            if apart[t, other]:
                continue
            pair, row = (names[t], names[other]), table[t, other]
            restitution = scene.pair(*pair).restitution
            yield ContactCase(pair, radius, reduced_radius, reduced_mass, restitution, row, own_of(law, row))


def _lightness(start: InitialGrains, kind: int, density: float) -> float:
    """Least mass that a force on a grain of a material meets, over the mass of its sphere [-]: 1 without clumps."""
    if start.clumps is None:
        return 1.0
    member = np.flatnonzero(start.clumps.of_grain != NONE)
    mine = start.type[member] == kind
    own = density * 4.0 / 3.0 * math.pi * start.radius[member] ** 3
    found = start.clumps.least_mass(start.radius) / own
    return min(1.0, float(found[mine].min(initial=1.0)))


def impact_of(law: str, column: int, one: ContactCase, speed: float) -> Impact:
    """The undamped impact of ``one`` at ``speed`` [m/s]; ``column`` is that of the stiffness base."""
    return impact(law, one.row[column], one.reduced_mass, one.reduced_radius, max(speed, 1e-6), one.own)


def limits_at(scene: Scene, one: ContactCase, secant: float, slope: float, oscillator: Any) -> tuple[float, float]:
    """Stability limits [s] of a packing and of one contact with k_n = ``secant`` and the slope of its force [N/m]."""
    at = coefficient_columns(scene)
    normal, tangential = _springs(scene, one, secant, slope)
    packing, single = packing_limit(normal, tangential), contact_limit(normal, tangential)
    if oscillator is not None and one.row[at.rolling_friction] > 0.0:
        arm, inertia = one.row[at.rolling_friction] * one.reduced_radius, 0.4 * one.reduced_mass * one.radius**2
        bending, losing = oscillator(secant, arm, one.row[at.rolling_damping], 3.5 * inertia)
        spring = Spring(bending, losing, 3.5 * inertia)
        rolling = rolling_limit(spring, tangential, inertia, one.reduced_mass, one.radius, one.wall)
        packing, single = min(packing, rolling[0]), min(single, rolling[1])
    return packing, single


def _springs(scene: Scene, one: ContactCase, secant: float, slope: float) -> tuple[Spring, Spring]:
    """Springs along and across the normal of a contact with k_n = ``secant`` and the slope of its force [N/m]."""
    at = coefficient_columns(scene)
    constant = stiffness(scene.normal_law, one.row[at.stiffness], one.reduced_radius)
    damping = damping_coefficient(scene.normal_law, secant, constant, one.row[at.damping], one.reduced_mass)
    sticks = scene.contact.tangential != "none" and one.row[at.friction] > 0.0
    shear, shear_damping = (one.row[at.of(name)] if sticks else 0.0 for name in ("shear", "shear_damping"))
    reducing = dashpot_slope(scene.normal_law, slope, secant)
    normal = along(slope, damping, one.reduced_mass, reducing)
    return normal, across(shear * secant, shear_damping * damping, one.reduced_mass)
