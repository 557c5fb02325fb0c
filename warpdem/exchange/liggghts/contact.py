"""Materials, pairs and contact law of a script.

LIGGGHTS numbers its atom types; the materials are called ``type1``, ``type2`` and so on.
"""

from __future__ import annotations

import math
from typing import Any

from warpdem.errors import SceneError
from warpdem.exchange.liggghts.deck import Deck, Fix, numbers

NORMAL = {"hertz": "hertz", "hooke": "hooke", "hooke/hysteresis": "luding"}
"""Normal laws by the name that follows ``model``."""
OLD_STYLES = {"gran/hertz/history": ("hertz", "history"), "gran/hooke/history": ("hooke", "history"),
              "gran/hooke": ("hooke", "no_history")}  # fmt: skip
"""Styles of old versions: normal and tangential model."""
PAIR_KEYS = {
    "coefficientRestitution": "restitution",
    "coefficientFriction": "friction",
    "coefficientRollingFriction": "rolling_friction",
    "coefficientRollingViscousDamping": "rolling_damping",
    "cohesionEnergyDensity": "cohesion_energy_density",
}
HOOKE = ("characteristicVelocity", "coefficientMaxElasticStiffness", "coefficientAdhesionStiffness",
         "coefficientPlasticityDepth")  # fmt: skip
"""Properties that the springs of linear laws come from."""


def material_name(number: float) -> str:
    """Name of the material of an atom type."""
    return f"type{int(number)}"


class Properties:
    """The global properties of a script, by name.

    Args:
        deck: the script.
    """

    def __init__(self, deck: Deck) -> None:
        self.of_name: dict[str, tuple[list[float], Fix]] = {}
        for fix in deck.of_style("property/global"):
            name, kind, values = fix.words[0], fix.words[1], fix.words[2:]
            if kind == "peratomtypepair":  # the number of types comes first
                values = values[1:]
            elif kind not in ("peratomtype", "scalar"):
                deck.notes.append(f"{fix.command}: not converted")
                continue
            self.of_name[name] = numbers(values, fix.command), fix

    @property
    def types(self) -> int:
        """Number of atom types."""
        return len(self.values("youngsModulus"))

    def values(self, name: str) -> list[float]:
        """Values of a property.

        Raises:
            SceneError: the script does not give it.
        """
        if name not in self.of_name:
            raise SceneError(f"the script has no 'fix ... property/global {name} ...', without which there are no contacts")
        return self.of_name[name][0]

    def of_pair(self, name: str, a: int, b: int) -> float | None:
        """Value for the types ``a`` and ``b``, counted from 0; None where the script has none."""
        if name not in self.of_name:
            return None
        values, fix = self.of_name[name]
        if len(values) == 1:
            return values[0]
        if len(values) != self.types**2:
            raise SceneError(f"{fix.command.place}: {name} needs {self.types**2} values for {self.types} types")
        return values[a * self.types + b]


class Law:
    """The words of pair_style.

    Args:
        deck: the script; what is other here is noted there.
    """

    def __init__(self, deck: Deck) -> None:
        style = deck.pair_style
        if not style:
            raise SceneError(f"{deck.path}: the script has no pair_style")
        if style[0] in OLD_STYLES:
            self._options: dict[str, str] = {}
            normal, tangential = OLD_STYLES[style[0]]
        elif style[0] == "gran" and len(style) > 2 and style[1] == "model":
            self._options = dict(zip(style[3::2], style[4::2], strict=False))
            normal, tangential = style[2], self._options.get("tangential", "off")
        else:
            words = "'pair_style gran model ...' is converted, and " + ", ".join(OLD_STYLES)
            raise SceneError(f"{deck.path}: pair_style {' '.join(style)}: {words}")
        if normal not in NORMAL:
            raise SceneError(f"{deck.path}: pair_style: model {normal}: converted are {', '.join(NORMAL)}")
        self.normal = NORMAL[normal]
        self.linear = self.normal in ("hooke", "luding")
        self.stiffness_ratio = 2.0 / 7.0 if self._options.get("ktToKnUser") == "on" else 1.0  # of linear springs
        self.contact = {"normal": self.normal, "tangential": "none" if tangential == "off" else "mindlin_displacement"}
        if tangential == "no_history":
            deck.notes.append("pair_style: tangential no_history, a dashpot without a spring, becomes mindlin_displacement")
        self._rolling(deck)
        self._cohesion(deck)
        if self._options.get("limitForce") == "on" and self.normal == "hertz":
            self.normal = self.contact["normal"] = "hertz_clamped"
        if self._options.get("tangential_damping") == "off":
            deck.notes.append("pair_style: tangential_damping off: here the dashpot along the surface stays")
        if self._options.get("surface", "default") != "default":
            deck.notes.append(f"pair_style: surface {self._options['surface']}: not converted")

    def _rolling(self, deck: Deck) -> None:
        model = self._options.get("rolling_friction", "off")
        if model == "off":
            return
        self.contact["rolling"] = "constant" if model == "cdt" else "spring"
        if model not in ("cdt", "epsd"):
            deck.notes.append(f"pair_style: rolling_friction {model} becomes rolling = \"spring\", the law of epsd")

    def _cohesion(self, deck: Deck) -> None:
        model = self._options.get("cohesion", "off")
        if model == "off":
            return
        if model == "sjkr" and self.normal == "hertz":
            self.normal = self.contact["normal"] = "sjkr"
        else:
            deck.notes.append(f"pair_style: cohesion {model} with model {self.normal}: not converted; sjkr goes with hertz")


def material_tables(properties: Properties, densities: dict[int, float], deck: Deck) -> dict[str, dict[str, float]]:
    """The materials; ``densities``: of the types that grains are of, by number from 1 on [kg/m3]."""
    modulus, poisson = properties.values("youngsModulus"), properties.values("poissonsRatio")
    if len(poisson) != len(modulus):
        raise SceneError(f"{deck.path}: youngsModulus has {len(modulus)} types, poissonsRatio {len(poisson)}")
    other = next(iter(densities.values()), 2500.0)
    out = {}
    for number in range(1, len(modulus) + 1):
        if number not in densities:
            deck.notes.append(f"no grains are of type {number}: its density, which no wall needs, is put to {other:g} kg/m3")
        out[material_name(number)] = {
            "density": densities.get(number, other),
            "young_modulus": modulus[number - 1],
            "poisson_ratio": poisson[number - 1],
        }
    return out


def pair_tables(properties: Properties, law: Law, radius: float | None, density: float, deck: Deck) -> list[dict[str, Any]]:
    """The pairs of materials.

    Args:
        properties: of the script.
        law: of the script.
        radius: mean radius of the grains [m], None without grains.
        density: of the grains [kg/m3].
        deck: the script.
    """
    out = []
    for a in range(properties.types):
        for b in range(a, properties.types):
            pair: dict[str, Any] = {"materials": [material_name(a + 1), material_name(b + 1)]}
            for name, key in PAIR_KEYS.items():
                value = properties.of_pair(name, a, b)
                if value is not None and _taken(key, law):
                    pair[key] = value
            if law.linear:
                pair |= _springs(properties, law, a, b, radius, density, deck)
            out.append(pair)
    used = {*PAIR_KEYS, "youngsModulus", "poissonsRatio", *(HOOKE if law.linear else ())}
    unused = sorted(set(properties.of_name) - used)
    if unused:
        deck.notes.append(f"property/global {', '.join(unused)}: not needed by the contact law of the scene")
    return out


def _taken(key: str, law: Law) -> bool:
    """Whether the law of the scene takes a key of a pair."""
    if key == "cohesion_energy_density":
        return law.normal == "sjkr"
    if key == "friction":
        return law.contact["tangential"] != "none"
    if key == "rolling_damping":
        return law.contact.get("rolling") == "spring"
    return key != "rolling_friction" or "rolling" in law.contact


def _springs(
    properties: Properties, law: Law, a: int, b: int, radius: float | None, density: float, deck: Deck
) -> dict[str, float]:  # fmt: skip
    """Stiffnesses of a pair: k = (16/15) sqrt(R*) E* (15 m* V^2 / (16 sqrt(R*) E*))^(1/5), of two mean grains.

    LIGGGHTS has another one for each contact, by its R* and m*.
    """
    velocity = properties.values("characteristicVelocity")[0]
    if radius is None:
        raise SceneError(f"{deck.path}: without grains in the script, the stiffness of its linear springs is not known")
    modulus, poisson = properties.values("youngsModulus"), properties.values("poissonsRatio")
    compliance = sum((1.0 - poisson[t] ** 2) / modulus[t] for t in (a, b))
    reduced, mass = 0.5 * radius, 0.5 * density * 4.0 / 3.0 * math.pi * radius**3
    base = math.sqrt(reduced) / compliance
    stiffness = 16.0 / 15.0 * base * (15.0 * mass * velocity**2 / (16.0 * base)) ** 0.2
    if (a, b) == (0, 0):
        words = "is that of two mean grains; LIGGGHTS takes one for each contact, by its sizes and masses"
        deck.notes.append(f"stiffness of the linear springs, by the characteristic velocity {velocity:g} m/s: {words}")
    pair = {"stiffness": stiffness, "tangential_stiffness_ratio": law.stiffness_ratio}
    if law.normal == "luding":
        for name, key, factor in (
            ("coefficientMaxElasticStiffness", "unloading_stiffness", stiffness),
            ("coefficientAdhesionStiffness", "adhesion_stiffness", stiffness),
            ("coefficientPlasticityDepth", "plasticity_depth", 1.0),
        ):
            value = properties.of_pair(name, a, b)
            if value is not None:
                pair[key] = value * factor
    return pair
