"""What every analytic shape of a wall says of itself."""

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from warpdem.scene.base import SceneModel

LEVEL = 1.0e-9
"""Sine of an angle below which a direction counts as level, or as along another [-]."""
Closed = Callable[[np.ndarray, float, np.ndarray], bool]
"""Whether an open end is closed to grains: by its centre [m], its radius [m] and the axis across it [-]."""


class Shape(SceneModel):
    """An analytic shape, in the axes of the wall's body."""

    KERNEL: ClassVar[str]
    """Its file in ``kernels/wall/``."""

    @property
    @abstractmethod
    def numbers(self) -> np.ndarray:
        """Parameters for the kernels, as that file has them, shape (k,)."""

    @property
    def sided(self) -> bool:
        """Whether one side of the wall is solid."""
        return True

    @property
    def is_hollow(self) -> bool:
        """Whether the grains are inside of it, and all else is solid."""
        return False

    @property
    @abstractmethod
    def side(self) -> str:
        """Which side the grains are on, for messages: "the plane, ..."."""

    @abstractmethod
    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""

    def bore(self, points: np.ndarray) -> np.ndarray:
        """Radius below which a grain at ``points`` [m], shape (n, 3), touches it at one point only [m], shape (n,)."""
        return np.full(len(points), np.inf)

    def extent(self, direction: np.ndarray) -> tuple[float, float]:
        """Least and greatest coordinate along a unit vector [m]."""
        return -np.inf, np.inf

    def is_unchanged_along(self, direction: np.ndarray) -> bool:
        """Whether a shift along a unit vector changes nothing."""
        return False

    @abstractmethod
    def catches(self, down: np.ndarray, is_closed: Closed) -> bool:
        """Whether it holds by itself whatever falls along ``down`` [-], where planes and narrowness close some of its ends."""

    def triangles(self, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles for pictures and files: vertices [m], shape (v, 3), and their numbers, shape (t, 3).

        What is infinite ends a little beyond the points ``around`` [m], shape (n, 3). Not of a plane: ``mesh.plane_patch``.
        """
        raise NotImplementedError


def inside_words(inside: bool) -> str:
    """Which side of a closed shape the grains are on, for messages."""
    return f"whose grains are {'inside' if inside else 'outside'} (inside = {str(inside).lower()})"
