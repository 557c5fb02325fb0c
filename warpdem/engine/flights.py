"""Which grains are in flight: fast ones for which the lists would be rebuilt though nothing is near them.

``kernels.lists.flight`` defines a flight and says why the lists stay valid. The host assigns paths when the lists would be
rebuilt sooner than usual, to the grains with the largest displacement; where that does not help, it tries less and less
often. Where every wall moves, the lists follow the walls and use no position in frame axes: then no grain flies. None flies
either where walls act at their periodic images, which paths do not take into account, nor where walls move by the load on
them, which nobody knows beforehand.
"""

from collections.abc import Callable

import numpy as np
import warp as wp

from warpdem.engine.batch import Batch
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.list_structs import put, rows_of
from warpdem.engine.program import Launch
from warpdem.kernels import grain
from warpdem.kernels.lists.displacement import INNER, OFF_PATH, OUTER
from warpdem.kernels.lists.flight import BLOCK
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.lists.rebuild import HASTY
from warpdem.state.particles import changed

ALLOWANCE = 0.125  # how far a grain may be off its path, over the skin [-]
LEAST_STEPS = 8  # that a path must be good for
MAX_PATH_ENDS_PER_STEP = 1.0 / 16.0  # paths that end per step, of all grains in flight: with more, new lists are cheaper
MAX_PAIRS, MAX_PAIRS_AFTER_REBUILD = 500_000, 8_000_000  # pairs of grains in flight checked for new paths, and for all again
ROUNDS = 4  # of assigning paths, each without those that the one before found too short
LONGEST_WAIT = 64  # list builds without another try, after tries that did not help
LONGEST = 2**17  # steps of a path


class Flights:
    """The grains in flight; the path of each is in ``ContactLists.flight``.

    Args:
        lists: the lists that paths are checked against.
        batch: schedule of the steps ahead.
        launch: how kernels are launched.

    Attributes:
        slots: of those in flight.
        laid: how often paths were assigned.
    """

    def __init__(self, lists: ContactLists, batch: Batch, launch: Launch) -> None:
        self.lists, self.batch, self.launch = lists, batch, launch
        self.model, self.state, self.clock, self.pool = lists.model, lists.state, lists.clock, lists.pool
        self._none = wp.zeros(0, dtype=Flight, device=self.model.device)
        self._failed = self._wait = 0
        self.laid = 0
        self.clear_paths()

    def clear_paths(self) -> None:
        """No grain is in flight any more: the lists are rebuilt."""
        self.lists.flight, self.slots = self._none, np.zeros(0, dtype=np.int64)

    def wanted_before(self) -> int:
        """Steps before which a device shall not build an outer list by itself."""
        return HASTY if self._possible and not self._wait else 0

    @property
    def _possible(self) -> bool:
        walls, clumps = self.model.features.walls, self.model.features.contact.clumps  # whose members fly along no parabola
        return self.model.features.frame.tracked and not walls.images and not walls.dynamic and not clumps

    def _now(self) -> tuple[int, float]:
        """Row of the placements at present, and the step."""
        base, _ = self.batch.row()
        return (base + 1) * self.batch.stages, float(self.clock.step_number)

    def take(self, stray: np.ndarray, hasty: bool) -> tuple[np.ndarray, np.ndarray]:
        """Assign paths to grains with large displacements, if that helps.

        Args:
            stray: what ``check_lists`` found of each grain that the lists know, shape (n,).
            hasty: whether lists would be rebuilt sooner than usual.

        Returns:
            ``stray`` without those that fly, and the slots of those that had to.
        """
        must = (stray & (INNER | OUTER | OFF_PATH)) > 0
        lost = np.flatnonzero(stray & OFF_PATH)
        self.list_built()
        none = np.zeros(0, dtype=np.int64)
        if not self._possible or not must.any() or not (len(lost) or (hasty and not self._wait)):
            return stray, none
        if len(lost) and (self.lists.flight.numpy().reshape(-1, 12)[lost, 10] > self.clock.step_number - LEAST_STEPS).any():
            self._failed += 1  # not free at all
            self._wait = min(2**self._failed, LONGEST_WAIT)
            return stray, none
        wanted = np.flatnonzero(stray)
        if not hasty or len(wanted) * (len(wanted) + len(self.slots)) > MAX_PAIRS:
            wanted = np.flatnonzero(must)
        flying = self.assign_paths(wanted, must)
        stray = stray.copy()
        stray[flying] = 0
        helped = not (stray & (INNER | OUTER | OFF_PATH)).any()
        self._failed = 0 if helped else self._failed + 1
        self._wait = 0 if helped else min(2**self._failed, LONGEST_WAIT)
        return stray, np.flatnonzero(must)

    def list_built(self) -> None:
        """Count a list build: after some of them another try may help."""
        self._wait = max(self._wait - 1, 0)

    def reassign_paths(self, wanted: np.ndarray) -> None:
        """Assign paths again after a rebuild, unless that has not helped lately."""
        if self._failed <= 1 and len(self.assign_paths(wanted, pairs=MAX_PAIRS_AFTER_REBUILD)) == len(wanted):
            self._failed = self._wait = 0

    def assign_paths(self, wanted: np.ndarray, must: np.ndarray | None = None, pairs: int = MAX_PAIRS) -> np.ndarray:
        """Assign paths from the present positions.

        Args:
            wanted: slots of the grains that are to fly.
            must: those without which it is no use, as a mask of all grains, shape (n,).
            pairs: of grains in flight that may be looked at.

        Returns:
            Slots of those of ``wanted`` that fly now.
        """
        model, lists = self.model, self.lists
        others = np.setdiff1d(self.slots, wanted)
        none = np.zeros(0, dtype=np.int64)
        if not len(wanted) or len(wanted) * (len(wanted) + len(others)) > pairs:
            return none
        self.laid += 1
        n, now = lists.known, float(self.clock.step_number)
        path = np.full((n, 12), -1.0)
        path[: lists.flight.shape[0]] = lists.flight.numpy().reshape(-1, 12)  # it has no row for newcomers yet
        path[wanted] = self._from_here(wanted)
        lists.flight = wp.array(path, dtype=Flight, device=model.device)
        steps_of = self._steps_of_paths()
        needed = wanted[must[wanted]] if must is not None else none
        if 0 < len(needed) < len(wanted):
            found = steps_of(needed, np.union1d(wanted, others))
            if (found < LEAST_STEPS).any() or (1.0 / found).sum() > MAX_PATH_ENDS_PER_STEP:
                path[wanted, 11] = -1.0  # without these it is no use: the others need not be looked at
                wanted = none
        found = none
        for _ in range(ROUNDS if len(wanted) else 0):
            found = steps_of(wanted, np.union1d(wanted, others))
            good = found >= LEAST_STEPS
            ends = (1.0 / found[good]).sum() + (1.0 / np.maximum(path[others, 11] - now, 1.0)).sum()
            if ends > MAX_PATH_ENDS_PER_STEP or (must is not None and must[wanted[~good]].any()):
                good[:] = False
            if good.all():
                break
            path[wanted[~good], 11] = -1.0
            wanted = wanted[good]
            lists.flight = wp.array(path, dtype=Flight, device=model.device)
            if not len(wanted):
                break
        else:
            path[wanted, 11] = -1.0
            wanted, found = wanted[:0], found[:0]
        if len(wanted):
            path[wanted, 11] = now + found - (2 if self.batch.stages > 1 else 0)  # its stages look ahead
        self.slots = np.flatnonzero(path[:, 11] >= 0.0)
        lists.flight = wp.array(path, dtype=Flight, device=model.device) if len(self.slots) else self._none
        self.drop_reference()
        return wanted

    def _steps_of_paths(self) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Gives steps for which the paths of some grains hold from now on, from their slots and those of all in flight."""
        model, lists, record, kernels = self.model, self.lists, self.state.record, self.model.kernels.paths
        blocks = -(-lists.known // BLOCK)
        low, high = (self.pool.buffer(name, (blocks,), wp.vec3d) for name in ("box_low", "box_high"))
        row, now = self._now()
        longest, fastest = self._walls_ahead()
        others = put(
            kernels.OtherGrains(), record=record, reference=lists.outer_reference, flight=lists.flight, low=low, high=high,
            rows=rows_of(lists.outer),
        )  # fmt: skip
        walls = put(
            kernels.WallsAhead(), placements=self.batch.control.placement, row=row, fastest=fastest, watched=self.batch.watched
        )
        if model.walls is not None:
            put(walls, surface=model.walls.surface, trees=model.walls.trees)
            put(walls, wall_contacts=lists.wall_contacts, near_feature=lists.near_feature)

        def steps_of(some: np.ndarray, flying: np.ndarray) -> np.ndarray:
            known = lists.outer_reference, lists.flight, lists.outer.allowance
            self.launch(kernels.enclose, blocks, record, *known, low, high)
            slots, all_slots = (self.pool.upload(s.astype(np.int32), wp.int32) for s in (some, flying))
            steps = self.pool.zeros(len(some), wp.int32)
            put(others, flyer=all_slots, flight=lists.flight)
            self.launch(kernels.steps_of_paths, len(some), slots, now, longest, others, walls, model.dt, steps)
            return steps.numpy()

        return steps_of

    def _from_here(self, slots: np.ndarray) -> np.ndarray:
        """Paths of free fall, without end, shape (k, 12)."""
        dt = self.model.dt
        record = self.state.record.numpy()[slots]
        place, velocity = record[:, grain.POSITION], record[:, grain.VELOCITY]
        row = self.model.schedule.rows(self.clock.step_number, 0)[0]
        fall = np.tile(row[2:5], (len(slots), 1))
        ahead = place + dt * (velocity + dt * fall)  # its place at the next step, if nothing holds it
        ahead = ahead + ahead @ row[5:14].reshape(3, 3).T + row[14:17]
        velocity = (ahead - place) / dt - 0.5 * dt * fall
        numbers = np.tile([ALLOWANCE * self.lists.skin, float(self.clock.step_number), 1.0e300], (len(slots), 1))
        return np.concatenate([place, velocity, fall, numbers], axis=1)

    def _walls_ahead(self) -> tuple[int, wp.array]:
        """Steps for which the positions of the walls are known, and how fast each motion is until then."""
        dt, moving = self.model.dt, self.model.features.walls.moving
        speeds, longest = np.zeros((max(len(self.model.schedule.motions), 1), 2)), LONGEST
        if moving:
            there = self.batch.placements_ahead()[:, :moving]
            longest = len(there) - 1
            turn, shift = there[..., :9].reshape(*there.shape[:2], 3, 3), there[..., 9:12]
            step = turn[1:] @ np.swapaxes(turn[:-1], -1, -2)
            spin = np.sqrt(((step - np.eye(3)) ** 2).sum(axis=(-1, -2)))
            displacement = shift[1:] - (step @ shift[:-1, ..., None])[..., 0]
            speeds[:moving, 0] = np.sqrt((displacement**2).sum(axis=-1)).max(axis=0, initial=0.0) / dt
            speeds[:moving, 1] = spin.max(axis=0, initial=0.0) / dt
        return longest, wp.array(1.001 * speeds, dtype=wp.vec2d, device=self.model.device)

    def end_paths(self) -> None:
        """All paths end with the present step: what they were checked against moves otherwise from now on."""
        if len(self.slots):
            path = self.lists.flight.numpy().reshape(-1, 12).copy()
            path[self.slots, 11] = float(self.clock.step_number)
            self.lists.flight.assign(path)

    def drop_reference(self) -> None:
        """Grains in flight have a path instead of a reference position."""
        lists, slots = self.lists, self.slots
        if len(slots):
            for reference in (lists.outer_reference, lists.reference):
                if reference.shape[0] == lists.known:
                    with changed(reference) as values:
                        values[slots] = np.inf  # far from every position, so that the path is always checked

    def leave(self, removed: np.ndarray) -> None:
        """Grains in slots ``removed`` have left the domain."""
        if len(self.slots) and np.isin(removed, self.slots).any():
            self.slots = np.setdiff1d(self.slots, removed)
            path = self.lists.flight.numpy().reshape(-1, 12).copy()
            path[removed, 11] = -1.0
            self.lists.flight.assign(path)
