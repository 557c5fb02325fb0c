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
    """One segment of a rate schedule."""

    until: Duration | None = Field(
        None, description="End of the segment [s], > 0 and increasing; only the last may omit it and then has no end."
    )
    rate: RateOrRamp = Field(description="Angular rate [rad/s], or [start, end] of a linear ramp.")


class Sinusoid(SceneModel):
    """A rate that oscillates: mean + amplitude sin(2 pi frequency t + phase)."""

    mean: AngularRate = Field(0.0, description="Mean angular rate [rad/s], default 0.")
    amplitude: AngularRate = Field(description="Amplitude of the angular rate [rad/s].")
    frequency: Frequency = Field(description="Frequency [1/s], > 0; rpm is refused, since revolutions are not oscillations.")
    phase: Phase = Field(0.0, description="Phase at time 0 [rad], default 0.")


def _time_and_rate(entry: Any) -> Any:
    if not isinstance(entry, (list, tuple, np.ndarray)) or len(entry) != 2:
        raise ValueError("must be a list of 2 numbers, [time in [s], rate in [rad/s]]")
    return entry


Knot = Annotated[tuple[Annotated[float, Quantity("s", ge=0)], AngularRate], BeforeValidator(_time_and_rate)]


class PiecewiseRate(NamedTuple):
    """A piecewise linear rate, arrays (k,) in long double; the last segment has no end."""

    start: np.ndarray
    """Start of each segment [s], increasing from 0."""
    angle: np.ndarray
    """Angle at the start [rad]."""
    rate: np.ndarray
    """Rate at the start [rad/s]."""
    acceleration: np.ndarray
    """Acceleration in each segment [rad/s2]."""

    @classmethod
    def of(cls, segments: list[tuple[float, float, float]], last: float) -> "PiecewiseRate":
        """The rate of segments (end [s], initial and final rate [rad/s]) from time 0 on, then constant at ``last``."""
        rows, start, angle = [], WIDE(0), WIDE(0)
        for end, *rates in segments:
            length, initial, final = WIDE(end) - start, WIDE(rates[0]), WIDE(rates[1])
            rows.append((start, angle, initial, (final - initial) / length))
            start, angle = WIDE(end), angle + (initial + final) / 2 * length
        rows.append((start, angle, WIDE(last), WIDE(0)))
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    def at(self, time: np.ndarray, segment_time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angle at ``time`` [s], and there rate and acceleration of the segments at ``segment_time`` [s], shapes (k,)."""
        start, angle, rate, acceleration = (column[self._number(time)] for column in self)
        since = time - start
        total = angle + since * (rate + acceleration * since / 2)
        start, _, rate, acceleration = (column[self._number(segment_time)] for column in self)
        return total, rate + acceleration * (time - start), acceleration

    def _number(self, time: np.ndarray) -> np.ndarray:
        return np.maximum(np.searchsorted(self.start, time, side="right") - 1, 0)
