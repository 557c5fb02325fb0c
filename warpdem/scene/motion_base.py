"""Common parts of the motions of a scene: a time of their own, frequencies and phases."""

from typing import Annotated

from pydantic import Field

from warpdem.scene.base import SceneModel
from warpdem.scene.units import Quantity

Frequency = Annotated[float, Quantity("1/s", gt=0)]
Phase = Annotated[float, Quantity("rad")]


class Timed(SceneModel):
    """Base of all motions that depend on time."""

    elapsed: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0, description="Time of the motion at time 0 of the run [s], >= 0, default 0: the motion is ahead by this."
    )
