"""What the grains of the last frame of a run look like as a whole: the angle of the cone that they form."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from warpdem.core.snapshot import Snapshot, in_laboratory
from warpdem.errors import WarpdemError
from warpdem.runs import Run


def cone_angle(shot: Snapshot) -> float:
    """Angle [degree] to the horizontal of the cone whose mean height and mean distance from its axis are those of the grains.

    A cone of height H and base R has its mean height at H / 4 and its mean distance from the axis at R / 2, so tan a = H / R =
    2 <h> / <r>. Heights are those of the centres above the lowest point of a grain; the axis goes through the centre of mass.
    All grains count by their mass, so it is less sensitive to single grains than a line along the slope.
    """
    height, aside = _heights(shot)
    above = np.average(height, weights=shot.mass) - (height - shot.radius).min()
    aside = aside - np.average(aside, axis=0, weights=shot.mass)
    out = np.average(np.linalg.norm(aside, axis=1), weights=shot.mass)
    return math.degrees(math.atan2(2.0 * above, out))


def thickness(shot: Snapshot) -> float:
    """Height [m] of the highest point of a grain above the lowest one."""
    height, _ = _heights(shot)
    return float((height + shot.radius).max() - (height - shot.radius).min())


def _heights(shot: Snapshot) -> tuple[np.ndarray, np.ndarray]:
    """Heights of centres against gravity, or along z without, shape (n,), and the rest of positions, shape (n, 3); [m]."""
    position, gravity = in_laboratory(shot).position, shot.gravity
    up = -gravity / np.linalg.norm(gravity) if gravity is not None and np.any(gravity) else np.array([0.0, 0.0, 1.0])
    height = position @ up
    return height, position - np.outer(height, up)


SHAPES: dict[str, Callable[[Snapshot], float]] = {"cone_angle": cone_angle, "height": thickness}
"""What is read of the last frame by its name."""


def shape_of(run: Run, name: str) -> float:
    """A number of the last frame of a run; nan if the run has no frames."""
    try:
        frames = run.frames
        shot = frames.frame(len(frames.times) - 1) if len(frames.times) else None
        return SHAPES[name](shot) if shot is not None and len(shot.id) else math.nan
    except WarpdemError:
        return math.nan
