"""Servos as scene data: walls that a controller moves so that the grains bear a given load."""

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from warpdem.scene.base import AngularRate, Direction, Point, exactly_one, validation_error
from warpdem.scene.motion_base import Timed
from warpdem.scene.rates import PiecewiseRate, Speed, Time
from warpdem.scene.units import Quantity

Force = Annotated[float, Quantity("N")]
Pressure = Annotated[float, Quantity("Pa")]
Torque = Annotated[float, Quantity("N m")]


def _knots(what: str) -> BeforeValidator:
    def checked(entry: Any) -> Any:
        if not isinstance(entry, (list, tuple, np.ndarray)) or len(entry) != 2:
            raise ValueError(f"must be a list of 2 numbers, [time in [s], {what}]")
        return entry

    return BeforeValidator(checked)


def _tag(value: Any) -> str:
    return "~table" if isinstance(value, (list, tuple, np.ndarray)) else "~number"


ForceCourse = Annotated[
    Annotated[Force, Tag("~number")]
    | Annotated[list[Annotated[tuple[Time, Force], _knots("force in [N]")]], Field(min_length=1), Tag("~table")],
    Discriminator(_tag),
]
PressureCourse = Annotated[
    Annotated[Pressure, Tag("~number")]
    | Annotated[list[Annotated[tuple[Time, Pressure], _knots("pressure in [Pa]")]], Field(min_length=1), Tag("~table")],
    Discriminator(_tag),
]
TorqueCourse = Annotated[
    Annotated[Torque, Tag("~number")]
    | Annotated[list[Annotated[tuple[Time, Torque], _knots("torque in [N m]")]], Field(min_length=1), Tag("~table")],
    Discriminator(_tag),
]


def require_increasing_course(key: str, course: float | list[tuple[float, float]]) -> None:
    """Refuse a table whose times do not increase.

    Raises:
        ValidationError: with ``key`` and the entry.
    """
    table = course if isinstance(course, list) else []
    for k in range(1, len(table)):
        if table[k][0] <= table[k - 1][0]:
            reason = f"must be later than {table[k - 1][0]:g} s, the entry before"
            raise validation_error([((key, k, 0), table[k][0], reason)])


def at_times(course: float | list[tuple[float, float]], times: np.ndarray) -> np.ndarray:
    """Values of a course at ``times`` [s], shape (k,): straight between the entries of a table, constant beyond."""
    if not isinstance(course, list):
        return np.full(len(times), float(course))
    return PiecewiseRate.tabulated(course).at(times, times)[1].astype(float)


class Servo(Timed):
    """A controller that moves a wall along an axis, or about one, so that it loads the grains as asked.

    The load is what the wall does to the grains: the component of its force along ``axis``, or of its torque about it. The wall
    rests before ``start`` and stays where it is after ``until``.
    """

    axis: Direction = Field(
        description="Direction [-] in which the wall pushes, or axis about which it turns, by the right-hand rule; any length "
        "but zero, held as a unit vector. In the axes of the wall at time 0."
    )
    origin: Point = Field((0.0, 0.0, 0.0), description="With torque: a point on the axis [m], default (0, 0, 0).")
    force: ForceCourse | None = Field(
        None, description="Force on the grains along the axis [N], or [[t [s], >= 0, force], ...]; this, pressure or torque."
    )
    pressure: PressureCourse | None = Field(
        None, description="Pressure on the grains along the axis [Pa], or [[t [s], >= 0, pressure], ...]: a force over area."
    )
    area: Annotated[float, Quantity("m2", gt=0)] | None = Field(
        None,
        description="With pressure: area that it acts on [m2], > 0; default that of the mesh seen along the axis. A shape "
        "needs it.",
    )
    torque: TorqueCourse | None = Field(
        None, description="Torque on the grains about the axis [N m], or [[t [s], >= 0, torque [N m]], ...]."
    )
    max_speed: Annotated[Speed, Quantity("m/s", gt=0)] | None = Field(
        None, description="With force or pressure, needed: largest speed [m/s], > 0. The wall comes to the grains with it."
    )
    max_rate: Annotated[AngularRate, Quantity("rad/s", gt=0)] | None = Field(
        None, description="With torque, needed: largest angular rate [rad/s], > 0."
    )

    @model_validator(mode="after")
    def _keys_fit(self) -> "Servo":
        exactly_one(self, "force", "pressure", "torque")
        needed, stray = ("max_rate", "max_speed") if self.rotates else ("max_speed", "max_rate")
        if getattr(self, needed) is None:
            raise validation_error([((needed,), None, f"missing: a servo needs its largest {needed[4:]}")])
        given = "torque" if self.torque is not None else "force" if self.force is not None else "pressure"
        wrong = [(stray, getattr(self, stray) is not None), ("origin", not self.rotates and any(self.origin))]
        wrong.append(("area", self.pressure is None and self.area is not None))
        for key, found in wrong:
            if found:
                raise validation_error([((key,), getattr(self, key), f"not with {given}")])
        require_increasing_course(given, getattr(self, given))
        return self

    def ahead_by(self, time: float) -> "Servo":
        """The same, whose time is ``time`` [s] at time 0."""
        return self.model_copy(update={"elapsed": time})

    @property
    def rotates(self) -> bool:
        """Whether the wall turns about the axis."""
        return self.torque is not None

    @property
    def most(self) -> float:
        """Largest speed [m/s] or angular rate [rad/s]."""
        return float(self.max_rate if self.rotates else self.max_speed)  # type: ignore[arg-type]  # one of them is given

    def target(self, times: np.ndarray) -> np.ndarray:
        """Load asked for at ``times`` [s] of the run, shape (k,) [N, Pa or N m]; NaN where the wall is held."""
        course = next(given for given in (self.force, self.pressure, self.torque) if given is not None)
        own = times + self.elapsed
        load = at_times(course, np.maximum(own - self.start, 0.0))
        active = (own >= self.start) & (own < (np.inf if self.until is None else self.until))
        return np.where(active, load, np.nan)

    def speed_bound(self, points: np.ndarray, fall: float) -> float:
        """Upper bound of the speed of body points, shape (n, 3), by the servo [m/s]; a ``fall`` [m/s] adds nothing."""
        if not self.rotates:
            return self.most
        arm = np.linalg.norm(np.cross(points - np.array(self.origin), np.array(self.axis)), axis=1)
        return self.most * float(arm.max(initial=0.0))
