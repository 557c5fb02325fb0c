"""Walls of a packing: which grains reach into them, and the moves that bring these back."""

from collections.abc import Callable, Sequence

import numpy as np

from warpdem.filling.fill_request import Filling
from warpdem.filling.placed_walls import TOUCH
from warpdem.mesh.triangle_mesh import signed_distance

MARGIN = 1e-3
"""Radii are this much larger while pushing [-]: the true ones then part after finitely many steps."""


class PackingWall:
    """A wall of the packing; only grains that may have come near it are measured again.

    Args:
        name: Name of the wall or mesh, for messages.
        distance: Distance of points (n, 3) [m] from it [m], (n,), negative where no grain may be, and its gradient, (n, 3).
        radius: Radii of the grains [m], shape (n,).
        touch: Overlap that is left alone, in radii [-]: a box that ends at a wall holds its grains itself.
    """

    def __init__(
        self, name: str, distance: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], radius: np.ndarray, touch: float
    ) -> None:
        self.name, self.radius, self._distance, self._touch = name, radius, distance, touch
        self.slack = np.zeros(len(radius))
        """Lower bound of each grain's gap to the wall [m]."""

    def note(self, move: np.ndarray) -> None:
        """Take note that the grains have moved [m], (n, 3)."""
        self.slack -= np.sqrt(np.einsum("ij,ij->i", move, move))

    def _measure(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Grains that may touch the wall, and the gradient of the distance at each, (k, 3)."""
        near = np.flatnonzero(self.slack <= MARGIN * self.radius)
        distance, gradient = self._distance(position[near])
        self.slack[near] = distance - self.radius[near]
        return near, gradient

    def push_in(self, position: np.ndarray) -> None:
        """Move each grain off the wall, in place, until it is a margin away from its nearest face."""
        near, gradient = self._measure(position)
        radius = self.radius[near]
        away = np.maximum(MARGIN * radius - self.slack[near], 0.0)
        if self._touch:
            away[self.slack[near] >= -self._touch * radius] = 0.0
        position[near] += away[:, None] * gradient

    def reached(self, position: np.ndarray) -> float:
        """How far a grain reaches into the wall, in its own radii [-]; 0 if none does."""
        near, _ = self._measure(position)
        into = -self.slack[near] / self.radius[near]
        return float(into[into > self._touch].max(initial=0.0))

    def worst(self, position: np.ndarray) -> int:
        """Number of the grain that reaches deepest into the wall."""
        self._measure(position)
        return int(np.argmin(self.slack / self.radius))


def walls_of(asked: Filling, radius: np.ndarray) -> list[PackingWall]:
    """Walls of a filling for its grains (n,) [m]: the mesh that it fills, and those that may come near."""
    mesh = asked.region.mesh
    walls = [PackingWall(wall.name, wall.distance, radius, TOUCH) for wall in asked.walls]
    if mesh is None:
        return walls

    def depth(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance, gradient = signed_distance(mesh, position)
        return -distance, -gradient

    return [PackingWall(mesh.name, depth, radius, 0.0), *walls]


def keep_this_side(move: np.ndarray, walls: Sequence[PackingWall]) -> None:
    """Shorten moves (n, 3) [m], in place, so that no centre crosses a wall: it is at least ``slack`` and a radius away."""
    if not walls:
        return
    free = np.min([wall.slack + wall.radius for wall in walls], axis=0)
    length = np.sqrt(np.einsum("ij,ij->i", move, move))
    longest = np.maximum(0.9 * free, 0.0)
    far = length > longest
    move[far] *= (longest[far] / length[far])[:, None]
