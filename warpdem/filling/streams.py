"""Grains that come in while a run goes on: how many are due at a step, and free places for them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.fill_region import closed_region, sample_points
from warpdem.filling.fill_space import body_test
from warpdem.filling.grain_source import Grains0
from warpdem.filling.placed_walls import PlacedWall, WallPose, assign_sides, place_walls, smallest_gap
from warpdem.scene.size_distribution import size_law

TRIES = 60  # random places looked at for one grain before it has to wait
SAMPLES = 4000  # places of a box at which is asked whether walls leave it free
INSTANTS = 24  # at which that is asked where walls move
BLOCKED = 0.01  # of a box: what walls may take of it before it is told
BEHIND = 0.02  # of what was due: what may be missing at the end before it is told
LEAST_EVENT_STEPS = 16  # steps between two looks at a stream, at least: each look that brings grains makes new contact lists


def representatives(scene) -> Grains0:
    """The smallest and the largest grain that each stream may bring, for what is decided before the run."""
    names = list(scene.materials)
    rows = [(names.index(s.material), d, s) for s in scene.streams for d in size_law(s.diameter).extremes]
    n = len(rows)
    return Grains0(
        id=np.full(n, -1, dtype=np.int64),
        type=np.array([kind for kind, _, _ in rows], dtype=np.int32),
        group=np.zeros(n, dtype=np.int32),
        radius=np.array([0.5 * d for _, d, _ in rows]).reshape(n),
        position=np.array([0.5 * (np.array(s.box.min) + s.box.max) for _, _, s in rows]).reshape(n, 3),
        velocity=np.array([s.velocity for _, _, s in rows]).reshape(n, 3),
        spin=np.zeros((n, 3)),
    )


def to_come(stream, density: float, end: float) -> int:
    """How many grains a stream brings up to ``end`` [s] if each finds room, at the mean mass of its sizes; 0 before it begins.

    Args:
        stream: Stream of the scene.
        density: Of its material [kg/m3].
        end: End of the run [s].
    """
    elapsed = max(0.0, (end if stream.until is None else min(end, stream.until)) - stream.start)
    rate = stream.count_rate or stream.mass_rate / (density * size_law(stream.diameter).mean_volume)
    return int(rate * elapsed + 1e-6)  # round-off takes none away


def mean_to_come(stream, density: float, end: float) -> float:
    """Mean over a run to ``end`` [s] of the number of grains that a stream has brought; arguments as of ``to_come``."""
    last = end if stream.until is None else min(end, stream.until)
    return to_come(stream, density, end) * max(0.0, end - 0.5 * (stream.start + last)) / end


class FeedWalls:
    """The walls beside the box of a stream as they stand at any time.

    Args:
        number: Number of the stream.
        scene: Validated scene.
        meshes: Mesh walls by name.
        places: Places of the bodies of all walls at a time [s], by the walls' numbers.
        moves: Which walls move in the frame, by their numbers.

    Attributes:
        notes: what is to be known of the walls, for people.

    Raises:
        SceneError: They never leave room for a grain; names them.
    """

    def __init__(
        self, number: int, scene, meshes: dict, places: Callable[[float], list[WallPose]], moves: Sequence[bool]
    ) -> None:
        stream = scene.streams[number]
        self._scene, self._meshes, self._places = scene, meshes, places
        low, high = np.array(stream.box.min), np.array(stream.box.max)
        self._box, law = np.array([low, high]), size_law(stream.diameter)
        smallest, largest = (0.5 * diameter for diameter in law.extremes)
        self._reach = largest
        self.notes: list[str] = []
        walls = place_walls(scene, meshes, places(stream.start))  # which side is whose is told when the first grains come
        moving = {wall.name for wall, goes in zip(scene.walls, moves, strict=True) if goes}
        # in axes that turn, gravity has no direction to tell a cup by
        up = -np.asarray(scene.gravity, float) if scene.frame is None else np.zeros(3)
        key = f"streams[{number}].box"
        points = sample_points(closed_region(None, self._box, key), SAMPLES)
        sided, self._vessels = assign_sides(walls, points, is_body=body_test(scene, up))
        self._still = [w for w in sided if w.name not in moving and w.is_near(self._box, largest)]
        self._moving = [k for k, wall in enumerate(sided) if wall.name in moving]
        self._sides = [wall.side for wall in sided]
        self._look(key, stream, points, smallest)

    def _look(self, key: str, stream, points: np.ndarray, radius: float) -> None:
        """Refuse a box that is never free, and note what walls leave of it; of a stream that comes after the end, neither."""
        if stream.start >= self._scene.time.end:
            return
        middle, half = self._box.mean(axis=0), 0.5 * np.ptp(self._box, axis=0)
        centres = middle + (points - middle) * (1.0 - radius / half)
        end = min(self._scene.time.end, stream.until or np.inf)
        instants = np.linspace(stream.start, max(stream.start, end), INSTANTS) if self._moving else [stream.start]
        shares, blame = [], {}
        for time in instants:
            walls = self.at(time)
            shares.append(float((smallest_gap(walls, centres, radius) >= 0.0).mean()) if walls else 1.0)
            for wall in walls:
                taken = float((wall.gap(centres, radius) < 0.0).mean())
                blame[wall.name] = max(taken, blame.get(wall.name, 0.0))
        named = ", ".join(repr(name) for name, taken in sorted(blame.items(), key=lambda item: -item[1]) if taken > 0.0)
        if max(shares) == 0.0:
            when = "at no time of the run" if self._moving else "nowhere"
            raise SceneError(
                f"{self._scene.source}: {key}: {when} is there a place in it for a grain of {2.0 * radius:.4g} m in diameter "
                f"clear of the wall {named}: move the box off it, or make it larger"
            )
        if min(shares) < 1.0 - BLOCKED:
            share = f"{min(shares):.0%} to {max(shares):.0%}" if len(shares) > 1 else f"{shares[0]:.0%}"
            self.notes.append(f"{key}: the wall {named} leaves {share} of it: grains come in where it leaves room for them")
        if self._vessels:
            held = ", ".join(map(repr, dict.fromkeys(self._vessels)))
            self.notes.append(f"{key}: is within the closed mesh {held}: its grains come in and stay inside")

    def at(self, time: float) -> list[PlacedWall]:
        """The walls that may touch a grain in the box at ``time`` [s]."""
        if not self._moving:
            return self._still
        walls = place_walls(self._scene, self._meshes, self._places(time))
        now = [replace(walls[k], side=self._sides[k]) for k in self._moving]
        return [*self._still, *(wall for wall in now if wall.is_near(self._box, self._reach))]


class Feeder:
    """One stream in a run.

    Attributes:
        count: grains that came in.
        mass: their mass [kg].
        every: steps between two looks.
        blocked: whether a grain that is due found no room at the last look.

    Args:
        number: Number of the stream.
        scene: Validated scene.
        dt: Time step [s].
        walls: The walls beside its box; None for none.
    """

    def __init__(self, number: int, scene, dt: float, walls: FeedWalls | None = None) -> None:
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
        times = [10.0 / stream.count_rate if stream.count_rate else 10.0 * mass / stream.mass_rate]  # until ten are due
        times += [smallest / speed] if speed else [np.sqrt(2.0 * smallest / fall)] if fall else []  # until there is room
        self.every = max(LEAST_EVENT_STEPS, int(min(times) / dt))
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
        elapsed = self._elapsed(step)
        walls = self.walls.at(step * self.dt) if self.walls is not None else []
        _, largest = self.sizes.extremes
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        beside = (np.abs(nearest(position - middle)) < half + 0.5 * largest + radius[:, None]).all(axis=1)
        near, size = [position[beside]], [radius[beside]]
        places, radii = [], []
        self.blocked = False
        while True:
            if self.waiting is None:
                self.waiting = float(self.sizes.draw(self.generator, 1)[0])
            r = 0.5 * self.waiting
            mass = self.density * 4.0 / 3.0 * np.pi * r**3
            due = stream.count_rate * elapsed - self.count if stream.count_rate else stream.mass_rate * elapsed - self.mass
            if due < (1.0 if stream.count_rate else mass):
                break
            there, sizes = np.concatenate(near), np.concatenate(size)
            for _ in range(TRIES):
                place = low + r + self.generator.random(3) * (high - low - 2.0 * r)
                way = nearest(there - place)
                if not (np.einsum("ij,ij->i", way, way) >= (sizes + r) ** 2).all():
                    continue
                if all(wall.gap(place[None], r)[0] >= 0.0 for wall in walls):
                    break
            else:
                self.blocked = True
                break
            near.append(place[None])
            size.append(np.array([r]))
            places.append(place)
            radii.append(r)
            self.count, self.mass, self.waiting = self.count + 1, self.mass + mass, None
        return np.array(places).reshape(-1, 3), np.array(radii)

    def _elapsed(self, step: int) -> float:
        """How long it has been going on at ``step`` [s]."""
        end = step * self.dt if self.stream.until is None else min(step * self.dt, self.stream.until)
        return max(0.0, end - self.stream.start)

    def due(self, step: int) -> tuple[float, str]:
        """What should have come in by ``step``, and its unit: grains, or kg."""
        stream, elapsed = self.stream, self._elapsed(step)
        return (stream.count_rate * elapsed, "grains") if stream.count_rate else (stream.mass_rate * elapsed, "kg")

    def shortfall(self, step: int) -> str | None:
        """That it brought less by ``step`` than it should have, in words; None if it kept up from look to look."""
        due, unit = self.due(step)
        came = float(self.count) if unit == "grains" else self.mass
        one = 1.0 if unit == "grains" else self.density * np.pi / 6.0 * self.sizes.extremes[1] ** 3
        rate = due / self._elapsed(step) if due else 0.0
        if due - came <= BEHIND * due + 2.0 * one + rate * self.every * self.dt:
            return None
        return (
            f"streams[{self.number}] brought {came:.4g} {unit} of {due:.4g} {unit}, {came / due:.0%} of its rate: grains or "
            "walls left no room in its box; make it larger or the rate smaller, or give its grains a velocity that clears it"
        )

    def state(self) -> dict:
        """What a checkpoint must hold of it, as JSON."""
        return {
            "generator": self.generator.bit_generator.state, "count": self.count, "mass": self.mass, "waiting": self.waiting,
            "blocked": self.blocked,
        }  # fmt: skip

    def restore(self, state: dict) -> None:
        """Go on from ``state``."""
        self.generator.bit_generator.state = state["generator"]
        self.count, self.mass, self.waiting = state["count"], state["mass"], state["waiting"]
        self.blocked = state["blocked"]
