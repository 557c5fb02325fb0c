"""A grain found on the other side of a wall than where it was: it went through.

A closed mesh keeps each grain inside or outside, as it was when it was first seen. The solid side of an analytic wall keeps
none: there the overlap tells at once, and this says by name when engine.max_overlap lets it pass.
"""

import numpy as np

from warpdem.guards.messages import grain_at, instant
from warpdem.kernels import grain
from warpdem.mesh.triangle_mesh import signed_distance

DEEP = 0.1  # radii beyond a mesh: what rounding of its search tree never makes


class SideGuard:
    """Remembers on which side of each wall the grains of a simulation are."""

    def __init__(self, sim) -> None:
        self.sim = sim
        round_ = any(sim.plan.domain.period)  # a grain that comes round may come in at the other end of a mesh
        self._meshes = [
            number for number, wall in enumerate(sim.scene.walls) if wall.mesh is not None and not wall.open and not round_
        ]
        self._shapes = [
            number
            for number, wall in enumerate(sim.scene.walls)
            if wall.shape is not None and getattr(wall.shape, "sided", True)
        ]
        self._ids = np.zeros(0, dtype=np.int64)
        self._inside = np.zeros((0, len(self._meshes)), dtype=bool)
        self._next = self._ids, self._inside
        if self._meshes and len(sim.state):
            self._note_sides(*self._distances())
            self.remember()

    def look(self) -> str:
        """Which grain is on another side than the one it was first seen on, nothing if none is."""
        sim = self.sim
        if not (self._meshes or self._shapes):
            return ""
        p, wrong = sim.particles, []
        ids, distance = self._distances()
        known = np.isin(ids, self._ids)
        before = np.searchsorted(self._ids, ids[known])
        for column, number in enumerate(self._meshes):
            inwards = np.where(self._inside[before, column], -1.0, 1.0)
            depth = -distance[known, column] * inwards / p.radius[known]
            wrong.append(self._beyond(np.flatnonzero(known), depth, DEEP, number))
        for number in self._shapes:
            height = sim.scene.walls[number].shape.nearest(self._in_body(p.position, number))[1]
            wrong.append(self._beyond(np.arange(len(ids)), -height / p.radius, 1.0, number))
        if self._meshes:
            self._note_sides(ids, distance)
        return next((message for message in wrong if message), "")

    def remember(self) -> None:
        """Compare later looks with the sides of the last one."""
        self._ids, self._inside = self._next

    def arrays(self) -> dict[str, np.ndarray]:
        """What is kept between looks: ids, shape (n,), and whether each is inside each closed mesh, shape (n, meshes)."""
        return {"sides_id": self._ids, "sides_inside": self._inside}

    def restore(self, arrays: dict[str, np.ndarray]) -> None:
        """Take over what ``arrays`` gave."""
        self._ids, self._inside = self._next = arrays["sides_id"], arrays["sides_inside"]

    def _distances(self) -> tuple[np.ndarray, np.ndarray]:
        """Ids in ascending order, shape (n,), and signed distances from each closed mesh [m], shape (n, meshes)."""
        sim = self.sim
        ids, position = sim.state.ids, sim.state.by_id(grain.POSITION)
        found = [
            signed_distance(sim.meshes[sim.scene.walls[number].name], self._in_body(position, number))[0]
            for number in self._meshes
        ]
        return ids, np.stack(found, axis=1) if found else np.zeros((len(ids), 0))

    def _note_sides(self, ids: np.ndarray, distance: np.ndarray) -> None:
        """The sides of grains seen before stay what they were, those of new ones are noted."""
        inside = distance < 0.0
        known = np.isin(ids, self._ids)
        inside[known] = self._inside[np.searchsorted(self._ids, ids[known])]
        self._next = ids, inside

    def _in_body(self, position: np.ndarray, number: int) -> np.ndarray:
        """Positions (n, 3) [m] in the body axes of wall ``number``."""
        body = self.sim.schedule.bodies(self.sim.time)[number]
        return (position - body[9:12]) @ body[:9].reshape(3, 3)

    def _beyond(self, rows: np.ndarray, depth: np.ndarray, allowed: float, number: int) -> str:
        """Which grain is furthest beyond the wall, ``depth`` in radii; nothing if none is more than ``allowed``."""
        beyond = depth > allowed
        if not beyond.any():
            return ""
        sim, worst = self.sim, int(np.argmax(depth))
        return (
            f"{instant(sim)}: {grain_at(sim, int(rows[worst]))} is on the wrong side of the wall "
            f"{sim.scene.walls[number].name!r}, {depth[worst]:.3g} of its radius beyond ({int(beyond.sum())} of {len(depth)} "
            f"grains are). Time step {sim.dt:.3g} s. Take a smaller time.step, or a stiffer material."
        )
