"""Host side of the grids that find grains near each other, one for each class of sizes (``kernels.lists.cells``)."""

import numpy as np
import warp as wp

from warpdem.kernels.lists import cells as kernels
from warpdem.kernels.lists.numbering import starts

CLASS_RATIO = 2.0
"""Largest over smallest radius of a class of sizes, about [-]."""


def size_classes(radius: np.ndarray) -> np.ndarray:
    """Class of each radius (n,) [m], 0 the largest, shape (n,): equal steps in its logarithm, close to `CLASS_RATIO`."""
    small, large = float(radius.min()), float(radius.max())
    count = max(1, round(np.log(large / small) / np.log(CLASS_RATIO)))
    if count == 1:
        return np.zeros(len(radius), dtype=np.int64)
    position = np.log(large / radius) * (count / np.log(large / small))
    return np.asarray(np.minimum(position.astype(np.int64), count - 1))


def finest_cell(radius: np.ndarray, classes: np.ndarray, beyond: float) -> float:
    """Width of the cells of the smallest grains [m]; arguments as of ``grids_for``."""
    return 2.0 * float(radius[classes == classes.max()].max()) + beyond


def grid_cells(position: np.ndarray, cell: float) -> tuple[int, int, int]:
    """Cells of a grid in each direction: as many as the grains span, but not many more than there are grains.

    The grid wraps around, so fewer cells only cost time.
    """
    span = np.array([np.ptp(column) for column in position.T]) / cell  # along the first axis NumPy takes 20 times as long
    cells = (np.minimum(span, 1000.0) + 1.0).astype(int)
    while cells.prod() > max(4096, 4 * len(position)) and cells.max() > 1:
        cells[cells.argmax()] //= 2
    nx, ny, nz = (int(c) for c in cells)
    return nx, ny, nz


class RowCapacity:
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
        return np.asarray(starts(self._room[classes]))

    def entries(self, classes: np.ndarray) -> int:
        """Room of all rows together."""
        return int(self._room[classes].sum())

    def holds(self, classes: np.ndarray, count: np.ndarray) -> bool:
        """Whether rows of ``count`` (n,) neighbours fit; where not, there is more room from now on."""
        longest = np.array([count[classes == size].max(initial=0) for size in range(len(self._room))], self._room.dtype)
        short = longest > self._room
        self._room = np.where(short, longest + np.maximum(4, longest // 8), self._room)
        return not short.any()


def grids_for(
    position: np.ndarray, radius: np.ndarray, classes: np.ndarray, beyond: float, device: wp.Device, widest: float | None = None
) -> kernels.SizeGrids:
    """Empty grids, wide enough for the grains.

    Args:
        position: positions [m], shape (n, 3), n > 0.
        radius: radii [m], shape (n,).
        classes: class of each grain, of ``size_classes``, shape (n,).
        beyond: how far beyond touching neighbours are looked for [m].
        device: where.
        widest: radius [m] of a class of its own, in front of the others, that nobody is in yet.
    """
    numbers = np.flatnonzero(np.bincount(classes))
    kinds = [(position, radius)]
    if len(numbers) > 1:
        kinds = [(position[mine], radius[mine]) for mine in (classes == number for number in numbers)]
    largest = [float(radii.max()) for _, radii in kinds]
    if widest is not None:
        kinds, largest = [(position, radius), *kinds], [widest, *largest]
    width = 2.0 * np.array(largest) + beyond
    cells = np.array([grid_cells(places, cell) for (places, _), cell in zip(kinds, width, strict=True)])
    first = starts((cells + np.array([1, 0, 0])).prod(axis=1))  # of each line one entry more than it has cells
    out = kernels.SizeGrids()
    out.largest = wp.array(largest, dtype=wp.float64, device=device)
    out.per_length = wp.array(1.0 / width, dtype=wp.float64, device=device)
    out.cells = wp.array(cells, dtype=wp.vec3i, device=device)
    out.first = wp.array(first[:-1], dtype=wp.int32, device=device)
    out.lines = int(cells[:, 1:].prod(axis=1).sum())
    out.end = wp.zeros(int(first[-1]), dtype=wp.int32, device=device)
    out.placed = wp.zeros(1 + len(cells), dtype=wp.int32, device=device)
    out.cell = wp.empty(len(radius), dtype=wp.int32, device=device)
    out.grain = wp.empty(len(radius) + kernels.SPARE, dtype=wp.int32, device=device)
    return out
