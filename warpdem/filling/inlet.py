"""An inlet: the grains that a stream inserts while a run goes on, how many are due at a step and where they fit."""

from collections.abc import Callable
from typing import Any

import numpy as np

from warpdem.filling.inlet_walls import InletWalls
from warpdem.scene.model import Scene
from warpdem.scene.size_distribution import size_law

TRIES = 60  # random positions tried for one grain before it has to wait
BEHIND = 0.02  # missing share of the grains due [-] above which a warning is given at the end
LEAST_EVENT_STEPS = (
    16  # least steps between two insertions: each one that inserts grains rebuilds the contact lists
)


class Inlet:
    """One stream in a run.

    Attributes:
        count: number of inserted grains.
        mass: their mass [kg].
        every: steps between two looks.
        blocked: whether a grain that is due found no free position at the last insertion.

    Args:
        number: Number of the stream.
        scene: Validated scene.
        dt: Time step [s].
        walls: The walls beside its box; None for none.
    """

    def __init__(self, number: int, scene: Scene, dt: float, walls: InletWalls | None = None) -> None:
        self.number, self.walls = number, walls
        self.stream = stream = scene.streams[number]
        self.dt = dt
        self.group = scene.groups.index(scene.group_names[len(scene.grains) + number])
        self.type = list(scene.materials).index(stream.material)
        self.density = scene.materials[stream.material].density
        self.generator = np.random.default_rng(stream.seed)
        self.count, self.mass = 0, 0.0
        self.waiting: float | None = None  # diameter drawn for the next grain [m]
        speed = float(np.linalg.norm(stream.velocity))
        fall = float(np.linalg.norm(scene.gravity))
        self.sizes = size_law(stream.diameter)
        smallest, _ = self.sizes.extremes
        self.blocked = False
        mass = self.density * np.pi / 6.0 * smallest**3
        # until ten grains are due
        times = [10.0 / stream.count_rate if stream.count_rate else 10.0 * mass / (stream.mass_rate or np.inf)]
        times += (
            [smallest / speed] if speed else [np.sqrt(2.0 * smallest / fall)] if fall else []
        )  # until the box is free again
        self.every = max(LEAST_EVENT_STEPS, int(min(times) / dt))
        self.first = int(np.ceil(stream.start / dt - 1e-9))

    def next_event(self, step: int) -> int | None:
        """The first step after ``step`` at which grains may be inserted; None if there is none."""
        after = self.first if step < self.first else self.first + ((step - self.first) // self.every + 1) * self.every
        late = self.stream.until is not None and after * self.dt > self.stream.until + self.every * self.dt
        return None if late else after

    def is_event(self, step: int) -> bool:
        """Whether grains may be inserted at ``step``."""
        return step >= self.first and (step - self.first) % self.every == 0

    def insert(
        self, step: int, position: np.ndarray, radius: np.ndarray, nearest: Callable[[np.ndarray], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Centers (k, 3) [m] and radii (k,) [m] of the grains that are inserted at ``step``.

        Args:
            step: the present step.
            position: centers of the present grains, shape (n, 3).
            radius: their radii, shape (n,).
            nearest: maps separations (n, 3) [m] to those of the nearest periodic images.
        """
        stream = self.stream
        low, high = np.array(stream.box.min), np.array(stream.box.max)
        elapsed = self._elapsed(step)
        walls = self.walls.at(step * self.dt) if self.walls is not None else []
        _, largest = self.sizes.extremes
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        beside = (np.abs(nearest(position - middle)) < half + 0.5 * largest + radius[:, None]).all(axis=1)
        near, size = [position[beside]], [radius[beside]]
        positions, radii = [], []
        self.blocked = False
        while True:
            if self.waiting is None:
                self.waiting = float(self.sizes.draw(self.generator, 1)[0])
            r = 0.5 * self.waiting
            mass = self.density * 4.0 / 3.0 * np.pi * r**3
            due = (
                stream.count_rate * elapsed - self.count
                if stream.count_rate
                else (stream.mass_rate or 0.0) * elapsed - self.mass
            )
            if due < (1.0 if stream.count_rate else mass):
                break
            there, sizes = np.concatenate(near), np.concatenate(size)
            for _ in range(TRIES):
                candidate = low + r + self.generator.random(3) * (high - low - 2.0 * r)
                separation = nearest(there - candidate)
                if not (np.einsum("ij,ij->i", separation, separation) >= (sizes + r) ** 2).all():
                    continue
                if all(wall.gap(candidate[None], r)[0] >= 0.0 for wall in walls):
                    break
            else:
                self.blocked = True
                break
            near.append(candidate[None])
            size.append(np.array([r]))
            positions.append(candidate)
            radii.append(r)
            self.count, self.mass, self.waiting = self.count + 1, self.mass + mass, None
        return np.array(positions).reshape(-1, 3), np.array(radii)

    def _elapsed(self, step: int) -> float:
        """How long it has been going on at ``step`` [s]."""
        end = step * self.dt if self.stream.until is None else min(step * self.dt, self.stream.until)
        return max(0.0, end - self.stream.start)

    def due(self, step: int) -> tuple[float, str]:
        """What should have been inserted by ``step``, and its unit: grains, or kg."""
        stream, elapsed = self.stream, self._elapsed(step)
        return (stream.count_rate * elapsed, "grains") if stream.count_rate else ((stream.mass_rate or 0.0) * elapsed, "kg")

    def shortfall(self, step: int) -> str | None:
        """Message that it inserted less by ``step`` than it should have; None if it kept up."""
        due, unit = self.due(step)
        inserted = float(self.count) if unit == "grains" else self.mass
        one = 1.0 if unit == "grains" else self.density * np.pi / 6.0 * self.sizes.extremes[1] ** 3
        rate = due / self._elapsed(step) if due else 0.0
        if due - inserted <= BEHIND * due + 2.0 * one + rate * self.every * self.dt:
            return None
        return (
            f"streams[{self.number}] inserted {inserted:.4g} {unit} of {due:.4g} {unit}, {inserted / due:.0%} of its rate: "
            "grains or walls left no space in its box; make it larger or the rate smaller, or give its grains a velocity that "
            "clears it"
        )

    def state(self) -> dict[str, Any]:
        """What a checkpoint must hold of it, as JSON."""
        return {
            "generator": self.generator.bit_generator.state, "count": self.count, "mass": self.mass, "waiting": self.waiting,
            "blocked": self.blocked,
        }  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from ``state``."""
        self.generator.bit_generator.state = state["generator"]
        self.count, self.mass, self.waiting = state["count"], state["mass"], state["waiting"]
        self.blocked = state["blocked"]
