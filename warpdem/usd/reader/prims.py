"""What prims are asked for: their ancestors, transforms, and values of attributes as JSON holds them."""

import re

import numpy as np

from warpdem.usd.reader.errors import Refused


def all_prims(stage):
    """All live, defined prims of a stage, those within instances too."""
    from pxr import Usd

    return Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())


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


def carriers(prim) -> list:
    """What a prim stands in, the nearest first."""
    found = []
    while not prim.IsPseudoRoot() and not (prim := prim.GetParent()).IsPseudoRoot():
        found.append(prim)
    return found


def above_of(path: str) -> list[str]:
    """Paths of what a prim stands in, the nearest first."""
    parts = path.split("/")
    return ["/".join(parts[:n]) for n in range(len(parts) - 1, 1, -1)]


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


def has_samples(prim) -> bool:
    """Whether the own transform of a prim has time samples."""
    from pxr import UsdGeom

    xform = UsdGeom.Xformable(prim)
    return bool(xform and xform.GetTimeSamples())


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


def plain(attribute) -> object:
    """Value of an attribute as JSON has it; a single-precision number is the shortest decimal that rounds to it."""
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
    """The float64 that stand for single-precision numbers: 9.81, not 9.8100004."""
    return numbers.astype(np.float32).astype("U32").astype(np.float64) if numbers.dtype.kind == "f" else numbers


def value_at(source, code: float):
    """Value of an attribute or primvar at a time code; one with indices is spread out by them."""
    return source.ComputeFlattened(code) if getattr(source, "IsIndexed", bool)() else source.Get(code)
