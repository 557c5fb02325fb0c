"""Walls of a scene from the colliders of a stage: their geometry, material and motion."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.usd import free_walls
from warpdem.usd.grain_columns import similarity
from warpdem.usd.tables import SceneTables


def add_wall(tables: SceneTables, prim: dict[str, Any]) -> None:
    """A wall from a collider: its geometry, material and motion."""
    table = tables.entry(prim, "walls")
    inside = table.pop("inside", None)
    table.setdefault("name", tables.unused_wall_name(prim))
    tables.bind(prim, table)
    if not any(key in table for key in tables.geometry):
        table |= _geometry(tables, prim, inside)
    if prim.get("surface_velocity") is not None:
        velocity = (tables.units.up @ np.array(prim["surface_velocity"]) * tables.units.metres).tolist()
        _add_surface_velocity(tables, prim, table, velocity)
    add_free_motion(tables, prim, table)
    motion = list(_motions(tables, prim))
    if motion and "motion" in table:
        raise SceneError(f"{tables.file}: {prim['path']} moves by USD's own attributes and by dem:motion: remove one of them")
    if motion:
        table["motion"] = motion
        # the stage defines the motion in the world
        table.setdefault("fixed_to", "laboratory")


def add_free_motion(tables: SceneTables, prim: dict[str, Any], table: dict[str, Any]) -> None:
    """Use what UsdPhysics says of a body that moves by forces, unless ``dem:free`` is present and agrees."""
    if "free" not in prim:
        return
    body, material = tables.free[prim["free"]], tables.data.get("materials", {}).get(table.get("material"), {})
    density = material.get("density")
    known = density if isinstance(density, float) else None  # no text with a unit
    found = free_walls.free_table(tables.file, body, prim["masses"], table, tables.units, known)
    if "free" not in table:  # the stage says where it is in the world
        table.setdefault("fixed_to", "laboratory")
    given = table.setdefault("free", {})
    wrong = next(free_walls.differences(given, found), None)
    if wrong is not None:
        origin = (body["joint"] or body)["path"]
        raise SceneError(
            f"{tables.file}: {prim['path']}.dem:free:{wrong} = {given[wrong]}, but by UsdPhysics at {origin} it is "
            f"{found[wrong]}: make them agree, or remove one of them"
        )
    key_path = tables.at[prim["path"]][0]
    for key in found.keys() - given.keys():
        given[key] = found[key]
        tables.origins[(*key_path, "free", key)] = (body["joint"] or body)["path"]


def _add_surface_velocity(tables: SceneTables, prim: dict[str, Any], table: dict[str, Any], velocity: list[float]) -> None:
    """Use PhysX's surface velocity [m/s], unless ``dem:surface_velocity`` is present and agrees."""
    given = table.get("surface_velocity")
    if isinstance(given, dict):
        if set(given) != {"velocity"}:
            raise SceneError(
                f"{tables.file}: {prim['path']} has a surface velocity by PhysxSurfaceVelocityAPI and another course by "
                "dem:surface_velocity: remove one of them"
            )
        table["surface_velocity"] = given["velocity"]
    key_path = tables.at[prim["path"]][0]
    tables.origins.setdefault((*key_path, "surface_velocity"), f"{prim['path']}.dem:surface_velocity")
    origin = f"{prim['path']}.physxSurfaceVelocity:surfaceVelocity"
    tables.standard_value(table, key_path, "surface_velocity", velocity, origin)


def _geometry(tables: SceneTables, prim: dict[str, Any], inside: bool | None) -> dict[str, Any]:
    """Geometry of a collider: an analytic plane or sphere, or its triangles."""
    matrix = np.array(prim["matrix"])
    linear = tables.units.up @ matrix[:3, :3]
    origin = (tables.units.up @ matrix[:3, 3] * tables.units.metres).tolist()
    if prim["kind"] == "PlaneShape":
        normal = np.linalg.inv(linear).T[:, "XYZ".index(prim["axis"])]
        return {"plane": {"point": origin, "normal": normal.tolist()}}
    factor = similarity(linear)
    if prim["kind"] == "SphereShape" and factor:
        radius = tables.units.convert(prim["radius"], length=1) * factor
        return {"sphere": {"centre": origin, "radius": radius, "inside": bool(inside)}}
    if inside is not None:
        raise SceneError(f"{tables.file}: {prim['path']}.dem:inside: only for a sphere that is also a sphere in the world")
    return {"mesh": tables.file.name, "prim": prim["path"]}


def _motions(tables: SceneTables, prim: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Motions of a collider, outermost first: its samples, or the velocities of its kinematic body."""
    body = prim.get("body")
    if prim["moves"] and body and not body["moves"] and any([*body["velocity"], *body["spin"]]):
        raise SceneError(
            f"{tables.file}: {prim['path']} moves by time samples of transforms, and its body {body['path']} by its "
            "velocities: remove one of them, or give both with dem:motion"
        )
    if prim["moves"]:
        yield {"usd": tables.file.name, "prim": prim["path"]}
        return
    if body is None:
        return
    parent = tables.units.up @ np.array(body["parent"])[:3, :3]
    velocity = parent @ np.array(body["velocity"]) * tables.units.metres
    spin = parent @ np.radians(body["spin"])
    if velocity.any():
        yield {"velocity": velocity.tolist()}
    if spin.any():
        origin = (tables.units.up @ np.array(body["origin"]) * tables.units.metres).tolist()
        yield {"axis": spin.tolist(), "origin": origin, "rate": float(np.linalg.norm(spin))}
