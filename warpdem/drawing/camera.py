"""Where a picture is taken from: presets, given positions, and a fit that shows everything.

Presets are defined for z upwards and rotated to the upward direction: against gravity as the first frame of the picture has it,
along z without gravity. The rotation is the shortest one from z, so that x stays to the right of a front view for y upwards.
"""

from dataclasses import dataclass

import numpy as np

from warpdem.core.pose import FramePose, RotationPart
from warpdem.drawing.style import PictureStyle
from warpdem.errors import WarpdemError

VIEW_ANGLE = 20.0
"""Angle from the lower to the upper edge [degree]: a long lens, so that walls along the line of sight hardly spread."""
_MARGIN = 1.06
_FORWARD = {
    "front": (0.0, 1.0, 0.0),
    "back": (0.0, -1.0, 0.0),
    "left": (1.0, 0.0, 0.0),
    "right": (-1.0, 0.0, 0.0),
    "top": (0.0, 0.0, -1.0),
    "bottom": (0.0, 0.0, 1.0),
    "iso": (-0.60, 0.66, -0.45),
}


@dataclass(frozen=True)
class Camera:
    """A camera with its position."""

    position: np.ndarray
    """Position [m], shape (3,)."""
    focus: np.ndarray
    """Point in the middle of the picture [m], shape (3,)."""
    up: np.ndarray
    """Direction that points upwards in the picture, shape (3,)."""
    angle: float
    """Angle from the lower to the upper edge [degree]."""
    height: float | None
    """Height of the picture in a parallel projection [m]; None for a perspective one."""

    @property
    def axes(self) -> np.ndarray:
        """Right, up and forward direction of the picture as rows, shape (3, 3)."""
        return picture_axes(self.focus - self.position, self.up)


def picture_axes(forward: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Right, up and forward direction as rows, shape (3, 3): unit vectors, up as near to ``up`` as possible."""
    forward = np.asarray(forward) / np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def upright(gravity: np.ndarray | None) -> np.ndarray:
    """Rotation of the presets, shape (3, 3): the shortest one that takes z upwards, against gravity (its last column).

    Args:
        gravity: Gravity in the axes of the view [m/s2], shape (3,); zero or None leaves z upwards.
    """
    size = 0.0 if gravity is None else float(np.linalg.norm(gravity))
    if not size or not np.isfinite(size):
        return np.eye(3)
    x, y, z = -np.asarray(gravity) / size
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])  # half a revolution about x; any horizontal axis would do
    return np.array(
        [[1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), x], [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), y], [-x, -y, z]]
    )


def view_axes(style: PictureStyle, pose: FramePose, rotation: np.ndarray) -> np.ndarray:
    """Right, up and forward direction of the picture as rows, shape (3, 3), as the style gives them.

    Args:
        style: Choices of the user.
        pose: Pose of the frame of reference at the first time drawn.
        rotation: Rotation of the presets, as ``upright`` gives it.

    Raises:
        WarpdemError: The upward direction is the direction of view.
    """
    if style.position is not None and style.focus is not None:
        forward = np.subtract(style.focus, style.position)
    elif style.camera != "auto":
        forward = rotation @ _FORWARD[style.camera]
    else:
        axis = next((part.axis for part in pose.parts if isinstance(part, RotationPart)), rotation[:, 2])
        # a frame that rotates about the vertical is seen from the side
        forward = rotation @ _FORWARD["front"] if abs(axis @ rotation[:, 2]) > 0.9 else axis
    return picture_axes(forward, _upwards(style, forward, rotation))


def camera_of(
    style: PictureStyle, rotation: np.ndarray, axes: np.ndarray, low: np.ndarray, high: np.ndarray, aspect: float
) -> Camera:
    """The camera of a style, with its position.

    Args:
        style: Choices of the user.
        rotation: Rotation of the presets, as ``upright`` gives it.
        axes: Right, up and forward direction of the picture as rows, shape (3, 3).
        low: Least coordinates of what is drawn along ``axes`` [m], shape (3,).
        high: Greatest coordinates [m], shape (3,).
        aspect: Width of the picture over its height [-].
    """
    middle, half = 0.5 * (low + high), 0.5 * _MARGIN * (high - low)
    focus = axes.T @ middle if style.focus is None else np.array(style.focus, dtype=float)
    # the nearest face of the box limits the view
    spread = max(half[1], half[0] / aspect, 1e-9)
    distance = spread / np.tan(np.radians(0.5 * VIEW_ANGLE)) + half[2]
    position = focus - distance * axes[2] if style.position is None else np.array(style.position, dtype=float)
    up = _upwards(style, focus - position, rotation)
    height = None if style.height is None else style.height / style.zoom
    angle = 2.0 * np.degrees(np.arctan(np.tan(np.radians(0.5 * VIEW_ANGLE)) / style.zoom))
    return Camera(position, focus, up, angle, height)


def _upwards(style: PictureStyle, forward: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(forward)
    if not length:
        raise WarpdemError("position and focus of the camera are one point: it has no direction")
    if style.up is None:
        # for a view along the vertical, the forward direction of the front view, as on a plan
        return rotation[:, 1 if abs(forward @ rotation[:, 2]) > 0.999 * length else 2]
    if np.linalg.norm(np.cross(style.up, forward)) <= 1e-6 * length * np.linalg.norm(style.up):
        raise WarpdemError(f"up {style.up!r} must not be zero or lie along the direction in which the camera looks")
    return np.array(style.up, dtype=float)
