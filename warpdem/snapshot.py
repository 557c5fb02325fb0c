"""What a run shows at one instant: all that writers and pictures see of it."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Placement:
    """Where a body stands in the frame axes: x_frame = rotation @ x_body + translation."""

    rotation: np.ndarray
    """Turn from body axes to frame axes, shape (3, 3)."""
    translation: np.ndarray
    """Shift [m], shape (3,)."""


@dataclass(frozen=True)
class FramePose:
    """Where the frame stands in the laboratory: x_lab = origin + R (x_frame - origin), R the turn by ``angle``."""

    axis: np.ndarray
    """Unit vector of the rotation axis, shape (3,)."""
    origin: np.ndarray
    """A point of the rotation axis [m], shape (3,)."""
    angle: float
    """Angle turned since time 0, not wrapped [rad]."""
    rate: float
    """Angular rate [rad/s]."""

    @property
    def rotation(self) -> np.ndarray:
        """Turn from frame axes to laboratory axes, shape (3, 3) (Rodrigues' formula)."""
        x, y, z = self.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        return np.eye(3) + np.sin(self.angle) * cross + 2.0 * np.sin(0.5 * self.angle) ** 2 * (cross @ cross)

    def to_laboratory(self, points: np.ndarray) -> np.ndarray:
        """Laboratory positions [m] of points given in frame axes, shape (n, 3)."""
        return self.origin + (points - self.origin) @ self.rotation.T


@dataclass(frozen=True)
class Snapshot:
    """State of a run at time t_k, ordered by grain id; vectors in frame axes, motion relative to the frame."""

    step: int
    time: float
    """Time [s]."""
    frame: FramePose
    id: np.ndarray
    """Grain ids, shape (n,), int64, ascending."""
    type: np.ndarray
    """Material index in the order of the scene, shape (n,), int32."""
    radius: np.ndarray
    """Radius [m], shape (n,)."""
    mass: np.ndarray
    """Mass [kg], shape (n,)."""
    position: np.ndarray
    """Position [m], shape (n, 3)."""
    velocity: np.ndarray
    """Velocity relative to the frame [m/s], shape (n, 3)."""
    spin: np.ndarray
    """Angular velocity relative to the frame [rad/s], shape (n, 3)."""
    force: np.ndarray
    """Contact force on each grain [N], shape (n, 3)."""
    walls: dict[str, Placement] = field(default_factory=dict)
    """Placement of each mesh wall in frame axes, by wall name."""


@dataclass(frozen=True)
class WallMesh:
    """A mesh wall in its body axes; its place at any instant is the snapshot's Placement of that name."""

    name: str
    vertices: np.ndarray
    """Corners [m], shape (v, 3), float64."""
    triangles: np.ndarray
    """Corner numbers of each triangle, shape (t, 3), int32."""
