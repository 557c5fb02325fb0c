"""Analytic walls as scene data: plane, cylinder, cone and sphere, and where points lie relative to them.

Each is one feature for the kernels. One with a solid side keeps grains on the other; a cylinder or cone that ends is a thin
sheet with open ends, solid from both sides.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field, StrictBool, model_validator

from warpdem.scene.base import Direction, Length, Point, SceneModel, validation_error
from warpdem.scene.units import Quantity

INSIDE = "Whether the grains are inside, default true; {} that ends is solid from both sides."


class Plane(SceneModel):
    """Infinite plane; grains are on the side to which the normal points."""

    point: Point = Field(description="A point of the plane [m].")
    normal: Direction = Field(description="Direction towards the grains [-], any length but zero; held as a unit vector.")

    @property
    def offset(self) -> float:
        """Offset d [m] of n . x = d."""
        return float(np.dot(self.normal, self.point))

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        height = (points - np.array(self.point)) @ np.array(self.normal)
        return points - height[:, None] * np.array(self.normal), height


class Revolved(SceneModel):
    """A generatrix, turned about an axis, in the coordinates height along the axis and distance from it."""

    @property
    def sided(self) -> bool:
        """Whether one side of the wall is solid."""
        return not self.ends

    @property
    def numbers(self) -> np.ndarray:
        """The numbers that the kernels read, see ``kernels/wall/revolved.py``, shape (13,)."""
        side = (-1.0 if self.inside else 1.0) if self.sided else 0.0
        return np.array([*self.origin, *self.axis, *self.foot, *self.run, *self.reach, side])

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        axis = np.array(self.axis)
        way = points - np.array(self.origin)
        height = way @ axis
        across = way - height[:, None] * axis
        far = np.linalg.norm(across, axis=1)
        # on the axis every direction across it is as good
        side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        outwards = np.where((far > 0.0)[:, None], across / np.where(far > 0.0, far, 1.0)[:, None], side / np.linalg.norm(side))
        h, r = height - self.foot[0], far - self.foot[1]
        along = np.clip(h * self.run[0] + r * self.run[1], *self.reach)
        at = np.outer(self.foot[0] + along * self.run[0], axis) + (self.foot[1] + along * self.run[1])[:, None] * outwards
        left = r * self.run[0] - h * self.run[1]
        apart = np.linalg.norm(way - at, axis=1)
        behind = self.sided & ((left > 0.0) == self.inside) & (left != 0.0)
        return at + np.array(self.origin), np.where(behind, -apart, apart)


class Cylinder(Revolved):
    """Cylinder about an axis, infinite, or with open ends."""

    point: Point = Field(description="A point of the axis [m]; with length, where the cylinder begins.")
    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    radius: Length = Field(description="Radius [m], > 0.")
    inside: StrictBool = Field(True, description=INSIDE.format("a cylinder"))
    length: Length | None = Field(None, description="Length from point along axis [m], > 0, open ends; default infinite.")

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are in the bore; bool, shape (n,)."""
        way = points - np.array(self.point)
        height = way @ np.array(self.axis)
        across = np.linalg.norm(way - height[:, None] * np.array(self.axis), axis=1)
        return (across < self.radius) & (height >= self.reach[0]) & (height <= self.reach[1])

    @property
    def ends(self) -> bool:
        """Whether it has ends."""
        return self.length is not None

    @property
    def origin(self) -> tuple[float, float, float]:
        """Where heights are counted from [m]."""
        return self.point

    @property
    def foot(self) -> tuple[float, float]:
        """A point of the generatrix (height, distance from the axis) [m]."""
        return 0.0, self.radius

    @property
    def run(self) -> tuple[float, float]:
        """Unit direction of the generatrix."""
        return 1.0, 0.0

    @property
    def reach(self) -> tuple[float, float]:
        """Begin and end of the generatrix along itself [m]."""
        return (0.0, self.length) if self.ends else (-math.inf, math.inf)


class Cone(Revolved):
    """Cone about an axis from its apex on, infinite, or a part with open ends."""

    apex: Point = Field(description="Apex [m].")
    axis: Direction = Field(
        description="Direction from the apex into the cone [-], any length but zero; held as a unit vector."
    )
    half_angle: Annotated[float, Quantity("rad", gt=0, lt=1.5707)] = Field(
        description="Angle between axis and surface [rad], > 0 and < 1.5707."
    )
    inside: StrictBool = Field(True, description=INSIDE.format("a cone"))
    start: Annotated[float, Quantity("m", ge=0)] = Field(
        0.0, description="Height above the apex, along the axis, at which the wall starts [m], >= 0, default 0; needs end."
    )
    end: Length | None = Field(None, description="Height at which it ends [m], > 0 and above start; default infinite.")

    @model_validator(mode="after")
    def _rises(self) -> "Cone":
        if self.end is None and self.start != 0.0:
            raise validation_error([(("start",), self.start, "needs an end: a cone with an open tip is a sheet with two ends")])
        if self.end is not None and self.end <= self.start:
            raise validation_error([(("end",), self.end, f"must be above start = {self.start:g} m")])
        return self

    @property
    def ends(self) -> bool:
        """Whether it has an end."""
        return self.end is not None

    @property
    def origin(self) -> tuple[float, float, float]:
        """Where heights are counted from [m]."""
        return self.apex

    @property
    def foot(self) -> tuple[float, float]:
        """A point of the generatrix (height, distance from the axis) [m]."""
        return 0.0, 0.0

    @property
    def run(self) -> tuple[float, float]:
        """Unit direction of the generatrix."""
        return math.cos(self.half_angle), math.sin(self.half_angle)

    @property
    def reach(self) -> tuple[float, float]:
        """Begin and end of the generatrix along itself [m]; the inside of an infinite cone has no border at the apex."""
        if self.ends:
            return self.start / self.run[0], self.end / self.run[0]
        return -math.inf if self.inside else 0.0, math.inf


class Sphere(SceneModel):
    """Sphere that grains are inside or outside of."""

    centre: Point = Field(description="Centre [m].")
    radius: Length = Field(description="Radius [m], > 0.")
    inside: StrictBool = Field(True, description="Whether the grains are inside, default true.")

    @property
    def numbers(self) -> np.ndarray:
        """The numbers that the kernels read, see ``kernels/wall/sphere.py``, shape (5,)."""
        return np.array([*self.centre, self.radius, -1.0 if self.inside else 1.0])

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether points [m], shape (n, 3), are inside; bool, shape (n,)."""
        return np.linalg.norm(points - np.array(self.centre), axis=1) < self.radius

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        way = points - np.array(self.centre)
        length = np.linalg.norm(way, axis=1)
        outwards = way / np.where(length > 0.0, length, 1.0)[:, None]
        height = length - self.radius
        return points - height[:, None] * outwards, -height if self.inside else height


Shape = Plane | Cylinder | Cone | Sphere
SHAPES = ("plane", "cylinder", "cone", "sphere")
"""Keys of a wall that name an analytic shape."""
