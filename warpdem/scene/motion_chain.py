"""Chains of motions, outermost first: the motion of the frame and of each wall of a scene."""

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from warpdem.core import rigid_motion
from warpdem.core.pose import Part
from warpdem.core.rigid_motion import WIDE, Increment, Pose
from warpdem.scene.model import Scene
from warpdem.scene.motion import FixedPlacement, Motion, Sampled
from warpdem.scene.motion_base import Timed
from warpdem.scene.rotation import Rotation
from warpdem.scene.screw import Advance
from warpdem.usd import motion as usd_motion


class RigidMotion(Protocol):
    """A motion as a function of time."""

    @property
    def rotates(self) -> bool:
        """Whether the axes ever rotate."""

    @property
    def moves(self) -> bool:
        """Whether the body ever moves."""

    @property
    def max_rate(self) -> float:
        """Maximum magnitude of the angular rate [rad/s]."""

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities and accelerations are those of the segments at ``segment_time`` [s]."""

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""

    def part(self, time: float) -> Part:
        """The motion at one time [s], for writers."""

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed [m/s] of all points within ``radius`` [m] of the given ones, shape (n, 3)."""

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""


class ElapsedMotion:
    """A motion whose time is ahead of the scene's by ``elapsed`` [s]."""

    def __init__(self, motion: RigidMotion, elapsed: float) -> None:
        self.motion, self.elapsed = motion, WIDE(elapsed)
        self.rotates, self.moves, self.max_rate = motion.rotates, motion.moves, motion.max_rate

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses of the motion at the later times."""
        return self.motion.pose(time + self.elapsed, segment_time + self.elapsed)

    def increments(self, time: np.ndarray) -> Increment:
        """Increments of the motion between the later times."""
        return self.motion.increments(time + self.elapsed)

    def part(self, time: float) -> Part:
        """The motion at the later time, for writers."""
        return self.motion.part(float(time + self.elapsed))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed of points [m/s]."""
        return self.motion.speed_bound(points, radius)

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""
        return self.motion.bounding_balls(points, radius, end + float(self.elapsed))


class BoundedMotion:
    """A motion that begins at ``start`` [s] and ends at ``until`` [s], None for never: at rest before and after.

    At ``start`` its own time is 0.
    """

    def __init__(self, motion: RigidMotion, start: float, until: float | None) -> None:
        self.motion, self.start, self.until = motion, WIDE(start), WIDE(np.inf if until is None else until)
        self.rotates, self.moves, self.max_rate = motion.rotates, motion.moves, motion.max_rate

    def _own(self, time: np.ndarray) -> np.ndarray:
        """Time of the motion itself [s] at ``time`` [s]."""
        return np.clip(np.asarray(time, dtype=WIDE), self.start, self.until) - self.start

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities are 0 where ``segment_time`` [s] is before the start or not before the end."""
        pose = self.motion.pose(self._own(time), self._own(segment_time))
        runs = ((segment_time >= self.start) & (segment_time < self.until))[:, None]
        moving = ("spin", "velocity", "spin_rate", "acceleration")
        return dataclasses.replace(pose, **{name: np.where(runs, getattr(pose, name), WIDE(0)) for name in moving})

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""
        return self.motion.increments(self._own(time))

    def part(self, time: float) -> Part:
        """The motion at one time [s], for writers."""
        return self.motion.part(float(self._own(np.asarray(time))))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed of points [m/s]."""
        return self.motion.speed_bound(points, radius)

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""
        return self.motion.bounding_balls(points, radius, float(self._own(np.asarray(end))))


class Chain:
    """Motions within motions, outermost first; an empty chain never moves.

    Attributes:
        motions: The single motions, a screw motion as two: its advance and its rotation.
        keys: Source and key of each of them in the scene.
        rotates: Whether the innermost axes ever rotate.
        moves: Whether the innermost body ever moves.
        displaces: Whether the innermost axes ever differ from the outer ones.
        max_rate: Upper bound of the angular rate [rad/s].

    Args:
        motions: The scene's motions; None is an empty chain.
        resolve: Gives the path of a file that the scene names.
        where: Source and key of the scene, for messages.
        folders: Folders that must hold all files which a USD file refers to; None for no restriction.

    Raises:
        SceneError: A sampled motion cannot be read.
    """

    def __init__(
        self,
        motions: Sequence[Motion] | None,
        resolve: Callable[[str], Path],
        where: str,
        folders: Sequence[Path] | None = None,
    ) -> None:
        given = motions or ()
        self.motions: list[RigidMotion] = []
        self.keys: list[str] = []
        for k, motion in enumerate(given):
            key = f"{where}[{k}]" if len(given) > 1 else where
            for course in _courses(motion, resolve, key, folders):
                self.motions.append(timed(course, motion) if isinstance(motion, Timed) else course)
                self.keys.append(key)
        self.rotates = any(motion.rotates for motion in self.motions)
        self.moves = any(motion.moves for motion in self.motions)
        self.max_rate = sum(motion.max_rate for motion in self.motions)
        self.displaces = self.moves or any(motion.displaces for motion in given if isinstance(motion, FixedPlacement))

    def pose(self, time: np.ndarray, segment_time: np.ndarray | None = None) -> Pose:
        """Poses of the innermost body at ``time`` [s], shape (k,).

        Where a rate or velocity jumps, ``segment_time`` [s] selects the side; None takes the value after the jump.
        """
        segment_time = time if segment_time is None else segment_time
        poses = [motion.pose(time, segment_time) for motion in self.motions]
        return functools.reduce(rigid_motion.compose, poses) if poses else rigid_motion.still(len(time))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""
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
        """The single motions at ``time`` [s], for writers."""
        return tuple(motion.part(time) for motion in self.motions)

    def speed_bound(self, points: np.ndarray, end: float) -> float:
        """Upper bound of the speed [m/s] of body points, shape (n, 3), up to the time ``end`` [s]."""
        total, radius = 0.0, 0.0
        for motion in reversed(self.motions):
            total += motion.speed_bound(points, radius)
            points, radius = motion.bounding_balls(points, radius, end)
        return total


def _courses(
    motion: Motion, resolve: Callable[[str], Path], key: str, folders: Sequence[Path] | None
) -> Iterator[RigidMotion]:
    """The motions of time that one motion of the scene consists of, outermost first."""
    if isinstance(motion, Sampled):
        yield usd_motion.read(resolve(motion.usd), motion.prim, key, folders)
        return
    if isinstance(motion, Rotation) and motion.pitch != 0.0:
        yield Advance(motion)
    yield motion


def timed(course: RigidMotion, motion: Timed) -> RigidMotion:
    """A motion in the time of the scene."""
    if motion.start > 0.0 or motion.until is not None:
        course = BoundedMotion(course, motion.start, motion.until)
    return ElapsedMotion(course, motion.elapsed) if motion.elapsed > 0.0 else course


def frame_chain(scene: Scene) -> Chain:
    """Motion of the frame of a scene."""
    return Chain(scene.frame, scene.resolve, f"{scene.source}: frame", scene.access.folders)


def wall_chain(scene: Scene, number: int) -> Chain:
    """Own motion of a wall of a scene."""
    where = f"{scene.source}: walls[{number}].motion"
    return Chain(scene.walls[number].motion, scene.resolve, where, scene.access.folders)


def largest_rates(scene: Scene) -> dict[str, float]:
    """Maximum magnitude [rad/s] of the rate of each motion of a scene, by key; motions that never rotate are left out."""
    chains = [frame_chain(scene), *(wall_chain(scene, k) for k in range(len(scene.walls)))]
    return {
        key.removeprefix(f"{scene.source}: "): motion.max_rate
        for chain in chains
        for key, motion in zip(chain.keys, chain.motions, strict=True)
        if motion.rotates
    }
