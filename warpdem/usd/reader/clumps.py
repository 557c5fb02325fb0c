"""Clumps of a result: a point instancer that says which clumps of the scene its prototypes are."""

from typing import TYPE_CHECKING

import numpy as np

from warpdem.usd.reader.prims import value_at

if TYPE_CHECKING:
    from pxr import Usd

CLUMPS = "Clumps"
"""Kind of the prim."""
CLUMP_ARRAYS = ("positions", "velocities", "spins", "orientations", "sizes", "clumps", "types", "groups")
"""Arrays of clumps, SI and frame axes, as primvars:dem:NAME."""


def is_clumps(prim: "Usd.Prim", tables: dict[str, object]) -> bool:
    """Whether a prim is the clumps of a result."""
    from pxr import UsdGeom

    return prim.IsA(UsdGeom.PointInstancer) and "clumps" in tables


def clump_arrays(prim: "Usd.Prim", code: float) -> dict[str, np.ndarray]:
    """Arrays of the clumps at a time code, by name; those that the prim lacks are left out."""
    from pxr import UsdGeom

    api = UsdGeom.PrimvarsAPI(prim)
    found = {name: value_at(api.GetPrimvar(f"dem:{name}"), code) for name in CLUMP_ARRAYS if api.HasPrimvar(f"dem:{name}")}
    return {f"dem.{name}": np.array(values) for name, values in found.items() if values is not None}
