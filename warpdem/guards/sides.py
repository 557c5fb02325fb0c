"""Grains that went through a wall: on the other side of a closed mesh, or behind an analytic wall.

A closed mesh keeps each grain inside or outside, as it was at the first look at it. At an analytic wall nothing is kept: only a
grain whose centre is more than its radius behind the wall is reported. The overlap guard normally stops such a run before.
"""

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from warpdem.guards.known_sides import KnownSides
from warpdem.guards.verdict import Verdict, at_time, grain_at
from warpdem.kernels import grain
from warpdem.kernels.measure import readings as kernels
from warpdem.kernels.step.schedule import Placement
from warpdem.measure.part import Part
from warpdem.measure.totals import Totals
from warpdem.mesh.triangle_mesh import TriangleMesh, signed_distance
from warpdem.state.view import RunView

ALLOWED = 1.0  # radii behind an analytic wall
ROUNDING = 1.0e-6  # of a distance over a radius, far from the origin too
DEEP = 0.1  # radii beyond a mesh: more than the rounding of its search tree can cause


class SideGuard:
    """Remembers on which side of each wall the grains of a run are.

    Args:
        view: the run before its first step.
    """

    NAME = "side"

    def __init__(self, view: RunView) -> None:
        walls = list(enumerate(view.model.scene.walls))
        # a grain that crosses a periodic border may come in at the other end of a mesh
        closed = not view.model.features.domain.periodic
        self._meshes = [number for number, wall in walls if wall.mesh is not None and not wall.open and closed]
        self._shapes = [
            number for number, wall in walls if wall.shape is not None and wall.shape.sided
        ]
        self._known: dict[int, KnownSides] = {}
        self._ids = np.zeros(0, dtype=np.int64)
        self._inside = np.zeros((0, len(self._meshes)), dtype=bool)
        self._next = self._ids, self._inside
        if self._meshes and len(view.state):
            self._note_sides(*self._distances(view))
            self.remember()

    def look(self, view: RunView, now: Totals) -> Verdict | None:
        """Which grain is on another side than the one it was first seen on, None if none is."""
        # what is no number is no less than anything: it must be looked at, on whichever rank it is
        behind = self._shapes and not np.max(now.each(furthest_behind)) <= ALLOWED - ROUNDING
        if not (self._meshes or behind):
            return None
        view.gather()
        wrong = []
        position, radius = view.state.by_id(grain.POSITION), view.state.by_id(grain.RADIUS)
        ids, distance = self._distances(view)
        known = np.isin(ids, self._ids)
        before = np.searchsorted(self._ids, ids[known])
        kind = view.state.material.numpy()[view.state.rank]
        for column, number in enumerate(self._meshes):
            inwards = np.where(self._inside[before, column], -1.0, 1.0)
            touches = view.model.scene.touched(kind[known], number)
            depth = np.where(touches, -distance[known, column] * inwards / radius[known], 0.0)
            if (depth > DEEP).any():  # a message gives the distance itself
                mesh = view.model.meshes[view.model.scene.walls[number].name]
                exact = -_searched(mesh, _in_body(view, position[known], number)) * inwards / radius[known]
                depth = np.where(touches, exact, 0.0)
            wrong.append(self._beyond(view, np.flatnonzero(known), depth, DEEP, number))
        for number in self._shapes if behind else ():
            shape = view.model.scene.walls[number].shape
            assert shape is not None
            height = shape.nearest(_in_body(view, position, number))[1]
            depth = np.where(view.model.scene.touched(kind, number), -height / radius, 0.0)
            wrong.append(self._beyond(view, np.arange(len(ids)), depth, ALLOWED, number))
        if self._meshes:
            self._note_sides(ids, distance)
        return next((verdict for verdict in wrong if verdict is not None), None)

    def remember(self) -> None:
        """Compare later looks with the sides of the last one."""
        self._ids, self._inside = self._next

    def arrays(self) -> dict[str, np.ndarray]:
        """What is kept between looks: ids, shape (n,), and whether each is inside each closed mesh, shape (n, meshes)."""
        return {"sides_id": self._ids, "sides_inside": self._inside}

    def restore(self, arrays: Mapping[str, Any]) -> None:
        """Take over what ``arrays`` gave."""
        self._ids, self._inside = self._next = arrays["sides_id"], arrays["sides_inside"]

    def _distances(self, view: RunView) -> tuple[np.ndarray, np.ndarray]:
        """Ids in ascending order, shape (n,), and signed distances from each closed mesh [m], shape (n, meshes).

        Within ``DEEP`` radii of a surface they are exact, beyond of the right sign (``known_sides``).
        """
        model, state = view.model, view.state
        ids, position = state.ids, state.by_id(grain.POSITION)
        exactly = DEEP * state.by_id(grain.RADIUS)
        found = []
        for number in self._meshes:
            if number not in self._known:
                mesh = model.meshes[model.scene.walls[number].name]
                bounds = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
                cell = 2.0 * float(exactly.mean()) / DEEP
                self._known[number] = KnownSides(bounds, cell, functools.partial(_searched, mesh))
            found.append(self._known[number].distances(_in_body(view, position, number), exactly))
        return ids, np.stack(found, axis=1) if found else np.zeros((len(ids), 0))

    def _note_sides(self, ids: np.ndarray, distance: np.ndarray) -> None:
        """The sides of grains seen before stay what they were, those of new ones are noted."""
        inside = distance < 0.0
        known = np.isin(ids, self._ids)
        inside[known] = self._inside[np.searchsorted(self._ids, ids[known])]
        self._next = ids, inside

    def _beyond(
        self, view: RunView, rows: np.ndarray, depth: np.ndarray, allowed: float, number: int
    ) -> Verdict | None:
        """Which grain is furthest beyond the wall, ``depth`` in radii; None if none is more than ``allowed``."""
        beyond = depth > allowed
        if not beyond.any():
            return None
        worst = int(np.argmax(depth))
        wall = view.model.scene.walls[number].name
        return Verdict(
            self.NAME,
            f"{at_time(view.clock)}: {grain_at(view.state, int(rows[worst]))} is on the wrong side of the wall "
            f"{wall!r}, {depth[worst]:.3g} of its radius beyond ({int(beyond.sum())} of "
            f"{len(depth)} grains are). Time step {view.clock.dt:.3g} s. {_remedy(view.model.meshes.get(wall))}",
        )


def _remedy(mesh: TriangleMesh | None) -> str:
    """What to do about a grain on the wrong side."""
    if mesh is None or not mesh.folded_edges:
        return "Take a smaller time.step, or a stiffer material."
    return (
        f"Its surface folds back onto itself at {mesh.folded_edges} edges, and near them the sides are not defined: mend "
        f"{mesh.name} (the notes of check say where), or add open = true to this wall, and no sides are watched."
    )


def _searched(mesh: TriangleMesh, points: np.ndarray) -> np.ndarray:
    """Signed distances of points (n, 3) of its body axes [m] from a mesh [m], shape (n,)."""
    return signed_distance(mesh, points)[0]


def furthest_behind(part: Part) -> float:
    """The most that any grain of a process is behind an analytic wall that has a solid side, in its radii."""
    walls, state, reader = part.view.model.walls, part.view.state, part.reader
    assert walls is not None
    bodies: wp.array = wp.array(part.bodies, dtype=Placement, device=part.view.model.device)
    most = reader.buffer("behind", (reader.rows, 1), wp.float64)
    most.fill_(-np.inf)
    reader.add(kernels.furthest_behind, state.owned, reader.plain("record", state.record), walls.surface, bodies, most)
    return float(most.numpy().max())


def _in_body(view: RunView, position: np.ndarray, number: int) -> np.ndarray:
    """Positions (n, 3) [m] in the body axes of wall ``number``."""
    body = view.model.schedule.bodies(view.clock.time)[number]
    # for so narrow a product BLAS takes longer to share it among threads than to compute it
    return np.einsum("ij,jk->ik", position - body[9:12], body[:9].reshape(3, 3))
