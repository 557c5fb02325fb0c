"""Rigid bodies that move by forces, their masses, and the joints that hold them (``PhysicsRigidBodyAPI``, joints, drives)."""

from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import all_prims, json_value, sample_codes, world_matrix

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom, UsdPhysics

JOINTS = {"PhysicsRevoluteJoint": ("hinge", "angular"), "PhysicsPrismaticJoint": ("slider", "linear")}
"""Types of joints that are read: what the wall has then, and the instance of their drive."""
MASS = {"mass": "physics:mass", "density": "physics:density", "centre": "physics:centerOfMass",
        "moments": "physics:diagonalInertia", "axes": "physics:principalAxes"}  # fmt: skip
"""Attributes of PhysicsMassAPI by what they are here."""
ENDS = ("body0", "body1")


def free_bodies(stage: "Usd.Stage", bodies: dict[str, "UsdPhysics.RigidBodyDesc"]) -> dict[str, dict[str, Any]]:
    """Bodies that move by forces, by path: where and how fast they are at time 0, their masses and their joints.

    Numbers are in the stage's units, vectors in the axes that the keys name; matrices act on column vectors.

    Raises:
        Refused: A joint or drive cannot be that of a wall.
    """
    from pxr import UsdGeom, UsdPhysics

    cache = UsdGeom.XformCache(0.0)
    found: dict[str, dict[str, Any]] = {}
    for path, desc in bodies.items():
        if not desc.rigidBodyEnabled or desc.kinematicBody:
            continue
        prim = stage.GetPrimAtPath(path)
        if sample_codes(prim):
            raise Refused(
                f"{path} is a rigid body that moves by forces, and its transform has time samples: remove the samples, or "
                "set physics:kinematicEnabled = true"
            )
        rigid = UsdPhysics.RigidBodyAPI(prim)
        found[path] = {
            "path": path,
            "matrix": world_matrix(cache, prim).tolist(),
            "parent": np.array(cache.GetParentToWorldTransform(prim)).T.tolist(),
            "velocity": json_value(rigid.GetVelocityAttr()),
            "spin": json_value(rigid.GetAngularVelocityAttr()),
            "joint": None,
        }
    for prim in all_prims(stage):
        kind = str(prim.GetTypeName())
        if kind in JOINTS and UsdPhysics.Joint(prim).GetJointEnabledAttr().Get():
            _join(prim, *JOINTS[kind], found, cache)
    return found


def _join(
    prim: "Usd.Prim", joint: str, drive: str, found: dict[str, dict[str, Any]], cache: "UsdGeom.XformCache"
) -> None:
    """Add a joint to the body that it holds.

    Raises:
        Refused: It holds no such body, two of them, one that another joint holds, or can break.
    """
    from pxr import UsdPhysics

    path, held = str(prim.GetPath()), UsdPhysics.Joint(prim)
    frames: list[dict[str, Any]] = []
    targets = [held.GetBody0Rel().GetTargets(), held.GetBody1Rel().GetTargets()]
    for number, (end, target) in enumerate(zip(ENDS, targets, strict=True)):
        other = prim.GetStage().GetPrimAtPath(target[0]) if target else None
        if target and not other:
            raise Refused(f"{path}.physics:{end}: there is no prim {target[0]}")
        if other is not None and sample_codes(other):
            raise Refused(
                f"{path}: {target[0]} moves by time samples: a joint to a moving body is not supported; hold the wall at one "
                "that rests, or give it dem:motion"
            )
        frames.append({
            "target": str(target[0]) if target else "",
            "matrix": world_matrix(cache, other).tolist() if other else np.eye(4).tolist(),
            "place": json_value(prim.GetAttribute(f"physics:localPos{number}")),
            "turn": _quaternion(prim.GetAttribute(f"physics:localRot{number}").Get()),
        })  # fmt: skip
    free = [_body_of(frame["target"], found) for frame in frames]
    if free[0] and free[1]:
        raise Refused(
            f"{path} joins two bodies that move by forces, {free[0]} and {free[1]}: a free wall is held at what rests; join "
            "each to the world, or set physics:kinematicEnabled = true for one"
        )
    for frame, body in zip(frames, free, strict=True):
        _require_rest(path, frame["target"], body, prim.GetStage())
    body = free[0] or free[1]
    if not body:
        raise Refused(
            f"{path} holds no body that moves by forces: apply PhysicsRigidBodyAPI to the wall without "
            "physics:kinematicEnabled, or set physics:jointEnabled = false"
        )
    if found[body]["joint"]:
        raise Refused(f"{path}: {body} is held by {found[body]['joint']['path']} too; a free wall has one joint: remove one")
    for name in ("physics:breakForce", "physics:breakTorque"):
        value = prim.GetAttribute(name)
        if value.HasAuthoredValue() and np.isfinite(value.Get()):
            raise Refused(f"{path}.{name} = {value.Get():g}: joints do not break: remove it")
    found[body]["joint"] = {
        "path": path, "joint": joint, "axis": str(prim.GetAttribute("physics:axis").Get()), "frames": frames,
        "moved": 0 if free[0] else 1,
        "range": [float(prim.GetAttribute(f"physics:{side}Limit").Get()) for side in ("lower", "upper")],
        "drive": _drive(prim, drive),
    }  # fmt: skip


def _body_of(path: str, found: dict[str, dict[str, Any]]) -> str:
    """The nearest of the bodies that is or contains a prim; "" if there is none."""
    while path:
        if path in found:
            return path
        path = path.rpartition("/")[0]
    return ""


def _require_rest(path: str, target: str, free: str, stage: "Usd.Stage") -> None:
    """Refuse a joint to a kinematic body that moves by its velocities."""
    from pxr import UsdPhysics

    prim = stage.GetPrimAtPath(target) if target and not free else None
    while prim and not prim.IsPseudoRoot():
        if prim.HasAPI(UsdPhysics.RigidBodyAPI):
            rigid = UsdPhysics.RigidBodyAPI(prim)
            speeds = [*rigid.GetVelocityAttr().Get(), *rigid.GetAngularVelocityAttr().Get()]
            if rigid.GetRigidBodyEnabledAttr().Get() and any(speeds):
                raise Refused(
                    f"{path}: {prim.GetPath()} moves by its velocities: a joint to a moving body is not supported; hold the "
                    "wall at one that rests, or give it dem:motion"
                )
            return
        prim = prim.GetParent()


def _drive(prim: "Usd.Prim", instance: str) -> dict[str, float] | None:
    """The drive of a joint in the stage's units, None if it has none.

    Raises:
        Refused: It drives an acceleration.
    """
    from pxr import UsdPhysics

    if not prim.HasAPI(UsdPhysics.DriveAPI, instance):
        return None
    name = f"drive:{instance}:physics:"
    if prim.GetAttribute(f"{name}type").Get() == "acceleration":
        raise Refused(
            f"{prim.GetPath()}.{name}type = acceleration: a drive of a free wall gives a force or torque: multiply stiffness, "
            "damping and maxForce by its mass or moment of inertia, and set the type to force"
        )
    keys = ("stiffness", "damping", "maxForce", "targetPosition", "targetVelocity")
    return {key: _number(prim.GetAttribute(name + key)) for key in keys}


def _number(attribute: "Usd.Attribute") -> float:
    value = json_value(attribute)
    return float(value)  # type: ignore[arg-type]  # the attribute is a number by its schema


def _quaternion(value: Any) -> list[float]:
    """A quaternion of USD, scalar first."""
    return [float(value.GetReal()), *(float(component) for component in value.GetImaginary())]


def stated_masses(prim: "Usd.Prim") -> dict[str, Any]:
    """What PhysicsMassAPI states of a prim, without what stands for "not given"; empty if it states nothing.

    With it the ``path`` of the prim and its local-to-world ``matrix``.
    """
    from pxr import UsdGeom, UsdPhysics

    if not prim.HasAPI(UsdPhysics.MassAPI):
        return {}
    given: dict[str, Any] = {}
    for key, name in MASS.items():
        attribute = prim.GetAttribute(name)
        if not attribute.HasAuthoredValue():
            continue
        value: Any = _quaternion(attribute.Get()) if key == "axes" else json_value(attribute)
        if np.isfinite(value).all() and (key == "centre" or np.any(value)):  # USD: zero, or minus infinity, is not given
            given[key] = value
    return given and {**given, "path": str(prim.GetPath()), "matrix": world_matrix(UsdGeom.XformCache(0.0), prim).tolist()}


def require_single_walls(free: dict[str, dict[str, Any]], prims: dict[str, dict[str, Any]]) -> list[str]:
    """Bodies that no wall belongs to.

    Raises:
        Refused: Several walls belong to a body.
    """
    empty = []
    for body in free:
        walls = [path for path, prim in prims.items() if prim.get("free") == body]
        if len(walls) > 1:
            raise Refused(
                f"{body} moves by forces and has several colliders, {', '.join(walls[:4])}: a free wall is one mesh; join them "
                "into one, or apply PhysicsCollisionAPI to one of them"
            )
        empty += [] if walls else [body]
    return empty
