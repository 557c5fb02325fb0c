"""Where a picture is taken from: presets, given places, and a fit that sees everything.

Presets are meant for z upwards and are turned to where up is: against gravity as the first frame of the picture has it, along z
without gravity. The turn is the shortest one from z, so that x stays to the right of a front view for y upwards.
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
    """A camera, placed."""

    position: np.ndarray
    """Place [m], shape (3,)."""
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
    """Right, up and forward direction as rows, shape (3, 3): unit vectors, up as near to ``up`` as can be."""
    forward = np.asarray(forward) / np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def upright(gravity: np.ndarray | None) -> np.ndarray:
    """Turn of the presets, shape (3, 3): its last column points upwards, against gravity, the shortest turn takes z there.

    Args:
        gravity: Gravity in the axes of the view [m/s2], shape (3,); zero or None leaves z upwards.
    """
    size = 0.0 if gravity is None else float(np.linalg.norm(gravity))
    if not size or not np.isfinite(size):
        return np.eye(3)
    x, y, z = -np.asarray(gravity) / size
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])  # half a turn about x, as every axis across would do
    return np.array(
        [[1.0 - x * x / (1.0 + z), -x * y / (1.0 + z), x], [-x * y / (1.0 + z), 1.0 - y * y / (1.0 + z), y], [-x, -y, z]]
    )


def looking(style: PictureStyle, pose: FramePose, turn: np.ndarray) -> np.ndarray:
    """Right, up and forward direction of the picture as rows, shape (3, 3), unless the camera's place is given.

    Args:
        style: What is asked for.
        pose: Where the frame stands in the first frame.
        turn: Turn of the presets, as ``upright`` gives it.

    Raises:
        WarpdemError: The direction upwards is the one the camera looks along.
    """
    if style.position is not None and style.focus is not None:
        forward = np.subtract(style.focus, style.position)
    elif style.camera != "auto":
        forward = turn @ _FORWARD[style.camera]
    else:
        axis = next((part.axis for part in pose.parts if isinstance(part, RotationPart)), turn[:, 2])
        # a frame that turns about the vertical is seen from the side
        forward = turn @ _FORWARD["front"] if abs(axis @ turn[:, 2]) > 0.9 else axis
    return picture_axes(forward, _upwards(style, forward, turn))


def placed(style: PictureStyle, turn: np.ndarray, axes: np.ndarray, low: np.ndarray, high: np.ndarray, aspect: float) -> Camera:
    """The camera of a style.

    Args:
        style: What is asked for.
        turn: Turn of the presets, as ``upright`` gives it.
        axes: Right, up and forward direction of the picture as rows, shape (3, 3).
        low: Least coordinates of anything along ``axes`` [m], shape (3,).
        high: Greatest coordinates [m], shape (3,).
        aspect: Width of the picture over its height [-].
    """
    middle, half = 0.5 * (low + high), 0.5 * _MARGIN * (high - low)
    focus = axes.T @ middle if style.focus is None else np.array(style.focus, dtype=float)
    # the nearest face of the box decides
    spread = max(half[1], half[0] / aspect, 1e-9)
    distance = spread / np.tan(np.radians(0.5 * VIEW_ANGLE)) + half[2]
    position = focus - distance * axes[2] if style.position is None else np.array(style.position, dtype=float)
    up = _upwards(style, focus - position, turn)
    height = None if style.height is None else style.height / style.zoom
    angle = 2.0 * np.degrees(np.arctan(np.tan(np.radians(0.5 * VIEW_ANGLE)) / style.zoom))
    return Camera(position, focus, up, angle, height)


def _upwards(style: PictureStyle, forward: np.ndarray, turn: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(forward)
    if not length:
        raise WarpdemError("position and focus of the camera are one point: it has no direction")
    if style.up is None:
        # along the vertical it is the way of the front view, as on a plan
        return turn[:, 1 if abs(forward @ turn[:, 2]) > 0.999 * length else 2]
    if np.linalg.norm(np.cross(style.up, forward)) <= 1e-6 * length * np.linalg.norm(style.up):
        raise WarpdemError(f"up {style.up!r} must not be zero or lie along the direction in which the camera looks")
    return np.array(style.up, dtype=float)
