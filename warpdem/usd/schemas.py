"""Treatment of physics in a USD stage: the table of schemas and attributes that are taken, noted or refused.

The first rule whose pattern and condition match applies to a name (of a prim's type, an applied schema or an attribute).
Taken are those that a scene can hold, and those that have no effect on grains. Refused are those whose loss would give another
flow than that of the stage, such as a belt that stands still. All others are noted with their path. Schemas are identified by
the names that a prim lists, so that those of other programs need not be registered.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Literal

import numpy as np

Verdict = Literal["taken", "noted", "refused"]


@dataclass(frozen=True)
class Prim:
    """The physics of a prim."""

    path: str
    type: str
    """Name of its type; "" if it has none."""
    schemas: tuple[str, ...]
    """Names of its applied schemas, registered or not."""
    values: dict[str, Any]
    """Authored attributes of physics by name; relationships as lists of paths."""
    sampled: tuple[str, ...] = ()
    """Those of them that change with time."""
    kind: str = ""
    """Its type by the physics parser: RigidBodyMaterial, MeshShape, SpherePointsShape (grains) ...; "" if none."""
    moves: bool = False
    """Whether its transform has time samples."""
    grains: tuple[str, ...] = ()
    """Paths of all grains of the stage."""
    free: bool = False
    """Whether it is a wall that moves by forces, or its body."""

    def applied(self, name: str) -> bool:
        """Whether a schema is applied."""
        return name in self.schemas

    def is_nonzero(self, *names: str) -> bool:
        """Whether one of the attributes is not zero, or changes with time."""
        return any(name in self.sampled or np.any(self.values.get(name, 0)) for name in names)

    def is_off(self, name: str) -> bool:
        """Whether an attribute is false; a missing attribute counts as true."""
        return self.values.get(name, True) is False

    @property
    def is_grains(self) -> bool:
        """Whether it holds grains."""
        return self.kind == "SpherePointsShape"


@dataclass(frozen=True)
class Rule:
    """Treatment of some names."""

    names: str
    """Patterns separated by spaces, * for any characters."""
    verdict: Verdict
    why: str = ""
    """Consequence for the run, and the remedy."""
    when: Callable[[Prim], bool] = lambda prim: True

    def fits(self, name: str, prim: Prim) -> bool:
        """Whether the rule applies to a name at a prim."""
        return any(fnmatchcase(name, pattern) for pattern in self.names.split()) and self.when(prim)


def _filters_grains(prim: Prim) -> bool:
    """Whether a filter of contacts concerns grains."""
    ends = [prim.path, *prim.values.get("physics:filteredPairs", ())]
    return any(f"{grains}/".startswith(f"{end}/") for grains in prim.grains for end in ends)


def _frictionless(prim: Prim) -> bool:
    """Whether only a static coefficient of friction is given."""
    return prim.is_nonzero("physics:staticFriction") and "physics:dynamicFriction" not in prim.values


def _one_friction(prim: Prim) -> bool:
    """Whether static and dynamic coefficients of friction are equal."""
    return bool(prim.values.get("physics:staticFriction", 0.0) == prim.values.get("physics:dynamicFriction"))


REMOVE = "remove it, or make the prim inactive"
MASSES = "physics:mass physics:density physics:centerOfMass physics:diagonalInertia physics:principalAxes"
JOINTS = {"PhysicsRevoluteJoint": "angular", "PhysicsPrismaticJoint": "linear"}
"""Joints of free walls, and the instances of their drives."""
VELOCITIES = ("physics:velocity", "physics:angularVelocity")
SURFACE_VELOCITY, SURFACE_SPIN = (
    "physxSurfaceVelocity:surfaceVelocity", "physxSurfaceVelocity:surfaceAngularVelocity"
)  # fmt: skip


def _has_surface_velocity(prim: Prim) -> bool:
    """Whether a surface velocity is active."""
    on = prim.applied("PhysxSurfaceVelocityAPI") and not prim.is_off("physxSurfaceVelocity:surfaceVelocityEnabled")
    return on and prim.is_nonzero(SURFACE_VELOCITY, SURFACE_SPIN)


def _joint_rules() -> Iterator[Rule]:
    """Rules for the joints of free walls that are on."""
    attributes = "body0 body1 localPos0 localPos1 localRot0 localRot1 axis lowerLimit upperLimit breakForce breakTorque"
    attributes += " jointEnabled collisionEnabled excludeFromArticulation"
    own = " ".join(f"physics:{name}" for name in attributes.split())
    for kind, drive in JOINTS.items():

        def is_on(prim: Prim, kind: str = kind) -> bool:
            return prim.type == kind and not prim.is_off("physics:jointEnabled")

        yield Rule(f"{kind} {own} PhysicsDriveAPI:{drive} drive:{drive}:physics:*", "taken", when=is_on)


def _rules() -> Iterator[Rule]:
    # the scene
    yield Rule(
        "PhysicsScene physics:gravityDirection physics:gravityMagnitude NewtonSceneAPI newton:gravityEnabled "
        "newton:timeStepsPerSecond",
        "taken",
    )
    yield Rule(
        "mjc:flag:gravity",
        "refused",
        "switches gravity off for another program only; set newton:gravityEnabled = false",
        lambda prim: prim.is_off("mjc:flag:gravity"),
    )
    yield Rule(
        "mjc:option:wind physxParticleSystem:wind",
        "refused",
        'wind is not supported: remove it, or give the scene a field (dem:list = "fields")',
        lambda prim: prim.is_nonzero("mjc:option:wind", "physxParticleSystem:wind"),
    )
    # materials
    yield Rule(
        "PhysicsMaterialAPI physics:dynamicFriction physics:restitution NewtonMaterialAPI newton:rollingFriction "
        "newton:mpm:youngsModulus newton:mpm:poissonsRatio",
        "taken",
    )
    yield Rule("physics:density", "taken", when=lambda prim: prim.applied("PhysicsMaterialAPI"))
    yield Rule(
        "physics:staticFriction",
        "refused",
        "grains have one coefficient of friction: give physics:dynamicFriction",
        _frictionless,
    )
    yield Rule("physics:staticFriction", "taken", when=_one_friction)
    yield Rule(
        "physics:staticFriction",
        "noted",
        "not taken: grains have one coefficient of friction, physics:dynamicFriction",
    )
    yield Rule(
        "*CombineMode *combineMode",
        "noted",
        'not taken: each pair of materials has coefficients of its own (dem:list = "pairs")',
    )
    yield Rule(
        "newton:torsionalFriction mjc:torsionalfriction",
        "noted",
        "not taken: with dem:contact:torsion = true rolling friction resists twisting too",
    )
    # masses
    yield Rule(
        "physics:mass physics:density",
        "refused",
        "the mass of grains follows from the density of their material: set physics:density of the material",
        lambda prim: prim.is_grains and prim.is_nonzero("physics:mass", "physics:density"),
    )
    yield Rule(
        "physics:density",
        "refused",
        "the mass of a free wall is its physics:mass, or follows from the density of its material: give one of them",
        lambda prim: prim.free and prim.is_nonzero("physics:density") and not prim.is_nonzero("physics:mass"),
    )
    yield Rule(f"PhysicsMassAPI {MASSES}", "taken", when=lambda prim: prim.free)
    yield Rule(
        f"PhysicsMassAPI {MASSES}",
        "noted",
        "not taken: the motion of walls is prescribed and does not depend on their mass",
    )
    # bodies
    yield Rule(
        "physxRigidBody:disableGravity physxRigidBody:linearDamping physxRigidBody:angularDamping",
        "refused",
        "gravity pulls every free wall, and its dampers are those of its drive or of dem:free:damping and dem:free:mounts; "
        f"{REMOVE}",
        lambda prim: prim.free
        and prim.is_nonzero(*(f"physxRigidBody:{key}" for key in ("disableGravity", "linearDamping", "angularDamping"))),
    )
    yield Rule("PhysicsRigidBodyAPI physics:rigidBodyEnabled physics:kinematicEnabled", "taken")
    yield Rule(
        " ".join(VELOCITIES),
        "refused",
        "has no effect, since PhysicsRigidBodyAPI is not applied: apply it with physics:kinematicEnabled = true, or remove "
        "the attribute",
        lambda prim: prim.is_nonzero(*VELOCITIES) and not prim.applied("PhysicsRigidBodyAPI"),
    )
    yield Rule(
        " ".join(VELOCITIES),
        "noted",
        "not taken, since physics:rigidBodyEnabled = false: it stands still",
        lambda prim: prim.is_nonzero(*VELOCITIES) and prim.is_off("physics:rigidBodyEnabled"),
    )
    yield Rule(
        " ".join(VELOCITIES),
        "noted",
        "not taken: the time samples of the transform define its motion",
        lambda prim: prim.is_nonzero(*VELOCITIES) and prim.moves,
    )
    yield Rule(" ".join(VELOCITIES), "taken")
    yield Rule(
        SURFACE_SPIN,
        "refused",
        "a surface that turns about the body's origin is not supported: give the wall dem:surface_velocity:axis and "
        "dem:surface_velocity:speed, the speed along axis x normal; with "
        "physxSurfaceVelocity:surfaceVelocityEnabled = false the wall stands still",
        lambda prim: _has_surface_velocity(prim) and prim.is_nonzero(SURFACE_SPIN),
    )
    yield Rule(
        "PhysxSurfaceVelocityAPI physxSurfaceVelocity:*",
        "noted",
        "no surface velocity is active: the wall stands still",
        lambda prim: not _has_surface_velocity(prim),
    )
    yield Rule("PhysxSurfaceVelocityAPI physxSurfaceVelocity:*", "taken")
    yield Rule(
        "PhysxSplinesSurfaceVelocityAPI",
        "refused",
        "a surface that moves along a curve is not supported: the wall would stand still; with "
        "physxSplinesSurfaceVelocity:surfaceVelocityEnabled = false it does",
        lambda prim: not prim.is_off("physxSplinesSurfaceVelocity:surfaceVelocityEnabled"),
    )
    yield Rule(
        "physxForce:force physxForce:torque",
        "refused",
        f"forces of PhysX are not supported; {REMOVE}",
        lambda prim: prim.is_nonzero("physxForce:force", "physxForce:torque") and not prim.is_off("physxForce:forceEnabled"),
    )
    # colliders
    yield Rule("PhysicsCollisionAPI physics:collisionEnabled PhysicsMeshCollisionAPI physics:simulationOwner", "taken")
    yield Rule("physics:approximation", "taken", when=lambda prim: prim.applied("PhysicsMeshCollisionAPI"))
    yield Rule(
        "physxCollision:restOffset newton:contactMargin",
        "noted",
        "not taken: the surface of a wall is that of its triangles, without an offset",
    )
    yield Rule(
        "PhysxTriggerAPI",
        "refused",
        "a trigger is not solid, a wall is: set physics:collisionEnabled = false",
        lambda prim: not prim.is_off("physics:collisionEnabled"),
    )
    yield Rule(
        "PhysicsFilteredPairsAPI physics:filteredPairs",
        "refused",
        f"grains are in contact with all walls and all grains, without exceptions; {REMOVE}",
        _filters_grains,
    )
    yield Rule(
        "PhysicsCollisionGroup",
        "refused",
        f"grains are in contact with all walls and all grains, without exceptions; {REMOVE}",
        lambda prim: prim.is_nonzero("physics:filteredGroups", "physics:invertFilteredGroups"),
    )
    # there are no contacts between walls
    yield Rule(
        "PhysicsFilteredPairsAPI physics:filteredPairs PhysicsCollisionGroup physics:filteredGroups "
        "physics:invertFilteredGroups physics:mergeGroup",
        "taken",
    )
    yield Rule("Physx*Cooked* physxCooked*", "taken")  # cached data of the stage
    # joints and drives
    yield Rule(
        "physxJoint:jointFriction physxJoint:armature",
        "refused",
        "friction and armature of joints are not supported: give a damping, and the wall's own moment of inertia",
        lambda prim: prim.type in JOINTS and prim.is_nonzero("physxJoint:jointFriction", "physxJoint:armature"),
    )
    yield from _joint_rules()
    yield Rule(
        "Physics*Joint PhysxPhysics*Joint PhysicsArticulationRootAPI PhysicsDriveAPI* PhysxMimicJointAPI* NewtonMimicAPI* "
        "PhysxTendon* MjcActuator* MjcTendon* MjcEquality* NewtonActuator* PhysxVehicle* PhysxCharacterController*",
        "refused",
        "joints, drives and tendons are not supported, but for revolute and prismatic joints of a free wall with their drive. "
        "A wall moves by time samples of its transform, by the velocities of a kinematic body, or as a free wall by what "
        f"UsdPhysics says of its body and joint or by dem:free:joint and the other keys of walls[].free; {REMOVE}",
        lambda prim: not prim.is_off("physics:jointEnabled") and not prim.is_off("physxArticulation:articulationEnabled"),
    )
    # deformable bodies, and particles of other programs
    yield Rule(
        "Physx*Deformable* OmniPhysics*Deformable* Physx*Cloth* PhysxPhysicsAttachment PhysxAutoAttachmentAPI",
        "refused",
        f"walls are rigid: deformable bodies are not read; {REMOVE}",
    )
    yield Rule(
        "PhysxParticleSetAPI",
        "refused",
        "its particles are no grains: apply PhysicsCollisionAPI to Points, or make them inactive",
        lambda prim: not prim.is_grains,
    )
    yield Rule(
        "PhysxParticleSamplingAPI",
        "refused",
        'has no effect here: remove it, and fill the wall by dem:list = "grains" with dem:fill:wall',
    )
    # graphs of Omniverse change attributes during a run
    yield Rule(
        "OmniGraphNode",
        "refused",
        "the node of a conveyor is not executed: the belt would stand still; make its graph inactive",
        lambda prim: "conveyor" in str(prim.values.get("node:type", "")).lower(),
    )
    yield Rule("OmniGraph", "noted", "the graph is not executed")
    yield Rule("OmniGraphNode node:type", "taken")  # noted with its graph
    # all else
    yield Rule("Physics* physics:* *:physics:*", "noted", "not taken")
    yield Rule("*", "noted", "settings of another program, not taken")


RULES = tuple(_rules())
"""Rules for the treatment of physics; the first rule that fits applies."""


def rule_of(name: str, prim: Prim) -> Rule:
    """The rule for a type, schema or attribute of a prim."""
    return next(rule for rule in RULES if rule.fits(name, prim))
