"""Infinite plane; drawn as a patch that the other planes of the scene cut off (``mesh.tessellation``)."""

import numpy as np
from pydantic import Field

from warpdem.scene.base import Direction, Point
from warpdem.scene.shapes.shape import LEVEL, Closed, Shape


class Plane(Shape):
    """Infinite plane; the grains are on the side of its normal."""

    KERNEL = "plane"

    point: Point = Field(description="A point of the plane [m].")
    normal: Direction = Field(description="Normal towards the grains [-], any length but zero; held as a unit vector.")

    @property
    def offset(self) -> float:
        """Offset d [m] of n . x = d."""
        return float(np.dot(self.normal, self.point))

    @property
    def numbers(self) -> np.ndarray:
        """Parameters for the kernels, see ``kernels/wall/plane.py``, shape (4,)."""
        return np.array([*self.normal, self.offset])

    @property
    def side(self) -> str:
        """Which side the grains are on, for messages."""
        return "whose normal must point to the grains"

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        height = (points - np.array(self.point)) @ np.array(self.normal)
        return points - height[:, None] * np.array(self.normal), height

    def is_unchanged_along(self, direction: np.ndarray) -> bool:
        """Whether the direction is in the plane."""
        return bool(abs(np.dot(self.normal, direction)) <= LEVEL)

    def catches(self, down: np.ndarray, is_closed: Closed) -> bool:
        """Whether it is no ceiling and no side wall."""
        return float(np.dot(self.normal, down)) < -LEVEL
