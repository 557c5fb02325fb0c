"""Neighbor table of a packing, the moves that push grains apart, and the worst overlap of each grain."""

import numpy as np
import warp as wp

from warpdem.core.threads import Threads, available_threads
from warpdem.filling.size_grids import RowRoom, grids_for, size_classes
from warpdem.kernels import packing as kernels


def worst_overlaps(position: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest overlap of each grain as a share of the smaller radius [-], (n,), and its partner, (n,), -1: none."""
    threads = Threads(available_threads())
    neighbours = NeighborTable(np.array(position, float), radius, len(radius), 0.0, threads, room=0)
    neighbours.build()
    threads.close()
    return neighbours.overlap.numpy(), neighbours.partner.numpy()


class NeighborTable:
    """Neighbour table with a skin, rebuilt when a grain has moved half of it; and the pushes that follow from it.

    Args:
        position: Positions [m], shape (n, 3); read again at each call.
        radius: Radii [m], shape (n,).
        loose: Number of grains, the first ones, that have neighbours and move.
        skin: Reach beyond touching [m].
        threads: Who computes.
        room: Neighbours that the table has room for to begin with, per grain; 0 for no table.
    """

    def __init__(self, position: np.ndarray, radius: np.ndarray, loose: int, skin: float, threads: Threads, room: int = 24):
        self._position, self._loose, self._skin, self._threads = position, loose, skin, threads
        self._radii, self._classes = radius, size_classes(radius)
        self._room = RowRoom(room) if room else None
        self._points = wp.zeros(len(position), dtype=wp.vec3d, device="cpu")
        self._radius = wp.array(radius, dtype=wp.float64, device="cpu")
        self._count = wp.zeros(loose, dtype=wp.int32, device="cpu")
        self._move = wp.zeros(loose, dtype=wp.vec3d, device="cpu")
        self.overlap = wp.zeros(loose, dtype=wp.float64, device="cpu")
        self.partner = wp.zeros(loose, dtype=wp.int32, device="cpu")
        self._built_at: np.ndarray | None = None
        self.builds = 0

    def build(self) -> None:
        """List the neighbours."""
        self._points.numpy()[:] = self._position
        grids = grids_for(self._position, self._radii, self._classes, self._skin, wp.get_device("cpu"))
        wp.launch(kernels.insert_grains, len(self._radii), [grids, self._points, self._radius], device="cpu")
        loose = self._classes[: self._loose]
        while True:
            start = self._room.starts(loose) if self._room else np.zeros(self._loose + 1, dtype=np.int32)
            self._start = wp.array(start, dtype=wp.int32, device="cpu")
            self._table = wp.empty(int(start[-1]), dtype=wp.int32, device="cpu")
            inputs = [grids, self._points, self._radius, self._skin, self._start]
            outputs = [self._table, self._count, self.overlap, self.partner]
            self._threads.split(kernels.list_neighbours, self._loose, [*inputs, *outputs], wp.get_device("cpu"))
            if self._room is None or self._room.holds(loose, self._count.numpy()):
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
        """Longest way of a grain since the table was built [m]."""
        way = self._position[: self._loose] - self._built_at
        return float(np.sqrt(np.einsum("ij,ij->i", way, way).max(initial=0.0)))
