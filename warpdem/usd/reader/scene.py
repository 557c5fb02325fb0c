"""All prims of a stage that state something about a scene."""

import numpy as np

from warpdem.usd.reader.colliders import COLLIDERS, collider
from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.grains import GRAINS, frame_code, frame_codes, grain_arrays, grains_of
from warpdem.usd.reader.physics import dem_tables, physics_of
from warpdem.usd.reader.prims import above_of, all_prims, plain

STANDARD = {
    "Scene": ("physics:gravityDirection", "physics:gravityMagnitude", "newton:gravityEnabled", "newton:timeStepsPerSecond"),
    "RigidBodyMaterial": (
        "physics:density", "physics:dynamicFriction", "physics:restitution", "newton:rollingFriction",
        "newton:mpm:youngsModulus", "newton:mpm:poissonsRatio",
    ),
}  # fmt: skip
"""Attributes of UsdPhysics and of Newton's schemas that a scene takes, by the kind of the prim."""


def read_scene(stage, at: str) -> tuple[dict, dict[str, np.ndarray]]:
    """All prims that say something about a scene, in the order of the stage.

    Each has its ``path``, ``kind`` (Scene, RigidBodyMaterial, SpherePointsShape, one of `COLLIDERS`, or Table), the nearest
    such prim ``above`` it, its tables ``dem``, the bound ``material``, and what its kind has; arrays are of grains.
    """
    from pxr import UsdGeom, UsdPhysics

    physics = UsdPhysics.UsdPhysicsLoadStageFromPrimRange(stage, ["/"])
    bodies = {str(desc.primPath): desc for kind, (_, found) in physics.items() if str(kind) == "RigidBody" for desc in found}
    descs = [desc for kind, (_, found) in physics.items() if str(kind) != "RigidBody" for desc in found]
    strange = next((d for d in descs if str(d.type).endswith("Shape") and str(d.type) not in (*COLLIDERS, GRAINS)), None)
    if strange is not None:
        raise Refused(f"{strange.primPath} is a {strange.type}, which is no wall; make a Mesh of it, or make it inactive")
    # joints and what else a prim may be besides are found by their schemas
    records = {str(desc.primPath): desc for desc in descs if str(desc.type) in (*COLLIDERS, *STANDARD, GRAINS)}
    kinds = {path: str(desc.type) for path, desc in records.items()}
    frames = sorted({t for p, k in kinds.items() if k == GRAINS for t in frame_codes(stage.GetPrimAtPath(p))})
    code = frame_code(frames, at, stage.GetTimeCodesPerSecond())
    prims, arrays, facts, beside = {}, {}, [], []
    for prim in all_prims(stage):
        path, tables = str(prim.GetPath()), dem_tables(prim)
        kind = kinds.get(path) or ("Table" if "list" in tables else "")
        said = physics_of(prim, kind)
        facts += [said] if said else []
        if not kind and prim.IsA(UsdGeom.PointInstancer):
            beside.append(instancer(prim))
        collides = prim.HasAPI(UsdPhysics.CollisionAPI) and UsdPhysics.CollisionAPI(prim).GetCollisionEnabledAttr().Get()
        if collides and not kind:
            raise Refused(
                f"{path} collides (PhysicsCollisionAPI) but is {a_kind(prim)}, which is no wall: apply the schema to each Mesh "
                "or shape that is one"
            )
        if not kind and prim.IsA(UsdGeom.Gprim):
            beside.append(path)
        if not kind:
            if tables:
                raise Refused(
                    f"{path}.dem:{next(iter(tables))}: the prim is no physics scene, physics material, collider or grains, and "
                    "does not say with dem:list which list of the scene it is an entry of"
                )
            continue
        above = next((p for p in above_of(path) if p in prims), "")
        prims[path] = {"path": path, "kind": kind, "above": above, "dem": tables, "material": bound_material(prim)}
        if kind in STANDARD:
            given = [prim.GetAttribute(name) for name in STANDARD[kind]]
            prims[path]["standard"] = {a.GetName(): plain(a) for a in given if a and a.HasAuthoredValue()}
        elif kind in COLLIDERS:
            prims[path] |= collider(prim, records[path], bodies)
        elif kind == GRAINS:
            prims[path] |= grains_of(prim, records[path], bodies, bool(frames))
            arrays |= {f"{path} {name}": values for name, values in grain_arrays(prim, code).items()}
    kilograms = UsdPhysics.GetStageKilogramsPerUnit(stage)
    if not (np.isfinite(kilograms) and kilograms > 0.0):
        raise Refused(f"kilogramsPerUnit = {kilograms:g}, must be above 0")
    check_overs(stage)
    found = {"prims": list(prims.values()), "physics": facts, "beside": beside}
    return {**found, "kilograms": kilograms, "code": code if frames else None}, arrays


def a_kind(prim) -> str:
    """Type of a prim with its article, for messages."""
    return f"a {prim.GetTypeName()}" if prim.GetTypeName() else "of no type"


def instancer(prim) -> str:
    """Path of a point instancer.

    Raises:
        Refused: what it repeats is more than a picture.
    """
    from pxr import Usd, UsdGeom

    path = prim.GetPath()
    for target in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets():
        top = prim.GetStage().GetPrimAtPath(target)
        for part in Usd.PrimRange(top, Usd.TraverseInstanceProxies()) if top else ():
            if physics_of(part, "") or dem_tables(part):
                raise Refused(
                    f"{path} is a point instancer of {part.GetPath()}, which has physics: it is not read; make its instances "
                    "prims of their own (grains: Points)"
                )
    return f"{path} (a point instancer)"


def check_overs(stage) -> None:
    """Look for prims that are changed but nowhere defined: USD passes over them in silence.

    Raises:
        Refused: one has something to say about the scene, as one does whose path is misspelt.
    """
    from pxr import Usd

    for prim in Usd.PrimRange.AllPrims(stage.GetPseudoRoot()):
        if prim.IsActive() and not prim.IsDefined() and not prim.IsAbstract() and (physics_of(prim, "") or dem_tables(prim)):
            raise Refused(f"{prim.GetPath()} is an over, and nothing defines the prim; correct its path, or take it out")


def bound_material(prim) -> str:
    """Path of the material bound for physics, or for all purposes."""
    from pxr import UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")[0]
    return str(material.GetPath()) if material else ""
