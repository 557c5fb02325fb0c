"""Sides of a closed mesh that need no search: in a cell of space that is further from the surface than its own size.

    |d(x) - d(c)| <= |x - c|          d: signed distance from the surface, c: centre of the cell that x is in

So where |d(c)| is larger than half the diagonal of the cell, all of the cell is on the side of its centre. Cells are searched
for when a grain is first in them, and kept: a look at a mesh then costs a search for the grains beside its surface alone.
"""

from collections.abc import Callable

import numpy as np

MOST_CELLS = 2**21
"""Cells at most, 8 B each: larger ones where the mesh is many grains wide."""


class KnownSides:
    """Signed distances from a closed mesh, at least as far as the sides are concerned.

    Args:
        bounds: lowest and highest corner of the mesh [m], shape (2, 3).
        cell: edge of the cells, if they are few enough [m].
        search: signed distance of points (n, 3) [m], shape (n,), negative inside.
    """

    def __init__(self, bounds: np.ndarray, cell: float, search: Callable[[np.ndarray], np.ndarray]) -> None:
        self._search, self._origin = search, bounds[0]
        width = bounds[1] - bounds[0]
        # one more along each axis may be begun
        self._cell = max(cell, 1.02 * float(np.prod(width) / MOST_CELLS) ** (1.0 / 3.0), float(width.max()) / 1000.0)
        self._shape = np.floor(width / self._cell).astype(np.int64) + 1
        self._of_centre = np.full(int(self._shape.prod()), np.nan)

    def distances(self, points: np.ndarray, exactly: np.ndarray) -> np.ndarray:
        """Signed distances [m], shape (n,), negative inside: of the right sign everywhere, and no further than they are.

        Args:
            points: places (n, 3) in body axes of the mesh [m].
            exactly: radius around the surface within which the distance itself is wanted [m], shape (n,).
        """
        at = np.floor((points - self._origin) / self._cell).astype(np.int64)
        within = ((at >= 0) & (at < self._shape)).all(axis=1)
        out = np.full(len(points), np.inf)  # beyond the bounds of the mesh a grain is outside
        there = np.flatnonzero(within)
        at = at[there]
        number = (at[:, 0] * self._shape[1] + at[:, 1]) * self._shape[2] + at[:, 2]
        new = np.unique(number[np.isnan(self._of_centre[number])])
        if len(new):
            cells = np.stack(np.unravel_index(new, tuple(self._shape)), axis=1)
            self._of_centre[new] = self._search(self._origin + (cells + 0.5) * self._cell)
        of_centre = self._of_centre[number]
        sure = np.abs(of_centre) - 0.87 * self._cell  # half the diagonal is sqrt(3)/2
        out[there] = np.copysign(sure, of_centre)
        near = there[sure <= exactly[there]]
        if len(near):
            out[near] = self._search(points[near])
        return out
