"""Groups of clumps from the arrays of a result."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.usd.grain_columns import require_equal_lengths
from warpdem.usd.reader.clumps import CLUMP_ARRAYS

COLUMNS = ("positions", "velocities", "spins", "orientations", "sizes")
"""Arrays that a group of the scene has."""
NUMBERS = ("clumps", "types", "groups")
"""Arrays by which the groups are distinguished."""


def clump_groups(
    file: Path, path: str, arrays: dict[str, np.ndarray], clumps: list[str], materials: list[str], groups: list[str]
) -> Iterator[dict[str, Any]]:
    """Tables of the groups, one for each clump, material and group that occur together.

    Args:
        file: The stage, for messages.
        path: Path of the prim, for messages.
        arrays: Its arrays by name.
        clumps: Names of the clumps that they number.
        materials: Names of the materials.
        groups: Names of the groups.

    Raises:
        SceneError: An array is missing, too short, or numbers what there is not.
    """
    held = {name: arrays.get(f"dem.{name}") for name in CLUMP_ARRAYS}
    if missing := [name for name, values in held.items() if values is None]:
        raise SceneError(f"{file}: {path}.primvars:dem:{missing[0]}: missing: its clumps are not known without it")
    columns: dict[str, np.ndarray] = {name: values for name, values in held.items() if values is not None}
    require_equal_lengths(file, path, columns)
    for name, known in (("clumps", clumps), ("types", materials), ("groups", groups)):
        wrong = (columns[name] < 0) | (columns[name] >= len(known))
        if wrong.any():
            raise SceneError(
                f"{file}: {path}.primvars:dem:{name}: holds {columns[name][wrong][0]}, must be from 0 to {len(known) - 1}"
            )
    numbers = np.stack([columns[name] for name in NUMBERS], axis=1)
    for of in np.unique(numbers, axis=0):
        taken = (numbers == of).all(axis=1)
        names = {"clump": clumps[of[0]], "material": materials[of[1]], "name": groups[of[2]]}
        yield names | {name: columns[name][taken] for name in COLUMNS}
