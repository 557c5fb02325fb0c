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
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.scene.model import Scene
from warpdem.scene.servo import Servo
from warpdem.scene.walls import Wall

if TYPE_CHECKING:
    from warpdem.model.schedule import Schedule


def pushed_area(servo: Servo, mesh: TriangleMesh | None) -> float:
    """Area that a pressure acts on [m2]: as given, else that of the mesh seen along the axis; 1 for a force or a torque."""
    if servo.pressure is None:
        return 1.0
    if servo.area is not None or mesh is None:
        return servo.area or 1.0
    a, b, c = mesh.corners.transpose(1, 0, 2)
    along = np.abs(0.5 * np.cross(b - a, c - a) @ np.array(servo.axis)).sum()
    return float(along if mesh.open_edges else 0.5 * along)


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
    """Least mass [kg] or moment of inertia [kg m2] of its motion."""
    state: np.ndarray = field(default_factory=lambda: np.zeros(STATE.width))
    """``STATE`` at present."""
    before: np.ndarray | None = None
    """Placement at the step before the present one, shape (24,)."""
    now: np.ndarray | None = None
    """Placement at present, shape (24,)."""

    @property
    def servo(self) -> Servo:
        """What the scene says of it."""
        assert self.wall.servo is not None
        return self.wall.servo

    @property
    def numbers(self) -> np.ndarray:
        """``NUMBERS``, shape (numbers,)."""
        servo = self.servo
        return np.array([float(servo.turns), *servo.axis, *servo.origin, self.least, servo.most])

    def drive(self, times: np.ndarray) -> np.ndarray:
        """Load asked for at ``times`` [s], shape (k,) [N or N m]; NaN where the wall is held."""
        return self.servo.target(times) * self.area

    def value(self, name: str) -> float:
        """A number of ``STATE``."""
        return float(self.state[getattr(STATE, name)])

    def pose(self, count: int) -> Pose:
        """Present pose in the axes of its carrier, ``count`` times."""
        axis, s, rate = rigid_motion.unit(self.servo.axis), self.value("position"), self.value("predicted")
        along = np.tile(axis, (count, 1))
        none = np.zeros_like(along)
        if not self.servo.turns:
            return rigid_motion.translation_by(s * along, rate * along, none)
        change = rigid_motion.rotation_increment(axis, np.full(count, s))
        return rigid_motion.rotation_about(np.array(self.servo.origin), change, rate * along, none)

    def saved(self) -> dict[str, Any]:
        """What a checkpoint holds of it, as JSON; ``own`` is its place in the axes of its carrier, shape (3, 4)."""
        pose = self.pose(1)
        own = np.hstack([pose.axes[0], pose.origin[0][:, None]]).astype(float).tolist()
        listed = {name: None if v is None else v.tolist() for name, v in self._moving().items()}
        return {**listed, "own": own}

    def restore(self, saved: dict[str, Any]) -> None:
        """Take over what ``saved`` gave."""
        for name in self._moving():
            setattr(self, name, None if saved[name] is None else np.array(saved[name]))

    def _moving(self) -> dict[str, np.ndarray | None]:
        return {"state": self.state, "before": self.before, "now": self.now}


def complete_dynamic_walls(
    schedule: "Schedule", scene: Scene, meshes: dict[str, TriangleMesh], expected: InitialGrains, resident: bool
) -> None:
    """Give the dynamic walls of a schedule what follows from meshes and grains.

    Raises:
        SceneError: the run cannot have such walls.
    """
    density = np.array([material.density for material in scene.materials.values()])
    masses = density[expected.type] * (4.0 / 3.0 * np.pi) * expected.radius**3
    for one in schedule.dynamic:
        key, scheme = f"{scene.source}: walls[{one.number}].servo", scene.engine.integrator
        if resident:
            raise SceneError(f"{key}: a wall that moves by the load on it runs on a CPU only: take --device cpu")
        if scheme != "exact_drift":
            raise SceneError(f'{key}: only with engine.integrator = "exact_drift"; it is "{scheme}"')
        mesh, shape = meshes.get(one.wall.name), one.wall.shape
        points = mesh.vertices if mesh is not None else shape.nearest(expected.position)[0] if shape is not None else None
        assert points is not None
        one.area = pushed_area(one.servo, mesh)
        one.least = least_mass(one, float(masses.max(initial=0.0)), points)


def least_mass(wall: DynamicWall, heaviest: float, points: np.ndarray) -> float:
    """Mass of the heaviest grain [kg], or its moment of inertia at the distance of the wall from its axis [kg m2].

    Args:
        wall: the wall.
        heaviest: mass of the heaviest grain that is expected [kg].
        points: corners of its mesh, or feet of the grains on its shape [m], shape (n, 3).
    """
    servo = wall.servo
    if not servo.turns or not len(points):
        return heaviest
    arm = np.cross(points - np.array(servo.origin), np.array(servo.axis))
    return heaviest * float((arm**2).sum(axis=1).max())


assert NUMBERS.width == 9 and STATE.width == 4, "numbers, value and pose are written for these columns"
