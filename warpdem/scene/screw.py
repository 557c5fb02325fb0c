"""The advance of a screw motion: the translation that a rotation with a pitch makes along its axis."""

import numpy as np

from warpdem.core import rigid_motion
from warpdem.core.pose import TranslationPart
from warpdem.core.rigid_motion import PI, WIDE, Increment, Pose
from warpdem.scene.rotation import Rotation


class Advance:
    """Translation by pitch angle / (2 pi) along the axis of a rotation; it commutes with the rotation."""

    rotates = False
    max_rate = 0.0

    def __init__(self, rotation: Rotation) -> None:
        self.rotation, self.moves = rotation, rotation.rotates
        self.per_angle = rigid_motion.unit(rotation.axis) * (WIDE(rotation.pitch) / (2 * PI))  # [m/rad]

    def pose(self, time: np.ndarray, segment_time: np.ndarray) -> Pose:
        """Poses at ``time`` [s]; velocities and accelerations are those of the segments at ``segment_time`` [s]."""
        angle, rate, acceleration = self.rotation.angle_and_rates(time, segment_time)
        return rigid_motion.translation_by(*(np.outer(value, self.per_angle) for value in (angle, rate, acceleration)))

    def increments(self, time: np.ndarray) -> Increment:
        """Increments between consecutive times [s]; shape (k + 1,) gives k."""
        angle, _, _ = self.rotation.angle_and_rates(time, time)
        return Increment(np.zeros((len(time) - 1, 3, 3), dtype=WIDE), -np.outer(np.diff(angle), self.per_angle))

    def part(self, time: float) -> TranslationPart:
        """The translation at one time [s], for writers."""
        return TranslationPart((self.rotation.angle(time) * self.per_angle).astype(float))

    def speed_bound(self, points: np.ndarray, radius: float) -> float:
        """Upper bound of the speed of any points [m/s]."""
        return self.rotation.max_rate * float(np.linalg.norm(self.per_angle.astype(float)))

    def bounding_balls(self, points: np.ndarray, radius: float, end: float) -> tuple[np.ndarray, float]:
        """Points and a radius [m]: balls that hold the given balls at every time up to ``end`` [s]."""
        return points, radius + self.speed_bound(points, radius) * end
