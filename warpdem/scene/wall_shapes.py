"""Analytic walls as scene data: plane, cylinder, cone and sphere, with nearest points and signed distances.

Each is one feature for the kernels. A shape with a solid side keeps grains on the other side; a cylinder or cone of finite
length is a thin sheet with open ends, solid from both sides.
"""

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, StrictBool, model_validator

from warpdem.scene.base import Direction, Length, Point, SceneModel, Vec3, validation_error
from warpdem.scene.units import Quantity

INSIDE = "Whether the grains are inside, default true; {} of finite length is solid from both sides."


class Plane(SceneModel):
    """Infinite plane; the grains are on the side of its normal."""

    point: Point = Field(description="A point of the plane [m].")
    normal: Direction = Field(description="Normal towards the grains [-], any length but zero; held as a unit vector.")

    @property
    def offset(self) -> float:
        """Offset d [m] of n . x = d."""
        return float(np.dot(self.normal, self.point))

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nearest points of the wall [m], shape (n, 3), and signed distances [m], shape (n,), negative on the solid side."""
        height = (points - np.array(self.point)) @ np.array(self.normal)
        return points - height[:, None] * np.array(self.normal), height


class Revolved(SceneModel):
    """Surface of revolution: a straight generatrix about an axis, in the coordinates height along the axis and radius."""

    if TYPE_CHECKING:  # fields of each shape, in its own order
        axis: Direction
        inside: bool

    @property
    def has_ends(self) -> bool:
        """Whether the shape has a finite length."""
        raise NotImplementedError

    @property
    def origin(self) -> Vec3:
        """Point of the axis at height 0 [m]."""
        raise NotImplementedError

    @property
    def foot(self) -> tuple[float, float]:
        """A point of the generatrix (height, radius) [m]."""
        raise NotImplementedError

    @property
    def direction(self) -> tuple[float, float]:
        """Unit direction of the generatrix (height, radius) [-]."""
        raise NotImplementedError

    @property
    def limits(self) -> tuple[float, float]:
        """Start and end of the generatrix along itself [m]."""
        raise NotImplementedError

    @property
    def sided(self) -> bool:
        """Whether one side of the wall is solid."""
        return not self.has_ends

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


class Cone(Revolved):
    """Cone about an axis, infinite from its apex, or a section with open ends."""

    apex: Point = Field(description="Apex [m].")
    axis: Direction = Field(
        description="Direction from the apex into the cone [-], any length but zero; held as a unit vector."
    )
    half_angle: Annotated[float, Quantity("rad", gt=0, lt=1.5707)] = Field(
        description="Angle between axis and surface [rad], > 0 and < 1.5707."
    )
    inside: StrictBool = Field(True, description=INSIDE.format("a cone"))
    start: Annotated[float, Quantity("m", ge=0)] = Field(
        0.0, description="Height above the apex, along the axis, of the start of the wall [m], >= 0, default 0; needs end."
    )
    end: Length | None = Field(None, description="Height of its end [m], > 0 and above start; default infinite.")

    @model_validator(mode="after")
    def _rises(self) -> "Cone":
        if self.end is None and self.start != 0.0:
            raise validation_error([(("start",), self.start, "needs an end: a cone with an open tip is a sheet with two ends")])
        if self.end is not None and self.end <= self.start:
            raise validation_error([(("end",), self.end, f"must be above start = {self.start:g} m")])
        return self

    @property
    def has_ends(self) -> bool:
        """Whether the cone has a finite length."""
        return self.end is not None

    @property
    def origin(self) -> Vec3:
        """Point of the axis at height 0 [m]."""
        return self.apex

    @property
    def foot(self) -> tuple[float, float]:
        """A point of the generatrix (height, radius) [m]."""
        return 0.0, 0.0

    @property
    def direction(self) -> tuple[float, float]:
        """Unit direction of the generatrix (height, radius) [-]."""
        return math.cos(self.half_angle), math.sin(self.half_angle)

    @property
    def limits(self) -> tuple[float, float]:
        """Start and end of the generatrix along itself [m]; the inside of an infinite cone has no limit at the apex."""
        if self.end is not None:
            return self.start / self.direction[0], self.end / self.direction[0]
        return -math.inf if self.inside else 0.0, math.inf


class Sphere(SceneModel):
    """Sphere with the grains inside or outside."""

    centre: Point = Field(description="Centre [m].")
    radius: Length = Field(description="Radius [m], > 0.")
    inside: StrictBool = Field(True, description="Whether the grains are inside, default true.")

    @property
    def numbers(self) -> np.ndarray:
        """Parameters for the kernels, see ``kernels/wall/sphere.py``, shape (5,)."""
        return np.array([*self.centre, self.radius, -1.0 if self.inside else 1.0])

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


Shape = Plane | Cylinder | Cone | Sphere
SHAPES = ("plane", "cylinder", "cone", "sphere")
"""Keys of a wall that name an analytic shape."""
