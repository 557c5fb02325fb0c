"""The rows of ``kernels.schedule`` for a batch of steps: all that is known beforehand about time."""

from dataclasses import dataclass

import numpy as np

from warpdem.snapshot import FramePose, Placement


def cross_matrix(axis: np.ndarray) -> np.ndarray:
    """Matrix [a]x with [a]x b = a x b, shape (3, 3)."""
    x, y, z = axis
    zero = 0.0 * x
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def turn_increment(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """R - I of the turn by ``angle`` [rad] (shape (k,)) about the unit ``axis``, shape (k, 3, 3); exact for small angles."""
    across = cross_matrix(axis)
    angle = np.asarray(angle, dtype=float)[:, None, None]
    return np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * (across @ across)


def drift_increment(axis: np.ndarray, angle: np.ndarray, step: np.ndarray) -> np.ndarray:
    """R - I of the drift of each ``step`` by ``angle`` [rad] (shapes (k,)), shape (k, 3, 3), without a bias over many steps.

    At a constant rate every step would round its nine numbers alike: some 1e-17 rad a step, 1e-11 after a million. So each
    number is rounded up or down by turns, in the proportion that its exact value lies between (a function of the step
    number, so that equal instants have equal bits). Needs a long double of more than 64 bits; else it is ``turn_increment``.
    """
    wide = np.longdouble
    unit_axis = axis.astype(wide) / np.sqrt(np.sum(np.square(axis.astype(wide))))
    across = cross_matrix(unit_axis)
    half = np.sin(wide(0.5) * angle.astype(wide))[:, None, None]
    exact = np.sin(angle.astype(wide))[:, None, None] * across + wide(2.0) * np.square(half) * (across @ across)
    rounded = exact.astype(np.float64)
    unit = np.spacing(np.abs(rounded))
    miss = (exact - rounded) / unit  # of a unit in the last place, -0.5 ... 0.5
    k = step.astype(wide)[:, None, None]
    turns = np.floor((k + 1) * miss + wide(0.5)) - np.floor(k * miss + wide(0.5))
    return rounded + unit * turns.astype(np.float64)


@dataclass(frozen=True)
class Motion:
    """How a group of walls moves: fixed to the frame or the laboratory, and turning by itself in it or not."""

    fixed_to: str
    rotation: object | None

    @property
    def rests_in_frame(self) -> bool:
        """Whether it never moves relative to the frame (given that the frame turns)."""
        return self.fixed_to == "frame" and self.rotation is None


class Schedule:
    """Frame, gravity and wall motions against time.

    Attributes:
        motions: wall motions, those that move relative to the frame first.
        wall_motion: motion number of each wall of the scene, shape (w,).
        moving: how many of the motions move relative to the frame.
    """

    def __init__(self, scene) -> None:
        self.dt = 0.0
        self.gravity = np.array(scene.gravity, dtype=float)
        self.frame = scene.frame
        self.turning = scene.frame is not None and scene.frame.max_rate() > 0.0
        self.axis = np.array(scene.frame.axis if scene.frame else (0.0, 0.0, 1.0), dtype=float)
        self.origin = np.array(scene.frame.origin if scene.frame else (0.0, 0.0, 0.0), dtype=float)
        # without a turning frame the laboratory is the frame
        found = [Motion(w.fixed_to if self.turning else "frame", w.rotation) for w in scene.walls]
        distinct = list({self._key(m): m for m in found}.values())
        self.motions = sorted(distinct, key=lambda m: m.rests_in_frame)
        self.moving = sum(not m.rests_in_frame for m in self.motions)
        keys = [self._key(m) for m in self.motions]
        self.wall_motion = np.array([keys.index(self._key(m)) for m in found], dtype=np.int32)

    @staticmethod
    def _key(motion: Motion) -> tuple:
        return motion.fixed_to, None if motion.rotation is None else repr(motion.rotation)

    def angle(self, time):
        """Angle of the frame [rad] at ``time`` [s]."""
        return self.frame.angle(time) if self.turning else 0.0 * time

    def pose(self, time: float) -> FramePose:
        """Place of the frame in the laboratory at ``time`` [s]."""
        rate = float(self.frame.rate_at(time)) if self.turning else 0.0
        return FramePose(self.axis, self.origin, float(self.angle(time)), rate)

    def rows(self, step: int, count: int) -> np.ndarray:
        """Rows of steps ``step`` to ``step + count``, shape (count + 1, 26)."""
        k = np.arange(step, step + count + 1)
        row = np.zeros((count + 1, 26))
        row[:, 0] = np.where(k == 0, 0.0, self.dt)
        row[:, 1] = np.where(k == 0, 0.5 * self.dt, self.dt)
        row[:, 2:5] = self.gravity
        if self.turning:
            theta = self.angle(np.maximum(np.arange(step - 1, step + count + 2), 0) * self.dt)  # nothing turned before 0
            row[:, 2:5] += turn_increment(self.axis, -theta[1:-1]) @ self.gravity
            drifts = np.arange(step - 1, step + count + 1)
            between = drift_increment(self.axis, -np.diff(theta), drifts).reshape(-1, 9)
            row[:, 5:14] = between[1:]
            row[:, 14:23] = between[:-1]
            row[:, 23:26] = self.origin
        return row

    def placements(self, step: int, count: int) -> np.ndarray:
        """Placements of the motions at steps ``step - 1`` to ``step + count + 1``, shape (count + 3, motions, 18)."""
        out = np.zeros((count + 3, max(len(self.motions), 1), 18))
        for m, motion in enumerate(self.motions):
            if motion.rests_in_frame:
                times = np.maximum(np.arange(step - 1, step + count + 2), 0) * self.dt
                spin = np.multiply.outer(self.frame.rate_at(times) if self.turning else 0.0 * times, self.axis)
                out[:, m, 0:9] = np.eye(3).ravel()
                out[:, m, 12:15] = spin
                out[:, m, 15:18] = -np.cross(spin, self.origin)
                continue
            for i in range(count + 3):
                out[i, m] = self._placement(motion, max(step - 1 + i, 0) * self.dt)
        return out

    def _placement(self, motion: Motion, time: float) -> np.ndarray:
        """The 18 numbers of one motion at ``time`` [s]."""
        pose = self.pose(time)
        frame_spin = self.axis * pose.rate
        turn, shift, spin, drift = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
        if motion.rotation is not None:
            axis, origin = np.array(motion.rotation.axis), np.array(motion.rotation.origin)
            increment = turn_increment(axis, np.array([motion.rotation.angle(time)]))[0]
            turn, shift = np.eye(3) + increment, -increment @ origin
            spin = axis * float(motion.rotation.rate_at(time))
            drift = -np.cross(spin, origin)
        if motion.fixed_to == "laboratory":
            back = pose.rotation.T  # laboratory axes -> frame axes
            centre = back @ (shift - self.origin) + self.origin
            spin = back @ spin
            if motion.rotation is not None:
                drift = -np.cross(spin, back @ (origin - self.origin) + self.origin)
            turn, shift = back @ turn, centre
        else:
            drift = drift - np.cross(frame_spin, self.origin)
            spin = spin + frame_spin
        return np.concatenate([turn.ravel(), shift, spin, drift])

    def wall_placements(self, scene, time: float) -> dict[str, Placement]:
        """Placement of every mesh wall at ``time`` [s], by name."""
        out = {}
        for wall, m in zip(scene.walls, self.wall_motion, strict=True):
            if wall.mesh is not None:
                numbers = self._placement(self.motions[m], time)
                out[wall.name] = Placement(numbers[:9].reshape(3, 3), numbers[9:12])
        return out
