"""Physics stated by a prim: schemas and attributes of any program, and the scene's own attributes ``dem:``."""

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.prims import has_samples, json_value

if TYPE_CHECKING:
    from pxr import Usd

PHYSICS = re.compile(r"(physics|physx|newton|mjc|omniphysics|omnigraph|isaac)", re.IGNORECASE)
"""Prefixes of the names of schemas, and of parts of attribute names, that concern physics."""


def stated_physics(prim: "Usd.Prim", kind: str) -> dict[str, Any]:
    """Schemas and attributes of physics of a prim, known or unknown here; empty if there are none.

    Returns:
        The fields of `warpdem.usd.schemas.Prim`.
    """
    from pxr import Usd

    info = prim.GetPrimTypeInfo()
    kind_of_prim = str(info.GetTypeName())
    schemas = [str(name) for name in info.GetAppliedAPISchemas() if PHYSICS.match(str(name))]
    values: dict[str, object] = {}
    sampled: list[str] = []
    for prop in prim.GetAuthoredProperties():
        name = prop.GetName()
        if not any(PHYSICS.match(part) for part in name.split(":")) and name != "node:type":
            continue
        if name.startswith(("material:binding", "dem:", "primvars:")):
            continue
        if isinstance(prop, Usd.Relationship):
            values[name] = [str(target) for target in prop.GetTargets()]
        elif prop.HasAuthoredValue():
            values[name] = short_json_value(prop)
            sampled += [name] if prop.ValueMightBeTimeVarying() else []
    physical = kind_of_prim if PHYSICS.match(kind_of_prim) else ""
    if not (physical or schemas or values):
        return {}
    content = {"path": str(prim.GetPath()), "type": physical, "schemas": schemas, "values": values, "sampled": sampled}
    return {**content, "kind": kind, "moves": has_samples(prim)}


def short_json_value(attribute: "Usd.Attribute") -> object:
    """Value of an attribute of another program for JSON; of long arrays only their length."""
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


def dem_tables(prim: "Usd.Prim") -> dict[str, object]:
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
            found[key] = json_value(prop)
    return found
