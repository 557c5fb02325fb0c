"""Surface velocities of colliders as PhysX states them (``PhysxSurfaceVelocityAPI``)."""

from typing import TYPE_CHECKING

import numpy as np

from warpdem.usd.reader.prims import json_value, world_matrix

if TYPE_CHECKING:
    from pxr import Usd

SCHEMA, PREFIX = "PhysxSurfaceVelocityAPI", "physxSurfaceVelocity:"


def surface_velocity(*holders: "Usd.Prim") -> list[float] | None:
    """Velocity of the surface in stage axes and units at time 0, of the first of a collider and its body that has one."""
    from pxr import UsdGeom

    for holder in holders:
        if SCHEMA not in [str(name) for name in holder.GetPrimTypeInfo().GetAppliedAPISchemas()]:
            continue
        values = {}
        for name in ("surfaceVelocity", "surfaceVelocityEnabled", "surfaceVelocityLocalSpace"):
            attribute = holder.GetAttribute(PREFIX + name)
            values[name] = json_value(attribute) if attribute and attribute.HasAuthoredValue() else None
        velocity = np.array(values["surfaceVelocity"] or (0.0, 0.0, 0.0), dtype=float)
        if values["surfaceVelocityEnabled"] is False or not velocity.any():
            continue
        if values["surfaceVelocityLocalSpace"] is not False:  # turned with the prim, not scaled
            axes = world_matrix(UsdGeom.XformCache(0.0), holder)[:3, :3]
            velocity = axes / np.linalg.norm(axes, axis=0) @ velocity
        return [float(component) for component in velocity]
    return None
