"""Poses at one time: placements of bodies in the frame, the single motions of a chain, and the pose of the frame itself."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Placement:
    """Position and orientation of a body in the frame axes: x_frame = rotation @ x_body + translation."""

    rotation: np.ndarray
    """Rotation from body axes to frame axes [-], shape (3, 3)."""
    translation: np.ndarray
    """Position of the body's origin in the frame axes [m], shape (3,)."""


@dataclass(frozen=True)
class RotationPart:
    """A rotation about an axis: x goes to origin + R (x - origin)."""

    axis: np.ndarray
    """Unit vector of the axis, shape (3,)."""
    origin: np.ndarray
    """A point on the axis [m], shape (3,)."""
    angle: float
    """Rotation angle since time 0, not wrapped [rad]."""


@dataclass(frozen=True)
class TranslationPart:
    """A translation: x goes to x + shift."""

    shift: np.ndarray
    """Displacement since time 0 [m], shape (3,)."""


@dataclass(frozen=True)
class SampledPart:
    """A rigid motion without a fixed axis: x goes to R x + shift."""

    quaternion: np.ndarray
    """Unit quaternion of R, scalar first, shape (4,)."""
    shift: np.ndarray
    """Displacement [m], shape (3,)."""


Part = RotationPart | TranslationPart | SampledPart


@dataclass(frozen=True)
class FramePose:
    """Pose and velocity of the frame in the laboratory: x_lab = rotation @ x_frame + translation."""

    rotation: np.ndarray
    """Rotation from frame axes to laboratory axes [-], shape (3, 3)."""
    translation: np.ndarray
    """Position of the frame's origin [m], shape (3,)."""
    spin: np.ndarray
    """Angular velocity in frame axes [rad/s], shape (3,)."""
    velocity: np.ndarray
    """Absolute velocity of the frame's origin in frame axes [m/s], shape (3,)."""
    parts: tuple[Part, ...] = ()
    """The single motions of the chain, outermost first; none in an inertial frame."""

    @classmethod
    def rotated(cls, axis: np.ndarray, origin: np.ndarray, angle: float, rate: float) -> "FramePose":
        """A frame rotated by ``angle`` [rad] about a unit axis through ``origin`` [m], which rotates at ``rate`` [rad/s]."""
        x, y, z = axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        increment = np.sin(angle) * cross + 2.0 * np.sin(0.5 * angle) ** 2 * (cross @ cross)  # R - I
        spin = rate * np.asarray(axis)
        part = RotationPart(np.asarray(axis), np.asarray(origin), float(angle))
        return cls(np.eye(3) + increment, -increment @ origin, spin, -np.cross(spin, origin), (part,))

    @property
    def angle(self) -> float:
        """Unwrapped angle of the outermost rotation [rad]; 0 when no part is one."""
        return next((part.angle for part in self.parts if isinstance(part, RotationPart)), 0.0)

    def to_laboratory(self, points: np.ndarray) -> np.ndarray:
        """Laboratory positions [m] of points given in frame axes, shape (n, 3)."""
        return np.asarray(points @ self.rotation.T + self.translation)

    def velocity_at(self, points: np.ndarray) -> np.ndarray:
        """Absolute velocity of the frame's points in frame axes [m/s], shape (n, 3): u + w x q."""
        return np.asarray(self.velocity + np.cross(self.spin, points))
