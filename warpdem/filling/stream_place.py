"""Where the region of a stream is at a time: in the frame, the laboratory, or carried by a wall."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpdem.mesh.solid import Inserted

ROUNDING = 1e-9
"""Share of a radius [-] by which a grain may reach out of its region."""
Axes = tuple[np.ndarray, np.ndarray]
"""Axes (3, 3) of a body in frame axes [-], and its origin there [m], shape (3,)."""


@dataclass(frozen=True, eq=False)
class PlaceNow:
    """A region in frame axes at one time."""

    shape: Inserted
    """In its own axes."""
    axes: Axes | None
    """Of the region; None where they are those of the frame."""

    @property
    def bounds(self) -> np.ndarray:
        """Least and greatest corner [m], shape (2, 3), of a box around it in frame axes."""
        low, high = self.shape.bounds
        if self.axes is None:
            return np.array([low, high])
        turn, origin = self.axes
        middle, reach = turn @ (0.5 * (low + high)) + origin, np.abs(turn) @ (0.5 * (high - low))
        return np.array([middle - reach, middle + reach])

    def in_frame(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) [m] of the region's axes in frame axes."""
        return points if self.axes is None else np.asarray(points @ self.axes[0].T + self.axes[1])

    def random_point(self, generator: np.random.Generator, radius: float) -> np.ndarray | None:
        """A random center (3,) [m] in frame axes for a grain of this radius [m]; None where none was found."""
        point = self.shape.random_points(generator, np.array([radius]))
        if self.shape.depth(point)[0] < radius * (1.0 - ROUNDING):
            return None
        return np.asarray(self.in_frame(point)[0])


class StreamPlace:
    """The region of a stream.

    Args:
        shape: In its own axes.
        axes: Gives these in frame axes at a time [s]; None where they are those of the frame.
    """

    def __init__(self, shape: Inserted, axes: Callable[[float], Axes] | None = None) -> None:
        self.shape, self._axes = shape, axes

    @property
    def moves(self) -> bool:
        """Whether it moves in the frame."""
        return self._axes is not None

    def at(self, time: float) -> PlaceNow:
        """Where it is at ``time`` [s]."""
        return PlaceNow(self.shape, None if self._axes is None else self._axes(time))

    def samples(self, radius: float, count: int) -> np.ndarray:
        """Centers [m] in the region's axes that a grain of this radius [m] may have, spread over it; shape (k, 3)."""
        points = self.shape.random_points(np.random.default_rng(0), np.full(count, radius))
        return points[self.shape.depth(points) >= radius * (1.0 - ROUNDING)]
