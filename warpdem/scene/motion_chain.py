"""Chains of motions, outermost first: the motion of the frame and of each wall of a scene."""

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from warpdem.core import rigid_motion
from warpdem.core.pose import Part
from warpdem.core.rigid_motion import WIDE, Increment, Pose
from warpdem.scene.motion import Sampled, Standing
from warpdem.usd import motion as usd_motion


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
