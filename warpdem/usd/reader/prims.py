"""Queries on prims: ancestors, transforms, and attribute values for JSON."""

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.errors import Refused

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom


def all_prims(stage: "Usd.Stage") -> "Usd.PrimRange":
    """All active, defined prims of a stage, including those within instances."""
    from pxr import Usd

    return Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())


def stage_units(stage: "Usd.Stage") -> dict[str, Any]:
    """Units, up axis and time scale of a stage, and those of them that the file does not state."""
    from pxr import UsdGeom

    unsaid = [] if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else ["metersPerUnit (0.01 then, by the rules of USD)"]
    unsaid += [] if stage.HasAuthoredMetadata("upAxis") else ["upAxis (Y then, by the rules of USD)"]
    metres, rate = UsdGeom.GetStageMetersPerUnit(stage), stage.GetTimeCodesPerSecond()
    for name, value in (("metersPerUnit", metres), ("timeCodesPerSecond", rate)):
        if not (np.isfinite(value) and value > 0.0):
            raise Refused(f"{name} = {value:g}, must be above 0")
    return {"metres": metres, "rate": rate, "up": str(UsdGeom.GetStageUpAxis(stage)), "unsaid": unsaid}


def prim_at(stage: "Usd.Stage", path: str, wanted: str) -> "Usd.Prim":
    """The prim at a path, active and defined.

    Raises:
        Refused: There is none; the text names the prims of the schema ``wanted``.
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


def ancestors(prim: "Usd.Prim") -> "list[Usd.Prim]":
    """Ancestors of a prim, the nearest first."""
    found = []
    while not prim.IsPseudoRoot() and not (prim := prim.GetParent()).IsPseudoRoot():
        found.append(prim)
    return found


def ancestor_paths(path: str) -> list[str]:
    """Paths of the ancestors of a prim, the nearest first."""
    parts = path.split("/")
    return ["/".join(parts[:n]) for n in range(len(parts) - 1, 1, -1)]


def world_matrix(cache: "UsdGeom.XformCache", prim: "Usd.Prim") -> np.ndarray:
    """Local-to-world matrix for column vectors, shape (4, 4)."""
    matrix = np.array(cache.GetLocalToWorldTransform(prim)).T
    if not np.isfinite(matrix).all():
        raise Refused(f"{prim.GetPath()}: its transform holds a number that is not finite")
    return matrix


def sample_codes(prim: "Usd.Prim") -> set[float]:
    """Time codes of the transform samples of a prim and its ancestors."""
    from pxr import UsdGeom

    codes: set[float] = set()
    while prim and not prim.IsPseudoRoot():
        xform = UsdGeom.Xformable(prim)
        codes |= set(xform.GetTimeSamples()) if xform else set()
        prim = None if xform and xform.GetResetXformStack() else prim.GetParent()
    return codes


def has_samples(prim: "Usd.Prim") -> bool:
    """Whether the prim's own transform has time samples."""
    from pxr import UsdGeom

    xform = UsdGeom.Xformable(prim)
    return bool(xform and xform.GetTimeSamples())


def constant_values(prim: "Usd.Prim", *names: str) -> list[Any]:
    """Values of attributes that do not change with time.

    Raises:
        Refused: An attribute is missing or has time samples.
    """
    values = []
    for name in names:
        attribute = prim.GetAttribute(name)
        if attribute.ValueMightBeTimeVarying():
            raise Refused(f"{prim.GetPath()}: its {name} change with time: it may move, but not change its shape")
        value = attribute.Get(0.0)
        if value is None:
            raise Refused(f"{prim.GetPath()} has no {name}")
        values.append(value)
    return values


def json_value(attribute: "Usd.Attribute") -> object:
    """Value of an attribute for JSON; a single-precision number becomes the shortest decimal that rounds to it."""
    value = attribute.Get(0.0)
    if attribute.GetTypeName().scalarType == "asset":
        if hasattr(value, "__len__"):
            raise Refused(f"{attribute.GetPath()}: a list of files is not read")
        return {"file": value.path, "found": value.resolvedPath}
    if isinstance(value, (bool, int, str)):
        return value
    numbers = np.array(value)
    if numbers.dtype.kind not in "fiub":
        return [str(entry) for entry in value]
    single = re.search(r"float|half|Vec\d[fh]", attribute.GetTypeName().type.typeName)
    return (shortest(numbers) if single else numbers).tolist()


def shortest(numbers: np.ndarray) -> np.ndarray:
    """The shortest decimals that round to single-precision numbers, in float64: 9.81, not 9.8100004."""
    return numbers.astype(np.float32).astype("U32").astype(np.float64) if numbers.dtype.kind == "f" else numbers


def value_at(source: "Usd.Attribute | UsdGeom.Primvar", code: float) -> Any:
    """Value of an attribute or primvar at a time code; an indexed primvar is expanded."""
    return source.ComputeFlattened(code) if getattr(source, "IsIndexed", bool)() else source.Get(code)
