"""The USD layers of a result that hold no frames: root layer, walls, and the grains for no time in particular."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpdem.core.pose import FramePose, RotationPart, SampledPart, TranslationPart
from warpdem.core.snapshot import WallMesh
from warpdem.filling.clump_template import ClumpTemplate
from warpdem.output import usd_clumps
from warpdem.output.usd_attributes import DISPLAY, GRAINS, STATE, extent, usd_value
from warpdem.scene.write_usd import WALLS as _WALLS
from warpdem.scene.write_usd import set_units

if TYPE_CHECKING:
    from pxr import Sdf, Usd

FRAME = "/World/Frame"
_SAND = (0.85, 0.68, 0.42)
_GLASS = (0.70, 0.78, 0.85)
PLACEMENT_OPS = ("xformOp:translate", "xformOp:orient")


def root_layer(
    frame: FramePose, wall_paths: list[str], rate: float, templates: list[ClumpTemplate] | None
) -> Sdf.Layer:
    """Root layer without frames: units, prims, transform ops, grains and clumps, or with None as ``templates`` neither."""
    from pxr import Usd, UsdGeom

    layer = _timed_layer(rate)
    stage = Usd.Stage.Open(layer)
    stage.SetFramesPerSecond(25.0)
    UsdGeom.Xform.Define(stage, "/World")
    _author_frame_ops(stage, frame)
    if templates is not None:
        _define_grains(stage, templates)
    for path in wall_paths:
        wall = UsdGeom.Xformable(stage.OverridePrim(path))
        wall.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble)
        wall.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    return layer


def piece_layer(rate: float, templates: list[ClumpTemplate]) -> Sdf.Layer:
    """Layer of the grains and clumps of one rank, without frames."""
    from pxr import Usd, UsdGeom

    layer = _timed_layer(rate)
    stage = Usd.Stage.Open(layer)
    for path in ("/World", FRAME):
        UsdGeom.Xform.Define(stage, path)
    _define_grains(stage, templates)
    return layer


def _timed_layer(rate: float) -> Sdf.Layer:
    """Layer with units, ``rate`` time codes in one second."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usda")
    set_units(layer)
    layer.timeCodesPerSecond = rate
    return layer


def _define_grains(stage: Usd.Stage, templates: list[ClumpTemplate]) -> None:
    """Define grains and clumps, without frames."""
    from pxr import Gf, Sdf, UsdGeom, Vt

    grains = UsdGeom.Points.Define(stage, GRAINS)
    # a stage has only those attributes of its clips that a layer declares
    for one in (*DISPLAY, *STATE):
        if one.name.startswith("primvars:"):
            kind = Sdf.ValueTypeNames.Find(one.kind)
            UsdGeom.PrimvarsAPI(grains).CreatePrimvar(one.name.removeprefix("primvars:"), kind, UsdGeom.Tokens.vertex)
    grains.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_SAND)]))
    if templates:
        usd_clumps.define_clumps(stage, templates)


def _author_frame_ops(stage: Usd.Stage, frame: FramePose) -> None:
    """One group of transform ops for each motion of the frame, outermost first; angles are not wrapped.

    A rotation is x = o + B Rz(angle) B^T (x' - o), B the constant turn that takes z onto the axis. An orient op would be
    shorter, but quaternions lose whole turns between two frames, and so do matrices; only a sampled motion, which has no
    axis of its own, is given by one.
    """
    from pxr import Gf, UsdGeom

    xform = UsdGeom.Xform.Define(stage, FRAME)
    double = UsdGeom.XformOp.PrecisionDouble
    ops = []
    for k, part in enumerate(frame.parts):
        if isinstance(part, TranslationPart):
            ops.append(xform.AddTranslateOp(double, f"shift{k}"))
        elif isinstance(part, SampledPart):
            ops += [xform.AddTranslateOp(double, f"shift{k}"), xform.AddOrientOp(double, f"turn{k}")]
        else:
            x, y, z = (float(c) for c in part.axis)
            tilt = Gf.Vec3d(0.0, np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x)))
            there = [xform.AddTranslateOp(double, f"origin{k}"), xform.AddRotateXYZOp(double, f"axis{k}")]
            there[0].Set(Gf.Vec3d(*(float(c) for c in part.origin)))
            there[1].Set(tilt)
            angle = xform.AddRotateZOp(double, f"angle{k}")
            back = [xform.AddRotateXYZOp(double, f"axis{k}", True), xform.AddTranslateOp(double, f"origin{k}", True)]
            ops += [*there, angle, *back]
    # the order that the calls above wrote would win over the variants
    xform.GetPrim().RemoveProperty("xformOpOrder")
    views = xform.GetPrim().GetVariantSets().AddVariantSet("view")
    for view, order in {"frame": [], "laboratory": ops}.items():
        views.AddVariant(view)
        views.SetVariantSelection(view)
        with views.GetVariantEditContext():
            xform.SetXformOpOrder(order)


def frame_samples(frame: FramePose) -> dict[str, object]:
    """Values of the ops of the frame that change with time, by attribute path."""
    from pxr import Gf

    samples: dict[str, object] = {}
    for k, part in enumerate(frame.parts):
        if isinstance(part, RotationPart):
            samples[f"{FRAME}.xformOp:rotateZ:angle{k}"] = float(np.degrees(part.angle))
            continue
        samples[f"{FRAME}.xformOp:translate:shift{k}"] = Gf.Vec3d(*part.shift.tolist())
        if isinstance(part, SampledPart):
            w, *v = part.quaternion.tolist()
            samples[f"{FRAME}.xformOp:orient:turn{k}"] = Gf.Quatd(w, *v)
    return samples


def fixed_motions(frame: FramePose) -> list[tuple[object, ...]]:
    """What must not change during a run: the kinds of the frame's motions, and axes and origins of rotations."""
    return [
        (type(part), *part.axis.tolist(), *part.origin.tolist()) if isinstance(part, RotationPart) else (type(part),)
        for part in frame.parts
    ]


def walls_layer(walls: list[WallMesh], paths: dict[str, str], loaded: dict[str, str]) -> Sdf.Layer:
    """Layer with the wall meshes in their body axes; those in ``loaded`` have room for a pressure."""
    from pxr import Gf, Sdf, Usd, UsdGeom, Vt

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    set_units(layer)
    stage = Usd.Stage.Open(layer)
    UsdGeom.Scope.Define(stage, _WALLS)
    for wall in walls:
        mesh = UsdGeom.Mesh.Define(stage, paths[wall.name])
        points = np.ascontiguousarray(wall.vertices, dtype=np.float32)
        mesh.GetPrim().SetDisplayName(wall.name)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(wall.triangles), 3, dtype=np.int32)))
        mesh.CreateFaceVertexIndicesAttr(
            Vt.IntArray.FromNumpy(np.ascontiguousarray(wall.triangles, dtype=np.int32).ravel())
        )
        mesh.CreateExtentAttr(usd_value("float3[]", extent(points)))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*_GLASS)]))
        mesh.CreateDisplayOpacityAttr(Vt.FloatArray([0.3]))
        if wall.name in loaded:
            UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("pressure", Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.uniform)
    return layer


def describe_grains(prim: Sdf.PrimSpec, groups: list[str], materials: list[str]) -> None:
    """Make the grains colliders, and say what the numbers of the state stand for: names of groups, and prims of materials."""
    from pxr import Sdf, Vt

    prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["PhysicsCollisionAPI"]))
    listed = Sdf.AttributeSpec(prim, "dem:groups", Sdf.ValueTypeNames.StringArray, Sdf.VariabilityUniform)
    listed.default = Vt.StringArray(groups)
    of = Sdf.RelationshipSpec(prim, "dem:materials", custom=True)
    for path in materials:
        of.targetPathList.explicitItems.append(path)


def first_layer(shown: dict[str, object]) -> Sdf.Layer:
    """Layer with places and sizes of the grains and clumps of a frame, for no time in particular."""
    from pxr import Sdf

    layer = Sdf.Layer.CreateAnonymous(".usdc")
    set_units(layer)
    grains = Sdf.CreatePrimInLayer(layer, GRAINS)
    for one in DISPLAY:
        if one.name in ("points", "widths", "extent"):
            attribute = Sdf.AttributeSpec(grains, one.name, Sdf.ValueTypeNames.Find(one.kind))
            attribute.default = shown[f"{GRAINS}.{one.name}"]
    for clump in usd_clumps.DISPLAY:
        path = f"{usd_clumps.CLUMPS}.{clump.name}"
        if clump.name in usd_clumps.AT_ANY_TIME and path in shown:
            prim = Sdf.CreatePrimInLayer(layer, usd_clumps.CLUMPS)
            Sdf.AttributeSpec(prim, clump.name, Sdf.ValueTypeNames.Find(clump.kind)).default = shown[path]
    return layer
