"""How much of grains and of lines between them lies in a bounded region and its images across periodic borders."""

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np


class ImageShare(ABC):
    """A region that may cross periodic borders; what lies in it alone a shape says.

    Args:
        bounds: Lowest and highest corner of the region [m], shape (2, 3).
        volume: Of the region [m3].
        period: Length of the domain along each periodic axis [m], else 0; shape (3,).

    Attributes:
        volume: Of the region [m3].
    """

    def __init__(self, bounds: np.ndarray, volume: float, period: Sequence[float]) -> None:
        self._bounds, self.volume = bounds, volume
        self._images = np.array(list(itertools.product(*[(0.0, p, -p) if p else (0.0,) for p in period])))

    @abstractmethod
    def _balls(self, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Volume of each ball that is in the shape [m3], shape (n,)."""

    @abstractmethod
    def _lines(self, start: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Share of each line start + t way, t from 0 to 1, that is in the shape [-], shape (n,)."""

    def of_balls(self, centre: np.ndarray, radius: np.ndarray) -> float:
        """Volume [m3] of balls at ``centre`` [m] (n, 3) with ``radius`` [m] (n,) that is inside."""
        low, high = self._bounds
        total = 0.0
        for image in self._images:
            place, size = centre + image, radius[:, None]
            near = ((place + size >= low) & (place - size <= high)).all(axis=1)
            total += float(self._balls(place[near], radius[near]).sum())
        return total

    def of_lines(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Share [-] of each straight line from ``start`` to ``end`` [m] (n, 3) that is inside, shape (n,)."""
        share, (low, high) = np.zeros(len(start)), self._bounds
        least, most = np.minimum(start, end), np.maximum(start, end)
        for image in self._images:
            near = ((most + image >= low) & (least + image <= high)).all(axis=1)
            share[near] += self._lines(start[near] + image, (end - start)[near])
        return share
