"""Cone about an axis: a section of it as a sheet, or the infinite one, solid on one side."""

import math
from typing import Annotated

from pydantic import Field, StrictBool, model_validator

from warpdem.scene.base import Direction, Length, Point, Vec3, validation_error
from warpdem.scene.shapes.revolved import INSIDE, Revolved
from warpdem.scene.shapes.shape import LEVEL
from warpdem.scene.units import Quantity


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

    def is_bottom(self, along: float, across: float) -> bool:
        """Whether down is outside of the cone that opens from its apex."""
        return math.atan2(across, along) > self.half_angle + LEVEL

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
