"""An inlet: the grains that a stream inserts while a run goes on, how many are due at a step and where they fit."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from warpdem.errors import SceneError
from warpdem.filling.inlet_walls import InletWalls
from warpdem.filling.stream_amount import brought_by, highest_rate, next_portion, total_of
from warpdem.filling.stream_place import StreamPlace
from warpdem.filling.stream_portions import Drawn, Spheres, extremes_of, portions_of
from warpdem.scene.model import Scene

TRIES = 60  # random positions tried for one grain before it has to wait
BEHIND = 0.02  # missing fraction of the grains due [-] above which a warning is given at the end
LEAST_EVENT_STEPS = (
    16  # least steps between two insertions: each one that inserts grains rebuilds the contact lists
)


class Insertion(NamedTuple):
    """Grains and clumps that are inserted at a step."""

    position: np.ndarray
    """Centers in frame axes [m], shape (k, 3)."""
    drawn: list[Drawn]
    """What was drawn of each (``PortionBodies.draw``)."""
    portion: np.ndarray
    """Portion of the recipe that each is of, shape (k,)."""
    axes: np.ndarray | None
    """Of the region in frame axes, shape (3, 3); None where they are those of the frame."""


class Inlet:
    """One stream in a run.

    Attributes:
        count: number of inserted grains, a clump is one.
        mass: their mass [kg].
        every: steps between two looks.
        blocked: whether a grain that is due found no free position at the last insertion.
        group: group of each portion.
        type: material of each portion.
        bodies: what each portion inserts.

    Args:
        number: Number of the stream.
        scene: Validated scene.
        dt: Time step [s].
        place: Where its region is.
        walls: The walls beside it; None for none.
    """

    def __init__(
        self, number: int, scene: Scene, dt: float, place: StreamPlace, walls: InletWalls | None = None
    ) -> None:
        self.number, self.place, self.walls = number, place, walls
        self.stream = stream = scene.streams[number]
        self.dt = dt
        self.group = [scene.groups.index(name) for name in scene.stream_groups(number)]
        self.type = [list(scene.materials).index(portion.material) for portion in stream.portions]
        self.bodies = portions_of(scene, stream)
        self.generator = np.random.default_rng(stream.seed)
        self.count, self.mass = 0, 0.0
        self.earlier = 0.0  # of the total, what it inserted in the runs before that this one continues
        self.brought = [0.0] * len(stream.portions)  # of each portion, grains [-] or mass [kg]
        self.waiting: Drawn = None  # what was drawn of the next grain or clump
        fall = float(np.linalg.norm(scene.gravity))
        self.extremes = smallest, largest = extremes_of(self.bodies)
        _check_size(scene, number, largest)
        self.blocked = False
        mass = self._least_mass(smallest)
        # until ten grains are due
        ten = 10.0 * (1.0 if stream.count_rate else mass) / highest_rate(stream)
        times = [ten] if ten else []
        # until the region is free again
        times += [smallest / stream.moved] if stream.moved else [np.sqrt(2.0 * smallest / fall)] if fall else []
        self.every = max(LEAST_EVENT_STEPS, int(min(times, default=0.0) / dt))
        self.first = int(np.ceil(stream.start / dt - 1e-9))

    @property
    def is_complete(self) -> bool:
        """Whether it has brought its total."""
        if self.stream.count is not None:
            return self.count + self.earlier >= self.stream.count
        return self.stream.mass is not None and self.stream.mass - self.mass - self.earlier < 0.5 * self._next_mass()

    def next_event(self, step: int) -> int | None:
        """The first step after ``step`` at which grains may be inserted; None if there is none."""
        after = self.first if step < self.first else self.first + ((step - self.first) // self.every + 1) * self.every
        late = self.stream.until is not None and after * self.dt > self.stream.until + self.every * self.dt
        return None if late or self.is_complete else after

    def is_event(self, step: int) -> bool:
        """Whether grains may be inserted at ``step``."""
        return step >= self.first and (step - self.first) % self.every == 0

    def beside(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Middle and half sizes [m] of the box that no grain reaches into which is not beside the region at ``step``."""
        low, high = self.place.at(step * self.dt).bounds
        return 0.5 * (low + high), 0.5 * (high - low) + 0.5 * self.extremes[1]

    def insert(
        self, step: int, position: np.ndarray, radius: np.ndarray, nearest: Callable[[np.ndarray], np.ndarray]
    ) -> Insertion:
        """The grains that are inserted at ``step``.

        Args:
            step: the present step.
            position: centers of the present grains, shape (n, 3).
            radius: their radii, shape (n,).
            nearest: maps separations (n, 3) [m] to those of the nearest periodic images.
        """
        stream, place = self.stream, self.place.at(step * self.dt)
        due = brought_by(stream, step * self.dt)
        walls = self.walls.at(step * self.dt) if self.walls is not None else []
        middle, half = self.beside(step)
        beside = (np.abs(nearest(position - middle)) < half + radius[:, None]).all(axis=1)
        near, size = [position[beside]], [radius[beside]]
        axes = None if place.axes is None else place.axes[0]
        positions, all_drawn, portions = [], [], []
        self.blocked = False
        while not self.is_complete:
            mass, portion = self._next_mass(), self._portion()
            if due - (self.count if stream.count_rate else self.mass) < (1.0 if stream.count_rate else mass):
                break
            body, drawn = self.bodies[portion], self.waiting
            there, sizes = np.concatenate(near), np.concatenate(size)
            met = walls if self.walls is None else self.walls.met(walls, portion)
            for _ in range(TRIES):
                candidate = place.random_point(self.generator, body.reach(drawn))
                if candidate is None:
                    continue
                centers, radii = body.grains(drawn, candidate, axes)
                if not all(_is_clear(center, r, there, sizes, nearest) for center, r in zip(centers, radii, strict=True)):
                    continue
                if all((wall.gap(centers, radii) >= 0.0).all() for wall in met):
                    break
            else:
                self.blocked = True
                break
            near.append(centers)
            size.append(radii)
            positions.append(candidate)
            all_drawn.append(drawn)
            portions.append(portion)
            self.count, self.mass, self.waiting = self.count + 1, self.mass + mass, None
            self.brought[portion] += mass if stream.by_mass else 1.0
        return Insertion(np.array(positions).reshape(-1, 3), all_drawn, np.array(portions, dtype=int), axes)

    def _portion(self) -> int:
        """Portion that the next grain is of."""
        return next_portion(self.stream, self.brought)

    def _next_mass(self) -> float:
        """Mass of the next grain or clump [kg], which is drawn where it is not known yet."""
        body = self.bodies[self._portion()]
        if self.waiting is None:
            self.waiting = body.draw(self.generator)
        return body.mass(self.waiting)

    def _least_mass(self, smallest: float) -> float:
        """Least mass of a body [kg], of spheres as if those of the least density were the smallest."""
        spheres = [one.density for one in self.bodies if isinstance(one, Spheres)]
        clumps = [one.mean_mass for one in self.bodies if not isinstance(one, Spheres)]
        return min([*clumps, *([min(spheres) * np.pi / 6.0 * smallest**3] if spheres else [])])

    def _largest_mass(self) -> float:
        """Largest mass of a body [kg], likewise."""
        spheres = [one.density for one in self.bodies if isinstance(one, Spheres)]
        clumps = [one.mean_mass for one in self.bodies if not isinstance(one, Spheres)]
        return max([*clumps, *([max(spheres) * np.pi / 6.0 * self.extremes[1] ** 3] if spheres else [])])

    def due(self, step: int) -> tuple[float, str]:
        """What should have been inserted by ``step``, and its unit: grains, or kg."""
        stream, due = self.stream, brought_by(self.stream, step * self.dt)
        if stream.count_rate or stream.mass_rate:
            counted, total = stream.count_rate is not None, np.inf
            if (stream.count is not None) == counted:
                total = total_of(stream) - self.earlier
            return min(due, total), "grains" if counted else "kg"
        return min(due, total_of(stream) - self.earlier), "kg" if stream.count is None else "grains"

    def shortfall(self, step: int) -> str | None:
        """Message that it inserted less by ``step`` than it should have; None if it kept up."""
        due, unit = self.due(step)
        if self.is_complete:
            return None
        inserted = float(self.count) if unit == "grains" else self.mass
        one = 1.0 if unit == "grains" else self._largest_mass()
        rate = highest_rate(self.stream) if np.isfinite(highest_rate(self.stream)) else 0.0
        if due - inserted <= BEHIND * due + 2.0 * one + rate * self.every * self.dt:
            return None
        return (
            f"streams[{self.number}] inserted {inserted:.4g} {unit} of {due:.4g} {unit}, {inserted / due:.0%} of its rate: "
            f"grains or walls left no space in its {self.stream.shape_key}; make it larger or the rate smaller, or give its "
            "grains a velocity that clears it"
        )

    def state(self) -> dict[str, Any]:
        """What a checkpoint must hold of it, as JSON."""
        return {
            "generator": self.generator.bit_generator.state, "count": self.count, "mass": self.mass, "waiting": self.waiting,
            "blocked": self.blocked, "brought": self.brought, "earlier": self.earlier,
        }  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from ``state``."""
        self.generator.bit_generator.state = state["generator"]
        self.count, self.mass, self.waiting = state["count"], state["mass"], state["waiting"]
        self.blocked, self.brought, self.earlier = state["blocked"], list(state["brought"]), state["earlier"]

    def go_on(self, state: dict[str, Any]) -> None:
        """Continue a stream of the run before, which ended with ``state``: here its grains are counted from 0."""
        inserted = state["count"] if self.stream.count is not None else state["mass"]
        self.restore({**state, "count": 0, "mass": 0.0, "earlier": state["earlier"] + inserted})


def _is_clear(
    center: np.ndarray, radius: float, there: np.ndarray, sizes: np.ndarray, nearest: Callable[[np.ndarray], np.ndarray]
) -> bool:
    """Whether a grain touches none of those of radius ``sizes`` at ``there`` [m]."""
    separation = nearest(there - center)
    return bool((np.einsum("ij,ij->i", separation, separation) >= (sizes + radius) ** 2).all())


def _check_size(scene: Scene, number: int, largest: float) -> None:
    """Refuse a region thinner than a clump, whose size only its template says; that of spheres the scene has checked.

    Raises:
        SceneError: The clump cannot be in the region in every direction.
    """
    stream = scene.streams[number]
    key = stream.shape_key
    if key in ("box", "cylinder", "sphere", "disk"):
        what, size = getattr(stream, key).thinnest
        if size < largest:
            raise SceneError(
                f"{scene.source}: streams[{number}].{key}: its {what} of {size:g} m must be at least the length of the largest "
                f"clump, {largest:g} m"
            )
