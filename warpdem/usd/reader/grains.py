"""Grains: points that collide, their arrays at a time code, and the frames of a result."""

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.physics import PHYSICS
from warpdem.usd.reader.prims import shortest, value_at, world_matrix

if TYPE_CHECKING:
    from pxr import Usd, UsdPhysics

GRAINS = "SpherePointsShape"
"""Shape type of the physics parser for grains."""
GRAIN_ARRAYS = ("positions", "velocities", "spins", "radii", "diameters", "types")
"""Arrays of grains in float64, SI and frame axes, as primvars:dem:NAME."""
GRAINS_TAKEN = re.compile(
    r"(points|widths|velocities|ids|extent|visibility|purpose|doubleSided|orientation|proxyPrim)$|(xformOp|material:binding|dem)[:O]"
    r"|primvars:(widths|omega|group|display\w+|dem:(" + "|".join(GRAIN_ARRAYS) + r"))(:|$)"
)
"""Attributes of grains that are read, or that only concern their appearance."""


def grain_settings(
    prim: "Usd.Prim", desc: "UsdPhysics.ShapeDesc", bodies: dict[str, "UsdPhysics.RigidBodyDesc"], frames: bool
) -> dict[str, Any]:
    """Whether grains collide, the names of their unread attributes, and of attributes of which only one sample is read.

    Raises:
        Refused: The points would be one rigid body.
    """
    body = bodies.get(str(desc.rigidBody))
    if body is not None and body.rigidBodyEnabled and desc.collisionEnabled:
        raise Refused(
            f"{prim.GetPath()}: its points would be one rigid body, by PhysicsRigidBodyAPI at {desc.rigidBody}; grains move "
            "independently: remove the schema"
        )
    names = [attribute.GetName() for attribute in prim.GetAuthoredAttributes() if attribute.HasAuthoredValue()]
    left = [name for name in names if not GRAINS_TAKEN.match(name)]
    left = [name for name in left if not any(PHYSICS.match(part) for part in name.split(":"))]
    moving = [name for name in ("points", "widths", "velocities", "ids") if prim.GetAttribute(name).ValueMightBeTimeVarying()]
    return {"enabled": bool(desc.collisionEnabled), "left": left, "moving": [] if frames else moving}


def grain_arrays(prim: "Usd.Prim", code: float) -> dict[str, np.ndarray]:
    """Arrays of the grains of a Points prim at a time code: USD's own, and those in float64 if present."""
    from pxr import UsdGeom

    api = UsdGeom.PrimvarsAPI(prim)
    widths = api.GetPrimvar("widths") or prim.GetAttribute("widths")
    sources = {
        "points": prim.GetAttribute("points"), "widths": widths, "velocities": prim.GetAttribute("velocities"),
        "omega": api.GetPrimvar("omega"), "ids": prim.GetAttribute("ids"), "group": api.GetPrimvar("group"),
        **{f"dem.{name}": api.GetPrimvar(f"dem:{name}") for name in GRAIN_ARRAYS},
    }  # fmt: skip
    values_by_name = {name: value_at(source, code) for name, source in sources.items() if source}
    arrays = {name: shortest(np.array(values)) for name, values in values_by_name.items() if values is not None}
    for name, values in values_by_name.items():
        if name.startswith("dem.") and values is not None:
            arrays[name] = np.array(values)
    arrays["matrix"] = world_matrix(UsdGeom.XformCache(code), prim)
    return arrays


def frame_codes(prim: "Usd.Prim") -> list[float]:
    """Time codes of the frames of a result."""
    attribute = prim.GetAttribute("primvars:dem:positions")
    return attribute.GetTimeSamples() if attribute else []


def frame_code(frames: list[float], at: str, rate: float) -> float:
    """Time code of the frame nearest to ``at`` [s], the last one without it; 0 in a stage without frames.

    Raises:
        Refused: There are no frames, or the time lies outside them.
    """
    if not frames:
        if at:
            raise Refused(f"at = {at} s: it holds no frames of a run (no primvars:dem:positions with time samples)")
        return 0.0
    wanted = float(at) * rate if at else frames[-1]
    slack = 1e-6 * abs(frames[-1])
    if not frames[0] - slack <= wanted <= frames[-1] + slack:
        raise Refused(f"at = {at} s: its frames lie between {frames[0] / rate:g} and {frames[-1] / rate:g} s")
    return min(frames, key=lambda code: abs(code - wanted))
