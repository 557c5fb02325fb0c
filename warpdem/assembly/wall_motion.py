"""Another motion for a driven wall, between two steps."""

import math
from typing import Any

import numpy as np

from warpdem.assembly.parts import Parts
from warpdem.errors import SceneError


def set_motion(run: Parts, wall: str, motion: Any) -> None:
    """As ``Simulation.set_motion``."""
    model = run.model
    driven = model.schedule.driven
    if wall not in driven:
        known = ", ".join(repr(name) for name in driven) or "none"
        has = any(one.name == wall for one in model.scene.walls)
        reason = "is not driven: add driven = true to it" if has else "is no wall of the scene"
        raise SceneError(f"set_motion: {wall!r} {reason}; driven walls: {known}")
    run.loop.evaluate()  # whether the forces of the present time were asked for before must not matter
    mesh = model.meshes.get(wall)
    points = mesh.vertices if mesh is not None else np.zeros((0, 3))
    radius = float(model.expected.radius.min(initial=math.inf))
    driven[wall].set(run.clock.time, motion, points, radius, model.dt)
    run.engine.motion_changed()
