"""Parameters of external fields and observers: read in units, and as the row of numbers that a kernel takes."""

from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np

from warpdem.core.nearest import nearest
from warpdem.kernels.field import NUMBERS
from warpdem.scene.units import Quantity, Vector


def field_values(
    module: ModuleType, given: Mapping[str, Any]
) -> tuple[dict[str, Any], list[tuple[tuple[str, ...], Any, str]]]:
    """Parameters of an external field or an observer in SI units, defaults filled in, in the order of its ``PARAMETERS``.

    Args:
        module: the field or observer.
        given: parameters as the scene has them: numbers, lists, strings with units.

    Returns:
        The values, and for each mistake its place in ``given``, the value there and what is wrong.
    """
    known = list(module.PARAMETERS)
    problems: list[tuple[tuple[str, ...], Any, str]] = [
        ((key,), value, "unknown parameter" + (nearest(key, known) or f"; known here: {', '.join(known) or 'none'}"))
        for key, value in given.items()
        if key not in known
    ]
    values: dict[str, Any] = {}
    for key, (unit, count, default) in module.PARAMETERS.items():
        value = given.get(key, default)
        quantity = Quantity(unit)
        if value is None:
            problems.append(((key,), None, f"missing: {count} number{'s' * (count > 1)} in [{unit}]"))
            continue
        try:
            if count == 1:
                values[key] = quantity.validate(value)
            else:
                values[key] = tuple(quantity.validate(entry) for entry in Vector(quantity, count).listed(value))
        except ValueError as error:
            problems.append(((key,), value, str(error)))
    return values, problems


def numbers(values: Mapping[str, Any]) -> np.ndarray:
    """The values of ``field_values`` one after the other, filled up with zeros, SI units, shape (NUMBERS,)."""
    row = np.zeros(NUMBERS)
    given = np.hstack([(), *values.values()])
    row[: len(given)] = given
    return row
