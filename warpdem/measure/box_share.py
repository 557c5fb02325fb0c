"""How much of grains and of lines between them lies in a box, with the images that come round periodic borders."""

import itertools
from collections.abc import Sequence

import numpy as np

from warpdem.measure.ball_in_box import ball_in_box


class BoxShare:
    """A box that may touch or cross periodic borders; along a periodic axis it is one period long at most.

    What lies at a lower face is inside, what lies at an upper one is not, so that boxes side by side share nothing.

    Args:
        low: lowest corner [m], shape (3,).
        high: highest corner [m], shape (3,).
        period: length of the domain along each periodic axis [m], else 0; shape (3,).

    Attributes:
        volume: of the box [m3].
    """

    def __init__(self, low: Sequence[float], high: Sequence[float], period: Sequence[float]) -> None:
        self._low, self._high, self._period = (np.array(values, dtype=float) for values in (low, high, period))
        length = self._high - self._low
        # such a box has no ends: whatever crosses the one comes in at the other
        round_ = (self._period > 0.0) & (length >= self._period * (1.0 - 1e-12))
        self.volume = float(np.prod(np.where(round_, self._period, length)))
        self._low[round_], self._high[round_], self._period[round_] = -np.inf, np.inf, 0.0
        self._images = np.array(list(itertools.product(*[(0.0, p, -p) if p else (0.0,) for p in self._period])))

    def holds(self, position: np.ndarray) -> np.ndarray:
        """Whether each position (n, 3) [m], or an image of it, is inside; shape (n,), bool."""
        place = self._shifted(position)
        return np.asarray(((place >= self._low) & (place < self._high)).all(axis=1))

    def of_balls(self, centre: np.ndarray, radius: np.ndarray) -> float:
        """Volume [m3] of balls at ``centre`` [m] (n, 3) with ``radius`` [m] (n,) that is inside."""
        place = self._shifted(centre)
        return float(sum(ball_in_box(place + image, radius, self._low, self._high).sum() for image in self._images))

    def of_lines(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Share [-] of each straight line from ``start`` to ``end`` [m] (n, 3) that is inside, shape (n,)."""
        way = end - start
        place = self._shifted(start)
        least, most = np.minimum(place, place + way), np.maximum(place, place + way)
        share = np.zeros(len(start))
        for image in self._images:
            near = ((most + image >= self._low) & (least + image <= self._high)).all(axis=1)
            share[near] += _clipped(place[near] + image, way[near], self._low, self._high)
        return share

    def _shifted(self, position: np.ndarray) -> np.ndarray:
        """Images of positions (n, 3) [m] within one period from the lowest corner on."""
        round_ = self._period > 0.0
        place = position.copy()
        low, period = self._low[round_], self._period[round_]
        place[:, round_] -= period * np.floor((position[:, round_] - low) / period)
        return place


def _clipped(start: np.ndarray, way: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Share of each line start + t way, t from 0 to 1, that is in a box; shape (n,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = (low - start) / way, (high - start) / way
    beside = way == 0.0  # along the faces: it is between them all the way or never
    between = (start >= low) & (start < high)
    enters = np.where(beside, np.where(between, 0.0, 2.0), np.minimum(first, last)).max(axis=1)
    leaves = np.where(beside, 1.0, np.maximum(first, last)).min(axis=1)
    return np.maximum(np.minimum(leaves, 1.0) - np.maximum(enters, 0.0), 0.0)
