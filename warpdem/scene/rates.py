"""Rates that change with time: schedules of constant rates and ramps, sinusoids, tables; angular ones, and velocities."""

import itertools
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from warpdem.core.key_path import KeyPath
from warpdem.core.rigid_motion import WIDE
from warpdem.scene.base import AngularRate, Duration, SceneModel, Vec3, validation_error
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


def _velocities(value: Any) -> str:
    """Tag of a velocity: three numbers, or the two velocities of a ramp."""
    ramp = isinstance(value, (list, tuple)) and len(value) == 2 and all(isinstance(v, (list, tuple)) for v in value)
    return "~ramp" if ramp else "~vector"


Velocity = Annotated[Vec3, Vector(Quantity("m/s"))]
VelocityOrRamp = Annotated[
    Annotated[Velocity, Tag("~vector")] | Annotated[tuple[Velocity, Velocity], Tag("~ramp")], Discriminator(_velocities)
]


class VelocitySegment(SceneModel):
    """One segment of a velocity schedule."""

    until: Duration | None = Field(
        None, description="End of the segment [s], > 0 and increasing; only the last may omit it and then has no end."
    )
    velocity: VelocityOrRamp = Field(description="Velocity [m/s], three numbers, or [start, end] of a linear ramp.")

    @property
    def rate(self) -> Vec3 | tuple[Vec3, Vec3]:
        """The velocity, as the rate of a segment."""
        return self.velocity


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


def _time_and_velocity(entry: Any) -> Any:
    if not isinstance(entry, (list, tuple, np.ndarray)) or len(entry) != 4:
        raise ValueError("must be a list of 4 numbers, [time in [s], three components of the velocity in [m/s]]")
    return entry


def _time_and_speed(entry: Any) -> Any:
    if not isinstance(entry, (list, tuple, np.ndarray)) or len(entry) != 2:
        raise ValueError("must be a list of 2 numbers, [time in [s], speed in [m/s]]")
    return entry


Time = Annotated[float, Quantity("s", ge=0)]
Knot = Annotated[tuple[Time, AngularRate], BeforeValidator(_time_and_rate)]
Speed = Annotated[float, Quantity("m/s")]
SpeedKnot = Annotated[tuple[Time, Speed], BeforeValidator(_time_and_speed)]
VelocityKnot = Annotated[tuple[Time, Speed, Speed, Speed], BeforeValidator(_time_and_velocity)]


def require_increasing(
    schedule: Sequence[RateSegment | VelocitySegment] | None, table: Sequence[tuple[float, ...]] | None
) -> None:
    """Refuse a schedule or a table whose times do not increase, and a schedule whose end is missing.

    Raises:
        ValidationError: With the key of the entry.
    """
    end = 0.0
    for k, segment in enumerate(schedule or []):
        until: KeyPath = ("schedule", k, "until")
        if segment.until is None:
            if k + 1 < len(schedule or []):
                raise validation_error([(until, None, "missing: only the last segment may omit it")])
            if is_ramp(segment):
                raise validation_error([(until, None, "missing: a ramp must end")])
        elif segment.until <= end:
            reason = f"must be later than {end:g} s, where the segment before it ends"
            raise validation_error([(until, segment.until, reason)])
        else:
            end = segment.until
    times = [entry[0] for entry in table or []]
    for k in range(1, len(times)):
        if times[k] <= times[k - 1]:
            reason = f"must be later than {times[k - 1]:g} s, the entry before"
            raise validation_error([(("table", k, 0), times[k], reason)])


def is_ramp(segment: RateSegment | VelocitySegment) -> bool:
    """Whether the rate of a segment changes linearly."""
    return isinstance(segment.rate, tuple) and len(segment.rate) == 2


class PiecewiseRate(NamedTuple):
    """A piecewise linear rate, arrays (k,) of an angular one or (k, 3) of a velocity, in long double.

    The last segment has no end. In the units of a velocity, angles are displacements [m].
    """

    start: np.ndarray
    """Start of each segment [s], increasing from 0, shape (k,)."""
    angle: np.ndarray
    """Angle at the start [rad]."""
    rate: np.ndarray
    """Rate at the start [rad/s]."""
    acceleration: np.ndarray
    """Acceleration in each segment [rad/s2]."""

    @classmethod
    def of(cls, segments: Sequence[tuple[float, Any, Any]], last: Any) -> "PiecewiseRate":
        """The rate of segments (end [s], initial and final rate [rad/s]) from time 0 on, then constant at ``last``."""
        constant = np.asarray(last, dtype=WIDE)
        rows, start, angle = [], WIDE(0), np.zeros_like(constant)
        for end, *rates in segments:
            length = WIDE(end) - start
            initial, final = (np.asarray(rate, dtype=WIDE) for rate in rates)
            rows.append((start, angle, initial, (final - initial) / length))
            start, angle = WIDE(end), angle + (initial + final) / 2 * length
        rows.append((start, angle, constant, np.zeros_like(constant)))
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    @classmethod
    def scheduled(cls, schedule: Sequence[RateSegment | VelocitySegment], rest: Any) -> "PiecewiseRate":
        """The rate of a schedule, and ``rest`` after its end."""
        segments, last = [], rest
        for segment in schedule:
            rates: Any = segment.rate if is_ramp(segment) else (segment.rate, segment.rate)
            if segment.until is None:  # the last one, of constant rate
                last = rates[1]
            else:
                segments.append((segment.until, *rates))
        return cls.of(segments, last)

    @classmethod
    def tabulated(cls, table: Sequence[tuple[float, Any]]) -> "PiecewiseRate":
        """The rate between the entries of a table, constant before the first and after the last."""
        (first_time, first_rate), *_ = table
        segments = [(first_time, first_rate, first_rate)] if first_time > 0 else []
        segments += [(b[0], a[1], b[1]) for a, b in itertools.pairwise(table)]
        return cls.of(segments, table[-1][1])

    def at(self, time: np.ndarray, segment_time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angle at ``time`` [s], and there rate and acceleration of the segments at ``segment_time`` [s].

        Times of shape (k,), results of shape (k,), of a velocity (k, 3).
        """
        start, angle, rate, acceleration = (column[self._number(time)] for column in self)
        since = self._beside(time - start)
        total = angle + since * (rate + acceleration * since / 2)
        start, _, rate, acceleration = (column[self._number(segment_time)] for column in self)
        return total, rate + acceleration * self._beside(time - start), acceleration

    def _beside(self, time: np.ndarray) -> np.ndarray:
        """Times [s] in the shape that multiplies rates."""
        return time if self.rate.ndim == 1 else np.asarray(time)[..., None]

    def _number(self, time: np.ndarray) -> np.ndarray:
        return np.maximum(np.searchsorted(self.start, time, side="right") - 1, 0)
