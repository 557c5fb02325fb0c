"""A scene from a USD stage: standard physics prims, and the scene's own keys in the namespace ``dem:``.

    PhysicsScene                         gravity; dem:time:end, dem:contact:normal ...: the tables of a scene file
    Material with PhysicsMaterialAPI     density, friction and restitution with itself; dem:young_modulus ...
    mesh or shape with CollisionAPI      wall: its true triangles, or the analytic plane or sphere; dem:open, dem:motion ...
    Points with CollisionAPI             grains: widths are diameters, velocities, ids, primvars:omega [rad/s]
    any prim with dem:list = "pairs"     entry of that list of the scene, or of the entry of its ancestor

``dem:a:b`` is key b of table a, as a.b in TOML, with the same units and strings. Its numbers are SI and in the scene's axes,
whatever the units and the up axis of the stage; standard attributes are converted. A standard attribute and its ``dem:``
counterpart must agree; the counterpart holds the digits that single precision lacks.
"""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core.key_path import KeyPath
from warpdem.errors import SceneError
from warpdem.usd import free_walls, unsupported
from warpdem.usd import stage as usd_stage
from warpdem.usd.clump_groups import clump_groups
from warpdem.usd.grain_columns import ROUNDING, grain_columns, require_equal_lengths, similarity
from warpdem.usd.reader.clumps import CLUMPS
from warpdem.usd.reader.grains import GRAIN_ARRAYS
from warpdem.usd.stage_units import StageUnits

GEOMETRY = ("mesh", "plane", "cylinder", "cone", "sphere")
"""Keys that define the geometry of a wall; without them the prim itself is the geometry."""
WITH_MATERIAL = ("walls", "grains", "streams", "recipe")
"""Lists whose entries have the material that is bound to their prims."""


def read(
    file: Path, at: float | None, folders: Sequence[Path] | None
) -> tuple[dict[str, Any], dict[KeyPath, str], float, list[str]]:
    """Tables of the scene of a stage, as from TOML.

    A frame of a result is a scene that begins at its own time 0, with the remainder of ``time.end`` and without contact
    history, as the title states.

    Args:
        file: USD file.
        at: Time of a frame [s] if the stage is the result of a run; None for the last frame.
        folders: Folders that must hold all files it refers to; None for no restriction.

    Returns:
        The tables; the attribute or prim of each key path; the time by which the motions and streams are ahead [s]; and notes
        on content of the stage that is not taken over.

    Raises:
        SceneError: The stage cannot be read, does not state its units, or holds content that is refused.
    """
    content, arrays = usd_stage.read(file, "scene", "" if at is None else repr(float(at)), str(file), folders)
    if content["unsaid"]:
        raise SceneError(f"{file}: the stage does not state its {' and '.join(content['unsaid'])}: a scene needs it")
    notes = unsupported.notes(file, content["physics"])
    tables = _SceneTables(file, content, arrays)
    time = 0.0 if content["code"] is None else content["code"] / content["rate"]
    if content["code"] is not None:
        _set_remaining_run(tables.data, time, file)
    return tables.data, tables.origins, time, [*content["noticed"], *notes, *_notes_on_unused(content)]


def _notes_on_unused(content: dict[str, Any]) -> list[str]:
    """Notes on shapes and points that are not part of the scene, and on arrays of grains that are not used."""
    notes, listed = [], unsupported.listed
    off = [prim["path"] for prim in content["prims"] if prim.get("enabled") is False]
    if off:
        notes.append(f"{listed(off)}: no walls or grains, since physics:collisionEnabled = false")
    if content["unused"]:
        notes.append(f"{listed(content['unused'])}: no walls or grains, since PhysicsCollisionAPI is not applied")
    for prim in content["prims"]:
        if prim.get("left"):
            notes.append(f"{prim['path']}: not taken of the grains: {', '.join(prim['left'])}")
        if prim.get("moving"):
            notes.append(f"{prim['path']}: {', '.join(prim['moving'])}: changes with time; grains start as they are at time 0")
    return notes


def _set_remaining_run(data: dict[str, Any], time: float, file: Path) -> None:
    """Change the tables to the remainder of a run, from its frame at ``time`` [s] on."""
    if "phases" in data:
        raise SceneError(f"{file}: a frame of a run in phases is no scene of its own; start from its checkpoint")
    data.pop("start", None)
    if time > 0.0:
        data["title"] = f"{data.get('title', '')}, from {time:g} s on without contact history".lstrip(", ")
        end = data.get("time", {}).get("end")
        if isinstance(end, float) and end - time > 1e-9 * time:
            data["time"]["end"] = end - time
        elif isinstance(end, float):
            del data["time"]["end"]  # nothing remains: the user gives a new end


class _SceneTables:
    """Builds the tables of a scene, prim by prim."""

    def __init__(self, file: Path, content: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        self.file, self.prims, self.arrays = file, content["prims"], arrays
        self.units, self.free = StageUnits.of(content), content["free"]
        self.up, self.metres, self.convert = self.units.up, self.units.metres, self.units.convert
        self.data: dict[str, Any] = {}
        self.origins: dict[KeyPath, str] = {}
        self.at: dict[str, tuple[KeyPath, dict[str, Any]]] = {}  # key path and table of each prim that has one
        self.names = {p["path"]: p["dem"].get("name", p["path"].rsplit("/", 1)[1]) for p in self.prims}
        scenes = [prim for prim in self.prims if prim["kind"] == "Scene"]
        if len(scenes) != 1:
            found = ", ".join(prim["path"] for prim in scenes) or "none"
            raise SceneError(f"{file}: a scene needs one PhysicsScene prim, which also holds the keys dem:...; found {found}")
        self.scene(scenes[0])
        for prim in self.prims:
            if prim["kind"] == "RigidBodyMaterial":
                self.material(prim)
        for prim in self.prims:
            if prim.get("enabled") is False:
                continue  # noted
            if prim["kind"] == "SpherePointsShape":
                self.grains(prim)
            elif prim["kind"] == CLUMPS:
                self.clumps(prim)
            elif prim["kind"] == "Table":
                table = self.entry(prim)
                if prim["dem"]["list"] in WITH_MATERIAL:
                    self.bind(prim, table)
                self.free_wall(prim, table)
            elif prim["kind"] not in ("Scene", "RigidBodyMaterial"):
                self.wall(prim)
        self.own_pairs()

    # -- any table -----------------------------------------------------------------------

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
            here[last] = self.value(value, f"{prim['path']}.dem:{key}")
            self.origins[(*key_path, *parents, last)] = f"{prim['path']}.dem:{key}"
        return table

    def value(self, value: Any, where: str) -> Any:
        """A value of the tables: files relative to the stage's folder, targets by their names."""
        if isinstance(value, dict) and "targets" in value:
            missing = [target for target in value["targets"] if target not in self.names]
            if missing or not value["targets"]:
                raise SceneError(f"{self.file}: {where}: {missing[0] if missing else 'empty'}: must target prims of the scene")
            names = [self.names[target] for target in value["targets"]]
            # a relationship holds each target once: one material means its pair with itself
            return (names * 2)[: max(2, len(names))] if where.endswith(":materials") else names[0]
        if isinstance(value, dict):
            return self.relative(value["found"]) if value["found"] else value["file"]
        return value

    def relative(self, file: str) -> str:
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

    # -- prims of UsdPhysics --------------------------------------------------------------------

    def scene(self, prim: dict[str, Any]) -> None:
        """Gravity and the tables of the scene prim."""
        self.fill(prim, (), self.data)
        standard, path = prim["standard"], prim["path"]
        if standard.get("newton:gravityEnabled") is False:
            self.standard_value(self.data, (), "gravity", [0.0, 0.0, 0.0], f"{path}.newton:gravityEnabled")
        elif "physics:gravityMagnitude" in standard or "gravity" not in self.data:
            direction = np.array(standard.get("physics:gravityDirection", (0.0, 0.0, 0.0)))
            direction = self.up @ direction if direction.any() else np.array([0.0, 0.0, -1.0])
            magnitude = standard.get("physics:gravityMagnitude", -np.inf)
            # USD: a negative magnitude stands for the gravity of the earth
            strength = self.convert(magnitude, length=1) if magnitude >= 0.0 else 9.81
            gravity = (direction / np.linalg.norm(direction) * strength + 0.0).tolist()
            self.standard_value(self.data, (), "gravity", gravity, f"{path}.physics:gravityMagnitude")
        if "newton:timeStepsPerSecond" in standard and "step" not in self.data.get("time", {}):
            step = 1.0 / max(standard["newton:timeStepsPerSecond"], 1e-300)
            self.standard_value(self.data.setdefault("time", {}), ("time",), "step", step, f"{path}.newton:timeStepsPerSecond")

    def material(self, prim: dict[str, Any]) -> None:
        """A material, its name and its density."""
        name, standard = self.names[prim["path"]], prim["standard"]
        materials = self.data.setdefault("materials", {})
        if name in materials:
            raise SceneError(f"{self.file}: {prim['path']}: {self.origins[('materials', name)]} is a material {name!r} too")
        key_path, table = ("materials", name), materials.setdefault(name, {})
        self.fill(prim, key_path, table)
        table.pop("name", None)
        for key, attribute, powers in (
            ("density", "physics:density", (-3, 1)),
            ("young_modulus", "newton:mpm:youngsModulus", (-1, 1)),
            ("poisson_ratio", "newton:mpm:poissonsRatio", (0, 0)),
        ):
            # USD: a density of 0 is not given
            if standard.get(attribute):
                value = self.convert(standard[attribute], *powers)
                self.standard_value(table, key_path, key, value, f"{prim['path']}.{attribute}")

    def own_pairs(self) -> None:
        """Coefficients of each material with itself, from its physics material."""
        for prim in self.prims:
            keys = {"restitution": "physics:restitution", "friction": "physics:dynamicFriction",
                    "rolling_friction": "newton:rollingFriction"}  # fmt: skip
            given = {key: name for key, name in keys.items() if name in prim.get("standard", {})}
            if prim["kind"] != "RigidBodyMaterial" or not given:
                continue
            pairs, both = self.data.setdefault("pairs", []), [self.names[prim["path"]]] * 2
            known = [i for i, pair in enumerate(pairs) if pair.get("materials") == both]
            if not known:
                known = [len(pairs)]
                pairs.append({"materials": both})
                self.origins["pairs", known[0]] = prim["path"]
            for key, name in given.items():
                self.standard_value(pairs[known[0]], ("pairs", known[0]), key, prim["standard"][name], f"{prim['path']}.{name}")

    def wall(self, prim: dict[str, Any]) -> None:
        """A wall from a collider: its geometry, material and motion."""
        table = self.entry(prim, "walls")
        inside = table.pop("inside", None)
        table.setdefault("name", self.unused_name(prim))
        self.bind(prim, table)
        if not any(key in table for key in GEOMETRY):
            table |= self.geometry(prim, inside)
        if prim.get("surface_velocity") is not None:
            velocity = (self.up @ np.array(prim["surface_velocity"]) * self.metres).tolist()
            self.surface_velocity(prim, table, velocity)
        self.free_wall(prim, table)
        motion = list(self.motion(prim))
        if motion and "motion" in table:
            raise SceneError(f"{self.file}: {prim['path']} moves by USD's own attributes and by dem:motion: remove one of them")
        if motion:
            table["motion"] = motion
            # the stage defines the motion in the world
            table.setdefault("fixed_to", "laboratory")

    def free_wall(self, prim: dict[str, Any], table: dict[str, Any]) -> None:
        """Use what UsdPhysics says of a body that moves by forces, unless ``dem:free`` is present and agrees."""
        if "free" not in prim:
            return
        body, material = self.free[prim["free"]], self.data.get("materials", {}).get(table.get("material"), {})
        density = material.get("density")
        known = density if isinstance(density, float) else None  # no text with a unit
        found = free_walls.free_table(self.file, body, prim["masses"], table, self.units, known)
        if "free" not in table:  # the stage says where it is in the world
            table.setdefault("fixed_to", "laboratory")
        given = table.setdefault("free", {})
        wrong = next(free_walls.differences(given, found), None)
        if wrong is not None:
            origin = (body["joint"] or body)["path"]
            raise SceneError(
                f"{self.file}: {prim['path']}.dem:free:{wrong} = {given[wrong]}, but by UsdPhysics at {origin} it is "
                f"{found[wrong]}: make them agree, or remove one of them"
            )
        key_path = self.at[prim["path"]][0]
        for key in found.keys() - given.keys():
            given[key] = found[key]
            self.origins[(*key_path, "free", key)] = (body["joint"] or body)["path"]

    def surface_velocity(self, prim: dict[str, Any], table: dict[str, Any], velocity: list[float]) -> None:
        """Use PhysX's surface velocity [m/s], unless ``dem:surface_velocity`` is present and agrees."""
        given = table.get("surface_velocity")
        if isinstance(given, dict):
            if set(given) != {"velocity"}:
                raise SceneError(
                    f"{self.file}: {prim['path']} has a surface velocity by PhysxSurfaceVelocityAPI and another course by "
                    "dem:surface_velocity: remove one of them"
                )
            table["surface_velocity"] = given["velocity"]
        key_path = self.at[prim["path"]][0]
        self.origins.setdefault((*key_path, "surface_velocity"), f"{prim['path']}.dem:surface_velocity")
        origin = f"{prim['path']}.physxSurfaceVelocity:surfaceVelocity"
        self.standard_value(table, key_path, "surface_velocity", velocity, origin)

    def unused_name(self, prim: dict[str, Any]) -> str:
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

    def geometry(self, prim: dict[str, Any], inside: bool | None) -> dict[str, Any]:
        """Geometry of a collider: an analytic plane or sphere, or its triangles."""
        matrix = np.array(prim["matrix"])
        linear = self.up @ matrix[:3, :3]
        origin = (self.up @ matrix[:3, 3] * self.metres).tolist()
        if prim["kind"] == "PlaneShape":
            normal = np.linalg.inv(linear).T[:, "XYZ".index(prim["axis"])]
            return {"plane": {"point": origin, "normal": normal.tolist()}}
        factor = similarity(linear)
        if prim["kind"] == "SphereShape" and factor:
            radius = self.convert(prim["radius"], length=1) * factor
            return {"sphere": {"centre": origin, "radius": radius, "inside": bool(inside)}}
        if inside is not None:
            raise SceneError(f"{self.file}: {prim['path']}.dem:inside: only for a sphere that is also a sphere in the world")
        return {"mesh": self.file.name, "prim": prim["path"]}

    def motion(self, prim: dict[str, Any]) -> Iterator[dict[str, Any]]:
        """Motions of a collider, outermost first: its samples, or the velocities of its kinematic body."""
        body = prim.get("body")
        if prim["moves"] and body and not body["moves"] and any([*body["velocity"], *body["spin"]]):
            raise SceneError(
                f"{self.file}: {prim['path']} moves by time samples of transforms, and its body {body['path']} by its "
                "velocities: remove one of them, or give both with dem:motion"
            )
        if prim["moves"]:
            yield {"usd": self.file.name, "prim": prim["path"]}
            return
        if body is None:
            return
        parent = self.up @ np.array(body["parent"])[:3, :3]
        velocity = parent @ np.array(body["velocity"]) * self.metres
        spin = parent @ np.radians(body["spin"])
        if velocity.any():
            yield {"velocity": velocity.tolist()}
        if spin.any():
            origin = (self.up @ np.array(body["origin"]) * self.metres).tolist()
            yield {"axis": spin.tolist(), "origin": origin, "rate": float(np.linalg.norm(spin))}

    # -- grains ---------------------------------------------------------------------------------

    def clumps(self, prim: dict[str, Any]) -> None:
        """The groups of clumps of a frame of a result."""
        path, dem = prim["path"], prim["dem"]
        arrays = {key.split(" ")[1]: a for key, a in self.arrays.items() if key.split(" ")[0] == path}
        names, groups = dem.pop("clumps"), dem.pop("groups", [])
        materials = [self.names.get(target, target) for target in dem.pop("materials", {"targets": []})["targets"]]
        for group in clump_groups(self.file, path, arrays, names, materials, groups):
            table = self.entry(prim, "grains")
            table |= group

    def grains(self, prim: dict[str, Any]) -> None:
        """The groups of grains of a Points prim: one, or one for each of its materials."""
        path = prim["path"]
        arrays = {key.split(" ")[1]: a for key, a in self.arrays.items() if key.split(" ")[0] == path}
        unknown = [name for name in prim["left"] if name.startswith("primvars:dem:")]
        if unknown:
            known = ", ".join(GRAIN_ARRAYS)
            raise SceneError(f"{self.file}: {path}.{unknown[0]}: no such array of grains; there are {known}")
        columns = grain_columns(self.file, path, arrays, self.up, self.metres)
        types = arrays.get("dem.types")
        if types is None:
            table = self.entry(prim, "grains")
            self.bind(prim, table)
            if any(key in table for key in ("radius", "diameter")):
                columns.pop("diameters", None)
            table |= columns
            return
        materials = prim["dem"].pop("materials", {"targets": []})["targets"]
        groups, group = prim["dem"].pop("groups", []), arrays.get("group", np.zeros(len(types), dtype=int))
        require_equal_lengths(self.file, path, {**columns, "types": types, "group": group})
        if len(types) and not (0 <= types.min() and types.max() < len(materials)):
            count = len(materials)
            raise SceneError(f"{self.file}: {path}.primvars:dem:types: must number the {count} targets of dem:materials")
        for number, of in np.unique(np.stack([types, group], axis=1), axis=0):
            table, taken = self.entry(prim, "grains"), (types == number) & (group == of)
            table["material"] = self.names[materials[number]]
            if 0 <= of < len(groups):
                table["name"] = groups[of]
            table |= {key: values[taken] for key, values in columns.items()}
