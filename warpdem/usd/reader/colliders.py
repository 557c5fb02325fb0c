"""Colliders: which are walls, where they are, and the body that moves them."""

from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.belts import surface_velocity
from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import constant_values, has_samples, json_value, sample_codes, world_matrix

if TYPE_CHECKING:
    from pxr import Usd, UsdPhysics

COLLIDERS = ("MeshShape", "CubeShape", "SphereShape", "CylinderShape", "ConeShape", "CapsuleShape", "PlaneShape")
"""Shape types of the physics parser that are walls."""
TRUE_TRIANGLES = ("none", "sdf")
"""Approximations of a collider that keep its triangles."""


def collider(
    prim: "Usd.Prim", desc: "UsdPhysics.ShapeDesc", bodies: dict[str, "UsdPhysics.RigidBodyDesc"]
) -> dict[str, Any]:
    """Collider as the physics parser describes it: its pose, its sizes, and the body that moves it."""
    from pxr import UsdGeom, UsdPhysics

    path = str(prim.GetPath())
    if not desc.collisionEnabled:
        return {"enabled": False}
    if getattr(desc, "approximation", "none") not in TRUE_TRIANGLES:
        raise Refused(f"{path}: approximation = {desc.approximation}: walls are the true triangles, so it must be none")
    if len({str(material) for material in desc.materials}) > 1:
        raise Refused(f"{path}: its parts have different physics materials; a wall has one")
    constant_values(prim, *(name for name in ("radius", "axis") if prim.HasAttribute(name)))
    content: dict[str, Any] = {
        "matrix": world_matrix(UsdGeom.XformCache(0.0), prim).tolist(),
        "axis": str(getattr(desc, "axis", "Z")),
        "radius": float(prim.GetAttribute("radius").Get(0.0)) if prim.HasAttribute("radius") else 0.0,
        "moves": bool(sample_codes(prim)),
        "enabled": True,
    }
    holders = [prim, *([prim.GetStage().GetPrimAtPath(desc.rigidBody)] if str(desc.rigidBody) in bodies else [])]
    content["surface_velocity"] = surface_velocity(*holders)
    body = bodies.get(str(desc.rigidBody))
    if body is None or not body.rigidBodyEnabled:
        return content
    if not body.kinematicBody:
        content["free"] = str(desc.rigidBody)
        return content
    moved, cache = prim.GetStage().GetPrimAtPath(desc.rigidBody), UsdGeom.XformCache(0.0)
    rigid = UsdPhysics.RigidBodyAPI(moved)
    check_outer_bodies(moved, bodies)
    content["body"] = {
        "path": str(desc.rigidBody),
        "parent": np.array(cache.GetParentToWorldTransform(moved)).T.tolist(),
        "origin": world_matrix(cache, moved)[:3, 3].tolist(),
        "velocity": json_value(rigid.GetVelocityAttr()),
        "spin": json_value(rigid.GetAngularVelocityAttr()),
        "moves": has_samples(moved),
    }
    return content


def check_outer_bodies(body: "Usd.Prim", bodies: dict[str, "UsdPhysics.RigidBodyDesc"]) -> None:
    """Check the bodies that contain a body.

    Raises:
        Refused: One of them moves by its velocities, which the inner body would not follow.
    """
    from pxr import UsdGeom

    here = body
    while not here.IsPseudoRoot():
        xform = UsdGeom.Xformable(here)
        if xform and xform.GetResetXformStack():
            return
        here = here.GetParent()
        outer = bodies.get(str(here.GetPath()))
        if outer is not None and outer.rigidBodyEnabled and any([*outer.linearVelocity, *outer.angularVelocity]):
            raise Refused(
                f"{body.GetPath()} is a body within the body {here.GetPath()}, which moves by its velocities: the inner body "
                "would not follow; give it dem:motion with both motions, the outer one first, and remove its schema"
            )
