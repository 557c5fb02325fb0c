"""Free walls as scene data: rigid bodies on a slider or a hinge, moved by grains, gravity, a spring, a damper and a motor."""

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from warpdem.scene.base import Direction, Point, SceneModel, Vec3, unit_vector, validation_error
from warpdem.scene.servo import ForceCourse, TorqueCourse, at_times, require_increasing_course
from warpdem.scene.units import Quantity, Vector

JOINT = 'What the wall may do: slide along its axis, "slider", turn about it, "hinge", or move as it can, "none".'
Joint = Literal["slider", "hinge", "none"]
MOUNTS = 8
"""Largest number of mounts of a body."""
POINTS = 16
"""Largest number of points of a motor curve."""


def _pair(what: str) -> BeforeValidator:
    def checked(entry: Any) -> Any:
        if not isinstance(entry, (list, tuple, np.ndarray)) or len(entry) != 2:
            raise ValueError(f"must be a list of 2 numbers, {what}")
        return entry

    return BeforeValidator(checked)


_Force = Annotated[
    tuple[Annotated[float, Quantity("m/s")], Annotated[float, Quantity("N")]], _pair("[speed in [m/s], force in [N]]")
]
_Torque = Annotated[
    tuple[Annotated[float, Quantity("rad/s")], Annotated[float, Quantity("N m")]],
    _pair("[rate in [rad/s], torque in [N m]]"),
]


def _joint(value: Any) -> str:
    joint = value.get("joint") if isinstance(value, dict) else getattr(value, "joint", None)
    return {"hinge": "~hinge", "none": "~body"}.get(joint, "~slider") if isinstance(joint, str) else "~slider"


class _Joint(SceneModel):
    """What sliders and hinges share."""

    axis: Direction = Field(
        description="Direction of the slider, or of the axis of the hinge [-], any length but zero, held as a unit vector; in "
        "the axes of the wall at time 0."
    )
    mass: Annotated[float, Quantity("kg", gt=0)] | None = Field(
        None, description="Mass [kg], > 0; default that of the closed mesh, filled with its material."
    )

    elapsed: Annotated[float, Quantity("s", ge=0)] = Field(
        0.0, description="Time of force or torque at time 0 of the run [s], >= 0, default 0: it is ahead by this."
    )

    @model_validator(mode="after")
    def _range_is_one(self) -> "_Joint":
        span = getattr(self, "range", None)
        if span is not None and not span[0] <= 0.0 <= span[1]:
            raise validation_error([(("range",), list(span), "must be [lowest, highest] around 0, where the wall begins")])
        for key in ("force", "torque"):
            require_increasing_course(key, getattr(self, key, 0.0))
        curve = getattr(self, "motor", None) or ()
        if len(curve) > POINTS:
            raise validation_error([(("motor",), None, f"has {len(curve)} points; at most {POINTS} are read")])
        for k in range(1, len(curve)):
            if curve[k][0] <= curve[k - 1][0]:
                raise validation_error([(("motor", k, 0), curve[k][0], f"must be above {curve[k - 1][0]:g}, the entry before")])
        return self

    rotates: ClassVar[bool] = False
    """Whether the wall turns about the axis."""
    most: ClassVar[float] = np.inf
    """Largest speed: there is no bound."""

    def target(self, times: np.ndarray) -> np.ndarray:
        """Force [N] or torque [N m] on the wall at ``times`` [s] of the run, shape (k,)."""
        return at_times(getattr(self, "torque" if self.rotates else "force"), times + self.elapsed)

    def later(self, time: float) -> Self:
        """The same from ``time`` [s] on."""
        return self.ahead_by(self.elapsed + time)

    def ahead_by(self, time: float) -> Self:
        """The same, whose time is ``time`` [s] at time 0."""
        return self.model_copy(update={"elapsed": time})

    def from_there(self, then: dict[str, Any]) -> Self:
        """The same that goes on from where ``then``, of a checkpoint, says that it was, as fast."""
        position, rate = then["position"], then["rate"]
        span, rest = getattr(self, "range", None), getattr(self, "rest", 0.0)
        moved = span and (min(span[0] - position, 0.0), max(span[1] - position, 0.0))
        return self.model_copy(update={"rate" if self.rotates else "velocity": rate, "rest": rest - position, "range": moved})

    @property
    def begins(self) -> float:
        """Rate at time 0 [m/s or rad/s]."""
        return float(getattr(self, "rate" if self.rotates else "velocity"))

    def speed_bound(self, points: np.ndarray, fall: float) -> float:
        """Speed that body points, shape (n, 3), may be expected to reach [m/s]: at the start, by the motor, or in a ``fall``.

        The motor is expected to reach the largest rate at which its curve drives, or ends.
        """
        rates = [abs(rate) for rate, load in (getattr(self, "motor", None) or ()) if rate * load >= 0.0]
        most = max([abs(self.begins), *rates])
        if self.rotates:
            arm = np.cross(points - np.array(getattr(self, "origin")), np.array(self.axis))  # noqa: B009  of hinges
            most *= float(np.linalg.norm(arm, axis=1).max(initial=0.0))
        return float(max(most, fall))

    @property
    def curve(self) -> np.ndarray:
        """Rate and load of the motor at ``POINTS`` points, the last of them again and again; zeros without a motor."""
        points = getattr(self, "motor", None) or [(0.0, 0.0)]
        return np.array([*points, *[points[-1]] * (POINTS - len(points))], dtype=float)


class Slider(_Joint):
    """A wall of a mass that is free along an axis."""

    joint: Joint = Field(description=JOINT)
    origin: ClassVar[tuple[float, float, float]] = (0.0, 0.0, 0.0)
    inertia: ClassVar[None] = None
    centre: ClassVar[None] = None
    velocity: Annotated[float, Quantity("m/s")] = Field(0.0, description="Velocity along the axis at time 0 [m/s], default 0.")
    force: ForceCourse = Field(0.0, description="Force on the wall along the axis [N], or [[t [s], >= 0, force [N]], ...]; 0.")
    motor: Annotated[list[_Force], Field(min_length=1)] | None = Field(
        None,
        description="Motor: force on the wall by its velocity, [[velocity [m/s], force [N]], ...], straight between, constant "
        "beyond; default none.",
    )
    stiffness: Annotated[float, Quantity("N/m", ge=0)] = Field(0.0, description="Stiffness of a spring [N/m], >= 0.")
    rest: Annotated[float, Quantity("m")] = Field(0.0, description="Displacement where the spring is at rest [m], default 0.")
    damping: Annotated[float, Quantity("kg/s", ge=0)] = Field(0.0, description="Coefficient of a damper [kg/s], >= 0.")
    range: Annotated[tuple[float, float], Vector(Quantity("m"), length=2)] | None = Field(
        None, description="Lowest and highest displacement [m], where the wall stops dead; default none."
    )


class Hinge(_Joint):
    """A wall of a moment of inertia that is free about an axis."""

    joint: Joint = Field(description=JOINT)
    rotates: ClassVar[bool] = True
    origin: Point = Field((0.0, 0.0, 0.0), description="A point on the axis [m], default (0, 0, 0).")
    inertia: Annotated[float, Quantity("kg m2", gt=0)] | None = Field(
        None, description="Moment of inertia about the axis [kg m2], > 0; default that of the closed mesh."
    )
    centre: Point | None = Field(
        None, description="Center of mass [m], where gravity acts; default that of the closed mesh, or on the axis (balanced)."
    )
    rate: Annotated[float, Quantity("rad/s")] = Field(0.0, description="Angular rate at time 0 [rad/s], default 0.")
    torque: TorqueCourse = Field(0.0, description="Torque about the axis [N m], or [[t [s], >= 0, torque [N m]], ...]; 0.")
    motor: Annotated[list[_Torque], Field(min_length=1)] | None = Field(
        None,
        description="Motor: torque on the wall by its rate, [[rate [rad/s], torque [N m]], ...], straight between, constant "
        "beyond; default none.",
    )
    stiffness: Annotated[float, Quantity("N m", ge=0)] = Field(0.0, description="Stiffness of a spring, per rad [N m], >= 0.")
    rest: Annotated[float, Quantity("rad")] = Field(0.0, description="Angle at which the spring is at rest [rad], default 0.")
    damping: Annotated[float, Quantity("N m s", ge=0)] = Field(0.0, description="Coefficient of a damper [N m s], >= 0.")
    range: Annotated[tuple[float, float], Vector(Quantity("rad"), length=2)] | None = Field(
        None, description="Lowest and highest angle [rad], where the wall stops dead; default none."
    )


class Mount(SceneModel):
    """A spring of no length and a damper between a point of the body and a fixed one."""

    point: Point = Field(description="Point of the body [m], where it is at time 0.")
    anchor: Point | None = Field(None, description="Fixed point that it is held at [m], default point.")
    stiffness: Annotated[float, Quantity("N/m", ge=0)] = Field(0.0, description="Stiffness in all directions [N/m], >= 0.")
    damping: Annotated[float, Quantity("kg/s", ge=0)] = Field(0.0, description="Coefficient of the damper [kg/s], >= 0.")


class FreeBody(SceneModel):
    """A wall that moves as a rigid body with six degrees of freedom; all keys in the axes of the wall at time 0."""

    joint: Joint = Field(description=JOINT)
    mass: Annotated[float, Quantity("kg", gt=0)] | None = Field(
        None, description="Mass [kg], > 0; default that of the closed mesh, filled with its material."
    )
    centre: Point | None = Field(None, description="Center of mass [m]; default that of the closed mesh.")
    inertia: Annotated[Vec3, Vector(Quantity("kg m2", gt=0))] | None = Field(
        None, description="Moments of inertia about x, y and z through the center [kg m2], > 0; default: of the mesh."
    )
    axes: Annotated[tuple[float, ...], Vector(Quantity("-"), length=4), AfterValidator(unit_vector)] | None = Field(
        None,
        description="With inertia: quaternion (w, x, y, z) [-] that turns x, y and z onto the axes of the three moments, held "
        "as a unit quaternion; default none.",
    )
    velocity: Annotated[Vec3, Vector(Quantity("m/s"))] = Field((0.0, 0.0, 0.0), description="Of the center at time 0 [m/s].")
    spin: Annotated[Vec3, Vector(Quantity("rad/s"))] = Field((0.0, 0.0, 0.0), description="At time 0 [rad/s], default 0.")
    force: Annotated[Vec3, Vector(Quantity("N"))] = Field((0.0, 0.0, 0.0), description="Constant force [N], default 0.")
    torque: Annotated[Vec3, Vector(Quantity("N m"))] = Field((0.0, 0.0, 0.0), description="Constant torque [N m], default 0.")
    mounts: Annotated[list[Mount], Field(max_length=MOUNTS)] = Field([], description="Springs and dampers, at most 8.")

    rotates: ClassVar[int] = 2
    axis: ClassVar[Vec3] = (0.0, 0.0, 0.0)
    origin: ClassVar[Vec3] = (0.0, 0.0, 0.0)
    most: ClassVar[float] = np.inf
    elapsed: ClassVar[float] = 0.0

    @model_validator(mode="after")
    def _is_a_body(self) -> "FreeBody":
        if self.inertia is not None and 2.0 * max(self.inertia) > sum(self.inertia) * (1.0 + 1e-9):
            reason = "of no body: none of the three may exceed the sum of the others"
            raise validation_error([(("inertia",), list(self.inertia), reason)])
        if self.axes is not None and self.inertia is None:
            raise validation_error([(("axes",), list(self.axes), "only with inertia: the axes of its three moments")])
        return self

    def later(self, time: float) -> "FreeBody":
        """The same: nothing of it depends on time."""
        return self

    def ahead_by(self, time: float) -> "FreeBody":
        """The same."""
        return self

    def from_there(self, then: dict[str, Any]) -> "FreeBody":
        """The same that goes on from where ``then``, of a checkpoint, says that it was, as fast."""
        own, to = np.array(then["own"]), {key: np.array(then[key]) for key in ("velocity", "spin")}
        turn, shift = own[:, :3], own[:, 3]

        def back(point: Vec3) -> Vec3:
            x, y, z = (turn.T @ (np.array(point) - shift)).tolist()
            return x, y, z

        mounts = [one.model_copy(update={"anchor": back(one.anchor or one.point)}) for one in self.mounts]
        turned = {key: tuple((turn.T @ vector).tolist()) for key, vector in to.items()}
        given = {key: tuple((turn.T @ np.array(getattr(self, key))).tolist()) for key in ("force", "torque")}
        return self.model_copy(update={"mounts": mounts, **turned, **given})

    def target(self, times: np.ndarray) -> np.ndarray:
        """Nothing acts along an axis."""
        return np.zeros(len(times))

    def speed_bound(self, points: np.ndarray, fall: float) -> float:
        """Speed that body points, shape (n, 3), may be expected to reach [m/s]: at the start, or in a ``fall``."""
        arm = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max(initial=0.0))
        return max(float(np.linalg.norm(self.velocity)) + float(np.linalg.norm(self.spin)) * arm, fall)


Free = Annotated[
    Annotated[Slider, Tag("~slider")] | Annotated[Hinge, Tag("~hinge")] | Annotated[FreeBody, Tag("~body")],
    Discriminator(_joint),
]
