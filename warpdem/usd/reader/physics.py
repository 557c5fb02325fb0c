"""What a prim states about physics, in any program's schemas, and in the scene's own attributes ``dem:``."""

import re

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import has_samples, plain

PHYSICS = re.compile(r"(physics|physx|newton|mjc|omniphysics|omnigraph|isaac)", re.IGNORECASE)
"""Beginnings of the names of schemas, and of parts of the names of attributes, that are about physics."""


def physics_of(prim, kind: str) -> dict:
    """What a prim says about physics, in schemas and attributes known here or not; empty if nothing.

    Returns:
        The fields of `warpdem.usd.schemas.Prim`.
    """
    from pxr import Usd

    info = prim.GetPrimTypeInfo()
    kind_of_prim = str(info.GetTypeName())
    schemas = [str(name) for name in info.GetAppliedAPISchemas() if PHYSICS.match(str(name))]
    values, sampled = {}, []
    for prop in prim.GetAuthoredProperties():
        name = prop.GetName()
        if not any(PHYSICS.match(part) for part in name.split(":")) and name != "node:type":
            continue
        if name.startswith(("material:binding", "dem:", "primvars:")):
            continue
        if isinstance(prop, Usd.Relationship):
            values[name] = [str(target) for target in prop.GetTargets()]
        elif prop.HasAuthoredValue():
            values[name] = brief(prop)
            sampled += [name] if prop.ValueMightBeTimeVarying() else []
    physical = kind_of_prim if PHYSICS.match(kind_of_prim) else ""
    if not (physical or schemas or values):
        return {}
    said = {"path": str(prim.GetPath()), "type": physical, "schemas": schemas, "values": values, "sampled": sampled}
    return {**said, "kind": kind, "moves": has_samples(prim)}


def brief(attribute) -> object:
    """Value of an attribute of another program as JSON has it; of long ones their length."""
    value = attribute.Get(0.0)
    if isinstance(value, (bool, int, float, str)):
        return value
    if hasattr(value, "__len__") and len(value) > 16:
        return f"{len(value)} values"
    try:
        numbers = np.array(value)
    except (TypeError, ValueError):
        return str(value)
    return numbers.tolist() if numbers.dtype.kind in "fiub" else str(value)


def dem_tables(prim) -> dict[str, object]:
    """Values of the attributes ``dem:KEY``, and names or targets of the relationships, by KEY."""
    from pxr import Usd

    found: dict[str, object] = {}
    for prop in prim.GetAuthoredPropertiesInNamespace("dem"):
        key = prop.GetName().removeprefix("dem:")
        if isinstance(prop, Usd.Relationship):
            found[key] = {"targets": [str(target) for target in prop.GetTargets()]}
        elif prop.HasAuthoredValue():
            if prop.ValueMightBeTimeVarying():
                raise Refused(f"{prop.GetPath()} changes with time; dem: attributes have one value")
            found[key] = plain(prop)
    return found
