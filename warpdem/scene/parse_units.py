"""Numbers with a unit: what a string such as "30 rpm" is in SI, and the units that a key of a scene may declare."""

import functools
import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Dimension:
    """Physical dimension of a key, as a noun and for pint."""

    noun: str
    base: dict[str, int]
    """Exponents of pint's base units. The radian is one of them, which distinguishes revolutions, events and pure numbers."""
    example: str
    least: float
    """Smallest magnitude of a number that must be above 0, SI."""
    most: float
    """Largest magnitude, SI."""


DIMENSIONS = {
    "m": Dimension("a length", {"meter": 1}, "0.45 mm", 1e-12, 1e12),
    "s": Dimension("a time", {"second": 1}, "20 ms", 1e-24, 1e15),
    "1/s": Dimension("a frequency", {"second": -1}, "50 Hz", 1e-18, 1e18),
    "m/s": Dimension("a speed", {"meter": 1, "second": -1}, "20 cm/s", 1e-18, 1e12),
    "m/s2": Dimension("an acceleration", {"meter": 1, "second": -2}, "9.81 m/s^2", 1e-18, 1e15),
    "kg": Dimension("a mass", {"kilogram": 1}, "20 g", 1e-30, 1e30),
    "kg/m3": Dimension("a density", {"kilogram": 1, "meter": -3}, "2.6 g/cm^3", 1e-9, 1e18),
    "Pa": Dimension("a pressure or a modulus", {"kilogram": 1, "meter": -1, "second": -2}, "50 MPa", 1e-9, 1e21),
    "N/m": Dimension("a stiffness", {"kilogram": 1, "second": -2}, "5 N/mm", 1e-18, 1e21),
    "J/m2": Dimension("a surface energy", {"kilogram": 1, "second": -2}, "50 mJ/m^2", 1e-18, 1e21),
    "J/m3": Dimension(
        "an energy density", {"kilogram": 1, "meter": -1, "second": -2}, "100 kJ/m^3", 1e-9, 1e21
    ),
    "Pa s": Dimension("a viscosity", {"kilogram": 1, "meter": -1, "second": -1}, "1 mPa s", 1e-18, 1e21),
    "kg m2": Dimension("a moment of inertia", {"kilogram": 1, "meter": 2}, "20 g cm^2", 1e-60, 1e30),
    "N": Dimension("a force", {"kilogram": 1, "meter": 1, "second": -2}, "2 mN", 1e-30, 1e21),
    "N m": Dimension("a torque", {"kilogram": 1, "meter": 2, "second": -2}, "2 mN m", 1e-30, 1e21),
    "N m s": Dimension("a damping coefficient", {"kilogram": 1, "meter": 2, "second": -1}, "2 mN m s", 1e-30, 1e21),
    "m2": Dimension("an area", {"meter": 2}, "4 cm^2", 1e-24, 1e24),
    "kg/s": Dimension("a mass rate or drag coefficient", {"kilogram": 1, "second": -1}, "0.1 g/s", 1e-30, 1e21),
    "C": Dimension("a charge", {"ampere": 1, "second": 1}, "1 nC", 1e-30, 1e21),
    "T": Dimension("a magnetic flux density", {"kilogram": 1, "ampere": -1, "second": -2}, "5 mT", 1e-30, 1e21),
    "V/m": Dimension("an electric field", {"kilogram": 1, "meter": 1, "ampere": -1, "second": -3}, "10 kV/m", 1e-30, 1e21),
    "rad": Dimension("an angle", {"radian": 1}, "90 deg", 1e-12, 1e12),
    "rad/s": Dimension("an angular rate", {"radian": 1, "second": -1}, "30 rpm", 1e-18, 1e12),
    "-": Dimension("a pure number", {}, "5 %", 1e-30, 1e30),
}
"""Units that a key of the scene may declare, with bounds far beyond the range of granular materials.

Within them products and squares of the numbers of a scene stay finite and normal in float64, and results in float32; a number
outside is a mistake.
"""

LONGEST_TEXT = 100
"""Maximum length of a number with its unit [characters]: pint takes minutes to parse a unit of thousands of letters."""
LARGEST_EXPONENT = 400
"""Power of ten beyond which a number is no float64 in any unit [-]."""
_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(1\s*/.+?|[^\d\s].*?)?\s*")
_BARE_POWER = re.compile(r"(?<=[a-z])(?=[23]\b)")


@functools.cache
def _registry() -> Any:
    """Return pint's registry; imported here because pint takes half a second and most scenes do not need it.

    Decimal makes the conversion exact up to one rounding: "0.45 mm" gives the same bits as 0.00045.
    """
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


def allowed_text(unit: str) -> str:
    """Text of the values that a key of this unit accepts."""
    wanted = DIMENSIONS[unit]
    plain = "0.05" if unit == "-" else f"a plain number in [{unit}]"
    return f'must be {wanted.noun}: {plain} or a string such as "{wanted.example}"'


def numbers_text(unit: str) -> str:
    """Text for several numbers of this unit."""
    return "pure numbers" if unit == "-" else f"numbers in [{unit}]"


@functools.lru_cache(maxsize=4096)
def _parse(text: str, unit: str) -> float:
    """Value in SI of a string with a unit.

    Raises:
        ValueError: there is no number, no known unit, or a unit of another dimension.
    """
    wanted, allowed = DIMENSIONS[unit], allowed_text(unit)
    match = _NUMBER_AND_UNIT.fullmatch(text) if len(text) <= LONGEST_TEXT else None
    if match is None:
        raise ValueError(allowed)
    if match[2] is None:
        raise ValueError(f"{allowed}; a number without unit is written without quotes")
    registry = _registry()
    try:
        # messages write "m/s2"; pint requires a power sign
        units = registry.parse_units(_BARE_POWER.sub("**", match[2]))
        if abs(Decimal(match[1]).adjusted()) > LARGEST_EXPONENT:
            return math.inf if Decimal(match[1]).adjusted() > 0 else 0.0
        quantity = (Decimal(match[1]) * units).to_base_units()
        base = {name: int(power) for name, power in quantity.unit_items() if power == int(power)}
        value = float(quantity.magnitude)
    except Exception:
        # pint's parser raises many types of errors on invalid text, AssertionError and decimal errors among them
        raise ValueError(f'{allowed}; "{match[2]}" is no known unit') from None
    if base != wanted.base or len(base) != len(quantity.unit_items()):
        if unit == "rad/s" and base == DIMENSIONS["1/s"].base:
            raise ValueError(f"must be {wanted.noun}; {match[2]} could mean revolutions or radians: write rpm or rad/s")
        raise ValueError(f'{allowed}; "{match[2]}" is not {wanted.noun}')
    return value


def to_si(value: Any, unit: str) -> float:
    """Value in SI units of a plain number (already SI) or of a string with a unit.

    Args:
        value: A number, or a string such as "30 rpm".
        unit: Unit that the key declares, one of ``DIMENSIONS``.

    Raises:
        ValueError: Not a number, not finite, no known unit, or a unit of another dimension; a rate in Hz is refused for
            an angular rate, rpm for a frequency or a time.
    """
    if isinstance(value, str):
        number = _parse(value, unit)
    elif isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    else:
        raise ValueError(allowed_text(unit))
    if not math.isfinite(number):
        raise ValueError(f"must be finite, {DIMENSIONS[unit].noun} in [{unit}]")
    return number
