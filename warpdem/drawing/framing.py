"""What the camera frames: the equipment and the bulk of the grains, whatever single grains do.

Finite walls are in the picture in all frames. Of the grains of a frame those count that are no outliers (by Tukey's fences, 1.5
times the distance of the quartiles beyond them); with finite walls they widen the picture by no more than twice the size of the
scene as it starts. The outliers are in the picture as well, if they are all within one size of what is in it already.
"""

import numpy as np

FENCE, WIDEST, NEAR = 1.5, 2.0, 1.0
"""Outliers begin so many distances of the quartiles beyond them; how far grains, and outliers, may widen a picture [sizes]."""


class Box:
    """Least and greatest coordinates met, along each of some directions."""

    def __init__(self, low: np.ndarray, high: np.ndarray) -> None:
        self.low, self.high = low, high

    @classmethod
    def empty(cls, directions: int) -> "Box":
        """A box of nothing."""
        return cls(np.full(directions, np.inf), np.full(directions, -np.inf))

    @property
    def there(self) -> bool:
        """Whether anything was met."""
        return bool(np.isfinite(self.low).all())

    @property
    def size(self) -> np.ndarray:
        """Greatest extent among the three directions that belong together [m], for each direction."""
        return np.repeat((self.high - self.low).reshape(-1, 3).max(axis=1), 3)

    def joined(self, other: "Box") -> "Box":
        """The box around both."""
        return Box(np.minimum(self.low, other.low), np.maximum(self.high, other.high))

    def taking(self, other: "Box") -> "Box":
        """The box, and another one on those sides where it stays near."""
        room = NEAR * self.size
        low = np.where(other.low >= self.low - room, np.minimum(self.low, other.low), self.low)
        high = np.where(other.high <= self.high + room, np.maximum(self.high, other.high), self.high)
        return Box(low, high)

    def within(self, other: "Box", room: float) -> "Box":
        """The box with its sides moved to where another one ends, widened by ``room`` sizes of that, if they are beyond."""
        if not (self.there and other.there):
            return self
        low, high = other.low - room * other.size, other.high + room * other.size
        return Box(np.clip(self.low, low, high), np.clip(self.high, low, high))


class Framing:
    """Gathers what is drawn, frame by frame, along fixed directions.

    Args:
        directions: unit vectors as rows, three by three at right angles, shape (3 k, 3).
    """

    def __init__(self, directions: np.ndarray) -> None:
        self._directions = directions
        self._walls, self._planes, self._start, self._bulk, self._all = (Box.empty(len(directions)) for _ in range(5))

    def meet_wall(self, points: np.ndarray, infinite: bool) -> None:
        """A wall of a frame by its corners [m], shape (n, 3); of a plane without end, its patch in the files."""
        found = self._around(points)
        if infinite:
            self._planes = self._planes.joined(found)
        else:
            self._walls = self._walls.joined(found)

    def meet_grains(self, position: np.ndarray, radius: np.ndarray) -> None:
        """The grains of a frame: centres [m], shape (n, 3), and radii [m], shape (n,)."""
        if not len(position):
            return
        along = position @ self._directions.T
        low, high = along - radius[:, None], along + radius[:, None]
        lower, upper = np.quantile(along, [0.25, 0.75], axis=0, method="nearest")
        reach = FENCE * (upper - lower) + radius.max()
        usual = (low >= lower - reach) & (high <= upper + reach)
        # along each direction by itself: one that flies off upwards is no outlier sideways
        bulk = Box(np.where(usual, low, np.inf).min(axis=0), np.where(usual, high, -np.inf).max(axis=0))
        bulk = Box(np.minimum(bulk.low, lower), np.maximum(bulk.high, upper))
        self._bulk, self._all = self._bulk.joined(bulk), self._all.joined(self._around(position, radius))

    def meet_start(self, position: np.ndarray, radius: np.ndarray) -> None:
        """The grains of the first frame of the results, which may not be drawn."""
        self._start = self._start.joined(self._around(position, radius))

    @property
    def bounded(self) -> bool:
        """Whether there are walls with an end."""
        return self._walls.there

    def box(self) -> Box:
        """What the picture shows along each direction [m], planes without end aside."""
        bulk = self._bulk
        if self._walls.there:
            bulk = bulk.within(self._walls.joined(self._planes).joined(self._start), WIDEST)
        core = self._walls.joined(bulk)
        if not core.there:
            return self._planes if self._planes.there else Box(np.full_like(core.low, -1.0), np.full_like(core.high, 1.0))
        return core.taking(self._all)

    def _around(self, points: np.ndarray, radius: np.ndarray | float = 0.0) -> Box:
        if not len(points):
            return Box.empty(len(self._directions))
        along, reach = points @ self._directions.T, np.reshape(radius, (-1, 1))
        return Box((along - reach).min(axis=0), (along + reach).max(axis=0))
