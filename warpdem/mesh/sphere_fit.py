"""Spheres that fill a closed mesh: a greedy fit.

Centres are points of a grid within the mesh. The radius of a sphere is the exact distance of its centre from the surface, plus
how far spheres may stick out; each sphere is the one that covers most of what no sphere before it covers. What a sphere adds
only falls while others are chosen, so a sphere is looked at again only while what it added before is the most (lazy greedy:
Minoux 1978).
"""

import heapq
from dataclasses import dataclass

import numpy as np

from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance

POINTS = 30_000
"""Points of the grid within the mesh, about."""
LAYERS = 2.0
"""Radius of the largest sphere within the mesh over the spacing of the grid, at least [-]: thin plates take a finer grid."""
MOST_POINTS = 300_000
"""Points of a grid at most, those outside the mesh included."""
SURFACE_POINTS = 20_000
"""Points on the surface at which the deviation is measured, about."""
ENOUGH = 1e-9
"""Coverage that counts as all [-]."""


@dataclass(frozen=True)
class SphereFit:
    """Spheres that fill a mesh, and how well."""

    centre: np.ndarray
    """Centres [m], shape (n, 3)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    coverage: float
    """Volume of the mesh that lies in spheres over its volume [-], on the grid of the fit."""
    mean_deviation: float
    """Mean distance of the surface of the mesh from the surface of the spheres [m], over its area."""
    deviation: float
    """Greatest such distance [m]."""


def fit_spheres(mesh: TriangleMesh, count: int, coverage: float = 1.0, outside: float = 0.0) -> SphereFit:
    """Spheres that fill a closed mesh.

    Args:
        mesh: The mesh.
        count: Spheres at most.
        coverage: Part of the volume of the mesh at which fewer are enough [-].
        outside: How far a sphere may stick out [m].
    """
    grid = _grid(mesh)
    radius = grid.depth + outside
    bare = np.ones(len(radius), dtype=bool)
    # every other point along each axis; a sphere that is chosen then climbs to a neighbouring point that adds more
    coarse = np.flatnonzero((grid.index % 2 == 0).all(axis=1))
    most = (4.0 / 3.0 * np.pi * (radius[coarse] / grid.spacing.min() + np.sqrt(3.0)) ** 3).astype(int)
    # at equal gains the deeper one, then the first: no order of the heap decides
    queue = [(-gain, -grid.depth[k], k) for gain, k in zip(most.tolist(), coarse.tolist(), strict=True)]
    heapq.heapify(queue)
    chosen: list[int] = []
    while queue and len(chosen) < count and bare.mean() > 1.0 - coverage + ENOUGH:
        _, deep, k = heapq.heappop(queue)
        now = -int(bare[grid.within(k, radius[k])].sum())
        if queue and now > queue[0][0]:
            heapq.heappush(queue, (now, deep, k))
        elif now == 0:
            break
        else:
            chosen.append(_climbed(grid, radius, bare, k))
            bare[grid.within(chosen[-1], radius[chosen[-1]])] = False
    points = grid.points
    centre, size = points[chosen], radius[chosen]
    apart = _surface_deviation(mesh, centre, size)
    return SphereFit(centre, size, 1.0 - float(bare.mean()), float(apart.mean()), float(apart.max()))


@dataclass(frozen=True)
class _Grid:
    """Points of a grid within a mesh."""

    points: np.ndarray
    """Points [m], shape (n, 3)."""
    depth: np.ndarray
    """Depths below the surface [m], shape (n,)."""
    spacing: np.ndarray
    """Spacing along each axis [m], shape (3,)."""
    index: np.ndarray
    """Number of each point along each axis, shape (n, 3)."""
    number: np.ndarray
    """Number of the point at each place of the grid, -1 outside the mesh."""

    def within(self, k: int, radius: float) -> np.ndarray:
        """Numbers of the points within a sphere about point k."""
        cut = (radius / self.spacing).astype(int) + 1
        low, high = np.maximum(self.index[k] - cut, 0), self.index[k] + cut + 1
        near = self.number[low[0] : high[0], low[1] : high[1], low[2] : high[2]].ravel()
        near = near[near >= 0]
        return np.asarray(near[np.square(self.points[near] - self.points[k]).sum(axis=1) < radius**2])

    def neighbours(self, k: int) -> np.ndarray:
        """Numbers of the points beside point k."""
        low, high = np.maximum(self.index[k] - 1, 0), self.index[k] + 2
        near = self.number[low[0] : high[0], low[1] : high[1], low[2] : high[2]].ravel()
        return np.asarray(near[(near >= 0) & (near != k)])


def _climbed(grid: _Grid, radius: np.ndarray, bare: np.ndarray, k: int) -> int:
    """The point that is reached from point k by going to the neighbour whose sphere adds most, while one adds more."""
    best = bare[grid.within(k, radius[k])].sum()
    while True:
        near = grid.neighbours(k)
        gains = [bare[grid.within(n, radius[n])].sum() for n in near]
        if not len(gains) or max(gains) <= best:
            return k
        k, best = int(near[int(np.argmax(gains))]), max(gains)


def _grid(mesh: TriangleMesh) -> _Grid:
    """A grid that fills the box of a mesh, fine enough for its volume and its thickness."""
    low, high = mesh.bounds
    size = high - low
    wanted, least = ((volume / number) ** (1.0 / 3.0) for volume, number in
                     ((abs(mesh.volume), POINTS), (float(np.prod(size)), MOST_POINTS)))  # fmt: skip
    while True:
        counts = np.ceil(size / max(wanted, least)).astype(int)
        spacing = size / counts
        axes = [begin + step * (np.arange(n) + 0.5) for begin, step, n in zip(low, spacing, counts, strict=True)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        depth = -signed_distance(mesh, points)[0]
        inside, deepest = depth > 0.0, float(depth.max())
        if wanted <= least or deepest >= LAYERS * wanted:
            number = np.full(len(points), -1)
            number[inside] = np.arange(inside.sum())
            index = np.stack(np.unravel_index(np.flatnonzero(inside), counts), axis=1)
            return _Grid(points[inside], depth[inside], spacing, index, number.reshape(counts))
        wanted = 0.5 * wanted if deepest <= 0.0 else max(0.5 * wanted, deepest / LAYERS)


def _surface_deviation(mesh: TriangleMesh, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Distance of points spread evenly over the surface of a mesh from the surface of spheres [m], shape (n,)."""
    a, b, c = mesh.corners.transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # as many as its part of the area in each triangle, at the points of a sequence of low discrepancy (Roberts 2018)
    fraction = np.cumsum(area) / area.sum()
    place = (np.arange(SURFACE_POINTS) + 0.5) / SURFACE_POINTS
    of = np.minimum(np.searchsorted(fraction, place), len(area) - 1)
    u, v = (np.mod(np.arange(SURFACE_POINTS) * step, 1.0) for step in (0.7548776662466927, 0.5698402909980532))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    points = a[of] + u[:, None] * (b - a)[of] + v[:, None] * (c - a)[of]
    nearest = np.full(len(points), np.inf)
    for middle, size in zip(centre, radius, strict=True):
        nearest = np.minimum(nearest, np.linalg.norm(points - middle, axis=1) - size)
    return np.asarray(np.abs(nearest))
