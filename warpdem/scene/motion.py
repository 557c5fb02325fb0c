"""Motions as scene data: rotation, translation, the sampled motion of a USD prim, a fixed place, and chains of them.

A motion starts from rest of place: at its time 0 the moving axes and those around them coincide, whatever the phases; its time
is that of the scene, or ahead of it by ``elapsed``. A frame or a wall takes one motion or a list, outermost first:
``[revolution, rotation]`` turns about an axis that is itself carried round.
"""

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    PlainSerializer,
    Tag,
    field_validator,
    model_validator,
)

from warpdem.core import rigid_motion
from warpdem.core.pose import Part, RotationPart, SampledPart, TranslationPart
from warpdem.core.rigid_motion import PI, WIDE, Increment, Pose
from warpdem.scene.base import (
    AngularRate,
    Direction,
    Duration,
    FileName,
    Point,
    SceneModel,
    Vec3,
    exactly_one,
    unit_vector,
    wrong,
)
from warpdem.scene.units import Quantity, Vector
from warpdem.usd import motion as usd_motion
from warpdem.usd.stage import USD_SUFFIXES

RateOrRamp = Annotated[
    Annotated[AngularRate, Tag("~number")]
    | Annotated[tuple[float, float], Vector(Quantity("rad/s"), length=2), Tag("~ramp")],
    Discriminator(lambda value: "~ramp" if isinstance(value, (list, tuple)) else "~number"),
]
Frequency = Annotated[float, Quantity("1/s", gt=0)]
Phase = Annotated[float, Quantity("rad")]


class Timed(SceneModel):
    """What all motions have: a time of their own."""

    elapsed: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0, description="How long the motion has been going on at time 0 [s], >= 0, default 0: its time is ahead by this."
    )


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
        places = [("schedule", k, key) for k, part in enumerate(parts) for key in _OF_SHIFTS if key in part]
        if schedule is not None and "axis" not in value:
            places += [(key,) for key in _OF_SHIFTS if key in value]
        if places:
            raise wrong([(places[0], None, _NO_SCHEDULE)])
        return value

    @model_validator(mode="after")
    def _one_rate(self) -> "Rotation":
        exactly_one(self, "rate", "schedule", "sinusoid", "table")
        end = 0.0
        for k, segment in enumerate(self.schedule or []):
            until = ("schedule", k, "until")
            if segment.until is None:
                if k + 1 < len(self.schedule):
                    raise wrong([(until, None, "missing: only the last stretch may omit it")])
                if isinstance(segment.rate, tuple):
                    raise wrong([(until, None, "missing: a ramp must end")])
            elif segment.until <= end:
                raise wrong([(until, segment.until, f"must be later than {end:g} s, where the stretch before ends")])
            else:
                end = segment.until
        times = [time for time, _ in self.table or []]
        for k in range(1, len(times)):
            if times[k] <= times[k - 1]:
                raise wrong([(("table", k, 0), times[k], f"must be later than {times[k - 1]:g} s, the entry before")])
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


class Translation(Timed):
    """Shifting without turning: velocity t + amplitude (sin(2 pi frequency t + phase) - sin(phase))."""

    velocity: Annotated[Vec3, Vector(Quantity("m/s"))] = Field(
        (0.0, 0.0, 0.0), description="Constant velocity [m/s], default 0."
    )
    amplitude: Annotated[Vec3, Vector(Quantity("m"))] | None = Field(
        None, description="Amplitude of the oscillation along each axis [m], default none; needs frequency."
    )
    frequency: Frequency | None = Field(None, description="Frequency of the oscillation [1/s], > 0; rpm is refused.")
    phase: Phase = Field(0.0, description="Phase of the oscillation at time 0 [rad], default 0.")

    @model_validator(mode="after")
    def _oscillation_is_whole(self) -> "Translation":
        if self.amplitude is not None and self.frequency is None:
            raise wrong([(("frequency",), None, "missing: an amplitude needs a frequency [1/s], > 0")])
        for key, given in (("frequency", self.frequency is not None), ("phase", self.phase != 0.0)):
            if given and self.amplitude is None:
                raise wrong([((key,), getattr(self, key), "only for an oscillation: give an amplitude [m] too")])
        if "velocity" not in self.model_fields_set and self.amplitude is None:
            raise ValueError("give velocity, amplitude with frequency, or both; found none")
        return self

    @property
    def turns(self) -> bool:
        """It never turns."""
        return False

    @property
    def max_rate(self) -> float:
        """No angular rate [rad/s]."""
        return 0.0

    @property
    def moves(self) -> bool:
        """Whether it ever moves."""
        return any(self.velocity) or any(self.amplitude or ())

    def _swing(self) -> tuple[np.ndarray, np.floating, np.floating]:
        """Amplitude [m] (3,), 2 pi f [rad/s] and phase [rad] in long double."""
        amplitude = np.array(self.amplitude or (0.0, 0.0, 0.0), dtype=WIDE)
        return amplitude, 2 * PI * WIDE(self.frequency or 0.0), WIDE(self.phase)

    def _shift(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Way from ``begin`` to ``end`` [s], shape (k, 3): the difference of sines as a product, without cancellation."""
        amplitude, swing, phase = self._swing()
        begin, end = np.asarray(begin, dtype=WIDE), np.asarray(end, dtype=WIDE)
        rise = 2 * np.cos(swing * (end + begin) / 2 + phase) * np.sin(swing * (end - begin) / 2)
        return np.outer(end - begin, np.array(self.velocity, dtype=WIDE)) + np.outer(rise, amplitude)

    def pose(self, time: np.ndarray, piece: np.ndarray) -> Pose:
        """Poses at ``time`` [s], shape (k,); there are no pieces."""
        amplitude, swing, phase = self._swing()
        angle = swing * np.asarray(time, dtype=WIDE) + phase
        velocity = np.array(self.velocity, dtype=WIDE) + np.outer(swing * np.cos(angle), amplitude)
        acceleration = -np.outer(swing * swing * np.sin(angle), amplitude)
        return rigid_motion.shifting_by(self._shift(np.zeros_like(time), time), velocity, acceleration)

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive instants of ``time`` [s], shape (k + 1,) gives k."""
        shift = self._shift(time[1:], time[:-1])
        return Increment(np.zeros((len(shift), 3, 3), dtype=WIDE), shift)

    def part(self, time: float) -> TranslationPart:
        """The place at one instant [s], for writers."""
        return TranslationPart(self._shift(np.zeros(1), np.array([time]))[0].astype(float))

    def speed(self, points: np.ndarray, slack: float) -> float:
        """Bound of the speed of any points [m/s]: |velocity| + 2 pi f |amplitude|."""
        amplitude, swing, _ = self._swing()
        return float(np.linalg.norm(self.velocity) + swing * np.linalg.norm(amplitude.astype(float)))

    def swept(self, points: np.ndarray, slack: float, end: float) -> tuple[np.ndarray, float]:
        """Points and slack [m] that hold the given ones at every time up to ``end`` [s]."""
        amplitude, _, _ = self._swing()
        swing = 2.0 * float(np.linalg.norm(amplitude.astype(float)))
        return points, slack + float(np.linalg.norm(self.velocity)) * end + swing


class Sampled(Timed):
    """The motion of a prim of a USD file, relative to its place at time 0; see ``warpdem.usd.motion``."""

    usd: FileName = Field(description="USD file, relative to the scene file.")
    prim: Annotated[str, Field(pattern=r"^/\S+$")] = Field(description='Path of the prim, such as "/World/Shaker".')

    @field_validator("usd")
    @classmethod
    def _known_suffix(cls, value: str) -> str:
        if Path(value).suffix.lower() not in USD_SUFFIXES:
            raise ValueError(f"must be a file ending in {', '.join(USD_SUFFIXES)}")
        return value


class Standing(SceneModel):
    """A fixed place: axes that are turned, then shifted, and stay there: x_outer = A x + shift."""

    quaternion: Annotated[tuple[float, ...], Vector(Quantity("-"), length=4), AfterValidator(unit_vector)] = Field(
        (1.0, 0.0, 0.0, 0.0), description="Turn as a quaternion (w, x, y, z) [-], held as a unit one, default none."
    )
    shift: Point = Field((0.0, 0.0, 0.0), description="Shift [m], default 0.")

    @model_validator(mode="after")
    def _says_something(self) -> "Standing":
        if not self.model_fields_set:
            raise ValueError("give quaternion, shift or both; found none")
        return self

    turns: ClassVar[bool] = False
    moves: ClassVar[bool] = False
    max_rate: ClassVar[float] = 0.0

    @functools.cached_property
    def axes(self) -> np.ndarray:
        """A, shape (3, 3), long double."""
        return np.eye(3, dtype=WIDE) + rigid_motion.quaternion_turn_increment(rigid_motion.unit(self.quaternion)[None])[0]

    @property
    def displaces(self) -> bool:
        """Whether the axes do not coincide."""
        return any(self.quaternion[1:]) or any(self.shift)

    def inverse(self, point: np.ndarray) -> np.ndarray:
        """The point x of the body that is at ``point`` [m], shape (3,)."""
        return (self.axes.T @ (point - np.array(self.shift))).astype(float)

    def pose(self, time: np.ndarray, piece: np.ndarray) -> Pose:
        """The same pose at each ``time``."""
        at_rest = rigid_motion.still(len(time))
        axes = np.broadcast_to(self.axes, at_rest.axes.shape)
        return dataclasses.replace(at_rest, axes=axes, origin=at_rest.origin + np.array(self.shift))

    def increments(self, time: np.ndarray) -> Increment:
        """None of k."""
        return Increment(np.zeros((len(time) - 1, 3, 3), dtype=WIDE), np.zeros((len(time) - 1, 3), dtype=WIDE))

    def part(self, time: float) -> SampledPart:
        """The place, for writers."""
        return SampledPart(np.array(self.quaternion), np.array(self.shift))

    def speed(self, points: np.ndarray, slack: float) -> float:
        """Nothing moves [m/s]."""
        return 0.0

    def swept(self, points: np.ndarray, slack: float, end: float) -> tuple[np.ndarray, float]:
        """The points in the outer axes, shape (n, 3) [m]."""
        return (points @ self.axes.T + np.array(self.shift)).astype(float), slack


class Begun:
    """A motion whose time is ahead by ``elapsed`` [s]."""

    def __init__(self, motion, elapsed: float) -> None:
        self.motion, self.elapsed = motion, WIDE(elapsed)
        self.turns, self.moves, self.max_rate = motion.turns, motion.moves, motion.max_rate

    def pose(self, time: np.ndarray, piece: np.ndarray) -> Pose:
        """As that of the motion, later."""
        return self.motion.pose(time + self.elapsed, piece + self.elapsed)

    def increments(self, time: np.ndarray) -> Increment:
        """As those of the motion, later."""
        return self.motion.increments(time + self.elapsed)

    def part(self, time: float) -> Part:
        """As that of the motion, later."""
        return self.motion.part(float(time + self.elapsed))

    def speed(self, points: np.ndarray, slack: float) -> float:
        """Bound of the speed of points [m/s]."""
        return self.motion.speed(points, slack)

    def swept(self, points: np.ndarray, slack: float, end: float) -> tuple[np.ndarray, float]:
        """Points and slack [m] that hold the given ones at every time up to ``end`` [s]."""
        return self.motion.swept(points, slack, end + float(self.elapsed))


def _kind(value: Any) -> str:
    """The motion that a table describes, by its keys: a misspelt key is answered beside those that are right."""
    keys = set(value) if isinstance(value, dict) else set(getattr(type(value), "model_fields", ()))
    for tag, model in (("~sampled", Sampled), ("~translation", Translation), ("~standing", Standing)):
        if keys & (set(model.model_fields) - set(Timed.model_fields)) and not keys & _OF_ROTATION:
            return tag
    return "~rotation"


_OF_ROTATION = set(Rotation.model_fields) - set(Timed.model_fields)


Motion = Annotated[
    Annotated[Rotation, Tag("~rotation")]
    | Annotated[Translation, Tag("~translation")]
    | Annotated[Sampled, Tag("~sampled")]
    | Annotated[Standing, Tag("~standing")],
    Discriminator(_kind),
]

Motions = Annotated[
    Annotated[list[Motion], Field(min_length=1), Tag("~list")] | Annotated[Motion, Tag("~one")],
    Discriminator(lambda value: "~list" if isinstance(value, (list, tuple)) else "~one"),
    AfterValidator(lambda value: tuple(value) if isinstance(value, list) else (value,)),
    PlainSerializer(lambda motions: motions, return_type=Any),  # a tuple is neither of the two forms above
]
"""One motion or a list of them, outermost first; held as a tuple."""


class Chain:
    """Motions within motions, outermost first; an empty one never moves.

    ``turns`` and ``moves`` tell whether the axes ever do, ``displaces`` whether they ever do not coincide with those around.

    Args:
        motions: the scene's motions; None is an empty chain.
        resolve: path of a file that the scene names.
        where: source and key of the scene, for messages.
        folders: folders that all files which a USD file refers to must lie in; None is no bound.

    Raises:
        SceneError: a sampled motion cannot be read.
    """

    def __init__(self, motions: tuple | None, resolve: Callable[[str], Path], where: str, folders=None) -> None:
        keys = [f"{where}[{k}]" if len(motions) > 1 else where for k in range(len(motions or ()))]
        self.motions = []
        for motion, key in zip(motions or (), keys, strict=True):
            course = motion
            if isinstance(motion, Sampled):
                course = usd_motion.read(resolve(motion.usd), motion.prim, key, folders)
            elapsed = getattr(motion, "elapsed", 0.0)
            self.motions.append(Begun(course, elapsed) if elapsed > 0.0 else course)
        self.turns = any(motion.turns for motion in self.motions)
        self.moves = any(motion.moves for motion in self.motions)
        self.max_rate = sum(motion.max_rate for motion in self.motions)
        self.displaces = self.moves or any(motion.displaces for motion in motions or () if isinstance(motion, Standing))

    def pose(self, time: np.ndarray, piece: np.ndarray | None = None) -> Pose:
        """Poses of the innermost body at ``time`` [s], shape (k,), velocities and accelerations by ``piece`` [s].

        Where a rate or velocity jumps, ``piece`` tells the side; None takes the value after the jump.
        """
        piece = time if piece is None else piece
        poses = [motion.pose(time, piece) for motion in self.motions]
        return functools.reduce(rigid_motion.compose, poses) if poses else rigid_motion.still(len(time))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive instants of ``time`` [s], shape (k + 1,) gives k."""
        steps = len(time) - 1
        total = Increment(np.zeros((steps, 3, 3), dtype=WIDE), np.zeros((steps, 3), dtype=WIDE))
        for k, motion in enumerate(self.motions):
            own = motion.increments(time)
            if k == 0:
                total = own
                continue
            pose = motion.pose(time, time)
            total = rigid_motion.chained(total, own, pose[:-1], pose[1:])
        return total

    def parts(self, time: float) -> tuple[Part, ...]:
        """The places of the single motions at ``time`` [s]."""
        return tuple(motion.part(time) for motion in self.motions)

    def speed(self, points: np.ndarray, end: float) -> float:
        """Bound of the speed of body points, shape (n, 3), up to ``end`` [s] [m/s]."""
        total, slack = 0.0, 0.0
        for motion in reversed(self.motions):
            total += motion.speed(points, slack)
            points, slack = motion.swept(points, slack, end)
        return total


def frame_chain(scene) -> Chain:
    """Motion of the frame of a scene."""
    return Chain(scene.frame, scene.resolve, f"{scene.source}: frame", scene.access.folders)


def wall_chain(scene, number: int) -> Chain:
    """Own motion of a wall of a scene."""
    where = f"{scene.source}: walls[{number}].motion"
    return Chain(scene.walls[number].motion, scene.resolve, where, scene.access.folders)


def largest_rates(scene) -> dict[str, float]:
    """Largest magnitude [rad/s] of the rate of each motion of a scene, by key; those that never turn are left out."""
    chains = {"frame": frame_chain(scene)} | {f"walls[{k}].motion": wall_chain(scene, k) for k in range(len(scene.walls))}
    return {
        f"{key}[{k}]" if len(chain.motions) > 1 else key: motion.max_rate
        for key, chain in chains.items()
        for k, motion in enumerate(chain.motions)
        if motion.turns
    }
