"""Who owns which part of space: recursive bisection of weighted points.

The parts halve the weight again and again, each by a plane across the longest side of what it cuts. Points on a plane belong to
the upper side. No bit of a run depends on the cuts.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Cuts:
    """A tree of cuts; the parts are numbered from low to high."""

    axis: np.ndarray
    """(parts - 1,) axis that each cut is across, 0 to 2, a cut before those of its lower and then of its upper side."""
    place: np.ndarray
    """(parts - 1,) where it is on that axis [m]."""

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self.axis) + 1

    @classmethod
    def of(cls, position: np.ndarray, weight: np.ndarray, parts: int, like: "Cuts | None" = None) -> "Cuts":
        """Cuts into ``parts`` of about equal weight.

        Args:
            position: points [m], shape (n, 3).
            weight: their weights [-], shape (n,).
            parts: number of parts.
            like: cuts whose axes are kept, so that little changes hands.
        """
        axis, place = np.zeros(parts - 1, dtype=np.int64), np.zeros(parts - 1)

        def cut(some: np.ndarray, node: int, count: int) -> None:
            if count == 1:
                return
            lower = count // 2
            here = position[some]
            axis[node] = like.axis[node] if like is not None else np.argmax(np.ptp(here, axis=0)) if len(some) else 0
            along = here[:, axis[node]]
            order = np.argsort(along, kind="stable")
            sums = np.cumsum(weight[some][order])
            if len(some):
                middle = min(int(np.searchsorted(sums, sums[-1] * lower / count, side="right")), len(some) - 1)
                place[node] = along[order[middle]]
            below = along < place[node]
            cut(some[below], node + 1, lower)
            cut(some[~below], node + lower, count - lower)

        cut(np.arange(len(position)), 0, parts)
        return cls(axis, place)

    def owner(self, position: np.ndarray) -> np.ndarray:
        """Number of the part that each point [m], shape (n, 3), is in, shape (n,)."""
        out = np.zeros(len(position), dtype=np.int64)

        def sort(some: np.ndarray, node: int, first: int, count: int) -> None:
            if count == 1:
                out[some] = first
                return
            lower = count // 2
            below = position[some, self.axis[node]] < self.place[node]
            sort(some[below], node + 1, first, lower)
            sort(some[~below], node + lower, first + lower, count - lower)

        sort(np.arange(len(position)), 0, 0, self.parts)
        return out
