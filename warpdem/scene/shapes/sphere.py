"""Sphere with the grains inside or outside."""

import numpy as np
from pydantic import Field, StrictBool

from warpdem.scene.base import Length, Point
from warpdem.scene.shapes.lathe import SECTIONS, lathe
from warpdem.scene.shapes.shape import Closed, Shape, inside_words


class Sphere(Shape):
    """Sphere with the grains inside or outside."""

    KERNEL = "sphere"

    centre: Point = Field(description="Centre [m].")
    radius: Length = Field(description="Radius [m], > 0.")
    inside: StrictBool = Field(True, description="Whether the grains are inside, default true.")

    @property
    def numbers(self) -> np.ndarray:
        """Parameters for the kernels, see ``kernels/wall/sphere.py``, shape (5,)."""
        return np.array([*self.centre, self.radius, -1.0 if self.inside else 1.0])

    @property
    def is_hollow(self) -> bool:
        """Whether the grains are inside."""
        return self.inside

    @property
    def side(self) -> str:
        """Which side the grains are on, for messages."""
        return inside_words(self.inside)

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are inside; bool, shape (n,)."""
        return np.asarray(np.linalg.norm(points - np.array(self.centre), axis=1) < self.radius)

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        arm = points - np.array(self.centre)
        length = np.linalg.norm(arm, axis=1)
        outward = arm / np.where(length > 0.0, length, 1.0)[:, None]
        height = length - self.radius
        return points - height[:, None] * outward, -height if self.inside else height

    def bore(self, points: np.ndarray) -> np.ndarray:
        """Radius below which a grain there touches it at one point only [m], shape (n,)."""
        return np.where(self.holds(points), self.radius, np.inf)

    def extent(self, direction: np.ndarray) -> tuple[float, float]:
        """Least and greatest coordinate along a unit vector [m]."""
        middle = float(np.dot(self.centre, direction))
        return middle - self.radius, middle + self.radius

    def catches(self, down: np.ndarray, is_closed: Closed) -> bool:
        """Whether the grains are inside."""
        return self.inside

    def triangles(self, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles for pictures and files."""
        polar = np.linspace(0.0, np.pi, SECTIONS // 2 + 1)
        return lathe(self.centre, (0.0, 0.0, 1.0), -self.radius * np.cos(polar), self.radius * np.sin(polar))
