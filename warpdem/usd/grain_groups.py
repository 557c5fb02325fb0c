"""Groups of grains and of clumps of a scene from the points of a stage."""

from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.usd.clump_groups import clump_groups
from warpdem.usd.grain_columns import grain_columns, require_equal_lengths
from warpdem.usd.reader.grains import GRAIN_ARRAYS
from warpdem.usd.tables import SceneTables


def add_clumps(tables: SceneTables, prim: dict[str, Any]) -> None:
    """The groups of clumps of a frame of a result."""
    path, dem = prim["path"], prim["dem"]
    arrays = {key.split(" ")[1]: a for key, a in tables.arrays.items() if key.split(" ")[0] == path}
    names, groups = dem.pop("clumps"), dem.pop("groups", [])
    materials = [tables.names.get(target, target) for target in dem.pop("materials", {"targets": []})["targets"]]
    for group in clump_groups(tables.file, path, arrays, names, materials, groups):
        table = tables.entry(prim, "grains")
        table |= group


def add_grains(tables: SceneTables, prim: dict[str, Any]) -> None:
    """The groups of grains of a Points prim: one, or one for each of its materials."""
    path = prim["path"]
    arrays = {key.split(" ")[1]: a for key, a in tables.arrays.items() if key.split(" ")[0] == path}
    unknown = [name for name in prim["left"] if name.startswith("primvars:dem:")]
    if unknown:
        known = ", ".join(GRAIN_ARRAYS)
        raise SceneError(f"{tables.file}: {path}.{unknown[0]}: no such array of grains; there are {known}")
    columns = grain_columns(tables.file, path, arrays, tables.units.up, tables.units.metres)
    types = arrays.get("dem.types")
    if types is None:
        table = tables.entry(prim, "grains")
        tables.bind(prim, table)
        if any(key in table for key in ("radius", "diameter")):
            columns.pop("diameters", None)
        table |= columns
        return
    materials = prim["dem"].pop("materials", {"targets": []})["targets"]
    groups, group = prim["dem"].pop("groups", []), arrays.get("group", np.zeros(len(types), dtype=int))
    require_equal_lengths(tables.file, path, {**columns, "types": types, "group": group})
    if len(types) and not (0 <= types.min() and types.max() < len(materials)):
        count = len(materials)
        raise SceneError(f"{tables.file}: {path}.primvars:dem:types: must number the {count} targets of dem:materials")
    for number, of in np.unique(np.stack([types, group], axis=1), axis=0):
        table, taken = tables.entry(prim, "grains"), (types == number) & (group == of)
        table["material"] = tables.names[materials[number]]
        if 0 <= of < len(groups):
            table["name"] = groups[of]
        table |= {key: values[taken] for key, values in columns.items()}
