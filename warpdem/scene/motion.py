"""Motions as scene data: rotation, translation, the sampled motion of a USD prim, a fixed placement, and chains of them.

At time 0 of a motion the moving axes and the axes around them coincide, whatever its phases. Its time is that of the scene, or
ahead of it by ``elapsed``. A frame or a wall takes one motion or a list, outermost first: ``[revolution, rotation]`` rotates
about an axis that itself revolves.
"""

import dataclasses
import functools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, PlainSerializer, Tag, field_validator, model_validator

from warpdem.core import rigid_motion
from warpdem.core.pose import SampledPart, TranslationPart
from warpdem.core.rigid_motion import PI, WIDE, Increment, Pose
from warpdem.scene.base import FileName, Point, SceneModel, Vec3, unit_vector, validation_error
from warpdem.scene.motion_base import Frequency, Phase, Timed
from warpdem.scene.rates import (
    PiecewiseRate,
    Velocity,
    VelocityKnot,
    VelocitySegment,
    require_increasing,
)
from warpdem.scene.rotation import Rotation
from warpdem.scene.units import Quantity, Vector
from warpdem.usd.stage import USD_SUFFIXES


class Translation(Timed):
    """Translation by the integral of the velocity + amplitude (sin(2 pi frequency t + phase) - sin(phase)).

    The velocity is constant, scheduled, or interpolated in a table. After the last ``until`` of a schedule it is 0. That of a
    table is constant before its first and after its last entry.
    """

    velocity: Velocity = Field(
        (0.0, 0.0, 0.0), description="Constant velocity [m/s], default 0; this, schedule or table."
    )
    schedule: Annotated[list[VelocitySegment], Field(min_length=1)] | None = Field(
        None, description="Segments of constant or linearly changing velocity, one after the other."
    )
    table: Annotated[list[VelocityKnot], Field(min_length=1)] | None = Field(
        None, description="Times [s], >= 0 and increasing, and velocities [m/s] there: [[t, x, y, z], ...]."
    )
    amplitude: Annotated[Vec3, Vector(Quantity("m"))] | None = Field(
        None, description="Amplitude of the oscillation along each axis [m], default none; needs frequency."
    )
    frequency: Frequency | None = Field(None, description="Frequency of the oscillation [1/s], > 0; rpm is refused.")
    phase: Phase = Field(0.0, description="Phase of the oscillation at time 0 [rad], default 0.")

    @model_validator(mode="after")
    def _oscillation_is_whole(self) -> "Translation":
        if self.amplitude is not None and self.frequency is None:
            raise validation_error([(("frequency",), None, "missing: an amplitude needs a frequency [1/s], > 0")])
        for key, given in (("frequency", self.frequency is not None), ("phase", self.phase != 0.0)):
            if given and self.amplitude is None:
                raise validation_error([((key,), getattr(self, key), "only for an oscillation: give an amplitude [m] too")])
        courses = [key for key in ("schedule", "table") if getattr(self, key) is not None]
        if any(self.velocity):
            courses.append("velocity")
        if len(courses) > 1:
            raise ValueError(f"give one of velocity, schedule and table; found {' and '.join(courses)}")
        if not courses and "velocity" not in self.model_fields_set and self.amplitude is None:
            raise ValueError("give velocity, schedule or table, amplitude with frequency, or both; found none")
        require_increasing(self.schedule, self.table)
        return self

    @functools.cached_property
    def _pieces(self) -> PiecewiseRate | None:
        """The velocity where it changes; None for a constant one."""
        if self.table is not None:
            return PiecewiseRate.tabulated([(time, velocity) for time, *velocity in self.table])
        return PiecewiseRate.scheduled(self.schedule, (0.0, 0.0, 0.0)) if self.schedule is not None else None

    @property
    def max_speed(self) -> float:
        """Largest magnitude of the velocity without the oscillation [m/s]: a ramp is fastest at one of its ends."""
        if self._pieces is None:
            return float(np.linalg.norm(self.velocity))
        found = [velocity for _, *velocity in self.table or ()]
        velocities = [np.reshape(found, (-1, 3)), *(np.reshape(part.velocity, (-1, 3)) for part in self.schedule or ())]
        return float(np.linalg.norm(np.concatenate(velocities), axis=1).max())

    @property
    def rotates(self) -> bool:
        """A translation never rotates."""
        return False

    @property
    def max_rate(self) -> float:
        """Maximum angular rate [rad/s]: none."""
        return 0.0

    @property
    def moves(self) -> bool:
        """Whether the body ever moves."""
        return self.max_speed > 0.0 or any(self.amplitude or ())

    def _oscillation(self) -> tuple[np.ndarray, np.floating, np.floating]:
        """Amplitude [m] (3,), 2 pi f [rad/s] and phase [rad] in long double."""
        amplitude = np.array(self.amplitude or (0.0, 0.0, 0.0), dtype=WIDE)
        return amplitude, 2 * PI * WIDE(self.frequency or 0.0), WIDE(self.phase)

    def _displacement(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Displacement [m] from ``begin`` to ``end`` [s], shape (k, 3): without cancellation of sines."""
        amplitude, pulsation, phase = self._oscillation()
        begin, end = np.asarray(begin, dtype=WIDE), np.asarray(end, dtype=WIDE)
        change = 2 * np.cos(pulsation * (end + begin) / 2 + phase) * np.sin(pulsation * (end - begin) / 2)
        if self._pieces is None:
            steady = np.outer(end - begin, np.array(self.velocity, dtype=WIDE))
        else:
            steady = self._pieces.at(end, end)[0] - self._pieces.at(begin, begin)[0]
        return steady + np.outer(change, amplitude)

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses at ``time`` [s], shape (k,); velocities are those of the segments at ``segment_time`` [s]."""
        amplitude, pulsation, phase = self._oscillation()
        angle = pulsation * np.asarray(time, dtype=WIDE) + phase
        velocity = np.array(self.velocity, dtype=WIDE) + np.outer(pulsation * np.cos(angle), amplitude)
        acceleration = -np.outer(pulsation * pulsation * np.sin(angle), amplitude)
        if self._pieces is not None:
            _, scheduled, change = self._pieces.at(np.asarray(time, dtype=WIDE), segment_time)
            velocity, acceleration = velocity + scheduled, acceleration + change
        return rigid_motion.translation_by(self._displacement(np.zeros_like(time), time), velocity, acceleration)

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""
        shift = self._displacement(time[1:], time[:-1])
        return Increment(np.zeros((len(shift), 3, 3), dtype=WIDE), shift)

    def part(self, time: float) -> TranslationPart:
        """The translation at one time [s], for writers."""
        return TranslationPart(self._displacement(np.zeros(1), np.array([time]))[0].astype(float))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed of any points [m/s]: max |velocity| + 2 pi f |amplitude|."""
        amplitude, pulsation, _ = self._oscillation()
        return float(self.max_speed + pulsation * np.linalg.norm(amplitude.astype(float)))

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""
        amplitude, _, _ = self._oscillation()
        stroke = 2.0 * float(np.linalg.norm(amplitude.astype(float)))
        return points, radius + self.max_speed * end + stroke


class Sampled(Timed):
    """The motion of a prim of a USD file, relative to its pose at time 0; see ``warpdem.usd.motion``."""

    usd: FileName = Field(description="USD file, relative to the scene file.")
    prim: Annotated[str, Field(pattern=r"^/\S+$")] = Field(description='Path of the prim, such as "/World/Shaker".')

    @field_validator("usd")
    @classmethod
    def _known_suffix(cls, value: str) -> str:
        if Path(value).suffix.lower() not in USD_SUFFIXES:
            raise ValueError(f"must be a file ending in {', '.join(USD_SUFFIXES)}")
        return value


class FixedPlacement(SceneModel):
    """A fixed placement: axes that are rotated, then translated, and stay there: x_outer = A x + shift."""

    quaternion: Annotated[tuple[float, ...], Vector(Quantity("-"), length=4), AfterValidator(unit_vector)] = Field(
        (1.0, 0.0, 0.0, 0.0), description="Rotation as a quaternion (w, x, y, z) [-], held as a unit quaternion, default none."
    )
    shift: Point = Field((0.0, 0.0, 0.0), description="Translation [m], default 0.")

    @model_validator(mode="after")
    def _is_not_empty(self) -> "FixedPlacement":
        if not self.model_fields_set:
            raise ValueError("give quaternion, shift or both; found none")
        return self

    rotates: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    max_rate: ClassVar[float] = 0.0

    @functools.cached_property
    def axes(self) -> np.ndarray:
        """A, shape (3, 3), long double."""
        increment = rigid_motion.quaternion_rotation_increment(rigid_motion.unit(self.quaternion)[None])[0]
        return np.asarray(np.eye(3, dtype=WIDE) + increment)

    @property
    def displaces(self) -> bool:
        """Whether the axes do not coincide."""
        return any(self.quaternion[1:]) or any(self.shift)

    def inverse(self, point: np.ndarray) -> np.ndarray:
        """Body coordinates x of the outer ``point`` [m], shape (3,)."""
        return np.asarray(self.axes.T @ (point - np.array(self.shift)), dtype=float)

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """The same pose at every ``time``."""
        at_rest = rigid_motion.still(len(time))
        axes = np.broadcast_to(self.axes, at_rest.axes.shape)
        return dataclasses.replace(at_rest, axes=axes, origin=at_rest.origin + np.array(self.shift))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments of zero between consecutive times; shape (k + 1,) gives k."""
        return Increment(np.zeros((len(time) - 1, 3, 3), dtype=WIDE), np.zeros((len(time) - 1, 3), dtype=WIDE))

    def part(self, time: float) -> SampledPart:
        """The placement, for writers."""
        return SampledPart(np.array(self.quaternion), np.array(self.shift))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed of any points [m/s]: 0."""
        return 0.0

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points [m] in the outer axes, shape (n, 3), and a radius [m]: balls that hold the given balls at every time."""
        return np.asarray(points @ self.axes.T + np.array(self.shift), dtype=float), radius


def _motion_tag(value: Any) -> str:
    """Tag of the motion that a table describes, by its known keys, so that a message can name a misspelt one."""
    keys = set(value) if isinstance(value, dict) else set(getattr(type(value), "model_fields", ()))
    if isinstance(value, Translation) or (isinstance(value, dict) and _of_velocities(value)):
        return "~translation"
    for tag, model in (("~sampled", Sampled), ("~translation", Translation), ("~placement", FixedPlacement)):
        if keys & (set(model.model_fields) - set(Timed.model_fields)) and not keys & _ROTATION_KEYS:
            return tag
    return "~rotation"


def _of_velocities(value: dict[str, Any]) -> bool:
    """Whether a table describes a motion without an axis by a schedule or a table, whose entries hold velocities."""
    if set(value) & _AXIS_KEYS:
        return False
    if set(value) & {"velocity", "amplitude"}:
        return True
    entries = [*_entries(value.get("schedule")), *_entries(value.get("table"))]
    return any(
        (isinstance(entry, dict) and "velocity" in entry)
        or (isinstance(entry, (list, tuple)) and len(entry) == 4)
        for entry in entries
    )


def _entries(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else []


_AXIS_KEYS = {"axis", "origin", "rate", "sinusoid", "pitch"}
_ROTATION_KEYS = set(Rotation.model_fields) - set(Timed.model_fields)
Motion = Rotation | Translation | Sampled | FixedPlacement
_TaggedMotion = Annotated[
    Annotated[Rotation, Tag("~rotation")]
    | Annotated[Translation, Tag("~translation")]
    | Annotated[Sampled, Tag("~sampled")]
    | Annotated[FixedPlacement, Tag("~placement")],
    Discriminator(_motion_tag),
]
if TYPE_CHECKING:
    Motions = tuple[Motion, ...]
else:
    Motions = Annotated[
        Annotated[list[_TaggedMotion], Field(min_length=1), Tag("~list")] | Annotated[_TaggedMotion, Tag("~one")],
        Discriminator(lambda value: "~list" if isinstance(value, (list, tuple)) else "~one"),
        AfterValidator(lambda value: tuple(value) if isinstance(value, list) else (value,)),
        PlainSerializer(lambda motions: motions, return_type=Any),  # a tuple is neither of the two forms above
    ]
"""One motion or a list of them, outermost first; held as a tuple."""
