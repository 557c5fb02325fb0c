"""The space between walls that a filling may use where no closed mesh bounds it: a hopper, a cup, one side of a sheet.

A grid is laid over the space below the level. Its nodes at which the smallest grain fits are joined with those beside them
where no surface can lie between: where their distances from the walls add up to more than the way between them. What is
joined is one pool. A pool that reaches a side of the grid which nothing closes would run out.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpdem.core.progress import report_state
from warpdem.errors import SceneError
from warpdem.filling.barriers import Barrier
from warpdem.mesh.grouping import components

FEWEST_NODES, MOST_NODES = 200_000, 3_000_000
"""Nodes of a grid: more than are needed to measure its volume, no more than a few seconds allow."""
CELL = 1.0
"""Width of a cell in radii of the smallest grain [-], if that is neither too few nor too many nodes."""
POCKET = 0.1
"""Share of the largest pool below which another one is a pocket that is left empty [-]."""
SURE = 1.001
"""Sum of the distances of two nodes from the walls over the way between them from which no wall is between [-]: rounding."""
CHUNK = 200_000
"""Nodes whose distance is found at once."""
BISECTIONS = 12
"""Steps to find how wide an opening is."""

NEXT = [np.array(way) for way in itertools.product((-1, 0, 1), repeat=3) if any(way)]
"""Ways to the 26 nodes around a node."""


@dataclass(frozen=True, eq=False)
class Pool:
    """One or more parts of the space between walls, as nodes in the middles of the cells of a grid."""

    low: np.ndarray
    """Lowest corner of the grid along its axes [m], shape (3,)."""
    cell: np.ndarray
    """Widths of a cell [m], shape (3,)."""
    axes: np.ndarray
    """Axes of the grid in frame axes [-], shape (3, 3), one a row."""
    fits: np.ndarray
    """Nodes at which the smallest grain fits, bool, shape (a, b, c)."""
    within: np.ndarray
    """Nodes that are within, up to the walls, bool, shape (a, b, c)."""
    bounds: np.ndarray
    """Least and greatest corner along its axes [m], shape (2, 3)."""
    volume: float
    """Volume [m3]."""

    def holds(self, position: np.ndarray) -> np.ndarray:
        """Whether the node nearest to each point (n, 3) [m] is one at which a grain fits, bool, shape (n,)."""
        return self._at(self.fits, position)

    def is_near(self, position: np.ndarray) -> np.ndarray:
        """Whether the node nearest to each point (n, 3) [m] is within, bool, shape (n,)."""
        return self._at(self.within, position)

    def random_points(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """Random points [m] in cells in which the smallest grain fits, shape (count, 3)."""
        cells = np.argwhere(self.fits)
        chosen = cells[generator.integers(len(cells), size=count)]
        local = self.low + (chosen + generator.random((count, 3))) * self.cell
        return np.einsum("ij,ni->nj", self.axes, local)

    def _at(self, nodes: np.ndarray, position: np.ndarray) -> np.ndarray:
        local = np.einsum("ij,nj->ni", self.axes, position)
        index = np.clip(((local - self.low) / self.cell).astype(np.int64), 0, np.array(nodes.shape) - 1)
        return nodes[tuple(index.T)]


def find_pool(
    walls: Sequence[Barrier],
    box: np.ndarray,
    axes: np.ndarray,
    leaks: np.ndarray,
    radius: float,
    key: str,
    point: np.ndarray | None = None,
    most_nodes: int = MOST_NODES,
) -> Pool | None:
    """The pools within a box that do not run out of it, or the one that holds a point.

    Args:
        walls: Walls between which they are.
        box: Least and greatest corner of the box along ``axes`` [m], shape (2, 3).
        axes: Axes of the box in frame axes [-], shape (3, 3), one a row.
        leaks: Which of its lower and upper sides grains would run out of, bool, shape (2, 3); the others hold them.
        radius: Radius of the smallest grain [m].
        key: Scene key, for messages.
        point: A point of the pool in frame axes [m], shape (3,), or None for all pools but pockets.
        most_nodes: Nodes of the grid.

    Returns:
        The pools; None if there is none that does not run out, and no point is given.

    Raises:
        SceneError: No grain fits at the point, or from there the grains would run out; names where.
    """
    grid = _Grid(walls, box, axes, leaks, radius, most_nodes)
    low, cell, local = grid.low, grid.cell, grid.local
    fits = grid.distance >= radius
    for k, (side, sign) in itertools.product(range(3), enumerate((1.0, -1.0))):
        if not leaks[side, k]:  # grains lie within it, whole
            beside = sign * (local[k] - box[side, k]) < radius * (1.0 - 1e-9)
            fits &= ~beside.reshape([-1 if axis == k else 1 for axis in range(3)])
    label = grid.labels(fits)
    outside = np.unique(label[fits & grid.outside])
    if point is not None:
        seed = grid.node_at(point, fits, 2.0 * float(np.linalg.norm(cell)))
        if seed is None:
            raise SceneError(f"{key}: at point = [{_words(point)}] m no grain of {2.0 * radius:.4g} m in diameter fits")
        chosen = np.array([label[seed]])
        if np.isin(chosen, outside).any():
            raise SceneError(_runs_out(grid, seed, radius, key))
    else:
        kinds, count = np.unique(label[fits], return_counts=True)
        sealed = ~np.isin(kinds, outside)
        if not sealed.any():
            return None
        chosen = kinds[sealed & (count >= POCKET * count[sealed].max())]
    fits &= np.isin(label, chosen)
    within = fits.copy()
    for _ in range(int(np.ceil(radius / cell.min())) + 1):
        within = grid.grown(within)
    nodes, gap = np.argwhere(within), np.maximum(grid.distance[within], 0.0)[:, None]
    places = grid.low + (nodes + 0.5) * grid.cell
    bounds = np.array([np.maximum((places - gap).min(axis=0), box[0]), np.minimum((places + gap).max(axis=0), box[1])])
    return Pool(low, cell, axes, fits, within, bounds, grid.volume(within))


def where_it_runs_out(
    walls: Sequence[Barrier], box: np.ndarray, axes: np.ndarray, leaks: np.ndarray, radius: float, key: str
) -> str:
    """Why ``find_pool`` finds nothing, from the place that has walls on most sides of it, in words; arguments as there."""
    grid = _Grid(walls, box, axes, leaks, radius, FEWEST_NODES)
    solid = grid.distance < max(radius, 0.5 * float(grid.cell.max()))
    around = np.zeros(grid.shape, int)
    for k in range(3):
        around += np.logical_or.accumulate(solid, axis=k)
        around += np.flip(np.logical_or.accumulate(np.flip(solid, k), axis=k), k)
    around[solid | grid.outside] = -1
    if around.max() < 0:
        return f"{key}: no grain of {2.0 * radius:.4g} m in diameter fits between the walls"
    best = np.where(around == around.max(), grid.distance, -np.inf)
    return _runs_out(grid, np.unravel_index(int(np.argmax(best)), grid.shape), radius, key)


class _Grid:
    """Nodes with their distances from the walls, and which of them can be joined; arguments as of ``find_pool``.

    Attributes:
        low: lowest corner [m], shape (3,).
        cell: widths of a cell [m], shape (3,).
        local: coordinates of the nodes along each axis [m].
        distance: of each node from the walls [m], negative where no grain may be.
        outside: nodes of the last layer at a side that leaks.
    """

    def __init__(self, walls, box: np.ndarray, axes: np.ndarray, leaks: np.ndarray, radius: float, most: int) -> None:
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

    def _distances(self, walls: Sequence[Barrier]) -> np.ndarray:
        total = int(np.prod(self.shape))
        found = np.full(total, np.inf)
        for first in range(0, total, CHUNK):
            index = np.stack(np.unravel_index(np.arange(first, min(first + CHUNK, total)), self.shape), axis=1)
            part = found[first : first + CHUNK]
            for wall in walls:
                np.minimum(part, wall.distance(self.place(index))[0], out=part)
            report_state(f"looking for the space between walls: {first / total:.0%}")
        return found.reshape(self.shape)

    def place(self, index: np.ndarray) -> np.ndarray:
        """Where nodes (k, 3) are in frame axes [m], shape (k, 3)."""
        return np.stack([axis[i] for axis, i in zip(self.local, index.T, strict=True)], axis=1) @ self.axes

    def node_at(self, point: np.ndarray, nodes: np.ndarray, reach: float) -> tuple | None:
        """Index of the one of ``nodes`` that is nearest to a point [m], or None if none is within ``reach`` [m]."""
        index = np.argwhere(nodes)
        apart = np.linalg.norm(self.place(index) - np.asarray(point, float), axis=1)
        best = int(np.argmin(apart)) if len(index) else 0
        return tuple(index[best]) if len(index) and apart[best] <= reach else None

    def _joined(self, way: np.ndarray) -> tuple[tuple[slice, ...], tuple[slice, ...], np.ndarray]:
        """Slices of all nodes that have one in this way, of these, and whether no surface can lie between."""
        here = tuple(slice(max(-w, 0), n - max(w, 0)) for w, n in zip(way, self.shape, strict=True))
        there = tuple(slice(max(w, 0), n - max(-w, 0)) for w, n in zip(way, self.shape, strict=True))
        length = float(np.linalg.norm(way * self.cell))
        return here, there, self.distance[here] + self.distance[there] > SURE * length

    def labels(self, nodes: np.ndarray) -> np.ndarray:
        """Number of the pool of each node, shape of the grid; what is not among ``nodes`` has one of its own."""
        number = np.arange(nodes.size).reshape(self.shape)
        pairs = []
        for way in np.eye(3, dtype=int):
            here, there, joined = self._joined(way)
            both = joined & nodes[here] & nodes[there]
            pairs.append(np.stack([number[here][both], number[there][both]], axis=1))
        return components(nodes.size, np.concatenate(pairs)).reshape(self.shape)

    def grown(self, nodes: np.ndarray) -> np.ndarray:
        """Nodes and those beside them that are joined with them and clear of the walls."""
        out = nodes.copy()
        for way in NEXT:
            here, there, joined = self._joined(way)
            out[there] |= nodes[here] & joined & (self.distance[there] > 0.0)
        return out

    def volume(self, nodes: np.ndarray) -> float:
        """Volume of the space around ``nodes`` up to the walls [m3]: cells that a wall cuts count by the part on this side."""
        beside = np.zeros(self.shape, bool)
        for way in NEXT:
            here, there, _ = self._joined(way)
            beside[there] |= nodes[here]
        beside &= ~nodes
        share = np.abs(self.distance) / float(np.cbrt(self.cell.prod()))
        return float(np.minimum(0.5 + share[nodes], 1.0).sum() + np.maximum(0.5 - share[beside], 0.0).sum()) * self.cell.prod()

    def way(self, nodes: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """A shortest way over ``nodes`` from one of ``start`` to one of ``end``, indices (k, 3); empty if there is none."""
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
            beside = at + np.array(NEXT)
            beside = beside[((beside >= 0) & (beside < self.shape)).all(axis=1)]
            at = beside[step[tuple(beside.T)] == step[tuple(at)] - 1][0]
            found.append(at)
        return np.array(found)


def _runs_out(grid: _Grid, seed: tuple, radius: float, key: str) -> str:
    """Where grains at a node would run out, and how wide it is there: the narrowest place of the widest way out."""

    def leaks(least: float) -> tuple[np.ndarray, np.ndarray]:
        nodes = grid.distance >= least
        label = grid.labels(nodes)
        return nodes & (label == label[seed]), nodes & np.isin(label, np.unique(label[nodes & grid.outside]))

    low, high = radius, float(grid.distance[seed]) * (1.0 + 1e-9)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        pool, out = leaks(middle)
        low, high = (middle, high) if (pool & out).any() else (low, middle)
    start, end = leaks(high)[0], leaks(high)[1] | grid.outside
    if not start.any():
        start[seed] = True
    way = grid.way(grid.distance >= low, start, end)
    where = ""
    if len(way):
        narrowest = way[np.argmin(grid.distance[tuple(way.T)])]
        if (narrowest == seed).all():  # from there on it gets wider and wider
            exit_ = grid.way(grid.distance >= low, start, grid.outside)[:1]
            where = f" at about ({_words(grid.place(exit_)[0])}) m, where there is no wall"
        else:
            place = _words(grid.place(narrowest[None])[0])
            where = f" at about ({place}) m, where the walls leave an opening some {2.0 * low:.3g} m wide"
    return (
        f"{key}: the filling would run out{where}: close it with a wall (a gate), limit the filling by a region, whose sides "
        "hold the grains at the start, or by a height below which the walls hold them"
    )


def _words(point: np.ndarray) -> str:
    return ", ".join(f"{x:.4g}" for x in point)


