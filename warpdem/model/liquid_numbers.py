"""What liquid does in a scene: how strong bridges are beside weight and impacts, how far they reach, what they ask of the step.

    granular Bond number   Bo = F(0)/(m g)              of a bridge in contact; above 1 a grain hangs from another
    speed                  v_s = sqrt(2 W/m*)           of its work W to rupture; undamped impacts below do not part
    step                   0.3 m*/c_n,  c_n = 6 pi eta R*^2/S_min

Volumes are those of the first bridge of a grain: ``kernels.contact.films.covered`` of both films, at a wall half of the film
and what the wall gives; no film gives more than ``largest_share``. A longer step cuts the dashpot of the thinnest gaps
(``kernels.contact.normal_law``): it stays stable.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels.contact.films import covered
from warpdem.kernels.contact.normal_law import NORMAL_CAP
from warpdem.model.contact_cases import ContactCase, contact_cases
from warpdem.model.liquid import contents, largest_share
from warpdem.scene.model import Scene
from warpdem.scene.models import model

POINTS = 400
"""Gaps that the work of a bridge is added up at."""


@dataclass(frozen=True)
class Bridge:
    """The first bridge of the smallest grain of a material, with the fullest film, with one like it, another, or a wall."""

    materials: tuple[str, str]
    wall: bool
    radius: float
    """Of the grain [m]."""
    volume: float
    """[m3]."""
    pull: float
    """In contact [N]."""
    bond_number: float | None
    """Granular Bond number [-]; None without gravity."""
    rupture: float
    """Rupture distance [m]."""
    sticking_speed: float
    """Speed below which undamped impacts do not part [m/s]."""


def bridges(scene: Scene, start: InitialGrains) -> list[Bridge]:
    """A bridge of whatever may touch; none without a law of bridges, or of dry contacts.

    Args:
        scene: the validated scene.
        start: grains at the start, or that are to be expected.
    """
    if scene.contact.liquid == "none":
        return []
    law, g = model("liquid", scene.located(scene.contact.liquid)), math.hypot(*scene.gravity)
    most, out = largest_share(scene, float(start.radius.max(initial=0.0))), []
    for one in contact_cases(scene, start):
        volume = _volume(scene, start, one, most)
        if volume <= 0.0:
            continue
        bridge = volume, one.reduced_radius, one.own["bridge_pull"], one.own["bridge_wetting"]
        far = float(law.rupture(volume, one.reduced_radius, one.own["bridge_wetting"]))
        root = np.linspace(0.0, math.sqrt(far), POINTS)
        work = float(np.trapezoid(2.0 * root * law.force(root**2, *bridge), root))
        pull = float(law.force(0.0, *bridge))
        mass = scene.materials[one.materials[0]].density * 4.0 / 3.0 * math.pi * one.radius**3
        bond = pull / (mass * g) if g > 0.0 else None
        speed = math.sqrt(2.0 * work / one.reduced_mass)
        out.append(Bridge(one.materials, one.wall, one.radius, volume, pull, bond, far, speed))
    return out


def _volume(scene: Scene, start: InitialGrains, one: ContactCase, most: float) -> float:
    """Volume of the first bridge of a contact [m3], to which no film gives more than ``most``."""
    content = float(contents(scene)[np.unique(start.group)].max(initial=0.0))
    film = content * 4.0 / 3.0 * math.pi * one.radius**3
    if not one.wall:
        return 2.0 * min(film * float(covered(one.radius, one.radius)), most)
    thickness = max((w.liquid_film for w in scene.walls if w.material == one.materials[1]), default=0.0)
    return min(0.5 * film, most) + min(thickness * math.pi * one.radius**2, most)


def thin_gap_limit(scene: Scene, cases: Iterator[ContactCase]) -> float:
    """Longest step [s] that leaves the dashpot of the thinnest liquid gap as it is; inf where no bridge damps."""
    if scene.contact.liquid == "none":
        return math.inf
    found = math.inf
    for one in cases:
        viscosity, gap = one.own.get("bridge_drag", 0.0), one.own.get("bridge_roughness", 0.0)
        if viscosity > 0.0:
            found = min(found, float(NORMAL_CAP * one.reduced_mass * gap / (6.0 * math.pi * viscosity * one.reduced_radius**2)))
    return found
