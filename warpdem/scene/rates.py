"""Angular rates that change with time: schedules of constant rates and ramps, sinusoids, tables."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from warpdem.core.rigid_motion import WIDE
from warpdem.scene.base import AngularRate, Duration, SceneModel
from warpdem.scene.motion_base import Frequency, Phase
from warpdem.scene.units import Quantity, Vector

RateOrRamp = Annotated[
    Annotated[AngularRate, Tag("~number")]
    | Annotated[tuple[float, float], Vector(Quantity("rad/s"), length=2), Tag("~ramp")],
    Discriminator(lambda value: "~ramp" if isinstance(value, (list, tuple)) else "~number"),
]


class RateSegment(SceneModel):
    """One stretch of a rate schedule."""

    until: Duration | None = Field(
        None, description="End of the stretch [s], > 0 and rising; only the last may omit it and then holds for ever."
    )
    rate: RateOrRamp = Field(description="Angular rate [rad/s], or [start, end] of a linear ramp.")


class Sinusoid(SceneModel):
    """A rate that swings: mean + amplitude sin(2 pi frequency t + phase)."""

    mean: AngularRate = Field(0.0, description="Mean angular rate [rad/s], default 0.")
    amplitude: AngularRate = Field(description="Amplitude of the angular rate [rad/s].")
    frequency: Frequency = Field(description="Frequency [1/s], > 0; rpm is refused, since turns are not swings.")
    phase: Phase = Field(0.0, description="Phase at time 0 [rad], default 0.")


def _time_and_rate(entry: Any) -> Any:
    if not isinstance(entry, (list, tuple, np.ndarray)) or len(entry) != 2:
        raise ValueError("must be a list of 2 numbers, [time in [s], rate in [rad/s]]")
    return entry


Knot = Annotated[tuple[Annotated[float, Quantity("s", ge=0)], AngularRate], BeforeValidator(_time_and_rate)]


class Pieces(NamedTuple):
    """A rate that is piecewise linear, arrays (k,) in long double; the last piece has no end."""

    start: np.ndarray
    """[s], rising from 0."""
    angle: np.ndarray
    """Angle at the start [rad]."""
    rate: np.ndarray
    """Rate at the start [rad/s]."""
    acceleration: np.ndarray
    """[rad/s2]."""

    @classmethod
    def joined(cls, stretches: list[tuple[float, float, float]], last: float) -> "Pieces":
        """Pieces of stretches (end [s], first and last rate [rad/s]) from time 0 on, then the rate ``last``."""
        pieces, start, angle = [], WIDE(0), WIDE(0)
        for end, first, final in stretches:
            length, first, final = WIDE(end) - start, WIDE(first), WIDE(final)
            pieces.append((start, angle, first, (final - first) / length))
            start, angle = WIDE(end), angle + (first + final) / 2 * length
        pieces.append((start, angle, WIDE(last), WIDE(0)))
        return cls(*(np.array(column) for column in zip(*pieces, strict=True)))

    def at(self, time: np.ndarray, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angle at ``time`` [s], and there rate and acceleration of the pieces that hold ``piece`` [s], shapes (k,)."""
        start, angle, rate, acceleration = (column[self._number(time)] for column in self)
        since = time - start
        turned = angle + since * (rate + acceleration * since / 2)
        start, _, rate, acceleration = (column[self._number(piece)] for column in self)
        return turned, rate + acceleration * (time - start), acceleration

    def _number(self, time: np.ndarray) -> np.ndarray:
        return np.maximum(np.searchsorted(self.start, time, side="right") - 1, 0)
