"""Free walls of a scene as UsdPhysics states them, beside the scene's own attributes: for other programs.

The wall's prim, at rest in the world at time 0, is a rigid body with its masses; a hinge is a PhysicsRevoluteJoint and a slider
a PhysicsPrismaticJoint between the world and it. A spring, a damper and a constant load with a damper are a PhysicsDriveAPI, so
is a motor curve of two points with opposite loads. For the rest (loads in time, other curves, mounts, a moment about an axis
alone) USD has no counterpart.
"""

from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

JOINT = "Joint"
"""Name of the joint below its wall."""
_TURNED = {"X": 0, "Y": 1, "Z": 2}


def author_free(stage: Usd.Stage, path: str, free: dict[str, Any]) -> None:
    """Author body, masses and joint of a free wall whose prim is at ``path``; ``free`` is its table in SI."""
    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    rigid, masses = UsdPhysics.RigidBodyAPI.Apply(prim), UsdPhysics.MassAPI.Apply(prim)
    if free.get("mass"):
        masses.CreateMassAttr(free["mass"])
    if free.get("centre"):
        masses.CreateCenterOfMassAttr(Gf.Vec3f(*free["centre"]))
    if free["joint"] == "none":
        if free.get("inertia"):
            masses.CreateDiagonalInertiaAttr(Gf.Vec3f(*free["inertia"]))
            w, x, y, z = free.get("axes") or (1.0, 0.0, 0.0, 0.0)
            masses.CreatePrincipalAxesAttr(Gf.Quatf(w, x, y, z))
        rigid.CreateVelocityAttr(Gf.Vec3f(*free.get("velocity", (0.0, 0.0, 0.0))))
        rigid.CreateAngularVelocityAttr(Gf.Vec3f(*np.degrees(free.get("spin", (0.0, 0.0, 0.0))).tolist()))
        return
    axis = np.array(free["axis"]) / np.linalg.norm(free["axis"])
    if free["joint"] == "hinge":
        rigid.CreateAngularVelocityAttr(Gf.Vec3f(*np.degrees(free.get("rate", 0.0) * axis).tolist()))
    else:
        rigid.CreateVelocityAttr(Gf.Vec3f(*(free.get("velocity", 0.0) * axis).tolist()))
    _author_joint(stage, path, free, axis)


def _author_joint(stage: Usd.Stage, path: str, free: dict[str, Any], axis: np.ndarray) -> None:
    """The joint between the world and a wall."""
    hinge = free["joint"] == "hinge"
    joint = (UsdPhysics.RevoluteJoint if hinge else UsdPhysics.PrismaticJoint).Define(stage, f"{path}/{JOINT}")
    joint.CreateBody1Rel().SetTargets([path])
    name = next((name for name, k in _TURNED.items() if axis[k] == 1.0), "X")
    joint.CreateAxisAttr(name)
    rotation = Gf.Rotation(Gf.Vec3d(1, 0, 0), Gf.Vec3d(*axis.tolist()))
    if axis[_TURNED[name]] == 1.0:
        rotation = Gf.Rotation(Gf.Vec3d(1, 0, 0), 0.0)
    place, quaternion = Gf.Vec3f(*free.get("origin", (0.0, 0.0, 0.0))), Gf.Quatf(rotation.GetQuat())
    for position, rotation in (
        (joint.CreateLocalPos0Attr(), joint.CreateLocalRot0Attr()),
        (joint.CreateLocalPos1Attr(), joint.CreateLocalRot1Attr()),
    ):
        position.Set(place)
        rotation.Set(quaternion)
    if free.get("range"):
        low, high = np.degrees(free["range"]) if hinge else free["range"]
        joint.CreateLowerLimitAttr(float(low))
        joint.CreateUpperLimitAttr(float(high))
    drive = _drive(free)
    if drive:
        degrees = 180.0 / np.pi if hinge else 1.0
        api = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), "angular" if hinge else "linear")
        api.CreateTypeAttr("force")
        api.CreateStiffnessAttr(drive["stiffness"] / degrees)
        api.CreateDampingAttr(drive["damping"] / degrees)
        api.CreateTargetPositionAttr(drive["position"] * degrees)
        api.CreateTargetVelocityAttr(drive["velocity"] * degrees)
        if np.isfinite(drive["most"]):
            api.CreateMaxForceAttr(drive["most"])


def _drive(free: dict[str, Any]) -> dict[str, float] | None:
    """Numbers of a drive in SI and radians; None where there is nothing, or what a drive cannot be."""
    stiffness, damping = free.get("stiffness", 0.0), free.get("damping", 0.0)
    load, motor = free.get("torque", free.get("force", 0.0)), free.get("motor")
    drive = {"stiffness": stiffness, "damping": damping, "position": free.get("rest", 0.0), "velocity": 0.0, "most": np.inf}
    if not isinstance(load, int | float) or (load and not damping):
        return None
    if motor:
        (slow, push), (fast, pull) = motor[0], motor[-1]
        if len(motor) != 2 or push != -pull or push <= 0.0 or stiffness or damping:
            return None
        return drive | {"damping": 2.0 * push / (fast - slow), "velocity": 0.5 * (slow + fast), "most": push}
    if not stiffness and not damping:
        return None
    return drive | {"velocity": load / damping if load else 0.0}
