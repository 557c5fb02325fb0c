"""What becomes of physics in a USD stage: the table of schemas and attributes that are taken, noted or refused.

A name (of a prim's type, an applied schema or an attribute) is answered by the first rule whose pattern and condition fit it.
Taken is what a scene has a place for, and what means nothing to grains. What is refused would give another flow than the
stage asks for, such as a belt that stands still; all the rest is noted with its path. Schemas count by the names that a prim
lists, so that those of other programs need not be registered here.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any, Literal

import numpy as np

Verdict = Literal["taken", "noted", "refused"]


@dataclass(frozen=True)
class Prim:
    """What a prim says about physics."""

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
    """What the physics parser makes of it: RigidBodyMaterial, MeshShape, SpherePointsShape (grains) ...; "" if nothing."""
    moves: bool = False
    """Whether its transform has time samples."""
    grains: tuple[str, ...] = ()
    """Paths of all grains of the stage."""

    def applied(self, name: str) -> bool:
        """Whether a schema is applied."""
        return name in self.schemas

    def asks(self, *names: str) -> bool:
        """Whether one of the attributes is above or below zero, or changes with time."""
        return any(name in self.sampled or np.any(self.values.get(name, 0)) for name in names)

    def off(self, name: str) -> bool:
        """Whether an attribute is false; one that is not there is true."""
        return self.values.get(name, True) is False

    @property
    def is_grains(self) -> bool:
        """Whether it holds grains."""
        return self.kind == "SpherePointsShape"


@dataclass(frozen=True)
class Rule:
    """What becomes of some names."""

    names: str
    """Patterns with * for any characters, between spaces."""
    verdict: Verdict
    why: str = ""
    """What it means for the run, and what to do about it."""
    when: Callable[[Prim], bool] = lambda prim: True

    def fits(self, name: str, prim: Prim) -> bool:
        """Whether the rule answers for a name at a prim."""
        return any(fnmatchcase(name, pattern) for pattern in self.names.split()) and self.when(prim)


def _meets_grains(prim: Prim) -> bool:
    """Whether a filter of contacts is one with grains."""
    ends = [prim.path, *prim.values.get("physics:filteredPairs", ())]
    return any(f"{grains}/".startswith(f"{end}/") for grains in prim.grains for end in ends)


def _frictionless(prim: Prim) -> bool:
    """Whether only a static friction is given."""
    return prim.asks("physics:staticFriction") and "physics:dynamicFriction" not in prim.values


def _one_friction(prim: Prim) -> bool:
    """Whether static and dynamic friction are one number."""
    return prim.values.get("physics:staticFriction", 0.0) == prim.values.get("physics:dynamicFriction")


OUT = "take it out, or make the prim inactive"
VELOCITIES = ("physics:velocity", "physics:angularVelocity")
SURFACE_VELOCITIES = ("physxSurfaceVelocity:surfaceVelocity", "physxSurfaceVelocity:surfaceAngularVelocity")


def _moves_in_place(prim: Prim) -> bool:
    """Whether a surface velocity is in force."""
    on = prim.applied("PhysxSurfaceVelocityAPI") and not prim.off("physxSurfaceVelocity:surfaceVelocityEnabled")
    return on and prim.asks(*SURFACE_VELOCITIES)


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
        "switches gravity off for another program only; say newton:gravityEnabled = false",
        lambda prim: prim.off("mjc:flag:gravity"),
    )
    yield Rule(
        "mjc:option:wind physxParticleSystem:wind",
        "refused",
        'a wind does not blow here: take it out, or give the scene a field (dem:list = "fields")',
        lambda prim: prim.asks("mjc:option:wind", "physxParticleSystem:wind"),
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
        "grains have one coefficient of friction: say physics:dynamicFriction",
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
        "grains have the mass that the density of their material gives them: set physics:density of the material",
        lambda prim: prim.is_grains and prim.asks("physics:mass", "physics:density"),
    )
    yield Rule(
        "PhysicsMassAPI physics:mass physics:density physics:centerOfMass physics:diagonalInertia physics:principalAxes",
        "noted",
        "not taken: walls move as they are told, whatever their mass",
    )
    # bodies
    yield Rule("PhysicsRigidBodyAPI physics:rigidBodyEnabled physics:kinematicEnabled", "taken")
    yield Rule(
        " ".join(VELOCITIES),
        "refused",
        "moves nothing, since PhysicsRigidBodyAPI is not applied: apply it with physics:kinematicEnabled = true, or take "
        "the attribute out",
        lambda prim: prim.asks(*VELOCITIES) and not prim.applied("PhysicsRigidBodyAPI"),
    )
    yield Rule(
        " ".join(VELOCITIES),
        "noted",
        "not taken, since physics:rigidBodyEnabled = false: it stands still",
        lambda prim: prim.asks(*VELOCITIES) and prim.off("physics:rigidBodyEnabled"),
    )
    yield Rule(
        " ".join(VELOCITIES),
        "noted",
        "not taken: the time samples of the transform say how it moves",
        lambda prim: prim.asks(*VELOCITIES) and prim.moves,
    )
    yield Rule(" ".join(VELOCITIES), "taken")
    yield Rule(
        " ".join(SURFACE_VELOCITIES),
        "refused",
        "PhysxSurfaceVelocityAPI, a surface that moves in its place, is not supported: the wall would stand still. A belt "
        "may be a Plane of a kinematic body that moves along itself (physics:velocity); with "
        "physxSurfaceVelocity:surfaceVelocityEnabled = false the wall stands still",
        _moves_in_place,
    )
    yield Rule(
        "PhysxSurfaceVelocityAPI physxSurfaceVelocity:*",
        "noted",
        "no surface velocity is in force: the wall stands still",
        lambda prim: not _moves_in_place(prim),
    )
    yield Rule("PhysxSurfaceVelocityAPI physxSurfaceVelocity:*", "taken")  # refused by its velocities
    yield Rule(
        "PhysxSplinesSurfaceVelocityAPI",
        "refused",
        "a surface that moves along a curve is not supported: the wall would stand still; with "
        "physxSplinesSurfaceVelocity:surfaceVelocityEnabled = false it does",
        lambda prim: not prim.off("physxSplinesSurfaceVelocity:surfaceVelocityEnabled"),
    )
    yield Rule(
        "physxForce:force physxForce:torque",
        "refused",
        f"forces of PhysX push nothing here; {OUT}",
        lambda prim: prim.asks("physxForce:force", "physxForce:torque") and not prim.off("physxForce:forceEnabled"),
    )
    # colliders
    yield Rule("PhysicsCollisionAPI physics:collisionEnabled PhysicsMeshCollisionAPI physics:simulationOwner", "taken")
    yield Rule("physics:approximation", "taken", when=lambda prim: prim.applied("PhysicsMeshCollisionAPI"))
    yield Rule(
        "physxCollision:restOffset newton:contactMargin",
        "noted",
        "not taken: a wall is where its triangles are, without any distance",
    )
    yield Rule(
        "PhysxTriggerAPI",
        "refused",
        "a trigger is not solid, a wall is: say physics:collisionEnabled = false",
        lambda prim: not prim.off("physics:collisionEnabled"),
    )
    yield Rule(
        "PhysicsFilteredPairsAPI physics:filteredPairs",
        "refused",
        f"grains touch all walls and all grains: none can be excepted; {OUT}",
        _meets_grains,
    )
    yield Rule(
        "PhysicsCollisionGroup",
        "refused",
        f"grains touch all walls and all grains: none can be excepted; {OUT}",
        lambda prim: prim.asks("physics:filteredGroups", "physics:invertFilteredGroups"),
    )
    # walls do not touch each other anyway
    yield Rule(
        "PhysicsFilteredPairsAPI physics:filteredPairs PhysicsCollisionGroup physics:filteredGroups "
        "physics:invertFilteredGroups physics:mergeGroup",
        "taken",
    )
    yield Rule("Physx*Cooked* physxCooked*", "taken")  # a store of what is in the stage already
    # joints and drives
    yield Rule(
        "Physics*Joint PhysxPhysics*Joint PhysicsArticulationRootAPI PhysicsDriveAPI* PhysxMimicJointAPI* NewtonMimicAPI* "
        "PhysxTendon* MjcActuator* MjcTendon* MjcEquality* NewtonActuator* PhysxVehicle* PhysxCharacterController*",
        "refused",
        "joints, drives and tendons hold and move nothing here. A wall moves by time samples of its transform, or by the "
        f"velocities of a kinematic body; {OUT}",
        lambda prim: not prim.off("physics:jointEnabled") and not prim.off("physxArticulation:articulationEnabled"),
    )
    # what bends, and particles of other programs
    yield Rule(
        "Physx*Deformable* OmniPhysics*Deformable* Physx*Cloth* PhysxPhysicsAttachment PhysxAutoAttachmentAPI",
        "refused",
        f"walls are stiff: what deforms is not read; {OUT}",
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
        'fills nothing here: take it out, and fill the wall by dem:list = "grains" with dem:fill:wall',
    )
    # graphs of Omniverse set attributes while they run
    yield Rule(
        "OmniGraphNode",
        "refused",
        "the node of a conveyor is not run: the belt would stand still; make its graph inactive",
        lambda prim: "conveyor" in str(prim.values.get("node:type", "")).lower(),
    )
    yield Rule("OmniGraph", "noted", "the graph is not run")
    yield Rule("OmniGraphNode node:type", "taken")  # noted with its graph
    # all else
    yield Rule("Physics* physics:* *:physics:*", "noted", "not taken")
    yield Rule("*", "noted", "settings of another program, not taken")


RULES = tuple(_rules())
"""What becomes of physics, the first rule that fits being the one that counts."""


def rule_of(name: str, prim: Prim) -> Rule:
    """The rule that answers for a type, schema or attribute of a prim."""
    return next(rule for rule in RULES if rule.fits(name, prim))
