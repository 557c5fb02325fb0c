"""Grains: points that collide, their arrays at a time code, and the frames of a result."""

import re

import numpy as np

from warpdem.usd.reader.errors import Refused
from warpdem.usd.reader.physics import PHYSICS
from warpdem.usd.reader.prims import matrix_of, shortest, value_at

GRAINS = "SpherePointsShape"
"""Kind of the physics parser's shapes that are grains."""
GRAIN_ARRAYS = ("positions", "velocities", "spins", "radii", "diameters", "types")
"""Arrays of grains in float64, SI and frame axes, as primvars:dem:NAME."""
GRAINS_TAKEN = re.compile(
    r"(points|widths|velocities|ids|extent|visibility|purpose|doubleSided|orientation|proxyPrim)$|(xformOp|material:binding|dem)[:O]"
    r"|primvars:(widths|omega|group|display\w+|dem:(" + "|".join(GRAIN_ARRAYS) + r"))(:|$)"
)
"""Attributes of grains that are taken, or that say how they look."""


def grains_of(prim, desc, bodies: dict, frames: bool) -> dict:
    """Whether grains collide, the names of their attributes that are not taken, and of those of which one sample is.

    Raises:
        Refused: they would be one rigid body.
    """
    body = bodies.get(str(desc.rigidBody))
    if body is not None and body.rigidBodyEnabled and desc.collisionEnabled:
        raise Refused(
            f"{prim.GetPath()}: its points would be one stiff body, by PhysicsRigidBodyAPI at {desc.rigidBody}; grains move "
            "each by itself: take the schema out"
        )
    names = [attribute.GetName() for attribute in prim.GetAuthoredAttributes() if attribute.HasAuthoredValue()]
    left = [name for name in names if not GRAINS_TAKEN.match(name)]
    left = [name for name in left if not any(PHYSICS.match(part) for part in name.split(":"))]
    moving = [name for name in ("points", "widths", "velocities", "ids") if prim.GetAttribute(name).ValueMightBeTimeVarying()]
    return {"enabled": bool(desc.collisionEnabled), "left": left, "moving": [] if frames else moving}


def grain_arrays(prim, code: float) -> dict[str, np.ndarray]:
    """Arrays of the grains of a Points prim at a time code: as USD has them, and in float64 where they are there."""
    from pxr import UsdGeom

    api = UsdGeom.PrimvarsAPI(prim)
    widths = api.GetPrimvar("widths") or prim.GetAttribute("widths")
    sources = {
        "points": prim.GetAttribute("points"), "widths": widths, "velocities": prim.GetAttribute("velocities"),
        "omega": api.GetPrimvar("omega"), "ids": prim.GetAttribute("ids"), "group": api.GetPrimvar("group"),
        **{f"dem.{name}": api.GetPrimvar(f"dem:{name}") for name in GRAIN_ARRAYS},
    }  # fmt: skip
    held = {name: value_at(source, code) for name, source in sources.items() if source}
    arrays = {name: shortest(np.array(values)) for name, values in held.items() if values is not None}
    for name, values in held.items():
        if name.startswith("dem.") and values is not None:
            arrays[name] = np.array(values)
    arrays["matrix"] = matrix_of(UsdGeom.XformCache(code), prim)
    return arrays


def frame_codes(prim) -> list[float]:
    """Time codes of the frames of a result."""
    attribute = prim.GetAttribute("primvars:dem:positions")
    return attribute.GetTimeSamples() if attribute else []


def frame_code(frames: list[float], at: str, rate: float) -> float:
    """Time code of the frame nearest to ``at`` [s], the last one without it; 0 in a stage without frames.

    Raises:
        Refused: there are no frames, or the time lies outside them.
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
