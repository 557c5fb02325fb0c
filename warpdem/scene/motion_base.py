"""Common parts of the motions of a scene: a time of their own, in which they begin and end, frequencies and phases."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from warpdem.scene.base import Duration, SceneModel, validation_error
from warpdem.scene.units import Quantity

Frequency = Annotated[float, Quantity("1/s", gt=0)]
Phase = Annotated[float, Quantity("rad")]


class Timed(SceneModel):
    """Base of all motions that depend on time."""

    elapsed: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0, description="Time of the motion at time 0 of the run [s], >= 0, default 0: the motion is ahead by this."
    )
    start: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0,
        description="Time at which the motion begins [s], >= 0, default 0. It rests before; schedules, tables and phases count "
        "from here.",
    )
    until: Duration | None = Field(
        None, description="Time at which the motion ends [s], > 0, later than start; default never. It stays where it then is."
    )

    def later(self, time: float) -> Self:
        """The motion from ``time`` [s] on: ahead by it."""
        return self.model_copy(update={"elapsed": self.elapsed + time})

    @model_validator(mode="after")
    def _ends_after_its_start(self) -> "Timed":
        if self.until is not None and self.until <= self.start:
            raise validation_error([(("until",), self.until, f"must be later than start = {self.start:g} s")])
        return self
