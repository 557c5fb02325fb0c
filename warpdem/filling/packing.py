"""Filling regions with grains: random places, pushing apart while the grains grow, shaking where that is not enough.

A way to start, not a settled bed: nothing has weight here. What comes out has no overlap beyond `OVERLAP` between grains,
and none with the walls. How it is done:

* Random places; the grains start small and grow to their size within a few steps, while each step parts those that
  overlap (``kernels/packing.py``) and moves those that poke out back in. Each grain goes on as it moved before (heavy
  ball), which saves nine steps in ten in a dense packing. This reaches a solid fraction of 0.59 in a region of a dozen
  diameters, 0.61 where walls matter less.
* What stays jammed is shaken: the grains shrink to a fluid and grow again slowly, while their motion is kept at one
  mean speed instead of dying out, so that they find their way past each other (as in the event-driven growth of
  B. D. Lubachevsky, F. H. Stillinger, J. Stat. Phys. 60 (1990) 561, with soft pushes in place of collisions). Longer
  shaking reaches further; it ends when it no longer helps.

Fillings whose regions meet are packed together: none overlaps another, in whatever order they stand.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpdem.core import memory
from warpdem.core.progress import report_state
from warpdem.core.threads import Threads, available_threads
from warpdem.errors import SceneError
from warpdem.filling.barriers import TOUCH, Barrier
from warpdem.filling.region import Region, region
from warpdem.filling.size_grids import RowRoom, finest_cell, grids_for, size_classes
from warpdem.kernels import packing as kernels
from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance
from warpdem.scene.size_distribution import DiameterDistribution, SizeLaw, size_law

OVERLAP = 1e-6
"""Largest overlap left between two grains as a share of the smaller radius [-]: more than rounding leaves in a row of grains
that fits exactly between two walls."""
DENSEST = 0.74
"""Solid fraction of the densest packing of equal spheres [-]; more is refused at once."""
HEIGHT_FRACTION = 0.55
"""Solid fraction of a filling of which only the height is told [-]: a poured bed, walls included, hardly settles."""
START_FRACTION = 0.3
"""Solid fraction at which growing starts [-]: random places overlap little there."""
GROWING_STEPS = 30
"""Steps over which the grains grow to their size without shaking."""
FLUID_FRACTION = 0.5
"""Solid fraction to which the grains shrink when shaking starts [-]: just a fluid still."""
PACKING_BYTES = 350
"""Memory that packing takes at least per grain [B]; measured with 373 000 loose grains: 359, and 408 for moments."""
SHAKES = (300, 1000, 3000)
"""Steps over which the grains grow again while they are shaken, one attempt after the other."""
SHAKING = 0.03
"""Root mean square of a grain's move in one step of shaking, in its own radii [-]."""
SHAKING_HELPS = 0.8
"""Shaking goes on as long as an attempt leaves less than this share of the overlap of the one before [-]."""
MARGIN = 1e-3
"""Radii are this much larger while pushing [-]: the true ones then part after finitely many steps."""
MOMENTUM = 0.95
"""Share of a grain's last move that it repeats [-] (heavy ball)."""
SKIN = 0.6
"""Reach of the neighbour table beyond touching, in mean radii [-]."""
TRIES = 1_000_000
"""Random places in a row that are all outside the mesh, after which no grain is said to fit (20 to 5000 for each)."""
MOST_TRIES = 300_000_000
"""Random places for all grains together, after which the rest is said to find none [-]."""
PATIENCE = 300
"""Steps within which the largest overlap must shrink by `PROGRESS`, or growing to the full size is given up."""
PROGRESS = 1e-3
"""Share by which an overlap counts as smaller [-]."""
MOST_STEPS = 5000
"""Steps of one attempt."""
SMALLER_BY = 0.005, 1.5
"""Share by which grains that do not fit are made smaller, to find out what would fit, and its growth from one attempt to the
next [-]."""
LEAST_SMALLER = 0.003
"""Least share by which they are [-]."""
IN_WALL = 0.1
"""How far a grain that has no room reaches into a wall, though each step ends with moving it off, in its own radii [-]."""
SMALLER_ATTEMPTS = 10
"""Attempts with smaller grains."""
SMALLER_WORK = 2_000_000
"""Grains times steps of one of these attempts."""
SMALLER_STEPS = 100, 1000
"""Least and most steps of one of these attempts."""


@dataclass(frozen=True, eq=False)
class Filling:
    """Grains that are to be placed in a region."""

    region: Region
    radius: np.ndarray
    """Radii [m], shape (n,), in the order in which they were drawn."""
    places: np.random.Generator
    """Random numbers of the places; sizes come from a stream of their own."""
    key: str
    """Scene key, for messages."""
    walls: tuple[Barrier, ...] = ()
    """Walls that may come near them, beside the mesh of the region."""

    @property
    def solid_fraction(self) -> float:
        """Volume of the grains over volume of the region [-]."""
        return float((self.radius**3).sum()) * 4.0 / 3.0 * np.pi / self.region.volume


@dataclass(frozen=True)
class Packing:
    """What packing fillings together took."""

    keys: tuple[str, ...]
    """Scene keys of the fillings."""
    grains: int
    """Number of grains placed."""
    steps: int
    """Steps of pushing and shaking."""
    rebuilds: int
    """Neighbour searches."""
    shakes: int
    """Attempts of shaking; 0 when pushing apart was enough."""
    seconds: float
    """Time it took [s]."""


def filling(
    space: Region,
    sizes: SizeLaw,
    seed: int,
    count: int | None = None,
    solid_fraction: float | None = None,
    volume: float | None = None,
    key: str = "fill",
    walls: Sequence[Barrier] = (),
) -> Filling:
    """Draw the sizes of the grains of a filling.

    Sizes have their own stream of random numbers: the same seed gives the same sizes in any region.

    Args:
        space: Where the grains go.
        sizes: Size law.
        seed: Seed of the random numbers.
        count: Number of grains; exactly one of ``count``, ``solid_fraction`` and ``volume`` is given.
        solid_fraction: Volume of the grains over volume of the region [-].
        volume: Volume of the grains [m3].
        key: Scene key, for messages.
        walls: Walls to keep clear of, beside the mesh of the region.

    Raises:
        SceneError: Less than half a grain, or a solid fraction above that of the densest packing.
    """
    if sum(amount is not None for amount in (count, solid_fraction, volume)) != 1:
        raise SceneError(f"{key}: give exactly one of count, solid_fraction and volume")
    generator = np.random.default_rng(seed)
    places = generator.spawn(1)[0]
    number = count if count is not None else (volume or solid_fraction * space.volume) / sizes.mean_volume
    if reason := memory.refusal(number * PACKING_BYTES, f"packing {number:.6g} grains", "ask for fewer or larger grains"):
        _refuse_too_dense(number, number * sizes.mean_volume / space.volume, space, key)
        raise SceneError(f"{key}: {reason}")
    if count is not None:
        diameter = sizes.draw(generator, int(count))
    else:
        wanted = volume if volume is not None else solid_fraction * space.volume
        _refuse_too_dense(wanted / sizes.mean_volume, wanted / space.volume, space, key)
        diameter = sizes.draw_volume(generator, wanted)
        if len(diameter) == 0:
            raise SceneError(
                f"{key}: {wanted:.6g} m3 of grains (solid fraction {wanted / space.volume:.3g} of {space.volume:.6g} m3) "
                f"is less than half a grain of {sizes.draw(np.random.default_rng(seed), 1)[0]:.6g} m"
            )
    reach = 0.5 * float(diameter.max())
    asked = Filling(space, 0.5 * diameter, places, key, tuple(w for w in walls if w.is_near(space.bounds, reach)))
    _refuse_too_dense(len(diameter), asked.solid_fraction, space, key)
    return asked


def pack(fillings: list[Filling], held=None) -> tuple[list[np.ndarray], list[Packing]]:
    """Places for the grains of all fillings: inside their regions and without overlap.

    Fillings whose regions meet are packed together, others by themselves. The same arguments give the same bits, on any
    number of threads.

    Args:
        fillings: What is to be placed.
        held: Positions [m], shape (m, 3), and radii [m], shape (m,), of grains that stay where they are; or None.

    Returns:
        Positions [m] of each filling, shape (n, 3), and what each group of fillings took.

    Raises:
        SceneError: A grain without a place, or a solid fraction that cannot be reached; says what was reached.
    """
    position, radius = (np.zeros((0, 3)), np.zeros(0)) if held is None else held
    if fillings:
        grains = sum(len(asked.radius) for asked in fillings)
        keys = ", ".join(asked.key for asked in fillings)
        memory.require(grains * PACKING_BYTES, keys, f"packing {grains} grains", "ask for fewer or larger grains")
    places: list[np.ndarray] = [np.zeros((0, 3))] * len(fillings)
    took = []
    for group in _meeting([asked.region.bounds for asked in fillings]):
        low = np.min([fillings[k].region.bounds[0] for k in group], axis=0)
        high = np.max([fillings[k].region.bounds[1] for k in group], axis=0)
        near = ((position + radius[:, None] > low) & (position - radius[:, None] < high)).all(axis=1)
        with Pack([fillings[k] for k in group], position[near], radius[near]) as packed:
            took.append(packed.run())
            for k, points in zip(group, packed.places(), strict=True):
                places[k] = points
    return places, took


def fill(
    mesh: TriangleMesh | None,
    box,
    diameter: float | DiameterDistribution,
    seed: int,
    count: int | None = None,
    solid_fraction: float | None = None,
    key: str = "fill",
) -> tuple[np.ndarray, np.ndarray]:
    """One filling by itself: grains inside a closed mesh, a box, or the part of the mesh within the box.

    Args:
        mesh: Closed mesh to fill, or None.
        box: Least and greatest corner [m], shape (2, 3), or None for the whole mesh.
        diameter: Diameter of all grains [m], or a distribution.
        seed: Seed of the random numbers.
        count: Number of grains; exactly one of ``count`` and ``solid_fraction`` is given.
        solid_fraction: Volume of the grains over the volume of the region [-].
        key: Scene key, for messages.

    Returns:
        Positions [m], shape (n, 3), and radii [m], shape (n,), in the order in which sizes were drawn.

    Raises:
        SceneError: No space, a grain too large for it, or a solid fraction that cannot be reached.
    """
    asked = filling(region(mesh, box, key), size_law(diameter), seed, count, solid_fraction, key=key)
    [places], _ = pack([asked])
    return places, asked.radius


def worst_overlaps(position: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest overlap of each grain as a share of the smaller radius [-], (n,), and its partner, (n,), -1: none."""
    threads = Threads(available_threads())
    neighbours = _Neighbours(np.array(position, float), radius, len(radius), 0.0, threads, room=0)
    neighbours.build()
    threads.close()
    return neighbours.overlap.numpy(), neighbours.partner.numpy()


def _refuse_too_dense(count: float, fraction: float, space: Region, key: str) -> None:
    if fraction > DENSEST:
        raise SceneError(
            f"{key}: asked for {count:.0f} grains in {space.volume:.6g} m3, a solid fraction of {fraction:.3g}; "
            f"allowed is at most {DENSEST} (the densest packing of equal spheres), within reach about 0.6: ask for "
            "fewer or smaller grains"
        )


def _meeting(bounds: list[np.ndarray]) -> list[list[int]]:
    """Groups of boxes (2, 3) [m] that meet, directly or through others: numbers in ascending order."""
    groups: list[list[int]] = []
    for k, (low, high) in enumerate(bounds):
        meets = [group for group in groups if any((bounds[i][0] < high).all() and (low < bounds[i][1]).all() for i in group)]
        groups = [group for group in groups if group not in meets] + [sorted([k, *(i for group in meets for i in group)])]
    return groups


def _first_places(asked: Filling) -> np.ndarray:
    """Random centres [m] at least a radius inside the region, shape (n, 3)."""
    space, radius = asked.region, asked.radius
    narrow = (2.0 * radius[:, None] > space.high - space.low).any(axis=1)
    if narrow.any():
        raise _no_place(asked, radius[narrow])
    position = np.empty((len(radius), 3))
    left = np.arange(len(radius))
    in_vain = tried = 0
    while len(left):
        report_state(f"placing {len(radius)} grains: {len(left)} left")
        position[left] = space.random_points(asked.places, radius[left])
        tried += len(left)
        if space.mesh is None and space.pool is None and not asked.walls:
            break
        outside = left[~_is_free(asked, position[left], radius[left])]
        in_vain = in_vain + 1 if len(outside) == len(left) else 0
        if in_vain > np.clip(TRIES // len(left), 20, 5000) or (tried > MOST_TRIES and len(outside)):
            raise _no_place(asked, radius[left])
        left = outside
    return position


def _is_free(asked: Filling, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Whether grains, (n, 3) and (n,) [m], are clear of the mesh and the walls of a filling, bool, shape (n,)."""
    space = asked.region
    free = np.ones(len(position), bool) if space.pool is None else space.pool.holds(position)
    if space.mesh is not None:
        free &= signed_distance(space.mesh, position)[0] <= -radius
    for wall in asked.walls:
        some = np.flatnonzero(free)
        free[some] = wall.gap(position[some], radius[some]) >= -TOUCH * radius[some]
    return free


def _no_place(asked: Filling, radius: np.ndarray) -> SceneError:
    size = " x ".join(f"{v:.6g}" for v in asked.region.high - asked.region.low)
    return SceneError(
        f"{asked.key}: no place found for {len(radius)} grains, the largest {2 * radius.max():.6g} m in diameter, "
        f"in a region of {size} m; ask for smaller grains or a larger region"
    )


class Pack:
    """Fillings that are packed together, among grains that are held fast.

    Args:
        fillings: What is to be placed.
        held_position: Positions [m] of grains that stay where they are, shape (m, 3).
        held_radius: Their radii [m], shape (m,).
    """

    def __init__(self, fillings: list[Filling], held_position: np.ndarray, held_radius: np.ndarray) -> None:
        self._begin = time.perf_counter()
        self._fillings = fillings
        ends = np.cumsum([len(asked.radius) for asked in fillings])
        self._parts = [slice(end - len(asked.radius), end) for end, asked in zip(ends, fillings, strict=True)]
        self._loose = int(ends[-1])
        self._radius = np.concatenate([*(asked.radius for asked in fillings), held_radius])
        places = [_first_places(asked) for asked in fillings]
        # neighbours in space become neighbours in memory; the order within a filling is put back at the end
        cell = 2.0 * finest_cell(self._radius, size_classes(self._radius), 0.0)
        self._order = [np.lexsort(np.floor(points / cell).T) for points in places]
        self._position = np.concatenate([*(p[o] for p, o in zip(places, self._order, strict=True)), held_position])
        for part, order in zip(self._parts, self._order, strict=True):
            self._radius[part] = self._radius[part][order]
        self._walls = [_walls_of(asked, self._radius[part]) for asked, part in zip(fillings, self._parts, strict=True)]
        self._last = np.zeros((self._loose, 3))
        self._move = np.zeros((self._loose, 3))
        self._fraction = sum(asked.solid_fraction for asked in fillings)
        self._threads = Threads(available_threads())
        skin = SKIN * float(self._radius[: self._loose].mean())
        self._neighbours = _Neighbours(self._position, self._radius, self._loose, skin, self._threads)
        self._steps = 0
        self._stage = ""
        self._most_steps, self._patience = MOST_STEPS, PATIENCE

    def __enter__(self) -> "Pack":
        return self

    def __exit__(self, *_) -> None:
        self._threads.close()

    def places(self) -> list[np.ndarray]:
        """Positions [m] of the grains of each filling, shape (n, 3), in the order in which sizes were drawn."""
        found = []
        for part, order in zip(self._parts, self._order, strict=True):
            points = np.empty((len(order), 3))
            points[order] = self._position[part]
            found.append(points)
        return found

    def run(self) -> Packing:
        """Push apart, shake as long as that helps, and give up with what was reached.

        Raises:
            SceneError: The grains did not find places.
        """
        shakes = 0
        left = self._settle(1.0, self._size_at(START_FRACTION), GROWING_STEPS)
        for steps in SHAKES:
            if left <= 0.0:
                break
            before, shakes = left, shakes + 1
            self._stage = f", shaken {shakes} of up to {len(SHAKES)} times"
            self._shake(steps)
            left = self._settle()
            if left > SHAKING_HELPS * before:
                break
        if left > 0.0:
            raise self._too_dense(left)
        seconds = time.perf_counter() - self._begin
        keys = tuple(asked.key for asked in self._fillings)
        return Packing(keys, self._loose, self._steps, self._neighbours.builds, shakes, seconds)

    def _size_at(self, fraction: float) -> float:
        """Factor on the radii [-] at which the grains would have this solid fraction, at most 1."""
        return min(1.0, (fraction / self._fraction) ** (1.0 / 3.0))

    def _settle(self, goal: float = 1.0, start: float = 1.0, growing: int = 0) -> float:
        """Heavy-ball steps until nothing overlaps at `goal` times the radii; then 0, else the least overlap found [-].

        The grains grow from `start` times their radii within the first `growing` steps.
        """
        self._last[:] = 0.0
        best, best_step, least_out = np.inf, 0, np.inf
        for step in range(self._most_steps):
            growth = min(goal, start + (goal - start) * step / max(growing, 1)) if step < growing else goal
            overlap = self._push_apart(growth)
            if step >= growing:
                if overlap <= OVERLAP:
                    out = self._furthest_out()
                    if out <= 0.0:
                        return 0.0
                    if out < (1.0 - PROGRESS) * least_out:
                        least_out, best_step = out, step
                overlap = max(overlap, 0.0)
                if overlap < (1.0 - PROGRESS) * best:
                    best, best_step = overlap, step
                elif step - best_step > self._patience:
                    break
            self._advance(MOMENTUM)
        return max(best, OVERLAP)

    def _shake(self, steps: int) -> None:
        """Grow from a fluid to full size, slower and slower, while all grains keep moving."""
        start = self._size_at(FLUID_FRACTION)
        radius = self._radius[: self._loose, None]
        self._last[:] = self._fillings[0].places.normal(size=self._last.shape) * radius
        for step in range(steps):
            self._last *= SHAKING / np.sqrt(((self._last / radius) ** 2).sum(axis=1).mean())
            self._push_apart(start + (1.0 - start) * (1.0 - (1.0 - step / steps) ** 2))
            self._advance(1.0)

    def _push_apart(self, growth: float) -> float:
        """Find the moves that part grown grains; largest overlap as a share of the smaller true radius [-], none <= 0."""
        self._move, overlap = self._neighbours.push_apart(growth * (1.0 + MARGIN))
        # at least two margins of the overlap vanish with the margins
        return float(overlap.max(initial=0.0)) * (1.0 + MARGIN) - 2.0 * MARGIN

    def _furthest_out(self) -> float:
        """How far a grain reaches into a wall at most, in its own radii [-]; 0 if none does."""
        reached = (wall.reached(self._position[p]) for walls, p in zip(self._walls, self._parts, strict=True) for wall in walls)
        return max(reached, default=0.0)

    def _advance(self, momentum: float) -> None:
        """Move all loose grains: a share of their last moves again, the pushes, and back from the walls."""
        loose = self._position[: self._loose]
        self._last *= momentum
        self._last += self._move
        before = loose.copy()
        for asked, part, walls in zip(self._fillings, self._parts, self._walls, strict=True):
            if asked.region.pool is not None:
                _keep_this_side(self._last[part], walls)
        loose += self._last
        for asked, part, walls in zip(self._fillings, self._parts, self._walls, strict=True):
            asked.region.clamp(loose[part], self._radius[part])
            for wall in walls:
                came_from = loose[part].copy() if len(walls) > 1 else None
                wall.push_in(loose[part])
                if came_from is not None:  # the other walls count on knowing of every move
                    for other in walls:
                        if other is not wall:
                            other.note(loose[part] - came_from)
            if asked.region.pool is not None:
                strayed = ~asked.region.pool.is_near(loose[part])
                loose[part][strayed] = before[part][strayed]
                for wall in walls:
                    wall.slack[strayed] = np.minimum(wall.slack[strayed], 0.0)  # to be measured again
        np.subtract(loose, before, out=self._last)
        for part, walls in zip(self._parts, self._walls, strict=True):
            for wall in walls:
                wall.note(self._last[part])
        self._steps += 1
        report_state(f"packing {self._loose} grains: {self._steps} steps{self._stage}")

    def _too_dense(self, left: float) -> SceneError:
        """Error that says which solid fraction is within reach: smaller grains are tried until they fit, or for long enough."""
        goal, (least, growth) = 1.0, SMALLER_BY
        self._most_steps = int(np.clip(SMALLER_WORK // self._loose, *SMALLER_STEPS))
        self._patience = min(PATIENCE, self._most_steps // 3)
        in_wall = left <= OVERLAP  # no overlap is left that smaller grains would lose
        for attempt in range(0 if in_wall else SMALLER_ATTEMPTS):
            # half of what is left parts a pair; a small grain may lie many of its radii deep in a large one
            goal *= 1.0 - min(max(0.08 * left, min(0.5 * left, least * growth**attempt), LEAST_SMALLER), 0.1)
            self._stage = f" to find what fits, at {goal**3:.2f} of the volume"
            left = self._settle(goal)
            in_wall = left > 0.0 and self._furthest_out() > IN_WALL
            if left <= 0.0 or in_wall:
                break
        stuck = "" if left <= 0.0 else self._stuck_in_wall()
        found = "reached {:.3f} without overlap: about {:.0f} grains of these sizes fit"
        if in_wall:
            found = "not all found a place clear of the walls"
        elif left > 0.0:
            found = "less than {:.3f} would fit, {:.0f} grains of these sizes"
        asked = "; ".join(
            f"{one.key}: asked for solid fraction {one.solid_fraction:.3f} ({len(one.radius)} grains in "
            f"{one.region.volume:.6g} m3), {found.format(one.solid_fraction * goal**3, len(one.radius) * goal**3)}"
            for one in self._fillings
        )
        held = len(self._radius) - self._loose
        among = f" among {held} grains given by place" if held else ""
        return SceneError(
            f"{asked}{among} (after {self._steps} steps, {time.perf_counter() - self._begin:.1f} s){stuck}; ask for fewer "
            "grains, smaller ones or a larger region"
        )

    def _stuck_in_wall(self) -> str:
        """Which grain keeps reaching into a wall, in words; nothing if none does."""
        for walls, part in zip(self._walls, self._parts, strict=True):
            for wall in walls:
                position = self._position[part]
                if wall.reached(position) > 0.0:
                    where = ", ".join(f"{x:.4g}" for x in position[wall.worst(position)])
                    return f"; a grain at ({where}) m keeps reaching into {wall.name!r}, where there is too little room for it"
        return ""


class _Neighbours:
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


class _Wall:
    """A wall of the packing; only grains that may have come near it are measured again.

    Args:
        name: Name of the wall or mesh, for messages.
        distance: Distance of points (n, 3) [m] from it [m], (n,), negative where no grain may be, and its gradient, (n, 3).
        radius: Radii of the grains [m], shape (n,).
        touch: Overlap that is left alone, in radii [-]: a box that ends at a wall holds its grains itself.
    """

    def __init__(self, name: str, distance: Callable, radius: np.ndarray, touch: float):
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


def _walls_of(asked: Filling, radius: np.ndarray) -> list[_Wall]:
    """Walls of a filling for its grains (n,) [m]: the mesh that it fills, and those that may come near."""
    mesh = asked.region.mesh
    walls = [_Wall(wall.name, wall.distance, radius, TOUCH) for wall in asked.walls]
    if mesh is None:
        return walls

    def depth(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance, gradient = signed_distance(mesh, position)
        return -distance, -gradient

    return [_Wall(mesh.name, depth, radius, 0.0), *walls]


def _keep_this_side(move: np.ndarray, walls: Sequence[_Wall]) -> None:
    """Shorten moves (n, 3) [m], in place, so that no centre crosses a wall: it is at least ``slack`` and a radius away."""
    if not walls:
        return
    free = np.min([wall.slack + wall.radius for wall in walls], axis=0)
    length = np.sqrt(np.einsum("ij,ij->i", move, move))
    longest = np.maximum(0.9 * free, 0.0)
    far = length > longest
    move[far] *= (longest[far] / length[far])[:, None]
