"""Walls that are given other motions in a live run, for control loops.

A course is a motion from a time on, from the place that the wall then has. A wall keeps two of them: the present one, and the
one before it, which still defines where the wall was at the step before.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from warpdem.core.rigid_motion import Pose
from warpdem.errors import SceneError
from warpdem.model.travel import max_travel
from warpdem.scene.base import SceneModel
from warpdem.scene.messages import scene_error
from warpdem.scene.model import Scene
from warpdem.scene.motion import FixedPlacement, Motion, Motions
from warpdem.scene.motion_chain import Chain
from warpdem.usd.motion import quaternion_of

_MOTIONS: TypeAdapter[Any] = TypeAdapter(Motions)


class _Request(SceneModel):
    """What ``set_motion`` is given."""

    motion: Motions | None = Field(description="One motion, or a list, outermost first; None for rest.")


@dataclass(frozen=True)
class Course:
    """A chain of motions whose time begins at ``since`` [s]."""

    since: float
    motions: tuple[Motion, ...]
    chain: Chain

    def pose(self, time: np.ndarray) -> Pose:
        """Poses at ``time`` [s], none before the start."""
        return self.chain.pose(np.maximum(time - self.since, 0.0))


class DrivenMotion:
    """Own motion of one wall of a scene, in place of its chain.

    Args:
        scene: validated scene.
        number: of the wall.
        chain: its motion by the scene.

    Attributes:
        displaces: the wall is never taken to be at rest.
    """

    displaces = True

    def __init__(self, scene: Scene, number: int, chain: Chain) -> None:
        self._scene, self._wall = scene, scene.walls[number]
        self.courses = [Course(0.0, self._wall.motion or (), chain)]

    def pose(self, time: np.ndarray) -> Pose:
        """Poses of the wall's body at ``time`` [s], shape (k,); at the start of a course those of the new one."""
        poses = [course.pose(time) for course in self.courses]
        if len(poses) == 1:
            return poses[0]
        later = time >= self.courses[1].since
        values = (
            np.where(later.reshape(-1, *[1] * (getattr(poses[0], f.name).ndim - 1)), *(getattr(p, f.name) for p in poses[::-1]))
            for f in fields(Pose)
        )
        return Pose(*values)

    def set(self, time: float, motion: Any, points: np.ndarray, radius: float, dt: float) -> None:
        """Give the wall another motion from ``time`` [s] on, from where it then is.

        Args:
            time: the present time [s].
            motion: as the key ``motion`` of a wall; its time begins now; None for rest.
            points: corners of the wall's mesh in its body axes [m], shape (n, 3); none of an analytic wall.
            radius: smallest radius of the grains [m].
            dt: time step [s].

        Raises:
            SceneError: the motion is wrong, or grains beside the mesh could pass through it at its speed.
        """
        source = f"set_motion({self._wall.name!r}, ...)"
        try:
            motions = tuple(_Request.model_validate({"motion": motion}).motion or ())
        except ValidationError as error:
            raise scene_error(error, source, _Request) from None
        pose = self.pose(np.array([time]))
        quaternion = quaternion_of(pose.axes[0].astype(float)).astype(float).tolist()
        placement = FixedPlacement(quaternion=quaternion, shift=pose.origin[0].astype(float).tolist())
        course = self._course(time, (*motions, placement), source)
        if len(points):
            speed = course.chain.speed_bound(points, max(self._scene.time.end - time, 0.0))
            if speed * dt > (allowed := max_travel(self._wall) * radius):
                raise SceneError(
                    f"{source}: the wall may move at up to {speed:.4g} m/s, {speed * dt / radius:.3g} of the smallest radius "
                    f"in a step of {dt:.3g} s; beside a mesh {allowed / radius:g} is allowed: take a speed below "
                    f"{allowed / dt:.3g} m/s, or a smaller time.step"
                )
        self.courses = [*[c for c in self.courses if c.since < time][-1:], course]

    def _course(self, since: float, motions: Sequence[Motion], where: str) -> Course:
        chain = Chain(motions, self._scene.resolve, where, self._scene.access.folders)
        return Course(since, tuple(motions), chain)

    @property
    def is_changed(self) -> bool:
        """Whether the wall was given another motion than that of the scene."""
        return any(course.since > 0.0 for course in self.courses) or self.courses[0].motions != (self._wall.motion or ())

    def state(self) -> list[dict[str, Any]]:
        """What a checkpoint holds of it, as JSON."""
        return [{"since": c.since, "motions": [m.model_dump(mode="json") for m in c.motions]} for c in self.courses]

    def restore(self, state: list[dict[str, Any]]) -> None:
        """Take over what ``state`` gave."""
        name = f"walls {self._wall.name!r} of the checkpoint"
        self.courses = [
            self._course(entry["since"], _MOTIONS.validate_python(entry["motions"]) if entry["motions"] else (), name)
            for entry in state
        ]
