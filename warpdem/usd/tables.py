"""Tables of a scene as they are built from the prims of a stage: keys in the namespace ``dem:``, lists, standard attributes."""

import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core.key_path import KeyPath
from warpdem.errors import SceneError
from warpdem.usd.grain_columns import ROUNDING
from warpdem.usd.stage_units import StageUnits


class SceneTables:
    """Tables of a scene, and the prim or attribute that each of their keys comes from."""

    def __init__(
        self, file: Path, content: dict[str, Any], arrays: dict[str, np.ndarray], geometry: Collection[str]
    ) -> None:
        """Tables without entries.

        Args:
            file: USD file.
            content: What was read of its prims (``usd.reader``).
            arrays: Arrays of grains, by path of their prim and name.
            geometry: Keys that define the geometry of a wall; without them the prim itself is the geometry.
        """
        self.file, self.prims, self.arrays, self.geometry = file, content["prims"], arrays, geometry
        self.units, self.free = StageUnits.of(content), content["free"]
        self.data: dict[str, Any] = {}
        self.origins: dict[KeyPath, str] = {}
        self.at: dict[str, tuple[KeyPath, dict[str, Any]]] = {}  # key path and table of each prim that has one
        self.names = {p["path"]: p["dem"].get("name", p["path"].rsplit("/", 1)[1]) for p in self.prims}

    def fill(self, prim: dict[str, Any], key_path: KeyPath, table: dict[str, Any]) -> dict[str, Any]:
        """Write the ``dem:`` keys of a prim to a table and record its origin; returns the table."""
        self.at[prim["path"]] = key_path, table
        self.origins[key_path] = prim["path"]
        for key, value in prim["dem"].items():
            if key == "list":
                continue
            *parents, last = key.split(":")
            here = table
            for parent in parents:
                here = here.setdefault(parent, {})
                if not isinstance(here, dict):
                    raise SceneError(f"{self.file}: {prim['path']}.dem:{key}: dem:{':'.join(parents)} is a value, not a table")
            here[last] = self._value(value, f"{prim['path']}.dem:{key}")
            self.origins[(*key_path, *parents, last)] = f"{prim['path']}.dem:{key}"
        return table

    def _value(self, value: Any, where: str) -> Any:
        """A value of the tables: files relative to the stage's folder, targets by their names."""
        if isinstance(value, dict) and "targets" in value:
            missing = [target for target in value["targets"] if target not in self.names]
            if missing or not value["targets"]:
                raise SceneError(f"{self.file}: {where}: {missing[0] if missing else 'empty'}: must target prims of the scene")
            names = [self.names[target] for target in value["targets"]]
            # a relationship holds each target once: one material means its pair with itself
            return (names * 2)[: max(2, len(names))] if where.endswith(":materials") else names[0]
        if isinstance(value, dict):
            return self._relative(value["found"]) if value["found"] else value["file"]
        return value

    def _relative(self, file: str) -> str:
        """Path of a file from the stage's folder."""
        return Path(os.path.relpath(file, self.file.parent.resolve())).as_posix()

    def entry(self, prim: dict[str, Any], listed: str = "") -> dict[str, Any]:
        """Append a table to a list of the scene, or of the entry of the prim's ancestor."""
        *parents, key = (listed or prim["dem"]["list"]).split(":")
        key_path, here = self.at.get(prim["above"], ((), self.data))
        for parent in parents:
            here = here.setdefault(parent, {})
        entries = here.setdefault(key, [])
        entries.append({})
        return self.fill(prim, (*key_path, *parents, key, len(entries) - 1), entries[-1])

    def standard_value(self, table: dict[str, Any], key_path: KeyPath, key: str, value: Any, origin: str) -> None:
        """Use the value of a standard attribute, unless its ``dem:`` counterpart is present and agrees.

        Raises:
            SceneError: They differ.
        """
        if key not in table:
            table[key] = value
            self.origins[(*key_path, key)] = origin
            return
        numbers = np.atleast_1d(value).astype(float)
        given = table[key]
        slack = max(ROUNDING * np.abs(numbers).max(), float(np.finfo(np.float32).tiny))
        same = isinstance(given, str) or np.allclose(given, numbers, rtol=ROUNDING, atol=slack)
        if not same:
            raise SceneError(
                f"{self.file}: {origin} = {value}, but {self.origins[(*key_path, key)]} = {given} for {key}: make them "
                "agree, or remove one of them"
            )

    def unused_wall_name(self, prim: dict[str, Any]) -> str:
        """Name of the prim, with a number if another wall has it."""
        taken = {wall.get("name") for wall in self.data["walls"]}
        name, count = str(self.names[prim["path"]]), 1
        while name in taken:
            count += 1
            name = f"{self.names[prim['path']]}_{count}"
        return name

    def bind(self, prim: dict[str, Any], table: dict[str, Any]) -> None:
        """Use the bound material, if it is a physics material."""
        if "material" not in table and prim["material"] in self.at:
            table["material"] = self.names[prim["material"]]
