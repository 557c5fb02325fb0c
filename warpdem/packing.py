"""Filling a box or a mesh with grains: random places, then pushing apart until they hardly overlap.

A way to start, not a settled bed: nothing has weight here. Loose fillings are done in about a hundred steps of the
relaxation; the closer the solid fraction comes to random close packing (about 0.64 for nearly equal grains, more for
wide size distributions), the longer it takes, until it fails and says so.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.geometry import TriangleMesh, clipped_volume, require_closed, signed_distance
from warpdem.kernels import packing as kernels

OVERLAP = 1e-3
"""Largest overlap left between two grains as a share of the smaller radius, and of a grain with the wall [-]."""
DENSEST = 0.74
"""Solid fraction of the densest packing of equal spheres [-]; more is refused at once."""
START_FRACTION = 0.3
"""Solid fraction at which growing starts [-]: random places overlap little there."""
GROWING_STEPS = 30
"""Steps over which the grains grow to their size."""
MARGIN = 1e-3
"""Radii are this much larger while pushing [-]: the true ones then stop overlapping after finitely many steps."""
MOMENTUM = 0.95
"""Share of a grain's last move that it repeats [-] (heavy ball): at solid fraction 0.56 it saves nine steps in ten."""
MOST_STEPS = 3000
PATIENCE = 300
"""Steps without a smaller overlap after which the relaxation gives up asking for full size."""


@dataclass(frozen=True)
class _Space:
    """Where grains may be: an axis-aligned box, within a closed mesh if there is one."""

    low: np.ndarray
    high: np.ndarray
    mesh: TriangleMesh | None
    volume: float

    def clamp(self, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
        """Positions moved into the box shrunk by each grain's radius."""
        return np.clip(position, self.low + radius[:, None], self.high - radius[:, None])


def fill(
    mesh: TriangleMesh | None,
    box,
    diameter,
    seed: int,
    count: int | None = None,
    solid_fraction: float | None = None,
    key: str = "fill",
) -> tuple[np.ndarray, np.ndarray]:
    """Grains at random places inside a closed mesh, a box, or the part of the mesh within the box.

    Sizes are drawn first, from their own stream of random numbers: the same seed gives the same sizes in any space. The
    same arguments give the same bits. Grains overlap by less than `OVERLAP` of the smaller radius and poke out of the
    mesh by less than `OVERLAP` of their radius, of the box not at all.

    Args:
        mesh: Closed mesh to fill, or None.
        box: Least and greatest corner [m], shape (2, 3), or None for the whole mesh.
        diameter: Diameter [m], or a pair (a, b): uniform between a and b by number.
        seed: Seed of the random numbers.
        count: Number of grains; exactly one of `count` and `solid_fraction` is given.
        solid_fraction: Volume of the grains over the volume of the space [-].
        key: Scene key, for messages.

    Returns:
        Positions [m], shape (n, 3), and radii [m], shape (n,), in the order in which sizes were drawn.

    Raises:
        SceneError: No space, a grain too large for it, or a solid fraction that cannot be reached.
    """
    space = _space(mesh, box, key)
    sizes = np.random.default_rng(seed)
    places = sizes.spawn(1)[0]
    radius = _draw_radii(sizes, diameter, count, solid_fraction, space.volume, key)
    fraction = float((radius**3).sum()) * 4.0 / 3.0 * np.pi / space.volume
    if fraction > DENSEST:
        raise SceneError(
            f"{key}: asked for {len(radius)} grains in {space.volume:.6g} m3, a solid fraction of {fraction:.3g}; "
            f"allowed is at most {DENSEST} (the densest packing of equal spheres), within reach about 0.6: ask for "
            "fewer or smaller grains"
        )
    position = _draw_places(places, space, radius, key)
    return _relax(space, position, radius, fraction, key), radius


def worst_overlaps(position: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest overlap of each grain as a share of the smaller radius [-], (n,), and its partner, (n,), -1: none."""
    neighbours = _Neighbours(radius, skin=0.0, width=0)
    neighbours.build(np.asarray(position, float))
    return neighbours.overlap.numpy(), neighbours.partner.numpy()


def _space(mesh: TriangleMesh | None, box, key: str) -> _Space:
    """The space to fill, with its volume."""
    if mesh is not None:
        require_closed(mesh, key)
    bounds = np.asarray(mesh.bounds if box is None else box, float)
    low, high = bounds
    if mesh is not None:
        low, high = np.maximum(low, mesh.bounds[0]), np.minimum(high, mesh.bounds[1])
    if not (low < high).all():
        what = "is empty: min must be below max" if mesh is None else f"does not meet the mesh {mesh.name}"
        raise SceneError(f"{key}: the region {bounds.tolist()} m {what}")
    volume = float(np.prod(high - low)) if mesh is None else clipped_volume(mesh, (low, high))
    if volume <= 0.0:
        raise SceneError(f"{key}: the region {bounds.tolist()} m holds nothing of the inside of {mesh.name}")
    return _Space(low, high, mesh, volume)


def _draw_radii(rng, diameter, count, solid_fraction, volume: float, key: str) -> np.ndarray:
    """Radii [m] for a count, or as many as come closest to a solid fraction."""
    low, high = (diameter, diameter) if np.ndim(diameter) == 0 else diameter
    if not 0.0 < low <= high:
        raise SceneError(f"{key}: diameters from {low:g} to {high:g} m: must be above 0 and ascending")
    if (count is None) == (solid_fraction is None):
        raise SceneError(f"{key}: give exactly one of count and solid_fraction")
    if count is not None:
        return 0.5 * rng.uniform(low, high, int(count))
    # int(d^3, a..b) / (b - a) without the cancellation of (b^4 - a^4) / (b - a)
    mean_volume = np.pi / 6.0 * (low + high) * (low**2 + high**2) / 4.0
    wanted = solid_fraction * volume
    radius = np.empty(0)
    while (filled := np.cumsum(4.0 / 3.0 * np.pi * radius**3)).max(initial=0.0) < wanted:
        batch = int(1.1 * (wanted - filled.max(initial=0.0)) / mean_volume) + 16
        radius = np.concatenate([radius, 0.5 * rng.uniform(low, high, batch)])
    n = int(np.searchsorted(filled, wanted))
    # the grain that crosses the line is taken when it leaves the smaller error
    below = filled[n - 1] if n else 0.0
    n += bool(filled[n] - wanted < wanted - below)
    if n == 0:
        raise SceneError(
            f"{key}: solid_fraction {solid_fraction:g} of {volume:.6g} m3 is less than half a grain of "
            f"{2 * radius[0]:.6g} m"
        )
    return radius[:n]


def _draw_places(rng, space: _Space, radius: np.ndarray, key: str) -> np.ndarray:
    """Random centres [m] at least a radius inside the space, shape (n, 3)."""
    low, high = space.low + radius[:, None], space.high - radius[:, None]
    narrow = (high < low).any(axis=1)
    if narrow.any():
        raise _no_place(space, radius[narrow], key)
    position = np.empty((len(radius), 3))
    left = np.arange(len(radius))
    for _ in range(200):
        position[left] = low[left] + rng.random((len(left), 3)) * (high[left] - low[left])
        if space.mesh is None:
            return position
        left = left[signed_distance(space.mesh, position[left])[0] > -radius[left]]
        if len(left) == 0:
            return position
    raise _no_place(space, radius[left], key)


def _no_place(space: _Space, radius: np.ndarray, key: str) -> SceneError:
    size = " x ".join(f"{v:.6g}" for v in space.high - space.low)
    return SceneError(
        f"{key}: no place found for {len(radius)} grains, the largest {2 * radius.max():.6g} m in diameter, "
        f"in a region of {size} m; ask for smaller grains or a larger region"
    )


def _relax(space: _Space, position: np.ndarray, radius: np.ndarray, fraction: float, key: str) -> np.ndarray:
    """Positions [m] after pushing apart, heavy-ball iterations on growing grains."""
    start = min(1.0, (START_FRACTION / fraction) ** (1.0 / 3.0))
    neighbours = _Neighbours(radius, skin=0.3 * float(radius.mean()))
    wall = _MeshWall(space.mesh, radius)
    last = np.zeros_like(position)
    goal, best, best_step = 1.0, np.inf, 0
    for step in range(MOST_STEPS):
        growth = min(goal, start + (1.0 - start) * step / GROWING_STEPS)
        move, grown_overlap = neighbours.push_apart(position, growth * (1.0 + MARGIN))
        # as a share of the true radii: at least two margins of the overlap vanish with the margins
        overlap = float(grown_overlap.max()) * (1.0 + MARGIN) - 2.0 * MARGIN
        if growth == goal:
            # a tenth is kept back, so that rounding cannot lift a measured overlap above the promise
            if overlap < 0.9 * OVERLAP and wall.poke(position) < 0.9 * OVERLAP:
                break
            if overlap < best:
                best, best_step = overlap, step
            elif step - best_step > PATIENCE:
                # too dense; smaller grains tell the user what is within reach
                goal, best, best_step = 0.99 * goal, np.inf, step
        moved = wall.push_in(space.clamp(position + MOMENTUM * last + move, radius))
        last = moved - position
        wall.note(last)
        position = moved
    else:
        goal *= 1.0 - 0.5 * min(max(best, 0.0), 1.0)
    if goal < 1.0:
        raise SceneError(
            f"{key}: asked for solid fraction {fraction:.3f} ({len(radius)} grains in {space.volume:.6g} m3), reached "
            f"{fraction * goal**3:.3f} without overlap; ask for fewer grains, smaller ones or a larger region"
        )
    return position


class _Neighbours:
    """Neighbour table with a skin, rebuilt when a grain has moved half of it; and the pushes that follow from it."""

    def __init__(self, radius: np.ndarray, skin: float, width: int = 32):
        n = len(radius)
        self._largest, self._skin, self._width = float(radius.max()), skin, width
        self._radius = wp.array(radius, dtype=wp.float64, device="cpu")
        self._count = wp.zeros(n, dtype=wp.int32, device="cpu")
        self._move = wp.zeros(n, dtype=wp.vec3d, device="cpu")
        self.overlap = wp.zeros(n, dtype=wp.float64, device="cpu")
        self.partner = wp.zeros(n, dtype=wp.int32, device="cpu")
        self._built_at = None

    def build(self, position: np.ndarray) -> None:
        """List the neighbours at these positions [m], shape (n, 3)."""
        points = wp.array(position, dtype=wp.vec3d, device="cpu")
        cell = 2.0 * self._largest + self._skin
        # beyond 128 cells a side the grid wraps round, which costs time but loses nothing
        cells = np.clip(np.ptp(position, axis=0) / cell + 1.0, 1, 128).astype(int)
        grid = wp.HashGrid(*cells.tolist(), device="cpu", dtype=wp.float64)
        grid.build(points, cell)
        while True:
            self._table = wp.empty((len(position), max(self._width, 1)), dtype=wp.int32, device="cpu")
            wp.launch(
                kernels.list_neighbours,
                dim=len(position),
                inputs=[grid.id, points, self._radius, self._largest, self._skin],
                outputs=[self._table, self._count, self.overlap, self.partner],
                device="cpu",
            )
            most = int(self._count.numpy().max())
            if self._width == 0 or most <= self._width:
                break
            self._width = most + 8
        self._built_at = position.copy()

    def push_apart(self, position: np.ndarray, growth: float) -> tuple[np.ndarray, np.ndarray]:
        """Moves [m], (n, 3), of grains with radii times `growth`, and their largest overlaps [-], (n,)."""
        if self._built_at is None or ((position - self._built_at) ** 2).sum(axis=1).max() > (0.5 * self._skin) ** 2:
            self.build(position)
        wp.launch(
            kernels.push_apart,
            dim=len(position),
            inputs=[
                wp.array(position, dtype=wp.vec3d, device="cpu"),
                self._radius,
                growth,
                1.0,
                self._table,
                self._count,
            ],
            outputs=[self._move, self.overlap],
            device="cpu",
        )
        return self._move.numpy(), self.overlap.numpy()


class _MeshWall:
    """The mesh as a wall of the relaxation; only grains that may have come near it are measured again."""

    def __init__(self, mesh: TriangleMesh | None, radius: np.ndarray):
        self._mesh, self._radius = mesh, radius
        self._slack = np.zeros(len(radius))
        """Lower bound of each grain's gap to the wall [m]."""

    def note(self, move: np.ndarray) -> None:
        """Take note that the grains have moved [m], (n, 3)."""
        self._slack -= np.linalg.norm(move, axis=1)

    def _measure(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Grains that may touch the wall, and the gradient of the distance at each, (k, 3)."""
        near = np.flatnonzero(self._slack <= 0.0)
        distance, gradient = signed_distance(self._mesh, position[near])
        self._slack[near] = -distance - self._radius[near]
        return near, gradient

    def push_in(self, position: np.ndarray) -> np.ndarray:
        """Positions with each grain moved inwards until it touches its nearest face from inside."""
        if self._mesh is None:
            return position
        near, gradient = self._measure(position)
        out = np.minimum(self._slack[near], 0.0)
        position[near] += out[:, None] * gradient
        return position

    def poke(self, position: np.ndarray) -> float:
        """How far the worst grain pokes out of the mesh as a share of its radius [-]."""
        if self._mesh is None:
            return 0.0
        near, _ = self._measure(position)
        return float((-self._slack[near] / self._radius[near]).max(initial=0.0))
