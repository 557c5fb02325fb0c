"""Walls whose motion follows from the load on them, on the host: what the kernels are given, and where the walls are.

``kernels.step.dynamic_walls`` moves them. What of a wall is a function of time, its ``motion`` and what it is fixed to, is its
carrier; from there its own coordinate s leads to where it is.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from warpdem.core import rigid_motion
from warpdem.core.rigid_motion import Pose
from warpdem.errors import SceneError
from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels.step.dynamic_walls import NUMBERS, STATE
from warpdem.kernels.step.free_bodies import BODY, MOTION
from warpdem.kernels.wall.mobility import MOBILITY
from warpdem.mesh.solid_body import SolidBody, solid_body
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model import free_bodies
from warpdem.scene.free import POINTS, FreeBody, Hinge, Slider
from warpdem.scene.messages import rounded_down
from warpdem.scene.model import Scene
from warpdem.scene.servo import Servo
from warpdem.scene.walls import Wall

LARGEST_TURN = 0.2
"""Angle by which the spring of a free wall may let it swing in a step [rad]: its period is then right within 0.2 %."""

if TYPE_CHECKING:
    from warpdem.model.schedule import Schedule


def pushed_area(servo: Servo, mesh: TriangleMesh | None) -> float:
    """Area that a pressure acts on [m2]: as given, else that of the mesh seen along the axis; 1 for a force or a torque."""
    if servo.pressure is None:
        return 1.0
    if servo.area is not None or mesh is None:
        return servo.area or 1.0
    return mesh.area_along(np.array(servo.axis))


@dataclass
class DynamicWall:
    """One wall whose motion follows from the load on it."""

    number: int
    """Of the wall in the scene."""
    wall: Wall
    """The wall."""
    area: float = 1.0
    """Area that its pressure acts on [m2]."""
    least: float = 0.0
    """Least mass [kg] or moment of inertia [kg m2] of a servo."""
    inertia: float = 0.0
    """Mass [kg] or moment of inertia about the axis [kg m2] of a free wall; 0 of a servo."""
    mass: float = 0.0
    """Mass that gravity pulls [kg]."""
    center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """Where it does, in the axes of the wall [m], shape (3,)."""
    state: np.ndarray = field(default_factory=lambda: np.zeros(STATE.width))
    """``STATE`` at present."""
    before: np.ndarray | None = None
    """Placement at the step before the present one, shape (24,)."""
    now: np.ndarray | None = None
    """Placement at present, shape (24,)."""

    body: np.ndarray = field(default_factory=lambda: np.zeros(BODY.width))
    """``free_bodies.BODY``, of a body with six degrees of freedom."""
    motion: np.ndarray = field(default_factory=lambda: np.zeros(MOTION.width))
    """``free_bodies.MOTION`` of it at present."""

    @property
    def given(self) -> Servo | Slider | Hinge | FreeBody:
        """What the scene says of it."""
        assert self.wall.dynamic is not None
        return self.wall.dynamic

    @property
    def numbers(self) -> np.ndarray:
        """``NUMBERS``, shape (numbers,)."""
        given = self.given
        axis = float(given.rotates), *given.axis, *given.origin
        common = [*axis, self.least, given.most, self.inertia, self.mass, *self.center]
        if isinstance(given, Servo | FreeBody):
            return np.array([*common, 0.0, 0.0, 0.0, -np.inf, np.inf])
        return np.array([*common, given.stiffness, given.rest, given.damping, *(given.range or (-np.inf, np.inf))])

    @property
    def curve(self) -> np.ndarray:
        """Points of its motor curve, shape (points, 2)."""
        return self.given.curve if isinstance(self.given, Slider | Hinge) else np.zeros((POINTS, 2))

    @property
    def mobility(self) -> np.ndarray:
        """``kernels.wall.mobility.MOBILITY`` at present; zeros of a servo."""
        out, given = np.zeros(MOBILITY.width), self.given
        if isinstance(given, Servo):
            return out
        none, center = np.zeros((3, 3)), np.array(given.origin)
        if isinstance(given, FreeBody):
            axes, center = free_bodies.matrix_of(self.body[BODY.of("orientation")]), self.center
            inverse_mass, inverse_inertia = np.eye(3) / self.mass, axes @ np.diag(self.body[BODY.of("rates")]) @ axes.T
        else:
            along = np.outer(given.axis, given.axis) / self.inertia
            inverse_mass, inverse_inertia = (none, along) if given.rotates else (along, none)
        pairs = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
        tensors = {"inverse_mass": inverse_mass[pairs], "inverse_inertia": inverse_inertia[pairs]}
        values = {"yields": 1.0 - self.value("held"), "center": center, **tensors}
        for name, value in values.items():
            out[MOBILITY.of(name)] = value
        return out

    def drive(self, times: np.ndarray) -> np.ndarray:
        """Load that acts at ``times`` [s], shape (k,) [N or N m]; NaN where the wall is held."""
        return self.given.target(times) * self.area

    def value(self, name: str) -> float:
        """A number of ``STATE``; the correction of a body with six degrees of freedom too."""
        if name == "correction" and isinstance(self.given, FreeBody):
            return float(self.motion[MOTION.correction])
        return float(self.state[getattr(STATE, name)])

    def pose(self, count: int) -> Pose:
        """Present pose in the axes of its carrier, ``count`` times."""
        if isinstance(self.given, FreeBody):
            return free_bodies.pose(self, count) if self.body.any() else rigid_motion.still(count)
        axis, s, rate = rigid_motion.unit(self.given.axis), self.value("position"), self.value("predicted")
        along = np.tile(axis, (count, 1))
        none = np.zeros_like(along)
        if not self.given.rotates:
            return rigid_motion.translation_by(s * along, rate * along, none)
        change = rigid_motion.rotation_increment(axis, np.full(count, s))
        return rigid_motion.rotation_about(np.array(self.given.origin), change, rate * along, none)

    def saved(self) -> dict[str, Any]:
        """What a checkpoint holds of it, as JSON; ``own`` is its place in the axes of its carrier, shape (3, 4)."""
        pose = self.pose(1)
        own = np.hstack([pose.axes[0], pose.origin[0][:, None]]).astype(float).tolist()
        listed = {name: None if v is None else v.tolist() for name, v in self._moving().items()}
        listed |= {"velocity": self.motion[MOTION.of("seen_velocity")].tolist()}
        listed |= {"spin": self.motion[MOTION.of("seen_spin")].tolist()}
        return {**listed, "own": own, "position": self.value("position"), "rate": self.value("predicted")}

    def restore(self, saved: dict[str, Any]) -> None:
        """Take over what ``saved`` gave."""
        for name in self._moving():
            setattr(self, name, None if saved[name] is None else np.array(saved[name]))

    def _moving(self) -> dict[str, np.ndarray | None]:
        return {"state": self.state, "motion": self.motion, "before": self.before, "now": self.now}


def complete_dynamic_walls(
    schedule: "Schedule", scene: Scene, meshes: dict[str, TriangleMesh], expected: InitialGrains, stages: int, on_gpu: bool
) -> None:
    """Give the dynamic walls of a schedule what follows from meshes and grains.

    Raises:
        SceneError: the run cannot have such walls.
    """
    density = np.array([material.density for material in scene.materials.values()])
    masses = density[expected.type] * (4.0 / 3.0 * np.pi) * expected.radius**3
    for one in schedule.dynamic:
        kind = "servo" if isinstance(one.given, Servo) else "free"
        key, scheme = f"{scene.source}: walls[{one.number}].{kind}", scene.engine.integrator
        if on_gpu:
            raise SceneError(f"{key}: a wall that moves by the load on it runs on a CPU only: take --device cpu")
        if stages > 1:
            raise SceneError(
                f'{key}: not with engine.integrator = "{scheme}", whose steps have stages: the wall has none; take '
                '"exact_drift", or a scheme with one force call per step'
            )
        heaviest, mesh, shape = float(masses.max(initial=0.0)), meshes.get(one.wall.name), one.wall.shape
        if not isinstance(one.given, Servo):
            if one.wall.fixed_to == "frame" and schedule.frame.moves:
                raise SceneError(
                    f'{key}: its axis would move with the frame, whose inertial forces on the wall are not computed: give the '
                    'wall fixed_to = "laboratory"'
                )
            filled = scene.materials[one.wall.material].density
            solid = None if mesh is None or mesh.open_edges else solid_body(mesh, filled)
            if isinstance(one.given, FreeBody):
                free_bodies.complete(one, one.given, solid)
            else:
                _complete_free(one, one.given, solid)
            _check_free(key, one, heaviest, schedule.dt)
            continue
        points = mesh.vertices if mesh is not None else shape.nearest(expected.position)[0] if shape is not None else None
        assert points is not None
        one.area = pushed_area(one.given, mesh)
        one.least = least_mass(one.given, heaviest, points)


def mobilities(schedule: "Schedule") -> np.ndarray:
    """How walls yield at present, by placement, shape (motions, 16); none where no wall is free."""
    out = np.zeros((len(schedule.motions), MOBILITY.width))
    for one in schedule.dynamic:
        out[schedule.wall_motion[one.number]] = one.mobility
    return out if out.any() else out[:0]


def _complete_free(one: DynamicWall, given: Slider | Hinge, solid: SolidBody | None) -> None:
    """Mass, center and inertia: as given, else those of the closed mesh, scaled to a mass that is given."""
    axis, origin = np.array(given.axis), np.array(given.origin)
    own = given.mass if given.mass is not None else solid.mass if solid is not None else 0.0
    one.mass = own
    one.center = np.array(given.centre) if given.centre is not None else solid.center if solid is not None else origin
    if not given.rotates:
        one.inertia = own
    elif given.inertia is not None:
        one.inertia = given.inertia
    else:
        assert solid is not None
        one.inertia = solid.about(axis, origin) * own / solid.mass
    if not one.state.any():
        one.state[[STATE.rate, STATE.predicted]] = given.begins


def _check_free(key: str, one: DynamicWall, heaviest: float, dt: float) -> None:
    """Refuse a wall that the time step cannot follow.

    Raises:
        SceneError: it is lighter than a grain, or its spring, damper or motor curve is too stiff.
    """
    if one.mass and one.mass < heaviest:
        raise SceneError(
            f"{key}: its mass of {one.mass:.3g} kg is below that of the heaviest grain, {heaviest:.3g} kg: the time step is "
            "made for grains; give it more mass"
        )
    given = one.given
    if isinstance(given, FreeBody):
        # of all mounts together, at the most that each may move by a force on it
        arms = [float(np.linalg.norm(np.array(mount.point) - one.center)) for mount in given.mounts]
        yields = [one.inertia / one.mass + arm**2 for arm in arms]
        stiffness = sum(mount.stiffness * share for mount, share in zip(given.mounts, yields, strict=True))
        coefficients = {"mounts": sum(mount.damping * share for mount, share in zip(given.mounts, yields, strict=True))}
    else:
        assert isinstance(given, Slider | Hinge)
        rates, loads = one.curve.T
        apart = np.diff(rates) > 0.0
        stiffness = given.stiffness
        steepest = float(np.abs(np.diff(loads)[apart] / np.diff(rates)[apart]).max(initial=0.0))
        coefficients = {"damping": given.damping, "motor": steepest}
    turn, springs = dt * np.sqrt(stiffness / one.inertia), "mounts" if isinstance(given, FreeBody) else "stiffness"
    if turn > LARGEST_TURN:
        raise SceneError(
            f"{key}.{springs}: {stiffness:.3g} {'N m' if given.rotates else 'N/m'} lets the wall swing by {turn:.3g} rad in a "
            f"step of {dt:.3g} s; at most "
            f"{LARGEST_TURN} is computed well: take a time.step below {rounded_down(dt * LARGEST_TURN / turn)} s, a softer "
            "spring, or more mass"
        )
    for name, coefficient in coefficients.items():
        if (share := dt * coefficient / one.inertia) > 1.0:
            raise SceneError(
                f"{key}.{name}: {coefficient:.3g} {'N m s' if given.rotates else 'N s/m'} change its rate by {share:.3g} of "
                f"itself in a step of {dt:.3g} s, at most 1 is computed well: take a time.step below "
                f"{rounded_down(dt / share)} s, less of it, or more mass"
            )


def least_mass(servo: Servo, heaviest: float, points: np.ndarray) -> float:
    """Mass of the heaviest grain [kg], or its moment of inertia at the distance of the wall from its axis [kg m2].

    Args:
        servo: what moves the wall.
        heaviest: mass of the heaviest grain that is expected [kg].
        points: corners of its mesh, or feet of the grains on its shape [m], shape (n, 3).
    """
    if not servo.rotates or not len(points):
        return heaviest
    return heaviest * largest_arm(servo, points) ** 2


def largest_arm(given: Servo | Slider | Hinge, points: np.ndarray) -> float:
    """Largest distance of ``points``, shape (n, 3), from the axis of a wall [m]."""
    arm = np.cross(points - np.array(given.origin), np.array(given.axis))
    return float(np.sqrt((arm**2).sum(axis=1).max()))


assert NUMBERS.width == 19 and STATE.width == 7, "numbers, value and pose are written for these columns"
