"""What the USD results hold of each frame: attributes of the grains and of loaded walls, each declared once.

A new attribute of the grains is an entry of ``DISPLAY`` (single precision, for viewers) or of ``STATE`` (float64, which a
new scene starts from).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpdem.core.snapshot import Snapshot, WallLoad

GRAINS = "/World/Frame/Grains"
"""Prim of the grains."""


@dataclass(frozen=True)
class GrainAttribute:
    """An attribute of the prim of the grains."""

    name: str
    """Its name."""
    kind: str
    """Name of its value type."""
    read: Callable[[Snapshot], np.ndarray | None]
    """Its values; None where the snapshot has none."""


@dataclass(frozen=True)
class LoadAttribute:
    """An attribute of the prim of a wall whose load is written."""

    name: str
    """Its name."""
    kind: str
    """Name of its value type."""
    read: Callable[[WallLoad], np.ndarray | float]
    """Its values; vectors in frame axes."""


DISPLAY = (
    GrainAttribute("points", "point3f[]", lambda s: s.position),
    GrainAttribute("widths", "float[]", lambda s: 2.0 * s.radius),
    GrainAttribute("velocities", "vector3f[]", lambda s: s.velocity),
    GrainAttribute("ids", "int64[]", lambda s: s.id),
    GrainAttribute("primvars:omega", "vector3f[]", lambda s: s.spin),
    GrainAttribute("primvars:group", "int[]", lambda s: s.group),
    GrainAttribute("primvars:orientation", "quatf[]", lambda s: s.orientation),
    GrainAttribute("extent", "float3[]", lambda s: extent(s.position, s.radius.max(initial=0.0))),
)
"""Attributes of the grains for viewers."""
STATE = (
    GrainAttribute("primvars:dem:positions", "double3[]", lambda s: s.position),
    GrainAttribute("primvars:dem:velocities", "double3[]", lambda s: s.velocity),
    GrainAttribute("primvars:dem:spins", "double3[]", lambda s: s.spin),
    GrainAttribute("primvars:dem:radii", "double[]", lambda s: s.radius),
    GrainAttribute("primvars:dem:types", "int[]", lambda s: s.type),
)
"""Attributes of the grains to start from."""
LOAD = (
    LoadAttribute("primvars:pressure", "float[]", lambda load: load.pressure),
    LoadAttribute("force", "vector3d", lambda load: load.force),
    LoadAttribute("torque", "vector3d", lambda load: load.torque),
    LoadAttribute("torqueAbout", "point3d", lambda load: load.about),
    LoadAttribute("power", "double", lambda load: load.power),
)
"""Attributes of a wall with its load."""


def grain_values(attributes: tuple[GrainAttribute, ...], snapshot: Snapshot) -> dict[str, Any]:
    """Values of attributes of the grains as the USD library holds them, by attribute path."""
    arrays = {f"{GRAINS}.{one.name}": (one.kind, one.read(snapshot)) for one in attributes}
    return {path: usd_value(kind, values) for path, (kind, values) in arrays.items() if values is not None}


def load_values(path: str, load: WallLoad) -> dict[str, Any]:
    """Values of the attributes of the wall prim at ``path``, by attribute path."""
    values = {one: one.read(load) for one in LOAD}
    # an empty array would not fit the faces
    return {f"{path}.{one.name}": usd_value(one.kind, value) for one, value in values.items() if np.size(value)}


def usd_value(kind: str, values: np.ndarray | float) -> Any:
    """A value of the type of that name from NumPy numbers."""
    from pxr import Gf, Vt

    if kind == "double":
        return float(values)
    if kind in ("vector3d", "point3d"):
        return Gf.Vec3d(*np.asarray(values).tolist())
    makers = {
        "point3f[]": (Vt.Vec3fArray, np.float32),
        "vector3f[]": (Vt.Vec3fArray, np.float32),
        "float3[]": (Vt.Vec3fArray, np.float32),
        "float[]": (Vt.FloatArray, np.float32),
        "quatf[]": (Vt.QuatfArray, np.float32),
        "quath[]": (Vt.QuathArray, np.float16),
        "int[]": (Vt.IntArray, np.int32),
        "int64[]": (Vt.Int64Array, np.int64),
        "double[]": (Vt.DoubleArray, np.float64),
        "double3[]": (Vt.Vec3dArray, np.float64),
        "double4[]": (Vt.Vec4dArray, np.float64),
    }
    make, number = makers[kind]
    if kind in ("quatf[]", "quath[]"):
        values = np.roll(values, -1, axis=1)  # Gf holds the scalar part last
    if not np.size(values):
        return make()
    return make.FromNumpy(np.ascontiguousarray(values, dtype=number))


def extent(points: np.ndarray, radius: float = 0.0) -> np.ndarray:
    """Lowest and highest corner of a box around balls in single precision [m], shape (2, 3); no rows when there is nothing.

    Args:
        points: Centers [m], shape (n, 3).
        radius: Largest radius [m].
    """
    points = np.ascontiguousarray(points, dtype=np.float32)
    if len(points) == 0:
        return np.zeros((0, 3), np.float32)
    # eight rows beside each other: NumPy is slow along the first axis of three columns
    whole = len(points) // 8 * 8
    rows = [points[:whole].reshape(-1, 24)] if whole else []
    low, high = (
        np.concatenate([*(limit(r, axis=0).reshape(-1, 3) for r in rows), points[whole:]]) for limit in (np.min, np.max)
    )
    low, high = low.min(axis=0) - np.float32(radius), high.max(axis=0) + np.float32(radius)
    return np.stack([low, high])
