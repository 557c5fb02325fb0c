"""A grid laid over the space between walls: distances of its nodes, which of them are connected, and paths over them."""

import itertools
from collections.abc import Sequence

import numpy as np

from warpdem.core.progress import report_state
from warpdem.filling.placed_walls import PlacedWall
from warpdem.mesh.grouping import components

FEWEST_NODES, MOST_NODES = 200_000, 3_000_000
"""Nodes of a grid: more than are needed to measure its volume, no more than a few seconds allow."""
CELL = 1.0
"""Width of a cell in radii of the smallest grain [-], unless the grid then has too few or too many nodes."""
SURE = 1.001
"""Sum of the distances of two nodes from the walls over their own distance above which no wall is between them [-]; more than 1
for rounding."""
CHUNK = 200_000
"""Nodes whose distances are computed at once."""
NEIGHBORS = [np.array(offset) for offset in itertools.product((-1, 0, 1), repeat=3) if any(offset)]
"""Index offsets of the 26 nodes around a node."""


class SpaceGrid:
    """Nodes with their distances from the walls, and which of them can be joined; arguments as of ``find_open_space``.

    Attributes:
        low: lowest corner [m], shape (3,).
        cell: widths of a cell [m], shape (3,).
        local: coordinates of the nodes along each axis [m].
        distance: of each node from the walls [m], negative where no grain may be.
        outside: nodes of the last layer at a side that leaks.
    """

    def __init__(
        self,
        walls: Sequence[PlacedWall],
        box: np.ndarray,
        axes: np.ndarray,
        leaks: np.ndarray,
        radius: float,
        most: int,
    ) -> None:
        extent = box[1] - box[0]
        nodes = np.clip((extent / (CELL * radius)).prod(), min(FEWEST_NODES, most), most)
        width = float((extent.prod() / nodes) ** (1.0 / 3.0))
        # two layers of cells beyond each side that leaks: the last one is outside
        self.low, high = box[0] - 2.0 * width * leaks[0], box[1] + 2.0 * width * leaks[1]
        shape = np.maximum(np.ceil((high - self.low) / width - 1e-9).astype(int), 1)
        self.axes, self.shape, self.cell = axes, tuple(shape), (high - self.low) / shape
        self.local = [self.low[k] + (np.arange(shape[k]) + 0.5) * self.cell[k] for k in range(3)]
        self.distance = self._distances(walls)
        self.outside = np.zeros(self.shape, bool)
        for k, side in itertools.product(range(3), range(2)):
            if leaks[side, k]:
                self.outside[tuple(-side if axis == k else slice(None) for axis in range(3))] = True

    def _distances(self, walls: Sequence[PlacedWall]) -> np.ndarray:
        total = int(np.prod(self.shape))
        found = np.full(total, np.inf)
        for first in range(0, total, CHUNK):
            index = np.stack(np.unravel_index(np.arange(first, min(first + CHUNK, total)), self.shape), axis=1)
            part = found[first : first + CHUNK]
            for wall in walls:
                np.minimum(part, wall.distance(self.position(index))[0], out=part)
            report_state(f"looking for the space between walls: {first / total:.0%}")
        return found.reshape(self.shape)

    def position(self, index: np.ndarray) -> np.ndarray:
        """Positions of nodes (k, 3) in frame axes [m], shape (k, 3)."""
        return np.asarray(np.stack([axis[i] for axis, i in zip(self.local, index.T, strict=True)], axis=1) @ self.axes)

    def node_at(self, point: np.ndarray, nodes: np.ndarray, largest: float) -> tuple[int, ...] | None:
        """Index of the one of ``nodes`` that is nearest to a point [m], or None if none is within ``largest`` [m]."""
        index = np.argwhere(nodes)
        apart = np.linalg.norm(self.position(index) - np.asarray(point, float), axis=1)
        best = int(np.argmin(apart)) if len(index) else 0
        return tuple(int(i) for i in index[best]) if len(index) and apart[best] <= largest else None

    def _joined(self, offset: np.ndarray) -> tuple[tuple[slice, ...], tuple[slice, ...], np.ndarray]:
        """Slices of the nodes with a neighbor at this offset and of these neighbors, and whether no wall can lie between."""
        here = tuple(slice(max(-w, 0), n - max(w, 0)) for w, n in zip(offset, self.shape, strict=True))
        there = tuple(slice(max(w, 0), n - max(-w, 0)) for w, n in zip(offset, self.shape, strict=True))
        length = float(np.linalg.norm(offset * self.cell))
        return here, there, self.distance[here] + self.distance[there] > SURE * length

    def labels(self, nodes: np.ndarray) -> np.ndarray:
        """Number of the connected space of each node, shape of the grid; nodes not in ``nodes`` have numbers of their own."""
        number = np.arange(nodes.size).reshape(self.shape)
        pairs = []
        for offset in np.eye(3, dtype=int):
            here, there, joined = self._joined(offset)
            both = joined & nodes[here] & nodes[there]
            pairs.append(np.stack([number[here][both], number[there][both]], axis=1))
        return components(nodes.size, np.concatenate(pairs)).reshape(self.shape)

    def grown(self, nodes: np.ndarray) -> np.ndarray:
        """Nodes and those beside them that are joined with them and clear of the walls."""
        out = nodes.copy()
        for offset in NEIGHBORS:
            here, there, joined = self._joined(offset)
            out[there] |= nodes[here] & joined & (self.distance[there] > 0.0)
        return out

    def volume(self, nodes: np.ndarray) -> float:
        """Volume of the space around ``nodes`` up to the walls [m3]: cells that a wall cuts count by the part on this side."""
        beside = np.zeros(self.shape, bool)
        for offset in NEIGHBORS:
            here, there, _ = self._joined(offset)
            beside[there] |= nodes[here]
        beside &= ~nodes
        depth = np.abs(self.distance) / float(np.cbrt(self.cell.prod()))
        cells = float(np.minimum(0.5 + depth[nodes], 1.0).sum() + np.maximum(0.5 - depth[beside], 0.0).sum())
        return float(cells * self.cell.prod())

    def path(self, nodes: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """A shortest path over ``nodes`` from one of ``start`` to one of ``end``, indices (k, 3); empty if there is none."""
        step = np.full(self.shape, -1)
        step[start] = 0
        front, count = start, 0
        while front.any() and not (front & end).any():
            count += 1
            front = self.grown(front) & nodes & (step < 0)
            step[front] = count
        if not (front & end).any():
            return np.zeros((0, 3), int)
        at = np.argwhere(front & end)[0]
        found = [at]
        while step[tuple(at)] > 0:
            beside = at + np.array(NEIGHBORS)
            beside = beside[((beside >= 0) & (beside < self.shape)).all(axis=1)]
            at = beside[step[tuple(beside.T)] == step[tuple(at)] - 1][0]
            found.append(at)
        return np.array(found)
