"""Cylinder about an axis: a sheet or, without ends, solid on one side."""

import math

import numpy as np
from pydantic import Field, StrictBool

from warpdem.scene.base import Direction, Length, Point, Vec3
from warpdem.scene.shapes.revolved import INSIDE, Revolved
from warpdem.scene.shapes.shape import LEVEL


class Cylinder(Revolved):
    """Cylinder about an axis, infinite, or of finite length with open ends."""

    point: Point = Field(description="A point on the axis [m]; with length, the start of the cylinder.")
    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    radius: Length = Field(description="Radius [m], > 0.")
    inside: StrictBool = Field(True, description=INSIDE.format("a cylinder"))
    length: Length | None = Field(None, description="Length from point along axis [m], > 0, open ends; default infinite.")

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are inside the cylinder; bool, shape (n,)."""
        arm = points - np.array(self.point)
        height = arm @ np.array(self.axis)
        radius = np.linalg.norm(arm - height[:, None] * np.array(self.axis), axis=1)
        start, end = self.limits
        return np.asarray((radius < self.radius) & (height >= start) & (height <= end))

    def bore(self, points: np.ndarray) -> np.ndarray:
        """Radius below which a grain there touches it at one point only [m], shape (n,)."""
        return np.where(self.holds(points), self.radius, np.inf)

    def is_bottom(self, along: float, across: float) -> bool:
        """Whether it does not stand upright."""
        return across > LEVEL

    @property
    def has_ends(self) -> bool:
        """Whether the cylinder has a finite length."""
        return self.length is not None

    @property
    def origin(self) -> Vec3:
        """Point of the axis at height 0 [m]."""
        return self.point

    @property
    def foot(self) -> tuple[float, float]:
        """A point of the generatrix (height, radius) [m]."""
        return 0.0, self.radius

    @property
    def direction(self) -> tuple[float, float]:
        """Unit direction of the generatrix (height, radius) [-]."""
        return 1.0, 0.0

    @property
    def limits(self) -> tuple[float, float]:
        """Start and end of the generatrix along itself [m]."""
        return (-math.inf, math.inf) if self.length is None else (0.0, self.length)
