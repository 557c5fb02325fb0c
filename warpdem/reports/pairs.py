"""Coefficients of two materials as a report states them: those that the laws of the run read, with their units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def coefficients(pair: Mapping[str, Any], read: Mapping[str, str] | None) -> list[tuple[str, str, float]]:
    """Name, unit (empty for a pure number) and value of each coefficient.

    Args:
        pair: an entry of ``[[pairs]]`` with all defaults, in SI units.
        read: unit of each key that the laws read, from run.json; None in one of an older version: all numbers, without units.
    """
    return [
        (key.replace("_", " "), _unit((read or {}).get(key, "-")), value)
        for key, value in pair.items()
        if (read is None or key in read) and isinstance(value, int | float) and not isinstance(value, bool)
    ]


def headed(pair: Mapping[str, Any], read: Mapping[str, str] | None) -> dict[str, Any]:
    """The entry as a row of a table: its materials, and its coefficients by name with unit."""
    found = {f"{name} [{unit or '-'}]" if read is not None else name: value for name, unit, value in coefficients(pair, read)}
    return {"materials": pair["materials"], **found}


def _unit(unit: str) -> str:
    """As people write it."""
    return "" if unit == "-" else unit.replace("m2", "m²").replace("m3", "m³")
