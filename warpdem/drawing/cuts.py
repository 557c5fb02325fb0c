"""Cutting planes of a picture: the half-space that is shown."""

import re
from dataclasses import dataclass

import numpy as np

from warpdem.core.pose import FramePose
from warpdem.errors import WarpdemError

_SIDE = re.compile(r"([xyz])\s*([<>])=?\s*(\S+)")
_AXES = re.compile(r"(?:(frame|laboratory)\s*:)?\s*(.*)")


@dataclass(frozen=True)
class Cut:
    """The half-space n . x > d."""

    normal: np.ndarray
    """Unit normal n towards what is shown, shape (3,)."""
    offset: float
    """Offset d [m]."""
    in_laboratory: bool
    """Whether the plane rests in the laboratory; else in the frame."""

    def in_frame(self, pose: FramePose) -> tuple[np.ndarray, float]:
        """Normal and offset [m] in frame axes."""
        if not self.in_laboratory:
            return self.normal, self.offset
        return pose.rotation.T @ self.normal, self.offset - float(self.normal @ pose.translation)


def parsed_cut(text: str, view: str) -> Cut:
    """The cut that a text such as ``x < 0.1`` or ``frame: 0,0,0,1,0,0`` (point, normal) asks for.

    Raises:
        WarpdemError: The text says neither.
    """
    match = _AXES.fullmatch(text.strip())
    try:
        if match is None:
            raise ValueError
        axes, half_space = match.groups()
        if side := _SIDE.fullmatch(half_space):
            letter, sign, value = side.groups()
            normal = (1.0 if sign == ">" else -1.0) * np.eye(3)["xyz".index(letter)]
            point = np.full(3, float(value))
        else:
            numbers = np.array([float(word) for word in half_space.split(",")])
            point, normal = numbers.reshape(2, 3)
            length = np.linalg.norm(normal)
            normal = normal / length if length else np.full(3, np.nan)
        if not np.isfinite([*point, *normal]).all():
            raise ValueError
    except ValueError as error:
        raise WarpdemError(
            f'cut {text!r} cannot be read; give a side such as "x < 0.1", or point and normal as "px,py,pz,nx,ny,nz" [m], '
            'after "frame:" or "laboratory:" if other axes than those of the view are meant'
        ) from error
    return Cut(normal, float(normal @ point), (axes or view) == "laboratory")
