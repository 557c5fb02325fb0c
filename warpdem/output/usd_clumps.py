"""Clumps in the USD results: a PointInstancer whose prototypes are the surfaces of their unions of spheres.

Attributes for viewers are in single precision; those in ``primvars:dem:`` are what a new scene starts from: centres of mass,
velocities and spins (frame axes, relative to the frame), quaternions (w, x, y, z) from the axes of the clump to the frame axes,
sizes, and numbers of the clump, of the material and of the group.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core.snapshot import ClumpShots, Snapshot
from warpdem.filling.clump_template import ClumpTemplate
from warpdem.mesh.sphere_mesh import union_mesh
from warpdem.output.usd_attributes import extent, usd_value
from warpdem.scene.write_usd import set_units, unused_paths

if TYPE_CHECKING:
    from pxr import Sdf, Usd

CLUMPS = "/World/Frame/Clumps"
"""Prim of the clumps."""
_NUT = (0.72, 0.50, 0.31)


@dataclass(frozen=True)
class Instances:
    """The clumps of a frame as instances of their templates."""

    shots: ClumpShots
    size: np.ndarray
    """Factors on the lengths of the templates [-], shape (c,)."""
    material: np.ndarray
    """Material index in the order of the scene, shape (c,)."""
    group: np.ndarray
    """Number of the group, of those of ``Scene.groups``, shape (c,)."""
    reach: float
    """Greatest distance of a surface from the centre of its clump [m]."""


@dataclass(frozen=True)
class ClumpAttribute:
    """An attribute of the prim of the clumps."""

    name: str
    """Its name."""
    kind: str
    """Name of its value type."""
    read: Callable[[Instances], np.ndarray]
    """Its values."""


DISPLAY = (
    ClumpAttribute("positions", "point3f[]", lambda c: c.shots.position),
    ClumpAttribute("orientations", "quath[]", lambda c: c.shots.orientation),  # what all viewers know
    ClumpAttribute("orientationsf", "quatf[]", lambda c: c.shots.orientation),  # goes before the other where it is known
    ClumpAttribute("scales", "float3[]", lambda c: np.repeat(c.size[:, None], 3, axis=1)),
    ClumpAttribute("protoIndices", "int[]", lambda c: c.shots.type),
    ClumpAttribute("ids", "int64[]", lambda c: c.shots.id),
    ClumpAttribute("velocities", "vector3f[]", lambda c: c.shots.velocity),
    ClumpAttribute("angularVelocities", "vector3f[]", lambda c: np.degrees(c.shots.spin)),  # degrees per second, as USD has it
    ClumpAttribute("primvars:group", "int[]", lambda c: c.group),
    ClumpAttribute("extent", "float3[]", lambda c: extent(c.shots.position, c.reach)),
)
"""Attributes of the clumps for viewers."""
STATE = (
    ClumpAttribute("primvars:dem:positions", "double3[]", lambda c: c.shots.position),
    ClumpAttribute("primvars:dem:velocities", "double3[]", lambda c: c.shots.velocity),
    ClumpAttribute("primvars:dem:spins", "double3[]", lambda c: c.shots.spin),
    ClumpAttribute("primvars:dem:orientations", "double4[]", lambda c: c.shots.orientation),
    ClumpAttribute("primvars:dem:sizes", "double[]", lambda c: c.size),
    ClumpAttribute("primvars:dem:clumps", "int[]", lambda c: c.shots.type),
    ClumpAttribute("primvars:dem:types", "int[]", lambda c: c.material),
    ClumpAttribute("primvars:dem:groups", "int[]", lambda c: c.group),
)
"""Attributes of the clumps to start from."""
AT_ANY_TIME = ("positions", "orientations", "orientationsf", "scales", "protoIndices", "extent")
"""Attributes that are there for readers that ask for no time."""


def types(attributes: tuple[ClumpAttribute, ...]) -> dict[str, str]:
    """Type of each attribute, by path."""
    return {f"{CLUMPS}.{one.name}": one.kind for one in attributes}


def clump_values(attributes: tuple[ClumpAttribute, ...], instances: Instances) -> dict[str, Any]:
    """Values of attributes of the clumps as the USD library holds them, by attribute path."""
    return {f"{CLUMPS}.{one.name}": usd_value(one.kind, one.read(instances)) for one in attributes}


def instances_of(snapshot: Snapshot, templates: list[ClumpTemplate]) -> Instances:
    """The clumps of a frame; ``templates`` in the order of the scene."""
    shots = snapshot.clumps
    assert shots is not None
    lead = np.searchsorted(snapshot.id, shots.id)  # the first member of each
    radius, reach = (np.array([value(one) for one in templates])[shots.type] for value in (_equal_radius, _reach))
    size = shots.radius / radius
    return Instances(shots, size, snapshot.type[lead], snapshot.group[lead], float((size * reach).max(initial=0.0)))


def _equal_radius(template: ClumpTemplate) -> float:
    return template.equal_radius


def _reach(template: ClumpTemplate) -> float:
    return float((np.linalg.norm(template.arm, axis=1) + template.radius).max())


def without_members(snapshot: Snapshot) -> Snapshot:
    """The same with those grains alone that are no members of clumps."""
    assert snapshot.clump is not None
    alone = snapshot.clump < 0
    names = ("id", "type", "group", "radius", "mass", "position", "velocity", "spin", "force", "orientation", "clump")
    return replace(snapshot, **{name: of[alone] for name in names if (of := getattr(snapshot, name)) is not None})


def define_clumps(stage: Usd.Stage, templates: list[ClumpTemplate]) -> None:
    """Define the instancer, without frames; its prototypes are in ``prototypes_layer``, in the order of the scene."""
    from pxr import Sdf, UsdGeom

    instancer = UsdGeom.PointInstancer.Define(stage, CLUMPS)
    for one in (*DISPLAY, *STATE):
        if one.name.startswith("primvars:"):
            kind = Sdf.ValueTypeNames.Find(one.kind)
            UsdGeom.PrimvarsAPI(instancer).CreatePrimvar(one.name.removeprefix("primvars:"), kind, UsdGeom.Tokens.vertex)
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path(path) for path in _prototypes(templates)])


def _prototypes(templates: list[ClumpTemplate]) -> list[str]:
    """Paths of the prototypes."""
    return unused_paths(f"{CLUMPS}/Prototypes", [one.name for one in templates])


def prototypes_layer(templates: list[ClumpTemplate]) -> Sdf.Layer:
    """Layer with the surface of each clump at size 1, in its axes in the scene about the centre of mass."""
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    set_units(layer)
    stage = Usd.Stage.Open(layer)
    UsdGeom.Scope.Define(stage, f"{CLUMPS}/Prototypes")
    for template, path in zip(templates, _prototypes(templates), strict=True):
        made = union_mesh(template.arm @ template.matrix.T, template.radius)
        mesh = UsdGeom.Mesh.Define(stage, path)
        mesh.CreatePointsAttr(usd_value("point3f[]", made.vertices))
        mesh.CreateNormalsAttr(usd_value("vector3f[]", made.normals))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateFaceVertexCountsAttr(usd_value("int[]", np.full(len(made.triangles), 3)))
        mesh.CreateFaceVertexIndicesAttr(usd_value("int[]", made.triangles.ravel()))
        mesh.CreateExtentAttr(usd_value("float3[]", extent(made.vertices)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_NUT)]))
    return layer


def describe_clumps(prim: Sdf.PrimSpec, clumps: list[str], groups: list[str], materials: list[str]) -> None:
    """Say what the numbers of the state stand for: names of clumps and groups, and prims of materials."""
    from pxr import Sdf, Vt

    for name, values in (("dem:clumps", clumps), ("dem:groups", groups)):
        listed = Sdf.AttributeSpec(prim, name, Sdf.ValueTypeNames.StringArray, Sdf.VariabilityUniform)
        listed.default = Vt.StringArray(values)
    of = Sdf.RelationshipSpec(prim, "dem:materials", custom=True)
    for path in materials:
        of.targetPathList.explicitItems.append(path)
