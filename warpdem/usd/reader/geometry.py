"""The surfaces of a prim or of a whole stage: meshes and primitive shapes at time 0."""

from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.physics import stated_physics
from warpdem.usd.reader.prims import ancestors, constant_values, prim_at, sample_codes, world_matrix

if TYPE_CHECKING:
    from pxr import Usd

SHAPES = {
    "Cube": ("size",),
    "Sphere": ("radius",),
    "Cylinder": ("radius", "height", "axis"),
    "Cone": ("radius", "height", "axis"),
    "Capsule": ("radius", "height", "axis"),
    "Plane": ("width", "length", "axis"),
}
"""Primitive shapes and the attributes that define them."""
WITHOUT_SURFACE = ("Points", "Curves")
"""Suffixes of the names of schemas without a surface, which are left out."""


def read_geometry(stage: "Usd.Stage", path: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """All surfaces of a prim and its descendants (or of the stage) at time 0, in their own axes, with their matrices.

    Invisible prims, guides and proxies are left out, unless named themselves.
    """
    from pxr import Usd, UsdGeom

    top = prim_at(stage, path, "Gprim") if path else stage.GetPseudoRoot()
    surfaces: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    left_out: list[str] = []
    noticed, physics = [], [note for note in map(physics_note, ancestors(top)) if note]
    cache = UsdGeom.XformCache(0.0)
    for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies()):
        name = str(prim.GetPath())
        physics += [note] if (note := physics_note(prim)) else []
        if prim != top and prim.HasAttribute("visibility") and prim.GetAttribute("visibility").ValueMightBeTimeVarying():
            noticed.append(f"{name}: its visibility changes with time; its state at time 0 is used")
        if prim.IsA(UsdGeom.PointInstancer):
            raise Refused(f"{name} is a point instancer, which is not read; replace its instances by prims")
        if not prim.IsA(UsdGeom.Gprim):
            continue
        kind = str(prim.GetTypeName())
        shown = UsdGeom.Imageable(prim)
        if prim != top and shown.ComputeVisibility(0.0) == "invisible":
            left_out.append(f"{name} (invisible)")
        elif prim != top and shown.ComputePurpose() in ("guide", "proxy"):
            left_out.append(f"{name} (purpose {shown.ComputePurpose()})")
        elif kind.endswith(WITHOUT_SURFACE):
            left_out.append(f"{name} ({kind} has no surface)")
        elif kind == "Mesh" or kind in SHAPES:
            surface, content = mesh_polygons(prim) if kind == "Mesh" else shape_sizes(prim, kind)
            matrix = world_matrix(cache, prim)
            moves = bool(sample_codes(prim))
            surfaces.append({"path": name, "kind": kind, "moves": moves, **surface, **winding_and_material(prim)})
            arrays |= {f"{len(surfaces) - 1}.{key}": values for key, values in {**content, "matrix": matrix}.items()}
        else:
            raise Refused(f"{name} is a {kind}; supported are Mesh, {', '.join(SHAPES)}")
    if not surfaces:
        more = f"; left out: {', '.join(left_out[:8])}" if left_out else ""
        where = f"prim = {path!r}" if path else "it"
        raise Refused(f"{where} holds no surface (no Mesh, {', '.join(SHAPES)}){more}")
    if not path and len(surfaces) > 1:
        names = ", ".join(surface["path"] for surface in surfaces[:8]) + (" and more" if len(surfaces) > 8 else "")
        raise Refused(
            f"the stage holds {len(surfaces)} surfaces ({names}): select one, or a common ancestor, with prim"
        )
    return {"surfaces": surfaces, "left_out": left_out, "noticed": noticed, "physics": physics}, arrays


def physics_note(prim: "Usd.Prim") -> str:
    """Text of the physics of a prim, which geometry leaves out; empty if it has none, or is only a collider."""
    physics = stated_physics(prim, "")
    names = [name for name in (physics.get("schemas") or physics.get("values", ())) if name != "PhysicsCollisionAPI"]
    return f"{prim.GetPath()} ({', '.join(names)})" if names else ""


def winding_and_material(prim: "Usd.Prim") -> dict[str, Any]:
    """Winding of a surface and the name of its material."""
    from pxr import UsdGeom, UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    return {
        "left_handed": UsdGeom.Gprim(prim).GetOrientationAttr().Get(0.0) == UsdGeom.Tokens.leftHanded,
        "material": str(material.GetPath()) if material else "",
    }


def mesh_polygons(prim: "Usd.Prim") -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Points (v, 3), counts and indices of the polygons of a mesh, and its holes."""
    from pxr import UsdGeom

    if prim.HasProperty("primvars:skel:jointIndices"):
        raise Refused(f"{prim.GetPath()} is bound to a skeleton, which is not read")
    points, counts, indices = map(np.array, constant_values(prim, "points", "faceVertexCounts", "faceVertexIndices"))
    mesh = UsdGeom.Mesh(prim)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(0.0) or (), dtype=np.int64)
    scheme = mesh.GetSubdivisionSchemeAttr()
    smooth = str(scheme.Get()) if scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none else ""
    content = {"points": points.reshape(-1, 3), "counts": counts.ravel(), "indices": indices.ravel(), "holes": holes}
    return {"subdivision": smooth}, content


def shape_sizes(prim: "Usd.Prim", kind: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Sizes of a primitive shape in its own units, and its axis."""
    sizes = {name: value for name, value in zip(SHAPES[kind], constant_values(prim, *SHAPES[kind]), strict=True)}
    axis = str(sizes.pop("axis", "Z"))
    for name, value in sizes.items():
        if not (np.isfinite(value) and value > 0.0):
            raise Refused(f"{prim.GetPath()}: {name} = {value:g}, must be above 0")
    return {"sizes": {name: float(value) for name, value in sizes.items()}, "axis": axis}, {}
