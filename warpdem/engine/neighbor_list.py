"""When lists are built: a neighbor list is valid until a grain has moved too far, was inserted, or has left.

Two lists: the outer one holds pairs closer than the allowances of both grains, the inner one, which the forces go through,
those of them that are closer than a share of that. The launches of a build are in ``program``.
"""

from collections.abc import Callable
from enum import Enum, auto

import numpy as np

from warpdem.core.timers import Timers
from warpdem.engine.batch import Batch
from warpdem.engine.buffers import BufferPool
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.flights import Flights
from warpdem.engine.host_build import Found, HostBuild
from warpdem.engine.leavers import Leavers
from warpdem.engine.newcomers import Newcomers
from warpdem.engine.stops import not_finite
from warpdem.kernels.contact.films import FILM_AT, RELEASED
from warpdem.kernels.contact.liquid import COUNT
from warpdem.kernels.lists.displacement import FAST, INNER, INNER_HALF, NOT_FINITE, OFF_PATH, OUTER, OUTER_HALF
from warpdem.kernels.step.motion import BEYOND
from warpdem.kernels.wall import record as wall_record
from warpdem.model.model import Model
from warpdem.state.clock import Clock
from warpdem.state.particles import State, changed

INNER_STEPS = (30, 100)  # steps between two inner lists that their share is steered to
OUTER_STEPS = 120  # steps between two outer lists below which the skin grows (if it may)
REACH = 0.5  # allowance of a grain beyond half the skin, at most, over the mean radius [-]
INNER_SHARES = (0.02, 0.5)  # bounds of the share of the allowances that an inner list is built for
KEPT_SHARE = 0.75  # of the slots in memory that hold a grain, at least: with fewer the lists are rebuilt without the others
NO_SLOTS = np.zeros(0, dtype=np.int64)
BUILDS = 64  # outer lists that a device builds at most before the grains are sorted in memory again
DISPLACED = INNER_HALF | INNER | OUTER_HALF | OUTER | OFF_PATH


class Validity(Enum):
    """Which lists are valid for the present positions."""

    VALID = auto()
    INNER_OUT_OF_DATE = auto()
    """The outer list is valid."""
    OUTER_OUT_OF_DATE = auto()


def skin_bounds(model: Model) -> tuple[float, float]:
    """Least and largest skin [m]: as the scene says, or by the mean radius; well below the shortest period."""
    radius, skin = model.expected.radius, model.scene.engine.skin
    mean = float(radius.mean()) if len(radius) else 1.0
    low, high = (0.4 * mean, 2.0 * mean) if skin == "auto" else (skin, skin)
    most = 0.45 * min((length for length in model.features.domain.period if length), default=np.inf)
    return min(low, most), min(high, most)


class NeighborLists(ContactLists):
    """The lists of a run.

    Args:
        model, state, clock, batch: of the run.
        timers: add up the time of the builds.
        pool: memory of the lists.
        list_build: of the executor, gives what builds them.
        leavers: take grains out that left the domain.

    Attributes:
        device_builds_left: outer lists that a device may still build before the host's next.
        pending: work left by the steps for the next update, a sum of ``kernels.step.motion``'s BEYOND and LEFT.
        before_build: called before the arrays of the lists change.
        watch_travel: called with the record of the grains and the placements of the wall motions when a grain is fast beside
            a mesh, before any list is built.
        fastest: largest approach speed of contacts so far [m/s].
    """

    before_build: Callable[[], None]
    watch_travel: Callable[[np.ndarray, np.ndarray], None]
    fastest: Callable[[], float]

    def __init__(
        self, model: Model, state: State, clock: Clock, batch: Batch, timers: Timers, pool: BufferPool,
        list_build: Callable[[ContactLists, Batch], HostBuild], leavers: Leavers,
    ) -> None:  # fmt: skip
        self._skin_bounds = skin_bounds(model)
        super().__init__(model, state, clock, pool, self._skin_bounds[0])
        self._adapt_allowances()
        self._batch, self._timers, self._leavers = batch, timers, leavers
        self.build = list_build(self, batch)
        self.flights = Flights(self, batch, self.build.launch)
        self._newcomers = Newcomers(self, batch)
        self._last_refresh = self._last_rebuild = 0
        self.device_builds_left = self._device_builds = self._rebuilds_then = 0
        self.pending = 0
        self._inner_lost = False

    def update(self, grown: bool = False, force_rebuild: bool = False) -> None:
        """Make the lists valid for the present positions, without the grains that have left the domain.

        Args:
            grown: grains were inserted.
            force_rebuild: build both lists, whether they hold or not.

        Raises:
            StabilityError: a state is not finite, a grain is beyond a border that stops the run or crossed a periodic domain.
        """
        pending, self.pending = self.pending, 0
        inner_lost, self._inner_lost = self._inner_lost, False
        force_rebuild |= grown and (self.build.storage.rows_are_counted or not self.rebuilds)
        changed = grown or force_rebuild or not self.built
        if not changed and not pending:
            return
        self.settle_liquid()
        steps = self.clock.step_number - self._last_refresh
        few_left = len(self.state) < KEPT_SHARE * self.state.slots
        # where grains may fly instead, or the arrays are made for others, the inner list has to wait for what is found
        at_once = pending & BEYOND and not (changed or inner_lost or few_left or steps < INNER_STEPS[0])
        found = self._check(self.next_inner_share if at_once else None)
        if found.inner_built:
            return
        if found.all & NOT_FINITE:
            raise not_finite(self.state, self.clock, self.fastest())
        of_grain = found.of_grain
        gone = self._leavers.take(found)
        if len(gone):
            self._remove(gone)
            of_grain[gone] = 0
            # energies are kept by contact: what the spring of a partner has lost would count twice
            force_rebuild |= self.model.features.measures.energy
        force_rebuild |= len(self.state) < KEPT_SHARE * self.state.slots
        if not (changed or force_rebuild or pending & BEYOND):
            return
        if found.all & FAST:
            self.watch_travel(self.state.record.numpy(), self._batch.placements_ahead()[0])
        self.force_parity = (self.clock.step_number - 1) & 1
        force_rebuild |= not self.built
        fast = self.flights.slots
        if not force_rebuild:
            with self._timers.measure("lists"):
                validity, fast = self._validity(of_grain[: self.known] & DISPLACED)
                if validity is Validity.VALID and not (grown or inner_lost):
                    return
                force_rebuild = validity is Validity.OUTER_OUT_OF_DATE or (grown and not self._insert())
        if not grown and not force_rebuild:
            self.inner_share = self.next_inner_share
        self._last_refresh = self.clock.step_number
        if force_rebuild:
            self._adapt_skin()
            self._rebuild_outer(fast)
        self._rebuild_inner()

    def _check(self, inner_share: float | None) -> Found:
        """What has become of each grain; builds the inner list at once where it alone is out of date, if its share is given."""
        outer_share = 1.0 - max(self.inner_share, self.next_inner_share)
        with self._timers.measure("refresh"):
            found = self.build.check(outer_share, inner_share)
            if found.inner_built:
                assert inner_share is not None
                self.force_parity = (self.clock.step_number - 1) & 1
                self.inner_share, self._last_refresh = inner_share, self.clock.step_number
                self.flights.list_built()
                self.flights.drop_reference()
        return found

    def make(self) -> None:
        """Build both lists for the present positions."""
        self._batch.set_time()
        self._last_refresh = self._last_rebuild = self.clock.step_number
        self._rebuild_outer(sort=True)
        self._rebuild_inner()

    def _rebuild_outer(self, fast: np.ndarray = NO_SLOTS, sort: bool = False) -> None:
        """Build the outer list; the grains in slots ``fast`` fly if they can. ``sort``: as of ``HostBuild.outer``."""
        self.before_build()
        self.flights.clear_paths()
        with self._timers.measure("lists"):
            order = self.build.outer(sort)
            if order is not None and len(fast):
                self.flights.reassign_paths(np.flatnonzero(np.isin(order, fast)))

    def _rebuild_inner(self) -> None:
        """Build the inner list."""
        if self.built:
            with self._timers.measure("refresh"):
                self.build.inner()
                self.flights.drop_reference()

    def _validity(self, stray: np.ndarray) -> tuple[Validity, np.ndarray]:
        """Which lists are valid, and the slots of the grains that fly or were meant to.

        Some grains may fly from now on so that the lists stay valid.

        Args:
            stray: how far each grain has moved, shape (known,).
        """
        steps, known = self.clock.step_number - self._last_refresh, set(self.flights.slots)
        since = self.clock.step_number - self._last_rebuild
        outer_out_of_date = stray & (OUTER | OFF_PATH)
        hasty = steps < INNER_STEPS[0] or (outer_out_of_date.any() and since < OUTER_STEPS)
        stray, wanted = self.flights.take(stray, hasty)
        fast = np.union1d(self.flights.slots, wanted)
        if (stray & (OUTER | OFF_PATH)).any():
            return Validity.OUTER_OUT_OF_DATE, fast
        new = [slot for slot in self.flights.slots if slot not in known]
        unlisted = False  # all that is in the rows of those that fly is in the inner list
        if new:
            walls = self.wall_contacts
            unlisted = self.outer.neighbors.numpy()[new].any() or (walls and np.diff(walls.first.numpy())[new].any())
        return Validity.INNER_OUT_OF_DATE if (stray & INNER).any() or unlisted else Validity.VALID, fast

    def _insert(self) -> bool:
        """Whether newcomers could be added to the lists as they are.

        Existing paths were not checked against them: either they fly too, on paths checked against the others, or all paths are
        assigned again.
        """
        known, flying = self.known, self.flights.slots
        if not self._newcomers.add():
            return False
        if not len(flying):
            return True
        new = known + np.flatnonzero(self.state.here[known:])
        for slots in (new, self.flights.slots):
            if len(self.flights.assign_paths(slots)) == len(slots):
                return True
        return False

    @property
    def next_inner_share(self) -> float:
        """``inner_share`` of the next inner list [-], steered by the steps since the last."""
        steps = self.clock.step_number - self._last_refresh
        if self.inner_rebuilds and steps < INNER_STEPS[0]:
            return min(1.4 * self.inner_share, INNER_SHARES[1])
        if self.inner_rebuilds and steps > INNER_STEPS[1]:
            return max(self.inner_share / 1.4, INNER_SHARES[0])
        return self.inner_share

    def _remove(self, gone: np.ndarray) -> None:
        """Grains in slots ``gone`` touch nothing any more; the lists stay valid for the others."""
        self._give_back_at_walls(gone[gone < self.known])
        self.state.leave(gone)
        self.settle_liquid()
        self.flights.leave(gone)
        gone = gone[gone < self.known]  # one that was inserted just now is in no list
        if self.wall_contacts is not None and len(gone):
            for array in (self.wall_contacts.candidates, self.wall_contacts.point_count):
                with changed(array) as values:
                    values[..., gone] = 0

    def _give_back_at_walls(self, gone: np.ndarray) -> None:
        """Grains in slots ``gone`` take the liquid along that is between them and walls."""
        walls, film = self.wall_contacts, self.state.film
        if walls is None or film is None or not len(gone):
            return
        parity = (self.clock.step_number - 1) & 1
        count, first, points = walls.point_count.numpy()[parity], walls.first.numpy(), walls.point.numpy()[parity]
        at = wall_record.columns(self.model.features.contact.history)
        thickness = walls.wall_film.numpy()
        with changed(film) as films:
            for i in gone:
                for point in points[first[i] : first[i] + count[i]]:
                    counts = point[at.of(COUNT)]
                    held = int(counts) if counts > 0.0 else int(max(RELEASED - counts, 0.0))
                    of_wall = held // 2 if thickness[int(point[at.wall])] > 0.0 else 0
                    films[i, FILM_AT.returned] += held - of_wall
                    films[i, FILM_AT.drawn] -= of_wall

    def _adapt_skin(self) -> None:
        """A wider skin where outer lists were built often; once it is right a device builds the next ones alone."""
        made, steps = self.rebuilds - self._rebuilds_then, self.clock.step_number - self._last_rebuild
        wider = self.skin
        if made and steps < OUTER_STEPS * made:
            wider = min(1.25 * self.skin, self._skin_bounds[1])
        self._device_builds = min(2 * self._device_builds, BUILDS) if wider == self.skin and self._device_builds else 1
        self.device_builds_left = self._device_builds
        self.skin, self._last_rebuild, self._rebuilds_then = wider, self.clock.step_number, self.rebuilds
        self._adapt_allowances()

    def _adapt_allowances(self) -> None:
        """Set the bounds of how far a grain may move while the outer list holds."""
        least, radius = 0.5 * self.skin, self.model.expected.radius
        shortest = min((length for length in self.model.features.domain.period if length), default=np.inf)
        mean = float(radius.mean()) if len(radius) else 0.0
        self.most_allowance = max(least, min(least + REACH * mean, 0.225 * shortest))

    # -- built by a device ----------------------------------------------------------------------

    def inner_built_on_device(self, times: int, step: int, totals: list[int]) -> None:
        """The inner list was built, the last time at ``step``: its length is all that the host keeps of it."""
        self.inner_rebuilds += times
        self._last_refresh = step
        self.set_totals(totals)

    def outer_built_on_device(self, times: int, inner_lost: bool) -> None:
        """The outer list was built.

        Args:
            times: how often.
            inner_lost: the arrays were too short for the inner list after it. Of the one before only the history is left, so
                the host builds it whether grains have moved or not.
        """
        self._inner_lost = inner_lost
        if times:
            self.flights.clear_paths()
        self.rebuilds += times
        self.device_builds_left -= times
