"""Colliders: which are walls, where they are, and the kinematic body that moves them."""

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import has_samples, matrix_of, plain, sample_codes, still

COLLIDERS = ("MeshShape", "CubeShape", "SphereShape", "CylinderShape", "ConeShape", "CapsuleShape", "PlaneShape")
"""Kinds of the physics parser's shapes that are walls."""
TRUE_TRIANGLES = ("none", "sdf")
"""Approximations of a collider that are none."""


def collider(prim, desc, bodies: dict) -> dict:
    """What the physics parser says of a shape: its place, its lengths, and the body that carries it."""
    from pxr import UsdGeom, UsdPhysics

    path = str(prim.GetPath())
    if not desc.collisionEnabled:
        return {"enabled": False}
    if getattr(desc, "approximation", "none") not in TRUE_TRIANGLES:
        raise Refused(f"{path}: approximation = {desc.approximation}: walls are the true triangles, so it must be none")
    if len({str(material) for material in desc.materials}) > 1:
        raise Refused(f"{path}: its parts have different physics materials; a wall has one")
    still(prim, *(name for name in ("radius", "axis") if prim.HasAttribute(name)))
    said = {
        "matrix": matrix_of(UsdGeom.XformCache(0.0), prim).tolist(),
        "axis": str(getattr(desc, "axis", "Z")),
        "radius": float(prim.GetAttribute("radius").Get(0.0)) if prim.HasAttribute("radius") else 0.0,
        "moves": bool(sample_codes(prim)),
        "enabled": True,
    }
    body = bodies.get(str(desc.rigidBody))
    if body is None or not body.rigidBodyEnabled:
        return said
    if not body.kinematicBody:
        raise Refused(
            f"{desc.rigidBody} is a rigid body that moves by forces, which walls do not; set physics:kinematicEnabled = true"
        )
    moved, cache = prim.GetStage().GetPrimAtPath(desc.rigidBody), UsdGeom.XformCache(0.0)
    rigid = UsdPhysics.RigidBodyAPI(moved)
    check_carriers(moved, bodies)
    said["body"] = {
        "path": str(desc.rigidBody),
        "parent": np.array(cache.GetParentToWorldTransform(moved)).T.tolist(),
        "origin": matrix_of(cache, moved)[:3, 3].tolist(),
        "velocity": plain(rigid.GetVelocityAttr()),
        "spin": plain(rigid.GetAngularVelocityAttr()),
        "moves": has_samples(moved),
    }
    return said


def check_carriers(body, bodies: dict) -> None:
    """Look for bodies that a body stands in.

    Raises:
        Refused: one of them moves by its velocities, which the inner one would not follow.
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
                f"{body.GetPath()} is a body within the body {here.GetPath()}, which moves by its velocities: it would not be "
                "carried along; give the inner one dem:motion with both motions, the outer one first, and take its schema out"
            )
