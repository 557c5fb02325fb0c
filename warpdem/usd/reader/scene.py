"""All prims of a stage that belong to a scene."""

from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.bodies import free_bodies, require_single_walls, stated_masses
from warpdem.usd.reader.clumps import CLUMPS, clump_arrays, is_clumps
from warpdem.usd.reader.colliders import COLLIDERS, collider
from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.grains import GRAINS, frame_code, frame_codes, grain_arrays, grain_settings
from warpdem.usd.reader.physics import dem_tables, stated_physics
from warpdem.usd.reader.prims import all_prims, ancestor_paths, json_value

if TYPE_CHECKING:
    from pxr import Usd

STANDARD = {
    "Scene": ("physics:gravityDirection", "physics:gravityMagnitude", "newton:gravityEnabled", "newton:timeStepsPerSecond"),
    "RigidBodyMaterial": (
        "physics:density", "physics:dynamicFriction", "physics:restitution", "newton:rollingFriction",
        "newton:mpm:youngsModulus", "newton:mpm:poissonsRatio",
    ),
}  # fmt: skip
"""Attributes of UsdPhysics and of Newton's schemas that a scene takes, by the kind of the prim."""


def read_scene(stage: "Usd.Stage", at: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """All prims that belong to a scene, in the order of the stage.

    Each has its ``path``, ``kind`` (Scene, RigidBodyMaterial, SpherePointsShape, Clumps, one of `COLLIDERS`, or Table), the
    nearest such ancestor ``above``, its tables ``dem``, the bound ``material``, and the fields of its kind. The
    arrays are of grains and clumps.
    """
    from pxr import UsdGeom, UsdPhysics

    physics = UsdPhysics.UsdPhysicsLoadStageFromPrimRange(stage, ["/"])
    bodies = {str(desc.primPath): desc for kind, (_, found) in physics.items() if str(kind) == "RigidBody" for desc in found}
    descs = [desc for kind, (_, found) in physics.items() if str(kind) != "RigidBody" for desc in found]
    strange = next((d for d in descs if str(d.type).endswith("Shape") and str(d.type) not in (*COLLIDERS, GRAINS)), None)
    if strange is not None:
        raise Refused(f"{strange.primPath} is a {strange.type}, which cannot be a wall; use a Mesh, or make it inactive")
    # joints and other types are found by their schemas
    records = {str(desc.primPath): desc for desc in descs if str(desc.type) in (*COLLIDERS, *STANDARD, GRAINS)}
    kinds = {path: str(desc.type) for path, desc in records.items()}
    frames = sorted({t for p, k in kinds.items() if k == GRAINS for t in frame_codes(stage.GetPrimAtPath(p))})
    code = frame_code(frames, at, stage.GetTimeCodesPerSecond())
    free = free_bodies(stage, bodies)
    prims: dict[str, dict[str, Any]] = {}
    arrays: dict[str, np.ndarray] = {}
    stated: list[dict[str, Any]] = []
    unused: list[str] = []
    for prim in all_prims(stage):
        path, tables = str(prim.GetPath()), dem_tables(prim)
        kind = kinds.get(path) or (CLUMPS if is_clumps(prim, tables) else "Table" if "list" in tables else "")
        physics_of_prim = stated_physics(prim, kind)
        stated += [physics_of_prim] if physics_of_prim else []
        if not kind and prim.IsA(UsdGeom.PointInstancer):
            unused.append(instancer(prim))
        collides = prim.HasAPI(UsdPhysics.CollisionAPI) and UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get()
        if collides and not kind:
            raise Refused(
                f"{path} collides (PhysicsCollisionAPI) but is {type_text(prim)}, which cannot be a wall: apply the schema to "
                "each Mesh or shape that is a wall"
            )
        within = any(prims.get(p, {}).get("kind") == CLUMPS for p in ancestor_paths(path))  # a prototype
        if not kind and not within and prim.IsA(UsdGeom.Gprim):
            unused.append(path)
        if not kind:
            if tables:
                raise Refused(
                    f"{path}.dem:{next(iter(tables))}: the prim is no physics scene, physics material, collider or grains, and "
                    "has no dem:list that names the list of the scene it belongs to"
                )
            continue
        above = next((p for p in ancestor_paths(path) if p in prims), "")
        prims[path] = {"path": path, "kind": kind, "above": above, "dem": tables, "material": bound_material(prim)}
        if kind in STANDARD:
            given = [prim.GetAttribute(name) for name in STANDARD[kind]]
            prims[path]["standard"] = {a.GetName(): json_value(a) for a in given if a and a.HasAuthoredValue()}
        elif kind in COLLIDERS:
            prims[path] |= collider(prim, records[path], bodies)
        elif kind == GRAINS:
            prims[path] |= grain_settings(prim, records[path], bodies, bool(frames))
            arrays |= {f"{path} {name}": values for name, values in grain_arrays(prim, code).items()}
        elif kind == CLUMPS:
            arrays |= {f"{path} {name}": values for name, values in clump_arrays(prim, code).items()}
        elif path in free and tables.get("list") == "walls":
            prims[path]["free"] = path
        if "free" in prims[path]:
            prims[path]["masses"] = stated_masses(stage.GetPrimAtPath(prims[path]["free"])) or stated_masses(prim)
    unused += require_single_walls(free, prims)
    moving = {*free, *(path for path, prim in prims.items() if "free" in prim)}
    stated = [{**fields, "free": fields["path"] in moving} for fields in stated]
    kilograms = UsdPhysics.GetStageKilogramsPerUnit(stage)
    if not (np.isfinite(kilograms) and kilograms > 0.0):
        raise Refused(f"kilogramsPerUnit = {kilograms:g}, must be above 0")
    check_overs(stage)
    found = {"prims": list(prims.values()), "physics": stated, "unused": unused, "free": free}
    return {**found, "kilograms": kilograms, "code": code if frames else None}, arrays


def type_text(prim: "Usd.Prim") -> str:
    """Type of a prim with its article, for messages."""
    return f"a {prim.GetTypeName()}" if prim.GetTypeName() else "of no type"


def instancer(prim: "Usd.Prim") -> str:
    """Path of a point instancer.

    Raises:
        Refused: Its prototypes have physics.
    """
    from pxr import Usd, UsdGeom

    path = prim.GetPath()
    for target in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets():
        top = prim.GetStage().GetPrimAtPath(target)
        for part in Usd.PrimRange(top, Usd.TraverseInstanceProxies()) if top else ():
            if stated_physics(part, "") or dem_tables(part):
                raise Refused(
                    f"{path} is a point instancer of {part.GetPath()}, which has physics: it is not read; replace its "
                    "instances by prims (grains: Points)"
                )
    return f"{path} (a point instancer)"


def check_overs(stage: "Usd.Stage") -> None:
    """Check for prims that are changed but not defined, which USD ignores without a message.

    Raises:
        Refused: Such a prim has content for the scene, as happens when a path is misspelt.
    """
    from pxr import Usd

    for prim in Usd.PrimRange.AllPrims(stage.GetPseudoRoot()):
        undefined = prim.IsActive() and not prim.IsDefined() and not prim.IsAbstract()
        if undefined and (stated_physics(prim, "") or dem_tables(prim)):
            raise Refused(f"{prim.GetPath()} is an over, and nothing defines the prim; correct its path, or remove it")


def bound_material(prim: "Usd.Prim") -> str:
    """Path of the material bound for physics, or for all purposes."""
    from pxr import UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0]
    return str(material.GetPath()) if material else ""
