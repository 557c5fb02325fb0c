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

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core.key_path import KeyPath
from warpdem.errors import SceneError
from warpdem.usd import stage as usd_stage
from warpdem.usd import unsupported
from warpdem.usd.grain_groups import add_clumps, add_grains
from warpdem.usd.reader.clumps import CLUMPS
from warpdem.usd.tables import SceneTables
from warpdem.usd.walls import add_free_motion, add_wall

WITH_MATERIAL = ("walls", "grains", "streams", "recipe")
"""Lists whose entries have the material that is bound to their prims."""


def read(
    file: Path, at: float | None, folders: Sequence[Path] | None, geometry: Collection[str]
) -> tuple[dict[str, Any], dict[KeyPath, str], float, list[str]]:
    """Tables of the scene of a stage, as from TOML.

    A frame of a result is a scene that begins at its own time 0, with the remainder of ``time.end`` and without contact
    history, as the title states.

    Args:
        file: USD file.
        at: Time of a frame [s] if the stage is the result of a run; None for the last frame.
        folders: Folders that must hold all files it refers to; None for no restriction.
        geometry: Keys of a wall that define its geometry.

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
    tables = SceneTables(file, content, arrays, geometry)
    _fill(tables)
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


def _fill(tables: SceneTables) -> None:
    """Build the tables prim by prim: materials come before what they are bound to."""
    scenes = [prim for prim in tables.prims if prim["kind"] == "Scene"]
    if len(scenes) != 1:
        found = ", ".join(prim["path"] for prim in scenes) or "none"
        raise SceneError(
            f"{tables.file}: a scene needs one PhysicsScene prim, which also holds the keys dem:...; found {found}"
        )
    _add_scene(tables, scenes[0])
    for prim in tables.prims:
        if prim["kind"] == "RigidBodyMaterial":
            _add_material(tables, prim)
    for prim in tables.prims:
        if prim.get("enabled") is False:
            continue  # noted
        if prim["kind"] == "SpherePointsShape":
            add_grains(tables, prim)
        elif prim["kind"] == CLUMPS:
            add_clumps(tables, prim)
        elif prim["kind"] == "Table":
            table = tables.entry(prim)
            if prim["dem"]["list"] in WITH_MATERIAL:
                tables.bind(prim, table)
            add_free_motion(tables, prim, table)
        elif prim["kind"] not in ("Scene", "RigidBodyMaterial"):
            add_wall(tables, prim)
    _add_own_pairs(tables)


def _add_scene(tables: SceneTables, prim: dict[str, Any]) -> None:
    """Gravity and the tables of the scene prim."""
    tables.fill(prim, (), tables.data)
    standard, path = prim["standard"], prim["path"]
    if standard.get("newton:gravityEnabled") is False:
        tables.standard_value(tables.data, (), "gravity", [0.0, 0.0, 0.0], f"{path}.newton:gravityEnabled")
    elif "physics:gravityMagnitude" in standard or "gravity" not in tables.data:
        direction = np.array(standard.get("physics:gravityDirection", (0.0, 0.0, 0.0)))
        direction = tables.units.up @ direction if direction.any() else np.array([0.0, 0.0, -1.0])
        magnitude = standard.get("physics:gravityMagnitude", -np.inf)
        # USD: a negative magnitude stands for the gravity of the earth
        strength = tables.units.convert(magnitude, length=1) if magnitude >= 0.0 else 9.81
        gravity = (direction / np.linalg.norm(direction) * strength + 0.0).tolist()
        tables.standard_value(tables.data, (), "gravity", gravity, f"{path}.physics:gravityMagnitude")
    if "newton:timeStepsPerSecond" in standard and "step" not in tables.data.get("time", {}):
        step = 1.0 / max(standard["newton:timeStepsPerSecond"], 1e-300)
        tables.standard_value(tables.data.setdefault("time", {}), ("time",), "step", step, f"{path}.newton:timeStepsPerSecond")


def _add_material(tables: SceneTables, prim: dict[str, Any]) -> None:
    """A material, its name and its density."""
    name, standard = tables.names[prim["path"]], prim["standard"]
    materials = tables.data.setdefault("materials", {})
    if name in materials:
        raise SceneError(f"{tables.file}: {prim['path']}: {tables.origins[('materials', name)]} is a material {name!r} too")
    key_path, table = ("materials", name), materials.setdefault(name, {})
    tables.fill(prim, key_path, table)
    table.pop("name", None)
    for key, attribute, powers in (
        ("density", "physics:density", (-3, 1)),
        ("young_modulus", "newton:mpm:youngsModulus", (-1, 1)),
        ("poisson_ratio", "newton:mpm:poissonsRatio", (0, 0)),
    ):
        # USD: a density of 0 is not given
        if standard.get(attribute):
            value = tables.units.convert(standard[attribute], *powers)
            tables.standard_value(table, key_path, key, value, f"{prim['path']}.{attribute}")


def _add_own_pairs(tables: SceneTables) -> None:
    """Coefficients of each material with itself, from its physics material."""
    for prim in tables.prims:
        keys = {"restitution": "physics:restitution", "friction": "physics:dynamicFriction",
                "rolling_friction": "newton:rollingFriction"}  # fmt: skip
        given = {key: name for key, name in keys.items() if name in prim.get("standard", {})}
        if prim["kind"] != "RigidBodyMaterial" or not given:
            continue
        pairs, both = tables.data.setdefault("pairs", []), [tables.names[prim["path"]]] * 2
        known = [i for i, pair in enumerate(pairs) if pair.get("materials") == both]
        if not known:
            known = [len(pairs)]
            pairs.append({"materials": both})
            tables.origins["pairs", known[0]] = prim["path"]
        for key, name in given.items():
            tables.standard_value(pairs[known[0]], ("pairs", known[0]), key, prim["standard"][name], f"{prim['path']}.{name}")
