"""Rotation about a fixed axis, as scene data and as poses."""

import functools
from typing import Annotated, Any, overload

import numpy as np
from pydantic import Field, model_validator

from warpdem.core import rigid_motion
from warpdem.core.key_path import KeyPath
from warpdem.core.pose import RotationPart
from warpdem.core.rigid_motion import PI, WIDE, Increment, Pose
from warpdem.scene.base import AngularRate, Direction, Point, exactly_one, validation_error
from warpdem.scene.motion_base import Timed
from warpdem.scene.rates import Knot, PiecewiseRate, RateSegment, Sinusoid, require_increasing
from warpdem.scene.units import Quantity

_TRANSLATION_KEYS = ("velocity", "amplitude")
_NO_VELOCITIES = (
    "about an axis a schedule is one of angular rates; a schedule of velocities is a motion of its own, without axis, and a "
    "list of both is a chain. For a screw motion give the rotation a pitch"
)


class Rotation(Timed):
    """Rotation about a fixed axis at a rate that is constant, scheduled, oscillating, or interpolated in a table.

    After the last ``until`` of a schedule the rate is 0. The rate of a table is constant before its first and after its last
    entry. The angle is 0 at time 0, is not wrapped, and is positive by the right-hand rule about the axis.
    """

    axis: Direction = Field(description="Direction of the axis [-], any length but zero; held as a unit vector.")
    origin: Point = Field((0.0, 0.0, 0.0), description="A point on the axis [m], default (0, 0, 0).")
    rate: AngularRate | None = Field(
        None, description="Constant angular rate [rad/s]; this, schedule, sinusoid or table."
    )
    schedule: Annotated[list[RateSegment], Field(min_length=1)] | None = Field(
        None, description="Segments of constant or linearly changing rate, one after the other."
    )
    sinusoid: Sinusoid | None = Field(None, description="A rate that oscillates about a mean.")
    table: Annotated[list[Knot], Field(min_length=1)] | None = Field(
        None, description="Times [s], >= 0 and increasing, and angular rates [rad/s] there: [[t, rate], ...]."
    )
    pitch: Annotated[float, Quantity("m")] = Field(
        0.0, description="Advance along the axis per revolution [m], of either sign, default 0: a screw motion (helix)."
    )

    @model_validator(mode="before")
    @classmethod
    def _no_translation_keys(cls, value: Any) -> Any:
        schedule = value.get("schedule") if isinstance(value, dict) else None
        parts = [part if isinstance(part, dict) else {} for part in schedule] if isinstance(schedule, list) else []
        key_paths: list[KeyPath] = [
            ("schedule", k, key) for k, part in enumerate(parts) for key in _TRANSLATION_KEYS if key in part
        ]
        if key_paths:
            raise validation_error([(key_paths[0], None, _NO_VELOCITIES)])
        return value

    @model_validator(mode="after")
    def _one_rate(self) -> "Rotation":
        exactly_one(self, "rate", "schedule", "sinusoid", "table")
        require_increasing(self.schedule, self.table)
        return self

    @functools.cached_property
    def _pieces(self) -> PiecewiseRate:
        if self.table is not None:
            return PiecewiseRate.tabulated(self.table)
        if self.rate is not None:
            return PiecewiseRate.of([], self.rate)
        return PiecewiseRate.scheduled(self.schedule or [], 0.0)

    def angle_and_rates(self, time: np.ndarray, segment_time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angle [rad] at ``time`` [s] >= 0, and there rate and acceleration [rad/s2], shapes (k,), long double.

        Rate and acceleration are those of the segment of the schedule at ``segment_time`` [s], so that both sides of a jump are
        available.
        """
        if self.sinusoid is None:
            return self._pieces.at(time, segment_time)
        wave, time = self.sinusoid, np.asarray(time, dtype=WIDE)
        pulsation = 2 * PI * WIDE(wave.frequency)  # [rad/s]
        half, phase = pulsation * time / 2, WIDE(wave.phase)
        # cos(phase) - cos(2 half + phase) without cancellation
        angle = wave.mean * time + 2 * wave.amplitude / pulsation * np.sin(half + phase) * np.sin(half)
        rate = wave.mean + wave.amplitude * np.sin(2 * half + phase)
        return angle, rate, wave.amplitude * pulsation * np.cos(2 * half + phase)

    @overload
    def angle(self, t: float) -> float: ...

    @overload
    def angle(self, t: np.ndarray) -> np.ndarray: ...

    def angle(self, t: float | np.ndarray) -> float | np.ndarray:
        """Rotation angle [rad] from time 0 to t [s], t >= 0."""
        result = self.angle_and_rates(np.asarray(t), np.asarray(t))[0]
        return np.asarray(result, dtype=float) if np.ndim(t) else float(result)

    @overload
    def rate_at(self, t: float) -> float: ...

    @overload
    def rate_at(self, t: np.ndarray) -> np.ndarray: ...

    def rate_at(self, t: float | np.ndarray) -> float | np.ndarray:
        """Angular rate [rad/s] at t [s], t >= 0; where it jumps, the value after the jump."""
        result = self.angle_and_rates(np.asarray(t), np.asarray(t))[1]
        return np.asarray(result, dtype=float) if np.ndim(t) else float(result)

    @property
    def max_rate(self) -> float:
        """Maximum magnitude of the rate [rad/s]; of a sinusoid its bound."""
        if self.sinusoid is not None:
            return abs(self.sinusoid.mean) + abs(self.sinusoid.amplitude)
        if self.table is not None:
            return max(abs(rate) for _, rate in self.table)
        rates = [self.rate] if self.rate is not None else [segment.rate for segment in self.schedule or []]
        return float(np.max(np.abs(np.hstack(rates))))

    @property
    def rotates(self) -> bool:
        """Whether the axes ever rotate."""
        return self.max_rate > 0.0

    @property
    def moves(self) -> bool:
        """Whether the body ever moves."""
        return self.rotates

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities and accelerations are those of the segments at ``segment_time`` [s]."""
        axis = rigid_motion.unit(self.axis)
        angle, rate, acceleration = self.angle_and_rates(time, segment_time)
        change = rigid_motion.rotation_increment(axis, angle)
        return rigid_motion.rotation_about(np.array(self.origin), change, np.outer(rate, axis), np.outer(acceleration, axis))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""
        angle, _, _ = self.angle_and_rates(time, time)
        change = rigid_motion.rotation_increment(rigid_motion.unit(self.axis), -np.diff(angle))
        return Increment(change, -rigid_motion.apply(change, np.array(self.origin)))

    def part(self, time: float) -> RotationPart:
        """The rotation at one time [s], for writers."""
        return RotationPart(np.array(self.axis), np.array(self.origin), self.angle(time))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed [m/s] of all points within ``radius`` [m] of the given ones, shape (n, 3)."""
        arm = np.linalg.norm(np.cross(points - np.array(self.origin), np.array(self.axis)), axis=1).max()
        return self.max_rate * (float(arm) + radius)

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""
        centre = np.array(self.origin)
        return centre[None], float(np.linalg.norm(points - centre, axis=1).max()) + radius
