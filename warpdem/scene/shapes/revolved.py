"""What cylinder and cone share: a surface of revolution, in its own coordinates."""

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from warpdem.scene.base import Direction, Vec3
from warpdem.scene.shapes.lathe import lathe
from warpdem.scene.shapes.shape import LEVEL, Closed, Shape, inside_words

INSIDE = "Whether the grains are inside, default true; {} of finite length is solid from both sides."


class Revolved(Shape):
    """Surface of revolution: a straight generatrix about an axis, in the coordinates height along the axis and radius."""

    KERNEL = "revolved"

    if TYPE_CHECKING:  # fields of each shape, in its own order
        axis: Direction
        inside: bool

    @property
    @abstractmethod
    def has_ends(self) -> bool:
        """Whether the shape has a finite length."""

    @property
    @abstractmethod
    def origin(self) -> Vec3:
        """Point of the axis at height 0 [m]."""

    @property
    @abstractmethod
    def foot(self) -> tuple[float, float]:
        """A point of the generatrix (height, radius) [m]."""

    @property
    @abstractmethod
    def direction(self) -> tuple[float, float]:
        """Unit direction of the generatrix (height, radius) [-]."""

    @property
    @abstractmethod
    def limits(self) -> tuple[float, float]:
        """Start and end of the generatrix along itself [m]."""

    @abstractmethod
    def is_bottom(self, along: float, across: float) -> bool:
        """Whether it holds what is inside of it, being infinite, where down is ``along`` and ``across`` the axis [-]."""

    @property
    def ends(self) -> list[np.ndarray]:
        """Start and end of the generatrix, each (height, radius) [m]."""
        return [np.array(self.foot) + s * np.array(self.direction) for s in self.limits]

    @property
    def sided(self) -> bool:
        """Whether one side of the wall is solid."""
        return not self.has_ends

    @property
    def is_hollow(self) -> bool:
        """Whether the grains are inside of it, and all else is solid."""
        return self.inside and self.sided

    @property
    def side(self) -> str:
        """Which side the grains are on, for messages."""
        return inside_words(self.inside)

    @property
    def numbers(self) -> np.ndarray:
        """Parameters for the kernels, see ``kernels/wall/revolved.py``, shape (13,)."""
        side = (-1.0 if self.inside else 1.0) if self.sided else 0.0
        return np.array([*self.origin, *self.axis, *self.foot, *self.direction, *self.limits, side])

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        axis = np.array(self.axis)
        arm = points - np.array(self.origin)
        height = arm @ axis
        radial = arm - height[:, None] * axis
        radius = np.linalg.norm(radial, axis=1)
        # on the axis any radial direction is valid
        side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        outward = np.where(
            (radius > 0.0)[:, None], radial / np.where(radius > 0.0, radius, 1.0)[:, None], side / np.linalg.norm(side)
        )
        (foot_height, foot_radius), (rise, run) = self.foot, self.direction
        h, r = height - foot_height, radius - foot_radius
        along = np.clip(h * rise + r * run, *self.limits)
        nearest = np.outer(foot_height + along * rise, axis) + (foot_radius + along * run)[:, None] * outward
        offset = r * rise - h * run  # from the generatrix, positive outwards
        distance = np.linalg.norm(arm - nearest, axis=1)
        behind = self.sided & ((offset > 0.0) == self.inside) & (offset != 0.0)
        return nearest + np.array(self.origin), np.where(behind, -distance, distance)

    def extent(self, direction: np.ndarray) -> tuple[float, float]:
        """Least and greatest coordinate along a unit vector [m]."""
        middle, tilt = float(np.dot(self.origin, direction)), float(np.dot(self.axis, direction))
        across = np.linalg.norm(np.cross(self.axis, direction))
        if self.has_ends:
            both = [middle + tilt * h + sign * across * r for h, r in self.ends for sign in (-1.0, 1.0)]
            return min(both), max(both)
        if self.direction[1] == 0.0 and abs(tilt) <= LEVEL:
            return middle - self.foot[1], middle + self.foot[1]
        return -np.inf, np.inf

    def is_unchanged_along(self, direction: np.ndarray) -> bool:
        """Whether the direction is that of the axis of an infinite cylinder."""
        straight = self.direction[1] == 0.0 and not self.has_ends
        return straight and bool(np.linalg.norm(np.cross(self.axis, direction)) <= LEVEL)

    def catches(self, down: np.ndarray, is_closed: Closed) -> bool:
        """Whether it is round its grains and no lower end of it is open."""
        if not self.has_ends and not self.inside:
            return False
        axis = np.asarray(self.axis)
        along = float(axis @ down)
        if not self.has_ends:
            return self.is_bottom(along, float(np.sqrt(max(1.0 - along * along, 0.0))))
        mouths = [(np.asarray(self.origin) + h * axis, float(r)) for h, r in self.ends]
        depth = [float(centre @ down) for centre, _ in mouths]
        lowest = max(depth) - LEVEL * np.ptp(depth)
        return all(
            is_closed(centre, radius, axis) for (centre, radius), deep in zip(mouths, depth, strict=True) if deep >= lowest
        )

    def triangles(self, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangles for pictures and files; what is infinite ends a little beyond the points ``around`` [m], shape (n, 3)."""
        drawn = self._drawn_range(around)
        height, radius = (np.array(drawn) * run + foot for run, foot in zip(self.direction, self.foot, strict=True))
        return lathe(self.origin, self.axis, height, radius)

    def _drawn_range(self, around: np.ndarray) -> tuple[float, float]:
        """Start and end of the drawn part along the generatrix [m]."""
        begin, end = self.limits
        if np.isfinite([begin, end]).all():
            return begin, end
        along = (around - np.array(self.origin)) @ np.array(self.axis) / self.direction[0] if len(around) else np.zeros(1)
        margin = max(0.05 * np.ptp(along), 0.5 * self.foot[1])
        low = along.min() - margin if self.direction[1] == 0.0 else 0.0  # a cone begins at its apex
        return float(low), float(max(along.max() + margin, low + 2.0 * margin))
