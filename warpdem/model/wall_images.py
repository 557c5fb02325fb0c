"""Which walls act at their periodic images, and the refusal of those that could do so only in part.

Along each periodic axis a wall is one of four:

* the same all along it (a parallel plane, an infinite cylinder about it), or further from both borders than a grain reaches:
  it acts where it stands;
* longer than the domain, beyond both borders by a grain's radius at all times, as a drum's shell may be drawn: it acts as it is
  drawn, for what lies beyond the borders (its lids, say) is meant never to be met;
* a hollow that grains are inside of and that lies between the borders: it acts as it is drawn;
* any other up to the length of the domain and a radius on both sides: it acts at its images too, wherever it goes.

What is none of these is refused with the time and the border at which it would leave grains without a wall.
"""

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model.coefficients import law_gap
from warpdem.model.domain import AXES, Domain
from warpdem.model.schedule import Schedule
from warpdem.scene.model import Scene
from warpdem.scene.shapes.plane import Plane

TIMES = 2001
"""Times at which the motion of a wall is looked at over the run."""
ROUNDING = 1e-9
"""Of a period: what does not count of a length; of 1: what does not count of a direction [-]."""


def wall_images(
    scene: Scene, meshes: dict[str, TriangleMesh], schedule: Schedule, domain: Domain, radius: np.ndarray
) -> np.ndarray | None:
    """Images of a grain from which each wall is seen, a bit for each image of `Domain.images`, shape (w,).

    Args:
        scene: validated scene.
        meshes: triangles of its mesh walls, by name.
        schedule: motions of the walls; the kernels are given places within the domain.
        domain: borders.
        radius: radii of the grains that come to be [m], shape (n,).

    Returns:
        None where all walls act where they stand, whatever comes round.

    Raises:
        SceneError: a wall could act at its periodic images only in part.
    """
    period = np.array(domain.period)
    if not period.any() or not scene.walls:
        return None
    schedule.period = period
    largest = float(radius.max(initial=0.0))
    reach = largest + law_gap(scene, largest)
    times = np.linspace(0.0, scene.time.end, TIMES)
    placements = schedule.wall_places(times)
    images, found, plain = domain.images, [], True
    for number, wall in enumerate(scene.walls):
        repeats = np.zeros(3, bool)
        for k in np.flatnonzero(period):
            kind = _Along(scene, number, meshes.get(wall.name), int(k), domain, times, placements[:, number])
            repeats[k], is_plain = kind.judged(reach)
            plain &= is_plain
        allowed = ((images == 0.0) | repeats).all(axis=1)
        found.append(int((allowed * 2 ** np.arange(len(images))).sum()))
    return None if plain else np.array(found, dtype=np.int64)


class _Along:
    """A wall along one periodic axis."""

    def __init__(
        self, scene: Scene, number: int, mesh: TriangleMesh | None, axis: int, domain: Domain, times: np.ndarray,
        placement: np.ndarray,
    ) -> None:  # fmt: skip
        self.wall, self.mesh, self.times = scene.walls[number], mesh, times
        self.name, self.source = AXES[axis], scene.source
        self.key = f"walls[{number}] ({self.wall.name!r})"
        self.lower, self.length = domain.lower[axis], domain.period[axis]
        self.upper = self.lower + self.length
        self.closed = self._is_closed(scene, axis)
        # coordinate along the axis of a body point x: direction . x + shift
        directions, shift = placement[:, 3 * axis : 3 * axis + 3], placement[:, 9 + axis]
        if np.abs(directions - directions[0]).max() > ROUNDING:
            when = times[int(np.argmax(np.abs(directions - directions[0]).max(axis=1) > ROUNDING))]
            self._refuse(f"turns about another axis at t = {when:.4g} s", "take the periodic border, or the motion, away")
        self.direction, self.shift = directions[0], shift
        extent = self._extent()
        self.low, self.high = extent[0] + shift, extent[1] + shift

    def judged(self, reach: float) -> tuple[bool, bool]:
        """Whether the wall acts at its images, and whether grains that come round have nothing to do with where it ends."""
        wall, slack = self.wall, ROUNDING * self.length
        if wall.shape is not None and wall.shape.is_unchanged_along(self.direction):
            return False, True
        if isinstance(wall.shape, Plane):
            if not self.closed:
                self._refuse(
                    "is a plane across or oblique to it, whose images would fill the domain",
                    "take the periodic border away, or take an open mesh",
                )
            return False, True
        if not np.isfinite([self.low[0], self.high[0]]).all():
            self._refuse(
                "is infinite but not the same all along it", "give it ends (length; end of a cone), or take an open mesh"
            )
        if wall.shape is not None and wall.shape.is_hollow:
            self._require(
                (self.low >= self.lower - slack) & (self.high <= self.upper + slack),
                "grains are inside of it, and it reaches beyond",
                "move it between the borders, or take a closed mesh",
            )
            return False, True
        if (self.low >= self.lower + reach).all() and (self.high <= self.upper - reach).all():
            return False, True
        beyond = (self.low <= self.lower - reach + slack) & (self.high >= self.upper + reach - slack)
        if beyond.all():
            return False, False
        if self.high[0] - self.low[0] > self.length + 2.0 * reach + slack:
            self._require(
                beyond,
                f"is {self.high[0] - self.low[0]:.4g} m long, and no longer reaches beyond both by a grain's radius "
                f"({reach:.4g} m)",
                f"draw it longer, or at most {self.length:.4g} m long: then it acts at its periodic images",
            )
        gone = self.shift - self.shift[0]
        gone = gone - self.length * np.rint(gone / self.length)
        low, high = self.low[0] + gone.min(), self.high[0] + gone.max()
        if low < self.lower - self.length - slack or high > self.upper + self.length + slack:
            self._refuse(
                f"stands at {self.name} = {self.low[0]:.4g} to {self.high[0]:.4g} m, far beyond", "draw it between the borders"
            )
        return True, False

    def _extent(self) -> tuple[float, float]:
        """Least and greatest coordinate along the axis of the wall's body [m]."""
        if self.mesh is not None:
            along = self.mesh.vertices @ self.direction
            return float(along.min()), float(along.max())
        assert self.wall.shape is not None
        return self.wall.shape.extent(self.direction)

    def _is_closed(self, scene: Scene, axis: int) -> bool:
        """Whether two planes that rest keep all grains away from the borders."""
        sides, slack = set(), ROUNDING * self.length
        for wall in scene.walls:
            if isinstance(wall.shape, Plane) and wall.motion is None and wall.fixed_to == "frame":
                along, place = wall.shape.normal[axis], wall.shape.point[axis]
                if abs(along) > 1.0 - ROUNDING and self.lower - slack <= place <= self.upper + slack:
                    sides.add(along > 0.0)
        return len(sides) == 2

    def _require(self, sound: np.ndarray, what: str, remedy: str) -> None:
        """Refuse the wall at the first of these times at which it is not sound."""
        if not sound.all():
            first = int(np.argmin(sound))
            here = f"{self.name} = {self.low[first]:.6g} to {self.high[first]:.6g} m"
            self._refuse(f"{what}: at t = {self.times[first]:.4g} s it stands at {here}", remedy)

    def _refuse(self, what: str, remedy: str) -> None:
        raise SceneError(
            f"{self.source}: {self.key} and the periodic borders of {self.name} ({self.lower:g} and {self.upper:g} m): "
            f"the wall {what}; {remedy}"
        )
