"""Surface velocities as scene data: walls that stand still and whose surface moves along itself, as belts do.

A surface velocity is held as a translation: its velocity at a time is what counts, its displacement nothing. It is a vector V
in the body axes of the wall, of which the part along the surface acts, or a speed along axis x normal, as of a belt around
drums.
"""

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from warpdem.scene.base import Direction, Duration, SceneModel, exactly_one
from warpdem.scene.motion import Translation
from warpdem.scene.motion_base import Timed
from warpdem.scene.rates import Speed, SpeedKnot, VelocitySegment, require_increasing
from warpdem.scene.units import Quantity, Vector

SpeedOrRamp = Annotated[
    Annotated[Speed, Tag("~number")] | Annotated[tuple[float, float], Vector(Quantity("m/s"), length=2), Tag("~ramp")],
    Discriminator(lambda value: "~ramp" if isinstance(value, (list, tuple)) else "~number"),
]


class SpeedSegment(SceneModel):
    """One segment of a schedule of speeds."""

    until: Duration | None = Field(
        None, description="End of the segment [s], > 0 and increasing; only the last may omit it and then has no end."
    )
    speed: SpeedOrRamp = Field(description="Speed [m/s], or [start, end] of a linear ramp.")

    def along(self, axis: np.ndarray) -> VelocitySegment:
        """The segment with velocities along ``axis``."""
        ends = [(float(speed) * axis).tolist() for speed in np.atleast_1d(self.speed)]
        return VelocitySegment(until=self.until, velocity=ends if len(ends) == 2 else ends[0])


class Belt(Timed):
    """A surface that moves around an axis: its velocity is speed (axis x n), n the normal from the wall to the grain."""

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    speed: Speed | None = Field(
        None, description="Speed of the surface along axis x normal [m/s], of either sign; this, schedule or table."
    )
    schedule: Annotated[list[SpeedSegment], Field(min_length=1)] | None = Field(
        None, description="Segments of constant or linearly changing speed, one after the other; 0 after the last."
    )
    table: Annotated[list[SpeedKnot], Field(min_length=1)] | None = Field(
        None, description="Times [s], >= 0 and increasing, and speeds [m/s] there: [[t, speed], ...]."
    )

    @model_validator(mode="after")
    def _one_course(self) -> "Belt":
        exactly_one(self, "speed", "schedule", "table")
        require_increasing([segment.along(np.array(self.axis)) for segment in self.schedule or ()], self.table)
        return self

    @property
    def translation(self) -> Translation:
        """Translation whose velocity is speed times axis."""
        axis, timed = np.array(self.axis), {"elapsed": self.elapsed, "start": self.start, "until": self.until}
        if self.speed is not None:
            return Translation(velocity=tuple((self.speed * axis).tolist()), **timed)
        if self.schedule is not None:
            return Translation(schedule=[segment.along(axis) for segment in self.schedule], **timed)
        return Translation(table=[(time, *(speed * axis).tolist()) for time, speed in self.table or ()], **timed)


def _tag(value: Any) -> str:
    keys = set(value) if isinstance(value, dict) else set(getattr(type(value), "model_fields", ()))
    return "~belt" if keys & {"axis", "speed"} else "~translation"


def surface_speed(given: Translation | Belt) -> float:
    """Upper bound of the speed of a surface [m/s]."""
    translation = given.translation if isinstance(given, Belt) else given
    return translation.speed_bound(np.zeros((1, 3)), 0.0)


if TYPE_CHECKING:
    SurfaceVelocity = Translation | Belt
else:
    SurfaceVelocity = Annotated[
        Annotated[Belt, Tag("~belt")] | Annotated[Translation, Tag("~translation")],
        Discriminator(_tag),
        BeforeValidator(lambda value: {"velocity": value} if isinstance(value, (list, tuple, np.ndarray)) else value),
    ]
"""A vector, a translation whose velocity counts, or a belt."""
