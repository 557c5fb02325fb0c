"""What all motions of a scene have: a time of their own, frequencies and phases."""

from typing import Annotated

from pydantic import Field

from warpdem.scene.base import SceneModel
from warpdem.scene.units import Quantity

Frequency = Annotated[float, Quantity("1/s", gt=0)]
Phase = Annotated[float, Quantity("rad")]


class Timed(SceneModel):
    """What all motions have: a time of their own."""

    elapsed: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0, description="How long the motion has been going on at time 0 [s], >= 0, default 0: its time is ahead by this."
    )
