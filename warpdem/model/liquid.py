"""Liquid of a scene: the volume of a count, how much a bridge may hold, and how far bridges reach.

A grain of liquid content phi holds phi (4/3) pi R^3. The fullest film gives a bridge with a grain of its size the part
``kernels.contact.films.covered``; no film gives more than GROWTH times that to one bridge, and lists reach TRAVEL times the
longest rupture distance that follows: further by more than a grain goes in a step.
"""

from dataclasses import dataclass

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels.contact.films import FILM_AT, LARGEST, QUANTUM, covered
from warpdem.scene.model import Scene
from warpdem.scene.models import model

GROWTH = 1.728
"""What a film gives to a bridge at most, over what the fullest film gives at the start [-]: rupture distances grow by 1.2."""
TRAVEL = 1.2
"""Reach of the lists over the longest rupture distance [-]."""


@dataclass(frozen=True)
class Liquid:
    """The liquid of a run, in counts."""

    quantum: float
    """Volume of a count [m3]."""
    most_from_film: float
    """Counts that a film gives to a bridge at most, an even number."""
    contents: np.ndarray
    """Liquid content of the grains of each group as they come [-], shape (groups,)."""
    wall_film: np.ndarray
    """Thickness of the film on each wall [m], shape (walls,)."""

    def films(self, grains: InitialGrains) -> np.ndarray:
        """What new grains bring, columns as of ``kernels.contact.films.FILM_AT`` [counts], shape (n, 3)."""
        out = np.zeros((len(grains.radius), FILM_AT.width), dtype=np.int64)
        volume = 4.0 / 3.0 * np.pi * grains.radius**3
        out[:, FILM_AT.film] = np.rint(self.contents[grains.group] * volume / self.quantum)
        return out


def contents(scene: Scene) -> np.ndarray:
    """Liquid content of the grains of each group, in the order of ``scene.groups`` [-]."""
    out = dict.fromkeys(scene.groups, 0.0)
    out |= {name: group.liquid_content for name, group in zip(scene.group_names, scene.grains, strict=False)}
    for number, stream in enumerate(scene.streams):
        out |= dict(zip(scene.stream_groups(number), (p.liquid_content for p in stream.portions), strict=True))
    return np.array(list(out.values()), dtype=float)


def largest_share(scene: Scene, largest: float) -> float:
    """Volume that a film gives to a bridge at most [m3]; ``largest``: radius of the largest grain [m]."""
    film = float(contents(scene).max(initial=0.0)) * 4.0 / 3.0 * np.pi * largest**3
    thickness = max((wall.liquid_film for wall in scene.walls), default=0.0)
    now = GROWTH * max(film * covered(largest, largest), thickness * np.pi * largest**2)
    there = scene.start.liquid if scene.start is not None else None
    return max(now, there[1]) if there is not None else now


def liquid_of(scene: Scene, largest: float, real: type) -> Liquid | None:
    """The liquid of ``scene``; None without a law of bridges.

    Args:
        scene: the validated scene.
        largest: radius of the largest grain [m].
        real: precision of the contact history.
    """
    if scene.contact.liquid == "none":
        return None
    quantum = QUANTUM[real] * 4.0 / 3.0 * np.pi * largest**3
    if scene.start is not None and scene.start.liquid is not None:
        quantum = scene.start.liquid[0]  # whole counts stay whole
    most = min(2.0 * np.floor(0.5 * largest_share(scene, largest) / quantum), 0.5 * LARGEST[real])
    return Liquid(quantum, float(most), contents(scene), np.array([wall.liquid_film for wall in scene.walls], dtype=float))


def longest_rupture(scene: Scene, largest: float) -> float:
    """Longest rupture distance of a bridge [m]; ``largest``: radius of the largest grain [m]."""
    if scene.contact.liquid == "none":
        return 0.0
    law, volume = model("liquid", scene.located(scene.contact.liquid)), 2.0 * largest_share(scene, largest)
    angles = [getattr(pair, "contact_angle", 0.0) for pair in scene.pairs if pair.contact]
    return max((float(law.rupture(volume, 0.5 * largest, np.cos(angle))) for angle in angles), default=0.0)


def liquid_reach(scene: Scene, largest: float) -> float:
    """How far beyond contact the lists reach for bridges [m]; 0 without a law of bridges."""
    return TRAVEL * longest_rupture(scene, largest)
