"""What adhesion does in a scene: how strong it is beside weight and impacts, and which law suits it.

    granular Bond number   Bo = F_c/(m g)                    m the mass of the grain; above 1 a grain hangs from another
    sticking speed         v_s = sqrt(2 E_touch/m*)          of what a touch costs; undamped impacts below it do not part
    Tabor number           mu = (R* w^2/(E*^2 z^3))^(1/3)    JKR above some 5, DMT below some 0.1; z the range of the forces

A scene may take softer grains than there are, for longer steps. F_c does not change with the modulus E; E_touch goes as
(w^5/E^2)^(1/3), so v_s as E^(-1/3), and w E^(-2/5) keeps it (Haervig et al. 2017).

A normal law states ``adhesion(stiffness, radius, **own)`` -> F_c [N], E_touch [J], (R* w^2/E*^2)^(1/3) [m]. One whose pull-off
force depends on how hard the contact was pressed states ``pull_after(load, stiffness, radius, **own)`` [N] in its place, and is
asked for that after the grain's own weight.
"""

import math
from dataclasses import dataclass

from warpdem.filling.initial_grains import InitialGrains
from warpdem.model.coefficients import coefficient_columns
from warpdem.model.contact_cases import contact_cases
from warpdem.model.impact import own_constants, stiffness
from warpdem.scene.model import Scene
from warpdem.scene.models import model

RANGE = 0.3e-9
"""Range of the forces between surfaces [m]: z of the Tabor number."""


@dataclass(frozen=True)
class Adhesion:
    """Adhesion of the smallest grain of a material with one like it, one of another material, or a wall."""

    materials: tuple[str, str]
    wall: bool
    radius: float
    """Of the grain [m]."""
    pull_off_force: float
    """F_c [N]."""
    bond_number: float | None
    """Granular Bond number [-]; None without gravity."""
    sticking_speed: float | None
    """Speed below which undamped impacts stick [m/s]; 0 where a touch costs nothing, None where it depends on what it was
    pressed by."""
    tabor_number: float | None
    """At the moduli of the scene [-]; None where the law has no surface energy, or yields."""
    pressed_by: float
    """Load that F_c is left behind by [N]; 0 where it depends on none."""


def adhesions(scene: Scene, start: InitialGrains) -> list[Adhesion]:
    """The adhesion of whatever may touch; none where the law states none.

    Args:
        scene: the validated scene.
        start: grains at the start, or that are to be expected.
    """
    law, at = scene.normal_law, coefficient_columns(scene)
    module = model("normal", law)
    of_law, after = getattr(module, "adhesion", None), getattr(module, "pull_after", None)
    if of_law is None and after is None:
        return []
    g, out = math.hypot(*scene.gravity), []
    for one in contact_cases(scene, start):
        constant = stiffness(law, one.row[at.stiffness], one.reduced_radius)
        own = own_constants(law, one.own, one.reduced_radius)
        weight = g * scene.materials[one.materials[0]].density * 4.0 / 3.0 * math.pi * one.radius**3
        speed, tabor, load = None, None, 0.0
        if of_law is not None:
            pull, cost, neck = of_law(constant, one.reduced_radius, **own)
            speed = math.sqrt(2.0 * float(cost) / one.reduced_mass)
            tabor = None if neck is None else float(neck) / RANGE
        elif after is not None:
            load = weight
            pull = after(load, constant, one.reduced_radius, **own)
        bond = float(pull) / weight if weight > 0.0 else None
        out.append(Adhesion(one.materials, one.wall, one.radius, float(pull), bond, speed, tabor, load))
    return out
