"""Host side of the hash grids that find grains near each other, one for each class of sizes (``kernels.size_grids``)."""

import numpy as np
import warp as wp

from warpdem.kernels import size_grids as kernels

CLASS_RATIO = 2.0
"""Largest over smallest radius of a class of sizes, about [-]."""


def size_classes(radius: np.ndarray) -> np.ndarray:
    """Class of each radius (n,) [m], 0 the largest, shape (n,): equal steps in its logarithm, close to `CLASS_RATIO`."""
    small, large = float(radius.min()), float(radius.max())
    count = max(1, round(np.log(large / small) / np.log(CLASS_RATIO)))
    if count == 1:
        return np.zeros(len(radius), dtype=np.int64)
    place = np.log(large / radius) * (count / np.log(large / small))
    return np.minimum(place.astype(np.int64), count - 1)


def finest_cell(radius: np.ndarray, classes: np.ndarray, beyond: float) -> float:
    """Width of the cells of the smallest grains [m]; arguments as of ``SizeGrids.build``."""
    return 2.0 * float(radius[classes == classes.max()].max()) + beyond


def starts(count: np.ndarray) -> np.ndarray:
    """Exclusive prefix sums with the total at the end, int32."""
    out = np.zeros(len(count) + 1, dtype=np.int32)
    np.cumsum(count, out=out[1:])
    return out


def grid_cells(position: np.ndarray, cell: float) -> tuple[int, int, int]:
    """Cells of a hash grid in each direction: as many as the grains span, but not many more than there are grains.

    The grid wraps around, so fewer cells only cost time.
    """
    span = np.ptp(position, axis=0) / cell
    cells = (np.minimum(span, 1000.0) + 1.0).astype(int)
    while cells.prod() > max(4096, 8 * len(position)) and cells.max() > 1:
        cells[cells.argmax()] //= 2
    return tuple(int(c) for c in cells)


class RowRoom:
    """Room for the row of neighbours of each grain, the same in a class of sizes: rows are as long as their grains are large.

    Args:
        least: room per row to begin with.
    """

    def __init__(self, least: int) -> None:
        self._least = least
        self._room = np.full(1, least)

    def starts(self, classes: np.ndarray) -> np.ndarray:
        """Start of each row and the end of the last, shape (n + 1,), int32; ``classes`` (n,) of ``size_classes``."""
        missing = int(classes.max()) + 1 - len(self._room)
        self._room = np.pad(self._room, (0, max(missing, 0)), constant_values=self._least)
        return starts(self._room[classes])

    def entries(self, classes: np.ndarray) -> int:
        """Room of all rows together."""
        return int(self._room[classes].sum())

    def holds(self, classes: np.ndarray, count: np.ndarray) -> bool:
        """Whether rows of ``count`` (n,) neighbours fit; where not, there is more room from now on."""
        longest = np.array([count[classes == size].max(initial=0) for size in range(len(self._room))], self._room.dtype)
        short = longest > self._room
        self._room = np.where(short, longest + np.maximum(4, longest // 8), self._room)
        return not short.any()


class SizeGrids:
    """Finds the grains near a place."""

    def __init__(self, device) -> None:
        self._device = device
        self._grids: dict[int, tuple[tuple[int, int, int], wp.HashGrid]] = {}

    def build(self, position: np.ndarray, radius: np.ndarray, classes: np.ndarray, beyond: float) -> kernels.SizeGrids:
        """Put the grains on the grids of their classes.

        Args:
            position: positions [m], shape (n, 3), n > 0.
            radius: radii [m], shape (n,).
            classes: class of each grain, of ``size_classes``, shape (n,).
            beyond: how far beyond touching neighbours are looked for [m].
        """
        order = np.argsort(classes, kind="stable")
        sphere = np.column_stack([position, radius])[order]
        numbers, first = np.unique(classes[order], return_index=True)
        largest = np.maximum.reduceat(sphere[:, 3], first)
        grids = []
        for number, radius_there, mine in zip(numbers, largest, np.split(sphere[:, :3], first[1:]), strict=True):
            cell = 2.0 * radius_there + beyond
            grid = self._grid(int(number), grid_cells(mine, cell))
            grid.build(wp.array(np.ascontiguousarray(mine), dtype=wp.vec3d, device=self._device), cell)
            grids.append(grid.id)
        out = kernels.SizeGrids()
        out.grid = wp.array(grids, dtype=wp.uint64, device=self._device)
        out.first = wp.array(first.astype(np.int32), dtype=wp.int32, device=self._device)
        out.largest = wp.array(largest, dtype=wp.float64, device=self._device)
        out.sphere = wp.array(sphere, dtype=wp.vec4d, device=self._device)
        out.slot = wp.array(order.astype(np.int32), dtype=wp.int32, device=self._device)
        return out

    def _grid(self, number: int, cells: tuple[int, int, int]) -> wp.HashGrid:
        """Grid of a class, the one from before if it has these cells."""
        if self._grids.get(number, (None,))[0] != cells:
            self._grids[number] = cells, wp.HashGrid(*cells, device=self._device, dtype=wp.float64)
        return self._grids[number][1]
