"""What the camera frames: the equipment and the bulk of the grains, without outliers.

Finite walls are in the picture in all frames. So are the grains of a frame that are no outliers (by
Tukey's fences, 1.5 times the distance of the quartiles beyond them); with finite walls they widen the picture by no more than
twice the size of the scene at its start. The outliers are in the picture as well if they are all within one size of it.
"""

import numpy as np

FENCE, WIDEST, NEAR = 1.5, 2.0, 1.0
"""Outliers begin so many distances of the quartiles beyond them; how far grains, and outliers, may widen a picture [sizes]."""


class Box:
    """Least and greatest coordinates along each of some directions."""

    def __init__(self, low: np.ndarray, high: np.ndarray) -> None:
        self.low, self.high = low, high

    @classmethod
    def empty(cls, directions: int) -> "Box":
        """A box that holds nothing."""
        return cls(np.full(directions, np.inf), np.full(directions, -np.inf))

    @property
    def there(self) -> bool:
        """Whether the box holds anything."""
        return bool(np.isfinite(self.low).all())

    @property
    def size(self) -> np.ndarray:
        """Greatest extent among the three directions that belong together [m], for each direction."""
        return np.repeat((self.high - self.low).reshape(-1, 3).max(axis=1), 3)

    def joined(self, other: "Box") -> "Box":
        """The box around both."""
        return Box(np.minimum(self.low, other.low), np.maximum(self.high, other.high))

    def with_near(self, other: "Box") -> "Box":
        """The box, extended to another one on the sides where that is near."""
        near = NEAR * self.size
        low = np.where(other.low >= self.low - near, np.minimum(self.low, other.low), self.low)
        high = np.where(other.high <= self.high + near, np.maximum(self.high, other.high), self.high)
        return Box(low, high)

    def within(self, other: "Box", border: float) -> "Box":
        """The box with its sides moved to where another one ends, widened by ``border`` sizes of that, if they are beyond."""
        if not (self.there and other.there):
            return self
        low, high = other.low - border * other.size, other.high + border * other.size
        return Box(np.clip(self.low, low, high), np.clip(self.high, low, high))


class Framing:
    """Gathers what is drawn, frame by frame, along fixed directions.

    Args:
        directions: Unit vectors as rows, in groups of three at right angles, shape (3 k, 3).
    """

    def __init__(self, directions: np.ndarray) -> None:
        self._directions = directions
        self._walls, self._planes, self._start, self._bulk, self._all = (Box.empty(len(directions)) for _ in range(5))

    def include_wall(self, points: np.ndarray, infinite: bool) -> None:
        """Include a wall of a frame by its corners [m], shape (n, 3); of an infinite plane, its patch in the files."""
        found = self._around(points)
        if infinite:
            self._planes = self._planes.joined(found)
        else:
            self._walls = self._walls.joined(found)

    def include_grains(self, position: np.ndarray, radius: np.ndarray) -> None:
        """Include the grains of a frame: centres [m], shape (n, 3), and radii [m], shape (n,)."""
        if not len(position):
            return
        along = position @ self._directions.T
        low, high = along - radius[:, None], along + radius[:, None]
        lower, upper = np.quantile(along, [0.25, 0.75], axis=0, method="nearest")
        fence = FENCE * (upper - lower) + radius.max()
        usual = (low >= lower - fence) & (high <= upper + fence)
        # along each direction by itself: a grain that flies off upwards is no outlier sideways
        bulk = Box(np.where(usual, low, np.inf).min(axis=0), np.where(usual, high, -np.inf).max(axis=0))
        bulk = Box(np.minimum(bulk.low, lower), np.maximum(bulk.high, upper))
        self._bulk, self._all = self._bulk.joined(bulk), self._all.joined(self._around(position, radius))

    def include_start(self, position: np.ndarray, radius: np.ndarray) -> None:
        """Include the grains of the first frame of the results, which need not be among those drawn."""
        self._start = self._start.joined(self._around(position, radius))

    @property
    def bounded(self) -> bool:
        """Whether there are finite walls."""
        return self._walls.there

    def box(self) -> Box:
        """What the picture shows along each direction [m], without infinite planes."""
        bulk = self._bulk
        if self._walls.there:
            bulk = bulk.within(self._walls.joined(self._planes).joined(self._start), WIDEST)
        core = self._walls.joined(bulk)
        if not core.there:
            return self._planes if self._planes.there else Box(np.full_like(core.low, -1.0), np.full_like(core.high, 1.0))
        return core.with_near(self._all)

    def _around(self, points: np.ndarray, radius: np.ndarray | float = 0.0) -> Box:
        if not len(points):
            return Box.empty(len(self._directions))
        along, extent = points @ self._directions.T, np.reshape(radius, (-1, 1))
        return Box((along - extent).min(axis=0), (along + extent).max(axis=0))
