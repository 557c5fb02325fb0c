"""A grain found on the other side of a wall than where it was: it went through.

A closed mesh keeps each grain inside or outside, as it was when it was first seen. The solid side of an analytic wall keeps
none: there the overlap tells at once, and this says by name when engine.max_overlap lets it pass.
"""

import numpy as np

from warpdem.guards.words import grain_at, instant
from warpdem.kernels import grain
from warpdem.mesh.geometry import signed_distance

DEEP = 0.1  # radii beyond a mesh: what rounding of its search tree never makes


class SideGuard:
    """Remembers on which side of each wall the grains of a simulation are."""

    def __init__(self, sim) -> None:
        self.sim = sim
        round_ = any(sim.plan.period)  # a grain that comes round may come in at the other end of a mesh
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
        if self._meshes and len(sim.state):
            self._remember(*self._distances())

    def look(self) -> None:
        """Compare the side of every grain with the one that it was first seen on.

        Raises:
            StabilityError: one has passed.
        """
        sim = self.sim
        if not (self._meshes or self._shapes):
            return
        p = sim.particles
        ids, distance = self._distances()
        known = np.isin(ids, self._ids)
        before = np.searchsorted(self._ids, ids[known])
        for column, number in enumerate(self._meshes):
            inwards = np.where(self._inside[before, column], -1.0, 1.0)
            depth = -distance[known, column] * inwards / p.radius[known]
            self._tell(np.flatnonzero(known), depth, DEEP, number)
        for number in self._shapes:
            height = sim.scene.walls[number].shape.nearest(self._in_body(p.position, number))[1]
            self._tell(np.arange(len(ids)), -height / p.radius, 1.0, number)
        if self._meshes:
            self._remember(ids, distance)

    def _distances(self) -> tuple[np.ndarray, np.ndarray]:
        """Ids in ascending order, shape (n,), and signed distances from each closed mesh [m], shape (n, meshes)."""
        sim = self.sim
        ids, position = np.sort(sim.state.id.numpy()), sim.state.by_id(grain.POSITION)
        found = [
            signed_distance(sim.meshes[sim.scene.walls[number].name], self._in_body(position, number))[0]
            for number in self._meshes
        ]
        return ids, np.stack(found, axis=1) if found else np.zeros((len(ids), 0))

    def _remember(self, ids: np.ndarray, distance: np.ndarray) -> None:
        """Keep the sides of grains seen before, and note those of new ones."""
        inside = distance < 0.0
        known = np.isin(ids, self._ids)
        inside[known] = self._inside[np.searchsorted(self._ids, ids[known])]
        self._ids, self._inside = ids, inside

    def _in_body(self, position: np.ndarray, number: int) -> np.ndarray:
        """Positions (n, 3) [m] in the body axes of wall ``number``."""
        body = self.sim.schedule.bodies(self.sim.time)[number]
        return (position - body[9:12]) @ body[:9].reshape(3, 3)

    def _tell(self, rows: np.ndarray, depth: np.ndarray, allowed: float, number: int) -> None:
        """Notice the grain that is furthest beyond the wall, ``depth`` in radii."""
        beyond = depth > allowed
        if not beyond.any():
            return
        sim, worst = self.sim, int(np.argmax(depth))
        sim.guards.notice(
            "side",
            f"{instant(sim)}: {grain_at(sim, int(rows[worst]))} is on the wrong side of the wall "
            f"{sim.scene.walls[number].name!r}, {depth[worst]:.3g} of its radius beyond ({int(beyond.sum())} of {len(depth)} "
            f"grains are). Time step {sim.dt:.3g} s. Take a smaller time.step, or a stiffer material.",
        )
