"""Rotation about a fixed axis, as scene data and as poses."""

import functools
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from warpdem.core import rigid_motion
from warpdem.core.pose import RotationPart
from warpdem.core.rigid_motion import PI, WIDE, Increment, Pose
from warpdem.scene.base import AngularRate, Direction, Point, exactly_one, validation_error
from warpdem.scene.motion_base import Timed
from warpdem.scene.rates import Knot, Pieces, RateSegment, Sinusoid

_OF_SHIFTS = ("velocity", "amplitude")
_NO_SCHEDULE = (
    "a schedule is one of rates of turning about an axis; a velocity is constant, beside an oscillation with amplitude and "
    "frequency. For one that changes, give the motion as time samples of a USD prim (usd and prim), or change it with phases"
)


class Rotation(Timed):
    """Turning about a fixed axis at a rate that is constant, scheduled, swinging, or interpolated in a table.

    After the last ``until`` of a schedule the rate is 0; a table's rate is constant before its first and after its last
    entry. The angle is 0 at time 0, is not wrapped, and counts positive by the right hand rule about the axis.
    """

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    origin: Point = Field((0.0, 0.0, 0.0), description="A point of the axis [m], default (0, 0, 0).")
    rate: AngularRate | None = Field(
        None, description="Constant angular rate [rad/s]; this, schedule, sinusoid or table."
    )
    schedule: Annotated[list[RateSegment], Field(min_length=1)] | None = Field(
        None, description="Stretches of constant or linearly changing rate, one after the other."
    )
    sinusoid: Sinusoid | None = Field(None, description="A rate that swings about a mean.")
    table: Annotated[list[Knot], Field(min_length=1)] | None = Field(
        None, description="Times [s], >= 0 and rising, and angular rates [rad/s] there: [[t, rate], ...]."
    )

    @model_validator(mode="before")
    @classmethod
    def _only_turns(cls, value: Any) -> Any:
        schedule = value.get("schedule") if isinstance(value, dict) else None
        parts = [part if isinstance(part, dict) else {} for part in schedule] if isinstance(schedule, list) else []
        key_paths = [("schedule", k, key) for k, part in enumerate(parts) for key in _OF_SHIFTS if key in part]
        if schedule is not None and "axis" not in value:
            key_paths += [(key,) for key in _OF_SHIFTS if key in value]
        if key_paths:
            raise validation_error([(key_paths[0], None, _NO_SCHEDULE)])
        return value

    @model_validator(mode="after")
    def _one_rate(self) -> "Rotation":
        exactly_one(self, "rate", "schedule", "sinusoid", "table")
        end = 0.0
        for k, segment in enumerate(self.schedule or []):
            until = ("schedule", k, "until")
            if segment.until is None:
                if k + 1 < len(self.schedule):
                    raise validation_error([(until, None, "missing: only the last stretch may omit it")])
                if isinstance(segment.rate, tuple):
                    raise validation_error([(until, None, "missing: a ramp must end")])
            elif segment.until <= end:
                raise validation_error([(until, segment.until, f"must be later than {end:g} s, where the stretch before ends")])
            else:
                end = segment.until
        times = [time for time, _ in self.table or []]
        for k in range(1, len(times)):
            if times[k] <= times[k - 1]:
                reason = f"must be later than {times[k - 1]:g} s, the entry before"
                raise validation_error([(("table", k, 0), times[k], reason)])
        return self

    @functools.cached_property
    def _pieces(self) -> Pieces:
        if self.table is not None:
            (first_time, first_rate), *_ = self.table
            stretches = [(first_time, first_rate, first_rate)] if first_time > 0 else []
            stretches += [(b[0], a[1], b[1]) for a, b in zip(self.table[:-1], self.table[1:], strict=True)]
            return Pieces.joined(stretches, self.table[-1][1])
        if self.rate is not None:
            return Pieces.joined([], self.rate)
        ended = [s for s in self.schedule if s.until is not None]
        ramps = [s.rate if isinstance(s.rate, tuple) else (s.rate, s.rate) for s in ended]
        last = self.schedule[-1].rate if self.schedule[-1].until is None else 0.0
        return Pieces.joined([(s.until, *ramp) for s, ramp in zip(ended, ramps, strict=True)], last)

    def turning(self, time: np.ndarray, piece: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angle [rad] at ``time`` [s] >= 0, and there rate and acceleration [rad/s2], shapes (k,), long double.

        Rate and acceleration are those of the stretch of the schedule that holds ``piece`` [s]: each side of a jump can
        be asked for.
        """
        if self.sinusoid is None:
            return self._pieces.at(time, piece)
        wave, time = self.sinusoid, np.asarray(time, dtype=WIDE)
        swing = 2 * PI * WIDE(wave.frequency)
        half, phase = swing * time / 2, WIDE(wave.phase)
        # cos(phase) - cos(2 half + phase) without cancellation
        angle = wave.mean * time + 2 * wave.amplitude / swing * np.sin(half + phase) * np.sin(half)
        rate = wave.mean + wave.amplitude * np.sin(2 * half + phase)
        return angle, rate, wave.amplitude * swing * np.cos(2 * half + phase)

    def angle(self, t: float | np.ndarray) -> float | np.ndarray:
        """Angle [rad] turned from time 0 to t [s], t >= 0."""
        result = self.turning(t, t)[0]
        return np.asarray(result, dtype=float) if np.ndim(t) else float(result)

    def rate_at(self, t: float | np.ndarray) -> float | np.ndarray:
        """Angular rate [rad/s] at t [s], t >= 0; where it jumps, the value after the jump."""
        result = self.turning(t, t)[1]
        return np.asarray(result, dtype=float) if np.ndim(t) else float(result)

    @property
    def max_rate(self) -> float:
        """Largest magnitude [rad/s] that the rate ever takes (of a sinusoid: its bound)."""
        if self.sinusoid is not None:
            return abs(self.sinusoid.mean) + abs(self.sinusoid.amplitude)
        if self.table is not None:
            return max(abs(rate) for _, rate in self.table)
        rates = [self.rate] if self.rate is not None else [segment.rate for segment in self.schedule]
        return float(np.max(np.abs(np.hstack(rates))))

    @property
    def turns(self) -> bool:
        """Whether the axes ever turn."""
        return self.max_rate > 0.0

    moves = turns

    def pose(self, time: np.ndarray, piece: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities and accelerations are those of the stretches that hold ``piece`` [s]."""
        axis = rigid_motion.unit(self.axis)
        angle, rate, acceleration = self.turning(time, piece)
        turn = rigid_motion.turn_increment(axis, angle)
        return rigid_motion.turning_about(np.array(self.origin), turn, np.outer(rate, axis), np.outer(acceleration, axis))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive instants of ``time`` [s], shape (k + 1,) gives k."""
        turn = rigid_motion.turn_increment(rigid_motion.unit(self.axis), -np.diff(self.turning(time, time)[0]))
        return Increment(turn, -rigid_motion.apply(turn, np.array(self.origin)))

    def part(self, time: float) -> RotationPart:
        """The place at one instant [s], for writers."""
        return RotationPart(np.array(self.axis), np.array(self.origin), self.angle(time))

    def speed(self, points: np.ndarray, slack: float) -> float:
        """Bound of the speed of points within ``slack`` [m] of those given, shape (n, 3) [m/s]."""
        arm = np.linalg.norm(np.cross(points - np.array(self.origin), np.array(self.axis)), axis=1).max()
        return self.max_rate * (float(arm) + slack)

    def swept(self, points: np.ndarray, slack: float, end: float) -> tuple[np.ndarray, float]:
        """Points and slack [m] that hold the given ones at every time up to ``end`` [s]."""
        centre = np.array(self.origin)
        return centre[None], float(np.linalg.norm(points - centre, axis=1).max()) + slack
