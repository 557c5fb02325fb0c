"""The space between walls that a filling may use where no closed mesh bounds it: a hopper, a cup, one side of a sheet.

A grid is laid over the space below the level. Nodes at which the smallest grain fits are joined with those beside them
where no surface can lie between: where their distances from the walls add up to more than the distance between them. What is
joined is one space. From a space that reaches an open side of the grid the grains would run out.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.placed_walls import PlacedWall
from warpdem.filling.space_grid import FEWEST_NODES, MOST_NODES, SpaceGrid

POCKET = 0.1
"""Share of the largest space below which another one is a pocket that is left empty [-]."""
BISECTIONS = 12
"""Steps to find how wide an opening is."""


@dataclass(frozen=True, eq=False)
class OpenSpace:
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
        return np.asarray(np.einsum("ij,ni->nj", self.axes, local))

    def _at(self, nodes: np.ndarray, position: np.ndarray) -> np.ndarray:
        local = np.einsum("ij,nj->ni", self.axes, position)
        index = np.clip(((local - self.low) / self.cell).astype(np.int64), 0, np.array(nodes.shape) - 1)
        return np.asarray(nodes[tuple(index.T)])


def find_open_space(
    walls: Sequence[PlacedWall],
    box: np.ndarray,
    axes: np.ndarray,
    leaks: np.ndarray,
    radius: float,
    key: str,
    point: np.ndarray | None = None,
    most_nodes: int = MOST_NODES,
) -> OpenSpace | None:
    """The spaces within a box that grains do not run out of, or the one that holds a point.

    Args:
        walls: Walls between which they are.
        box: Least and greatest corner of the box along ``axes`` [m], shape (2, 3).
        axes: Axes of the box in frame axes [-], shape (3, 3), one a row.
        leaks: Which of its lower and upper sides grains would run out of, bool, shape (2, 3); the others hold them.
        radius: Radius of the smallest grain [m].
        key: Scene key, for messages.
        point: A point of the space in frame axes [m], shape (3,), or None for all spaces but pockets.
        most_nodes: Nodes of the grid.

    Returns:
        The spaces joined; None if grains run out of all of them, and no point is given.

    Raises:
        SceneError: No grain fits at the point, or from there the grains would run out; names where.
    """
    grid = SpaceGrid(walls, box, axes, leaks, radius, most_nodes)
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
            raise SceneError(f"{key}: at point = [{_coordinates(point)}] m no grain of {2.0 * radius:.4g} m in diameter fits")
        chosen = np.array([label[seed]])
        if np.isin(chosen, outside).any():
            raise SceneError(_leak_text(grid, seed, radius, key))
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
    positions = grid.low + (nodes + 0.5) * grid.cell
    bounds = np.array([np.maximum((positions - gap).min(axis=0), box[0]), np.minimum((positions + gap).max(axis=0), box[1])])
    return OpenSpace(low, cell, axes, fits, within, bounds, grid.volume(within))


def leak_message(
    walls: Sequence[PlacedWall], box: np.ndarray, axes: np.ndarray, leaks: np.ndarray, radius: float, key: str
) -> str:
    """Why ``find_open_space`` finds no space, seen from the node with walls on most sides; arguments as there."""
    grid = SpaceGrid(walls, box, axes, leaks, radius, FEWEST_NODES)
    solid = grid.distance < max(radius, 0.5 * float(grid.cell.max()))
    around = np.zeros(grid.shape, int)
    for k in range(3):
        around += np.logical_or.accumulate(solid, axis=k)
        around += np.flip(np.logical_or.accumulate(np.flip(solid, k), axis=k), k)
    around[solid | grid.outside] = -1
    if around.max() < 0:
        return f"{key}: no grain of {2.0 * radius:.4g} m in diameter fits between the walls"
    best = np.where(around == around.max(), grid.distance, -np.inf)
    seed = tuple(int(i) for i in np.unravel_index(int(np.argmax(best)), grid.shape))
    return _leak_text(grid, seed, radius, key)


def _leak_text(grid: SpaceGrid, seed: tuple[int, ...], radius: float, key: str) -> str:
    """Where grains at a node would run out, and how wide the opening is: the narrowest point of the widest path out."""

    def reachable(least: float) -> tuple[np.ndarray, np.ndarray]:
        nodes = grid.distance >= least
        label = grid.labels(nodes)
        return nodes & (label == label[seed]), nodes & np.isin(label, np.unique(label[nodes & grid.outside]))

    low, high = radius, float(grid.distance[seed]) * (1.0 + 1e-9)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        open_space, out = reachable(middle)
        low, high = (middle, high) if (open_space & out).any() else (low, middle)
    start, end = reachable(high)[0], reachable(high)[1] | grid.outside
    if not start.any():
        start[seed] = True
    path = grid.path(grid.distance >= low, start, end)
    where = ""
    if len(path):
        narrowest = path[np.argmin(grid.distance[tuple(path.T)])]
        if (narrowest == seed).all():  # from there on it gets wider and wider
            exit_ = grid.path(grid.distance >= low, start, grid.outside)[:1]
            where = f" at about ({_coordinates(grid.position(exit_)[0])}) m, where there is no wall"
        else:
            where_open = _coordinates(grid.position(narrowest[None])[0])
            where = f" at about ({where_open}) m, where the walls leave an opening some {2.0 * low:.3g} m wide"
    return (
        f"{key}: the filling would run out{where}: close it with a wall (a gate), limit the filling by a region, whose sides "
        "hold the grains at the start, or by a height below which the walls hold them"
    )


def _coordinates(point: np.ndarray) -> str:
    return ", ".join(f"{x:.4g}" for x in point)
