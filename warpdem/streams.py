"""Grains that come in while a run goes on: how many are due at a step, and free places for them."""

import numpy as np

from warpdem.grain_source import Grains0

TRIES = 60  # random places looked at for one grain before it has to wait
LEAST_EVENT_STEPS = 16  # steps between two looks at a stream, at least: each look makes new lists


def representatives(scene) -> Grains0:
    """The smallest and the largest grain that each stream may bring, for what is decided before the run."""
    names = list(scene.materials)
    rows = [(names.index(s.material), d, s) for s in scene.streams for d in extremes(s.diameter)]
    n = len(rows)
    return Grains0(
        id=np.full(n, -1, dtype=np.int64),
        type=np.array([kind for kind, _, _ in rows], dtype=np.int32),
        radius=np.array([0.5 * d for _, d, _ in rows]).reshape(n),
        position=np.array([0.5 * (np.array(s.box.min) + s.box.max) for _, _, s in rows]).reshape(n, 3),
        velocity=np.array([s.velocity for _, _, s in rows]).reshape(n, 3),
        spin=np.zeros((n, 3)),
    )


class Feeder:
    """One stream in a run.

    Attributes:
        count: grains that came in.
        mass: their mass [kg].
        every: steps between two looks.
    """

    def __init__(self, stream, scene, dt: float) -> None:
        self.stream, self.dt = stream, dt
        self.type = list(scene.materials).index(stream.material)
        self.density = scene.materials[stream.material].density
        self.generator = np.random.default_rng(stream.seed)
        self.count, self.mass = 0, 0.0
        self.waiting: float | None = None  # diameter that has been drawn and has no place yet [m]
        speed = float(np.linalg.norm(stream.velocity))
        fall = float(np.linalg.norm(scene.gravity))
        smallest, _ = extremes(stream.diameter)
        times = [smallest / speed] if speed else [np.sqrt(2.0 * smallest / fall)] if fall else [1000.0 * dt]
        self.every = max(LEAST_EVENT_STEPS, int(times[0] / dt))
        self.first = int(np.ceil(stream.start / dt - 1e-9))

    def next_event(self, step: int) -> int | None:
        """The first step after ``step`` at which grains may come in; None if there is none."""
        after = self.first if step < self.first else self.first + ((step - self.first) // self.every + 1) * self.every
        late = self.stream.until is not None and after * self.dt > self.stream.until + self.every * self.dt
        return None if late else after

    def is_event(self, step: int) -> bool:
        """Whether grains may come in at ``step``."""
        return step >= self.first and (step - self.first) % self.every == 0

    def bring(self, step: int, position: np.ndarray, radius: np.ndarray, nearest) -> tuple[np.ndarray, np.ndarray]:
        """Centres (k, 3) [m] and radii (k,) [m] of the grains that come in at ``step``.

        Args:
            step: the present step.
            position: centres of the grains that are there, shape (n, 3).
            radius: their radii, shape (n,).
            nearest: function of differences of places that gives those of nearest images.
        """
        stream = self.stream
        low, high = np.array(stream.box.min), np.array(stream.box.max)
        end = step * self.dt if stream.until is None else min(step * self.dt, stream.until)
        elapsed = max(0.0, end - stream.start)
        _, largest = extremes(stream.diameter)
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        beside = (np.abs(nearest(position - middle)) < half + 0.5 * largest + radius[:, None]).all(axis=1)
        near, size = [position[beside]], [radius[beside]]
        places, radii = [], []
        while True:
            if self.waiting is None:
                self.waiting = float(draw(stream.diameter, self.generator))
            r = 0.5 * self.waiting
            mass = self.density * 4.0 / 3.0 * np.pi * r**3
            due = stream.count_rate * elapsed - self.count if stream.count_rate else stream.mass_rate * elapsed - self.mass
            if due < (1.0 if stream.count_rate else mass):
                break
            there, sizes = np.concatenate(near), np.concatenate(size)
            for _ in range(TRIES):
                place = low + r + self.generator.random(3) * (high - low - 2.0 * r)
                way = nearest(there - place)
                if (np.einsum("ij,ij->i", way, way) >= (sizes + r) ** 2).all():
                    break
            else:
                break  # no room: it waits for the next look
            near.append(place[None])
            size.append(np.array([r]))
            places.append(place)
            radii.append(r)
            self.count, self.mass, self.waiting = self.count + 1, self.mass + mass, None
        return np.array(places).reshape(-1, 3), np.array(radii)

    def state(self) -> dict:
        """What a checkpoint must hold of it, as JSON."""
        return {
            "generator": self.generator.bit_generator.state, "count": self.count, "mass": self.mass, "waiting": self.waiting,
        }  # fmt: skip

    def restore(self, state: dict) -> None:
        """Go on from ``state``."""
        self.generator.bit_generator.state = state["generator"]
        self.count, self.mass, self.waiting = state["count"], state["mass"], state["waiting"]


def extremes(diameter) -> tuple[float, float]:
    """Smallest and largest diameter [m] of a distribution."""
    return diameter.uniform if hasattr(diameter, "uniform") else (diameter, diameter)


def draw(diameter, generator: np.random.Generator) -> float:
    """One diameter [m]."""
    low, high = extremes(diameter)
    return low + (high - low) * generator.random()
