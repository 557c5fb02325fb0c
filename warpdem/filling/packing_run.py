"""One packing: grains that grow while they are pushed apart, and are shaken where that is not enough."""

import time
from dataclasses import dataclass

import numpy as np

from warpdem.core.progress import report_state
from warpdem.core.threads import Threads, available_threads
from warpdem.errors import SceneError
from warpdem.filling.fill_request import Filling
from warpdem.filling.packing_moves import keep_grains_in, moved_and_kept_in, starting_positions
from warpdem.filling.packing_neighbors import NeighborTable
from warpdem.filling.packing_walls import MARGIN, keep_this_side, walls_of
from warpdem.filling.rigid_moves import PlacedClumps
from warpdem.filling.size_grids import finest_cell, size_classes

OVERLAP = 1e-6
"""Largest overlap left between two grains as a fraction of the smaller radius [-]: more than rounding leaves in a row of grains
that fits exactly between two walls."""
START_FRACTION = 0.3
"""Solid fraction at which growing starts [-]: random positions overlap little there."""
GROWING_STEPS = 30
"""Steps over which the grains grow to their size without shaking."""
FLUID_FRACTION = 0.5
"""Solid fraction to which the grains shrink when shaking starts [-]: just a fluid still."""
SHAKES = (300, 1000, 3000)
"""Steps over which the grains grow again while they are shaken, one attempt after the other."""
SHAKING = 0.03
"""Root mean square of a grain's move in one step of shaking, in its own radii [-]."""
SHAKING_HELPS = 0.8
"""Shaking goes on as long as an attempt leaves less than this fraction of the overlap of the one before [-]."""
MOMENTUM = 0.95
"""Fraction of a grain's last move that it repeats [-] (heavy ball)."""
SKIN = 0.6
"""Skin of the neighbor table, in mean radii [-]."""
PATIENCE = 300
"""Steps within which the largest overlap must shrink by `PROGRESS`, or growing to the full size is given up."""
PROGRESS = 1e-3
"""Fraction by which an overlap counts as smaller [-]."""
MOST_STEPS = 5000
"""Steps of one attempt."""
SMALLER_BY = 0.005, 1.5
"""Fraction by which grains that do not fit are made smaller, to find out what would fit, and its growth from one attempt to the
next [-]."""
LEAST_SMALLER = 0.003
"""Least fraction by which they are [-]."""
IN_WALL = 0.1
"""How far a grain that has no space reaches into a wall, though each step ends with moving it off, in its own radii [-]."""
SMALLER_ATTEMPTS = 10
"""Attempts with smaller grains."""
SMALLER_WORK = 2_000_000
"""Grains times steps of one of these attempts."""
SMALLER_STEPS = 100, 1000
"""Least and most steps of one of these attempts."""


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
    """Neighbor searches."""
    shakes: int
    """Attempts of shaking; 0 when pushing apart was enough."""
    seconds: float
    """Time it took [s]."""


class PackingRun:
    """Fillings that are packed together, among grains that do not move.

    Args:
        fillings: What is to be placed.
        held_position: Positions [m] of grains that stay where they are, shape (m, 3).
        held_radius: Their radii [m], shape (m,).
    """

    def __init__(self, fillings: list[Filling], held_position: np.ndarray, held_radius: np.ndarray) -> None:
        self._begin = time.perf_counter()
        self._fillings = fillings
        ends = np.cumsum([len(request.radius) for request in fillings])
        self._parts = [slice(end - len(request.radius), end) for end, request in zip(ends, fillings, strict=True)]
        self._loose = int(ends[-1])
        self._radius = np.concatenate([*(request.radius for request in fillings), held_radius])
        # neighbors in space become neighbors in memory; the order within a filling is restored at the end
        cell = 2.0 * finest_cell(self._radius, size_classes(self._radius), 0.0)
        self._order, points, self._rigid = [], [], []
        for request in fillings:
            order, points_of, rigid = starting_positions(request, cell)
            self._order.append(order)
            points.append(points_of)
            self._rigid.append(rigid)
        self._position = np.concatenate([*points, held_position])
        for part, order in zip(self._parts, self._order, strict=True):
            self._radius[part] = self._radius[part][order]
        self._walls = [walls_of(request, self._radius[part]) for request, part in zip(fillings, self._parts, strict=True)]
        self._last = np.zeros((self._loose, 3))
        self._move = np.zeros((self._loose, 3))
        self._fraction = sum(request.solid_fraction for request in fillings)
        self._threads = Threads(available_threads())
        skin = SKIN * float(self._radius[: self._loose].mean())
        self._neighbours = NeighborTable(
            self._position, self._radius, self._loose, skin, self._threads, clump=self._clump_numbers()
        )
        self._steps = 0
        self._stage = ""
        self._most_steps, self._patience = MOST_STEPS, PATIENCE

    def _clump_numbers(self) -> np.ndarray | None:
        """Number of the clump of each grain, -1 for none, shape (n,); None without clumps."""
        if not any(self._rigid):
            return None
        numbers, before = np.full(len(self._radius), -1), 0
        for part, rigid in zip(self._parts, self._rigid, strict=True):
            if rigid is not None:
                numbers[part] = rigid.of + before
                before += len(rigid.centre)
        return numbers

    def __enter__(self) -> "PackingRun":
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.close()

    def positions(self) -> list[np.ndarray | PlacedClumps]:
        """Positions [m] of the grains of each filling, shape (n, 3), in the order in which sizes were drawn.

        Clumps are in an order of their own.
        """
        found: list[np.ndarray | PlacedClumps] = []
        for part, order, rigid in zip(self._parts, self._order, self._rigid, strict=True):
            if rigid is not None:
                found.append(PlacedClumps(rigid.centre, rigid.turn, rigid.size))
                continue
            points = np.empty((len(order), 3))
            points[order] = self._position[part]
            found.append(points)
        return found

    def run(self) -> Packing:
        """Push apart, shake as long as that helps, and give up with what was reached.

        Raises:
            SceneError: The grains did not find positions.
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
        keys = tuple(request.key for request in self._fillings)
        return Packing(keys, self._loose, self._steps, self._neighbours.builds, shakes, seconds)

    def _size_at(self, fraction: float) -> float:
        """Factor on the radii [-] at which the grains would have this solid fraction, at most 1."""
        return float(min(1.0, (fraction / self._fraction) ** (1.0 / 3.0)))

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
        self._last[:] = self._fillings[0].generator.normal(size=self._last.shape) * radius
        for step in range(steps):
            self._last *= SHAKING / np.sqrt(((self._last / radius) ** 2).sum(axis=1).mean())
            self._push_apart(start + (1.0 - start) * (1.0 - (1.0 - step / steps) ** 2))
            self._advance(1.0)

    def _push_apart(self, growth: float) -> float:
        """Find the moves that part grown grains; largest overlap as a fraction of the smaller true radius [-], none <= 0."""
        self._move, overlap = self._neighbours.push_apart(growth * (1.0 + MARGIN))
        for part, rigid in zip(self._parts, self._rigid, strict=True):
            if rigid is not None:
                self._move[part] = rigid.pushed(self._move[part])
        # at least two margins of the overlap vanish with the margins
        return float(overlap.max(initial=0.0)) * (1.0 + MARGIN) - 2.0 * MARGIN

    def _furthest_out(self) -> float:
        """How far a grain reaches into a wall at most, in its own radii [-]; 0 if none does."""
        reached = [wall.reached(self._position[p]) for walls, p in zip(self._walls, self._parts, strict=True) for wall in walls]
        for request, part, rigid in zip(self._fillings, self._parts, self._rigid, strict=True):
            if rigid is not None:  # a box moves the whole of a clump: it may be too narrow for it
                inside = self._position[part].copy()
                request.region.clamp(inside, self._radius[part])
                out = np.linalg.norm(inside - self._position[part], axis=1) / self._radius[part]
                reached.append(float(out[out > OVERLAP].max(initial=0.0)))
        return max(reached, default=0.0)

    def _advance(self, momentum: float) -> None:
        """Move all loose grains: a fraction of their last moves again, the pushes, and back from the walls."""
        loose = self._position[: self._loose]
        self._last *= momentum
        self._last += self._move
        before = loose.copy()
        for request, part, walls, rigid in zip(self._fillings, self._parts, self._walls, self._rigid, strict=True):
            if request.region.open_space is not None:
                allowed = self._last[part] if rigid is None else self._last[part].copy()
                keep_this_side(allowed, walls)
                if rigid is not None:
                    rigid.shortened(self._last[part], allowed)
        for request, part, walls, rigid in zip(self._fillings, self._parts, self._walls, self._rigid, strict=True):
            if rigid is None:
                loose[part] += self._last[part]
                keep_grains_in(request, loose[part], before[part], self._radius[part], walls)
            else:
                loose[part] = moved_and_kept_in(request, rigid, self._last[part], self._radius[part], walls)
        np.subtract(loose, before, out=self._last)
        for part, walls in zip(self._parts, self._walls, strict=True):
            for wall in walls:
                wall.note(self._last[part])
        self._steps += 1
        report_state(f"packing {self._loose} grains: {self._steps} steps{self._stage}")

    def _too_dense(self, left: float) -> SceneError:
        """Error that says which solid fraction is within reach: smaller grains are tried until they fit, or for long enough."""
        if any(self._rigid):
            asked = "; ".join(
                f"{one.key}: asked for solid fraction {one.solid_fraction:.3f} "
                f"({len(one.radius) if rigid is None else len(rigid.centre)} {'grains' if rigid is None else 'clumps'})"
                for one, rigid in zip(self._fillings, self._rigid, strict=True)
            )
            return SceneError(
                f"{asked}: overlaps of {left:.2g} of a radius are left (after {self._steps} steps, "
                f"{time.perf_counter() - self._begin:.1f} s){self._stuck_in_wall()}; ask for fewer, smaller ones or more space"
            )
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
            found = "not all found a position clear of the walls"
        elif left > 0.0:
            found = "less than {:.3f} would fit, {:.0f} grains of these sizes"
        request = "; ".join(
            f"{one.key}: asked for solid fraction {one.solid_fraction:.3f} ({len(one.radius)} grains in "
            f"{one.region.volume:.6g} m3), {found.format(one.solid_fraction * goal**3, len(one.radius) * goal**3)}"
            for one in self._fillings
        )
        held = len(self._radius) - self._loose
        among = f" among {held} grains given by position" if held else ""
        return SceneError(
            f"{request}{among} (after {self._steps} steps, {time.perf_counter() - self._begin:.1f} s){stuck}; ask for fewer "
            "grains, smaller ones or a larger region"
        )

    def _stuck_in_wall(self) -> str:
        """Message on the grain that keeps reaching into a wall; empty if none does."""
        for walls, part in zip(self._walls, self._parts, strict=True):
            for wall in walls:
                position = self._position[part]
                if wall.reached(position) > 0.0:
                    where = ", ".join(f"{x:.4g}" for x in position[wall.worst(position)])
                    return f"; a grain at ({where}) m keeps reaching into {wall.name!r}, where there is too little space for it"
        return ""
