"""The surfaces of a prim or of a whole stage: meshes and primitive shapes at time 0."""

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.physics import physics_of
from warpdem.usd.reader.prims import carriers, matrix_of, prim_at, sample_codes, still

SHAPES = {
    "Cube": ("size",),
    "Sphere": ("radius",),
    "Cylinder": ("radius", "height", "axis"),
    "Cone": ("radius", "height", "axis"),
    "Capsule": ("radius", "height", "axis"),
    "Plane": ("width", "length", "axis"),
}
"""Primitive shapes and the attributes that make them."""
WITHOUT_SURFACE = ("Points", "Curves")
"""Ends of the schema names of what has no surface and is left out."""


def read_geometry(stage, path: str) -> tuple[dict, dict[str, np.ndarray]]:
    """All surfaces at and below a prim (or of the stage) at time 0, in their own axes with their matrices.

    What is invisible or meant as a guide or a stand-in is left out, unless it is the very prim that is named.
    """
    from pxr import Usd, UsdGeom

    top = prim_at(stage, path, "Gprim") if path else stage.GetPseudoRoot()
    surfaces, arrays, left_out = [], {}, []
    noticed, physics = [], [words for words in map(physics_words, carriers(top)) if words]
    cache = UsdGeom.XformCache(0.0)
    for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies()):
        name = str(prim.GetPath())
        physics += [words] if (words := physics_words(prim)) else []
        if prim != top and prim.HasAttribute("visibility") and prim.GetAttribute("visibility").ValueMightBeTimeVarying():
            noticed.append(f"{name}: its visibility changes with time; it is taken as it is at time 0")
        if prim.IsA(UsdGeom.PointInstancer):
            raise Refused(f"{name} is a point instancer, which is not read; make its instances prims of their own")
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
            surface, held = mesh_of(prim) if kind == "Mesh" else shape_of(prim, kind)
            matrix = matrix_of(cache, prim)
            surfaces.append({"path": name, "kind": kind, "moves": bool(sample_codes(prim)), **surface, **about(prim)})
            arrays |= {f"{len(surfaces) - 1}.{key}": values for key, values in {**held, "matrix": matrix}.items()}
        else:
            raise Refused(f"{name} is a {kind}; read are Mesh, {', '.join(SHAPES)}")
    if not surfaces:
        more = f"; left out: {', '.join(left_out[:8])}" if left_out else ""
        where = f"prim = {path!r}" if path else "it"
        raise Refused(f"{where} holds no surface (no Mesh, {', '.join(SHAPES)}){more}")
    if not path and len(surfaces) > 1:
        names = ", ".join(surface["path"] for surface in surfaces[:8]) + (" and more" if len(surfaces) > 8 else "")
        raise Refused(
            f"the stage holds {len(surfaces)} surfaces ({names}): say with prim which one, or what they stand in"
        )
    return {"surfaces": surfaces, "left_out": left_out, "noticed": noticed, "physics": physics}, arrays


def physics_words(prim) -> str:
    """The physics of a prim in words, which geometry leaves out; empty if it has none, or is no more than a collider."""
    said = physics_of(prim, "")
    names = [name for name in (said.get("schemas") or said.get("values", ())) if name != "PhysicsCollisionAPI"]
    return f"{prim.GetPath()} ({', '.join(names)})" if names else ""


def about(prim) -> dict:
    """Winding of a surface and the name of its material."""
    from pxr import UsdGeom, UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    return {
        "left_handed": UsdGeom.Gprim(prim).GetOrientationAttr().Get(0.0) == UsdGeom.Tokens.leftHanded,
        "material": str(material.GetPath()) if material else "",
    }


def mesh_of(prim) -> tuple[dict, dict[str, np.ndarray]]:
    """Points (v, 3), counts and indices of the polygons of a mesh without its holes."""
    from pxr import UsdGeom

    if prim.HasProperty("primvars:skel:jointIndices"):
        raise Refused(f"{prim.GetPath()} is bound to a skeleton, which is not read")
    points, counts, indices = map(np.array, still(prim, "points", "faceVertexCounts", "faceVertexIndices"))
    mesh = UsdGeom.Mesh(prim)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(0.0) or (), dtype=np.int64)
    scheme = mesh.GetSubdivisionSchemeAttr()
    smooth = str(scheme.Get()) if scheme.HasAuthoredValue() and scheme.Get() != UsdGeom.Tokens.none else ""
    held = {"points": points.reshape(-1, 3), "counts": counts.ravel(), "indices": indices.ravel(), "holes": holes}
    return {"subdivision": smooth}, held


def shape_of(prim, kind: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Lengths of a primitive shape in its own units, and its axis."""
    sizes = {name: value for name, value in zip(SHAPES[kind], still(prim, *SHAPES[kind]), strict=True)}
    axis = str(sizes.pop("axis", "Z"))
    for name, value in sizes.items():
        if not (np.isfinite(value) and value > 0.0):
            raise Refused(f"{prim.GetPath()}: {name} = {value:g}, must be above 0")
    return {"sizes": {name: float(value) for name, value in sizes.items()}, "axis": axis}, {}
