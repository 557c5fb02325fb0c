"""Grains as another program wrote them, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class ForeignGrains:
    """Grains of one time of a file."""

    position: np.ndarray
    """Centres [m], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    velocity: np.ndarray | None = None
    """Velocities [m/s], shape (n, 3); None if the file has none."""
    spin: np.ndarray | None = None
    """Angular velocities [rad/s], shape (n, 3); None if the file has none."""
    id: np.ndarray | None = None
    """Ids, shape (n,), int64; None if the file has none."""
    type: np.ndarray | None = None
    """Types, shape (n,), int64; None if the file has none."""
    when: str = ""
    """The time, in the file's own words."""
    ignored: tuple[str, ...] = field(default=())
    """Columns that were not taken."""
