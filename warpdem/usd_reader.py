"""Program that opens a USD file and hands back plain arrays; `warpdem.usd_stage` runs it in a process of its own.

A damaged file can make the USD library crash, loop or ask for any amount of memory; here that ends this process and not
the run. Run as ``python usd_reader.py geometry|motion FILE [PRIM]``; the answer on standard output is an .npz archive whose
array ``answer`` is a text in JSON: either what the file says, or ``{"refused": reason}``. This file imports nothing of the
package, so that it starts fast.
"""

import contextlib
import io
import json
import os
import sys
from pathlib import Path

import numpy as np

MEMORY_SLACK = 512 << 20
"""Memory that reading may take beyond `MEMORY_SHARE` times the file [bytes]."""
MEMORY_SHARE = 10
"""Memory that reading may take per byte of the files it opens [-]."""
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


class Refused(Exception):
    """The file cannot be used; the text says why."""


def limit_memory(size: int) -> None:
    """Let this process take at most so much more memory for files of ``size`` bytes, where the system can hold it to that."""
    try:
        import resource

        status = Path("/proc/self/status").read_text()
        used = int(status.split("VmData:")[1].split()[0]) * 1024
        resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY_SLACK + MEMORY_SHARE * size, resource.RLIM_INFINITY))
    except (ImportError, OSError, ValueError, IndexError):
        return  # another system than Linux, or one that allows less already: the time limit remains


def open_stage(file: str):
    """The stage of a file, with all that it refers to.

    Raises:
        Refused: it cannot be opened or composed.
    """
    from pxr import Usd

    limit_memory(os.path.getsize(file))
    stage = Usd.Stage.Open(file)
    layers = [layer.realPath for layer in stage.GetUsedLayers()]
    limit_memory(sum(os.path.getsize(path) for path in layers if path and os.path.isfile(path)))
    errors = stage.GetCompositionErrors()
    if errors:
        raise Refused(f"what it refers to cannot be put together: {str(errors[0])[:300]}")
    return stage


def units_of(stage) -> dict:
    """Units, upright axis and time scale of a stage, and what of it the file does not say."""
    from pxr import UsdGeom

    unsaid = [] if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else ["metersPerUnit (0.01 then, by the rules of USD)"]
    unsaid += [] if stage.HasAuthoredMetadata("upAxis") else ["upAxis (Y then, by the rules of USD)"]
    metres, rate = UsdGeom.GetStageMetersPerUnit(stage), stage.GetTimeCodesPerSecond()
    for name, value in (("metersPerUnit", metres), ("timeCodesPerSecond", rate)):
        if not (np.isfinite(value) and value > 0.0):
            raise Refused(f"{name} = {value:g}, must be above 0")
    return {"metres": metres, "rate": rate, "up": str(UsdGeom.GetStageUpAxis(stage)), "unsaid": unsaid}


def prim_at(stage, path: str, wanted: str):
    """The prim of a path, live and defined.

    Raises:
        Refused: there is none; names those that are a ``wanted``.
    """
    from pxr import Sdf, Usd, UsdGeom

    prim = stage.GetPrimAtPath(path) if Sdf.Path.IsValidPathString(path) else None
    if prim and prim.IsActive() and prim.IsDefined() and not prim.IsAbstract():
        return prim
    schema = getattr(UsdGeom, wanted)
    everything = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    there = [str(p.GetPath()) for p in everything if p.IsA(schema)]
    listed = ", ".join(there[:8]) + (f" and {len(there) - 8} more" if len(there) > 8 else "")
    raise Refused(f"prim = {path!r}: no such prim; there is {listed or 'none'}")


def matrix_of(cache, prim) -> np.ndarray:
    """Local-to-world matrix for column vectors, shape (4, 4)."""
    matrix = np.array(cache.GetLocalToWorldTransform(prim)).T
    if not np.isfinite(matrix).all():
        raise Refused(f"{prim.GetPath()}: its transform holds a number that is not finite")
    return matrix


def sample_codes(prim) -> set[float]:
    """Time codes at which a prim or something it stands in has another transform."""
    from pxr import UsdGeom

    codes: set[float] = set()
    while prim and not prim.IsPseudoRoot():
        xform = UsdGeom.Xformable(prim)
        codes |= set(xform.GetTimeSamples()) if xform else set()
        prim = None if xform and xform.GetResetXformStack() else prim.GetParent()
    return codes


def read_motion(stage, path: str) -> tuple[dict, dict[str, np.ndarray]]:
    """Time codes (m,) and local-to-world matrices (m, 4, 4) of the samples of a prim."""
    from pxr import UsdGeom

    prim = prim_at(stage, path, "Xformable")
    if not prim.IsA(UsdGeom.Xformable):
        raise Refused(f"prim = {path!r} is nothing that can move")
    codes = sorted(sample_codes(prim))
    if not codes:
        raise Refused(f"prim = {path!r}: neither it nor what it stands in has time samples: it never moves")
    matrices = np.array([matrix_of(UsdGeom.XformCache(code), prim) for code in codes])
    return {}, {"codes": np.array(codes), "matrices": matrices}


def read_geometry(stage, path: str) -> tuple[dict, dict[str, np.ndarray]]:
    """All surfaces at and below a prim (or of the stage) at time 0, in their own axes with their matrices.

    What is invisible or meant as a guide or a stand-in is left out, unless it is the very prim that is named.
    """
    from pxr import Usd, UsdGeom

    top = prim_at(stage, path, "Gprim") if path else stage.GetPseudoRoot()
    surfaces, arrays, left_out = [], {}, []
    cache = UsdGeom.XformCache(0.0)
    for prim in Usd.PrimRange(top, Usd.TraverseInstanceProxies()):
        name = str(prim.GetPath())
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
    return {"surfaces": surfaces, "left_out": left_out}, arrays


def about(prim) -> dict:
    """Winding of a surface and the name of its material."""
    from pxr import UsdGeom, UsdShade

    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    return {
        "left_handed": UsdGeom.Gprim(prim).GetOrientationAttr().Get(0.0) == UsdGeom.Tokens.leftHanded,
        "material": str(material.GetPath()) if material else "",
    }


def still(prim, *names: str) -> list:
    """Values of attributes that do not change with time.

    Raises:
        Refused: one is missing or has time samples.
    """
    values = []
    for name in names:
        attribute = prim.GetAttribute(name)
        if attribute.ValueMightBeTimeVarying():
            raise Refused(f"{prim.GetPath()}: its {name} change with time: only its place may move, not its shape")
        value = attribute.Get(0.0)
        if value is None:
            raise Refused(f"{prim.GetPath()} has no {name}")
        values.append(value)
    return values


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


def answer(what: str, file: str, path: str) -> dict[str, np.ndarray]:
    """All arrays of the answer to one question."""
    from pxr import Tf

    arrays: dict[str, np.ndarray] = {}
    try:
        stage = open_stage(file)
        said, arrays = {"geometry": read_geometry, "motion": read_motion}[what](stage, path)
        said |= units_of(stage)
    except Refused as refused:
        said = {"refused": str(refused)}
    except MemoryError:
        said = {"refused": "reading it takes far more memory than the file is long: damaged?"}
    except (Tf.ErrorException, RuntimeError) as error:
        try:
            text = " ".join(str(error).split())
        except UnicodeDecodeError:  # the library quotes the bytes it stumbled over
            text = "it holds bytes that are no text"
        said = {"refused": f"cannot be read as USD: {text[:400] or type(error).__name__}"}
    return {"answer": np.array(json.dumps(said)), **arrays}


def main() -> None:
    """Answer the question of the command line."""
    what, file, path = (*sys.argv[1:], "")[:3]
    # the answer alone goes to standard output: what libraries print goes to standard error
    with open(os.dup(1), "wb") as out:
        os.dup2(2, 1)
        held = io.BytesIO()
        with contextlib.suppress(BrokenPipeError):
            np.savez(held, **answer(what, file, path))
            out.write(held.getbuffer())


if __name__ == "__main__":
    main()
