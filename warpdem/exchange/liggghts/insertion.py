"""Grains of a script: templates and distributions, packed at once (``[[grains]]``) or inserted on the way (``[[streams]]``)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from warpdem.errors import SceneError
from warpdem.exchange.liggghts.contact import material_name
from warpdem.exchange.liggghts.deck import Deck, Fix, numbers
from warpdem.exchange.liggghts.walls import Placement, mesh_file, meshes

FACET_AXES = {"x": (0, 1, 2), "y": (1, 0, 2), "z": (2, 0, 1)}
"""Axis of a cylinder, and the other two in the order in which LIGGGHTS gives its centre."""
SPREAD = 3.0
"""Deviations of a Gaussian size from its mean at which it is cut off."""


@dataclass(frozen=True)
class Portion:
    """Grains of one template.

    Attributes:
        type: number of the atom type.
        density: [kg/m3].
        diameter: a number [m] or a distribution, as a scene has it.
        mean: mean diameter [m].
        share: of the mass, or of the number where ``by_number``.
        by_number: what ``share`` counts.
    """

    type: int
    density: float
    diameter: float | dict[str, Any]
    mean: float
    share: float
    by_number: bool

    @property
    def mass(self) -> float:
        """Mass of a grain of the mean diameter [kg]."""
        return self.density * math.pi / 6.0 * self.mean**3


class Distributions:
    """What grains there are, by the names of the distributions.

    Args:
        deck: the script.
    """

    def __init__(self, deck: Deck) -> None:
        self._templates = {fix.name: _template(fix, deck) for fix in deck.of_style("particletemplate/")}
        self.portions: dict[str, list[Portion]] = {}
        for fix in deck.of_style("particledistribution/discrete"):
            by_number, count = fix.style.endswith("numberbased"), int(numbers(fix.words[1:2], fix.command)[0])
            names, shares = fix.words[2 : 2 + 2 * count : 2], numbers(fix.words[3 : 3 + 2 * count : 2], fix.command)
            missing = [name for name in names if name not in self._templates]
            if missing or len(names) != count or len(shares) != count:
                raise SceneError(f"{fix.command.place}: needs {count} pairs of a template and its share; unknown: {missing}")
            known = ((self._templates[name], share) for name, share in zip(names, shares, strict=True))
            self.portions[fix.name] = [
                Portion(*template, share, by_number) for template, share in known if template is not None and share > 0.0
            ]

    @property
    def all(self) -> list[Portion]:
        """The portions of all distributions."""
        return [portion for portions in self.portions.values() for portion in portions]


def _template(fix: Fix, deck: Deck) -> tuple[int, float, float | dict[str, Any], float] | None:
    """Type, density, diameter and mean diameter of a template; None where it is no sphere."""
    kind, density, radius = fix.numbers("atom_type"), fix.after("density", 2), fix.after("radius", 2)
    if fix.style != "particletemplate/sphere" or density is None or radius is None:
        deck.notes.append(f"{fix.command}: not converted: only spheres are; [clumps.NAME] has grains made of several")
        return None
    if density[0] != "constant":
        deck.notes.append(f"{fix.command}: density {density[0]}: the mean is taken for all")
    value = numbers(density[1:2], fix.command)[0]
    number = int(kind[0]) if kind else 1
    if radius[0] == "constant":
        size = 2.0 * numbers(radius[1:2], fix.command)[0]
        return number, value, size, size
    if radius[0] == "uniform":
        low, high = (2.0 * r for r in numbers((fix.after("radius", 3) or ())[1:3], fix.command))
        return number, value, {"uniform": [low, high]}, 0.5 * (low + high)
    if radius[0] == "gaussian":
        words = [word for word in fix.after("radius", 4) or () if word not in ("gaussian", "number", "mass")]
        mean, deviation = (2.0 * r for r in numbers(words[:2], fix.command))
        limits = {"min": max(mean - SPREAD * deviation, 0.05 * mean), "max": mean + SPREAD * deviation}
        return number, value, {"normal": {"mean": mean, "deviation": deviation, **limits}}, mean
    deck.notes.append(f"{fix.command}: radius {radius[0]}: not converted")
    return None


class Insertion:
    """The grains and streams of a scene.

    Args:
        deck: the script.
        path_of: path of a file as the scene names it, from the one that the script names.

    Attributes:
        distributions: of the script.
        grains: entries of ``[[grains]]``.
        streams: entries of ``[[streams]]``.
    """

    def __init__(self, deck: Deck, path_of: Callable[[str], str]) -> None:
        self._deck, self._path_of = deck, path_of
        self.distributions = Distributions(deck)
        self.grains: list[dict[str, Any]] = []
        self.streams: list[dict[str, Any]] = []
        for fix in deck.of_style("insert/"):
            portions = self._portions(fix)
            if not portions:
                deck.notes.append(f"{fix.command}: not converted: no template of it is")
            elif fix.style == "insert/pack":
                self._pack(fix, portions)
            elif fix.style in ("insert/stream", "insert/rate/region"):
                self._stream(fix, portions)
            else:
                deck.notes.append(f"{fix.command}: not converted")

    def _portions(self, fix: Fix) -> list[Portion]:
        name = fix.after("distributiontemplate")
        if name is None or name[0] not in self.distributions.portions:
            raise SceneError(f"{fix.command.place}: there is no distribution {name[0] if name else 'named'}")
        return self.distributions.portions[name[0]]

    # -- packed at once -------------------------------------------------------------------------

    def _pack(self, fix: Fix, portions: list[Portion]) -> None:
        region = self._region(fix)
        if region is None:
            return
        every = fix.after("insert_every")
        asked = {key: fix.numbers(key) for key in ("particles_in_region", "mass_in_region", "volumefraction_region")}
        if every is not None and every[0] != "once" and asked["particles_in_region"]:
            self._again_and_again(fix, portions, region, numbers(every, fix.command)[0], asked["particles_in_region"][0])
            return
        velocity = self._velocity(fix)
        if any(velocity):
            self._deck.notes.append(f"{fix.command}: a filling is at rest, its velocity of {_text(velocity)} m/s is not taken")
        if fix.start > 0.0:
            self._deck.notes.append(f"{fix.command}: begins at {fix.start:g} s; here it is there from the start")
        parts = _merged(portions)
        shares = _shares(parts, by_mass=asked["particles_in_region"] is None)
        for part, share in zip(parts, shares, strict=True):
            fill: dict[str, Any] = {**region, "diameter": part.diameter}
            if asked["particles_in_region"]:
                fill["count"] = max(round(asked["particles_in_region"][0] * share), 1)
            elif asked["mass_in_region"]:
                fill["mass"] = asked["mass_in_region"][0] * share
            elif asked["volumefraction_region"]:
                fill["solid_fraction"] = asked["volumefraction_region"][0] * share
            else:
                raise SceneError(f"{fix.command.place}: says neither {', nor '.join(asked)}")
            self.grains.append({"name": self._group(fix, part, parts), "material": material_name(part.type), "fill": fill})

    def _again_and_again(self, fix: Fix, portions: list[Portion], region: dict[str, Any], every: float, count: float) -> None:
        """A filling that is topped up is a stream of its number per interval."""
        interval = every * self._deck.timestep
        end = self._deck.end if fix.until is None else fix.until
        times = max(math.ceil((end - fix.start) / interval), 1)
        words = "a region topped up becomes a stream of as many grains, less those that LIGGGHTS finds there still"
        self._deck.notes.append(f"{fix.command}: {words}")
        rate = {"count_rate": count / interval, "count": round(count * times)}
        self._add_stream(fix, portions, {**region, **rate}, end)

    # -- inserted on the way --------------------------------------------------------------------

    def _stream(self, fix: Fix, portions: list[Portion]) -> None:
        stream: dict[str, Any] = {}
        if fix.style == "insert/stream":
            name = fix.after("insertion_face")
            surfaces = meshes(self._deck)
            if name is None or name[0] not in surfaces:
                raise SceneError(f"{fix.command.place}: its insertion_face is no mesh of the script")
            face = surfaces[name[0]]
            stream["face"] = {"file": mesh_file(face, self._deck, self._path_of), **Placement(face).table()}
        else:
            region = self._region(fix)
            if region is None:
                return
            stream |= region
        for key, rate, total in (("massrate", "mass_rate", "mass"), ("particlerate", "count_rate", "count")):
            if (value := fix.numbers(key)) is not None:
                stream[rate] = value[0]
            amount = fix.after("mass" if total == "mass" else "nparticles")
            if amount is not None and amount[0] != "INF":
                number = numbers(amount, fix.command)[0]
                stream[total] = number if total == "mass" else int(number)
        self._add_stream(fix, portions, stream, fix.until)

    def _add_stream(self, fix: Fix, portions: list[Portion], stream: dict[str, Any], until: float | None) -> None:
        velocity, parts = self._velocity(fix), _merged(portions)
        if any(velocity):
            stream["velocity"] = velocity
        if len(parts) == 1:
            stream = {"material": material_name(parts[0].type), "diameter": parts[0].diameter, **stream}
        else:
            stream["recipe"] = [
                {
                    "material": material_name(part.type),
                    "diameter": part.diameter,
                    ("number_share" if part.by_number else "mass_share"): part.share,
                }
                for part in parts
            ]
        start = fix.numbers("start")
        begin = start[0] * self._deck.timestep if start else fix.start
        if begin > 0.0:
            stream["start"] = begin
        if until is not None and until < self._deck.end:
            stream["until"] = until
        self.streams.append({"name": fix.name, **stream})

    # -- both -----------------------------------------------------------------------------------

    def _region(self, fix: Fix) -> dict[str, Any] | None:
        """The region of an insertion as keys of a scene; None where it is of another kind."""
        name = fix.after("region")
        words = self._deck.regions.get(name[0]) if name else None
        if words is None:
            raise SceneError(f"{fix.command.place}: there is no region {name[0] if name else 'named'}")
        if words[0] == "block":
            low_high = numbers(words[1:7], fix.command)
            return {"box": {"min": low_high[::2], "max": low_high[1::2]}}
        if words[0] == "sphere":
            x, y, z, radius = numbers(words[1:5], fix.command)
            return {"sphere": {"centre": [x, y, z], "radius": radius}}
        if words[0] == "cylinder" and words[1] in FACET_AXES:
            first, second, radius, low, high = numbers(words[2:7], fix.command)
            along, *across = FACET_AXES[words[1]]
            point = [0.0, 0.0, 0.0]
            point[along], point[across[0]], point[across[1]] = low, first, second
            axis = [1.0 if k == along else 0.0 for k in range(3)]
            return {"cylinder": {"point": point, "axis": axis, "radius": radius, "length": high - low}}
        kinds = "block, cylinder and sphere"
        self._deck.notes.append(f"{fix.command}: region {words[0]}: not converted; {kinds} are, and a fill has 'wall', 'mesh'")
        return None

    def _velocity(self, fix: Fix) -> list[float]:
        """Velocity of the grains that are inserted [m/s]; the mean where it is random."""
        words = fix.after("vel", 4)
        if words is None:
            return [0.0, 0.0, 0.0]
        if words[0] != "constant":
            self._deck.notes.append(f"{fix.command}: vel {words[0]}: only its mean is taken")
        return numbers(words[1:4], fix.command)

    @staticmethod
    def _group(fix: Fix, part: Portion, parts: list[Portion]) -> str:
        """Name of the group of a part of a filling."""
        return fix.name if len(parts) == 1 else f"{fix.name}_{parts.index(part) + 1}"


def _merged(portions: list[Portion]) -> list[Portion]:
    """Portions of one material whose sizes are numbers as one, with a table of sizes."""
    first = portions[0]
    alike = all((p.type, p.density, p.by_number) == (first.type, first.density, first.by_number) for p in portions)
    if len(portions) == 1 or not alike or not all(isinstance(p.diameter, float) for p in portions):
        return portions
    table = {"table": [[p.diameter, p.share] for p in sorted(portions, key=lambda p: p.mean)],
             "by": "number" if first.by_number else "mass"}  # fmt: skip
    numbers_of = [p.share if p.by_number else p.share / p.mean**3 for p in portions]
    mean = sum(n * p.mean for n, p in zip(numbers_of, portions, strict=True)) / sum(numbers_of)
    return [Portion(first.type, first.density, table, mean, 1.0, first.by_number)]


def _shares(parts: list[Portion], *, by_mass: bool) -> list[float]:
    """Share of each part of the mass (of the number where not ``by_mass``), with a sum of 1."""
    weights = []
    for part in parts:
        weight = part.share
        if part.by_number and by_mass:
            weight *= part.mass
        elif not part.by_number and not by_mass:
            weight /= part.mass
        weights.append(weight)
    return [weight / sum(weights) for weight in weights]


def _text(vector: list[float]) -> str:
    return "(" + ", ".join(f"{x:g}" for x in vector) + ")"
