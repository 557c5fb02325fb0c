"""Neighbor table of a packing, the moves that push grains apart, and the worst overlap of each grain."""

import numpy as np
import warp as wp

from warpdem.core.threads import Threads, available_threads
from warpdem.filling.size_grids import RowCapacity, grids_for, size_classes
from warpdem.kernels import packing as kernels
from warpdem.kernels.lists import cells


def worst_overlaps(
    position: np.ndarray, radius: np.ndarray, clump: np.ndarray | None = None,
    through: tuple[np.ndarray, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Largest overlap of each grain as a fraction of the smaller radius [-], (n,), and its partner, (n,), -1: none.

    Members of one clump, whose numbers ``clump`` (n,) holds, may overlap each other, and so may materials that pass through
    each other: ``through`` as of ``NeighborTable``.
    """
    threads = Threads(available_threads())
    neighbors = NeighborTable(np.array(position, float), radius, len(radius), 0.0, threads, 0, clump, through)
    neighbors.build()
    threads.close()
    return neighbors.overlap.numpy(), neighbors.partner.numpy()


class NeighborTable:
    """Neighbour table with a skin, rebuilt when a grain has moved half of it; and the pushes that follow from it.

    Args:
        position: Positions [m], shape (n, 3); read again at each call.
        radius: Radii [m], shape (n,).
        loose: Number of grains, the first ones, that have neighbors and move.
        skin: Reach beyond touching [m].
        threads: Who computes.
        capacity: Neighbors per grain that the table can hold at first; 0 for no table.
        clump: Number of the clump of each grain, -1 for none: members of one are no neighbors; None without clumps.
        through: Material of each grain, (n,), and whether two materials pass through each other, (m, m), which are then no
            neighbors either; None where all touch.
    """

    def __init__(
        self, position: np.ndarray, radius: np.ndarray, loose: int, skin: float, threads: Threads, capacity: int = 24,
        clump: np.ndarray | None = None, through: tuple[np.ndarray, np.ndarray] | None = None,
    ):  # fmt: skip
        self._position, self._loose, self._skin, self._threads = position, loose, skin, threads
        self._radii, self._classes = radius, size_classes(radius)
        self._capacity = RowCapacity(capacity) if capacity else None
        self._points = wp.zeros(len(position), dtype=wp.vec3d, device="cpu")
        self._radius: wp.array[wp.float64] = wp.array(radius, dtype=wp.float64, device="cpu")
        numbers = np.zeros(0, dtype=np.int32) if clump is None else clump.astype(np.int32)
        self._clump: wp.array[wp.int32] = wp.array(numbers, dtype=wp.int32, device="cpu")
        kinds, table = (np.zeros(0), np.zeros((0, 0))) if through is None else through
        self._kinds: wp.array[wp.int32] = wp.array(kinds.astype(np.int32), dtype=wp.int32, device="cpu")
        self._apart: wp.array[wp.int32] = wp.array(table.astype(np.int32), dtype=wp.int32, device="cpu")
        self._count = wp.zeros(loose, dtype=wp.int32, device="cpu")
        self._move = wp.zeros(loose, dtype=wp.vec3d, device="cpu")
        self.overlap = wp.zeros(loose, dtype=wp.float64, device="cpu")
        self.partner = wp.zeros(loose, dtype=wp.int32, device="cpu")
        self._built_at: np.ndarray | None = None
        self.builds = 0

    def build(self) -> None:
        """List the neighbors."""
        self._points.numpy()[:] = self._position
        grids = grids_for(self._position, self._radii, self._classes, self._skin, wp.get_device("cpu"))
        wp.launch(kernels.count_in_cells, len(self._radii), [grids, self._points, self._radius], device="cpu")
        wp.launch(cells.start_lines, grids.lines, [0, grids], device="cpu")
        wp.launch(kernels.sort_by_cell, len(self._radii), [grids], device="cpu")
        loose = self._classes[: self._loose]
        while True:
            start = self._capacity.starts(loose) if self._capacity else np.zeros(self._loose + 1, dtype=np.int32)
            self._start: wp.array[wp.int32] = wp.array(start, dtype=wp.int32, device="cpu")
            self._table = wp.empty(int(start[-1]), dtype=wp.int32, device="cpu")
            inputs = [grids, self._points, self._radius, self._clump, self._kinds, self._apart, self._skin, self._start]
            outputs = [self._table, self._count, self.overlap, self.partner]
            self._threads.split(kernels.list_neighbours, self._loose, [*inputs, *outputs], wp.get_device("cpu"))
            if self._capacity is None or self._capacity.holds(loose, self._count.numpy()):
                break
        self._built_at = self._position[: self._loose].copy()
        self.builds += 1

    def push_apart(self, growth: float) -> tuple[np.ndarray, np.ndarray]:
        """Moves [m], (loose, 3), of grains with radii times `growth`, and their largest overlaps [-], (loose,)."""
        if self._built_at is None or self._moved() > 0.5 * self._skin:
            self.build()
        self._points.numpy()[:] = self._position
        inputs = [self._points, self._radius, self._loose, growth, self._start, self._table, self._count]
        outputs = [self._move, self.overlap]
        self._threads.split(kernels.push_apart, self._loose, [*inputs, *outputs], wp.get_device("cpu"))
        return self._move.numpy(), self.overlap.numpy()

    def _moved(self) -> float:
        """Largest displacement of a grain since the table was built [m]."""
        moved = self._position[: self._loose] - self._built_at
        return float(np.sqrt(np.einsum("ij,ij->i", moved, moved).max(initial=0.0)))
