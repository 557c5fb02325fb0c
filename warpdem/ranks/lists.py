"""Neighbor lists of a rank, built at the same steps as those of all others.

Steps stop on all ranks where a grain of any has moved too far for the inner list. All inner lists are then built again, or all
outer ones, and with those grains change hands and ghosts are chosen again. So a ghost has moved just as far since as its owner
found, who alone looks, and ranks have the same skins.
"""

from collections.abc import Callable

import numpy as np

from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.stops import crossed_domain, not_finite
from warpdem.errors import WarpdemError
from warpdem.kernels import grain
from warpdem.kernels.lists.displacement import CROSSED, FAST, IN_OUTLET, NOT_FINITE, OUT_OF_DATE, OUTLET_NUMBER
from warpdem.kernels.step.motion import LEFT
from warpdem.ranks.world import World
from warpdem.state.particles import changed

HERE = (1 << OUTLET_NUMBER) - 1
"""Bits of what is found of a grain, without the number of the outlet that it is in."""


class RankLists(NeighborLists):
    """The lists of a rank.

    Attributes:
        world: the ranks.
        move_grains: called where outer lists are to be built: deals the grains out again and builds them.
        leave: called on all ranks where a grain of some is in an outlet: counts and removes those.
        fast_found: called on all ranks where a grain of some is fast beside a mesh, with whether one is on this rank.
        rebuilt: called where inner lists were built.
    """

    world: World
    move_grains: Callable[[], None]
    fast_found: Callable[[bool], None]
    leave: Callable[[], None]
    rebuilt: Callable[[], None]

    @property
    def share_that_holds(self) -> float:
        """As ``ContactLists``; no rank knows whether a grain is alone."""
        return self.inner_share

    def _adapt_allowances(self) -> None:
        """All grains have the same, on each rank that knows them."""
        self.most_allowance = 0.5 * self.skin

    def update(self, grown: bool = False, force_rebuild: bool = False) -> None:
        """As ``NeighborLists``, on all ranks together.

        Raises:
            StabilityError: as ``NeighborLists``, on all ranks that of the lowest.
        """
        pending, self.pending = self.pending, 0
        force_rebuild |= grown or not self.rebuilds
        if not (force_rebuild or pending):
            return
        self.settle_liquid()
        found = self._found_on_all_ranks()
        if found & IN_OUTLET:
            self.leave()
        if found & FAST:
            self.fast_found(bool(self._found_here & FAST))
        if force_rebuild or pending & LEFT or found & (OUT_OF_DATE | IN_OUTLET):
            self._adapt_skin()
            self.inner_share = self.next_inner_share
            self._last_refresh = self.clock.step_number
            with self._timers.measure("lists"):
                self.move_grains()
        else:
            self.inner_share = self.next_inner_share
            self._last_refresh = self.clock.step_number
            self.force_parity = (self.clock.step_number - 1) & 1
            self._rebuild_inner()
            self._count()
            self.rebuilt()

    def _found_on_all_ranks(self) -> int:
        """What has become of the grains of all ranks, by bits.

        Raises:
            StabilityError: one is no number, or crossed a periodic domain.
        """
        self._of_grain = np.zeros(0, dtype=np.int32)
        if self.state.slots and self.built:
            outer_share = 1.0 - max(self.inner_share, self.next_inner_share)
            with self._timers.measure("refresh"):
                self._of_grain = self.build.check(outer_share).of_grain[: self.state.owned]
        self._found_here = int(np.bitwise_or.reduce(self._of_grain & HERE, initial=0))
        found = self.world.any_of(self._found_here)
        if found & (NOT_FINITE | CROSSED):
            self.world.raise_first(self._stop())
        return found

    def _stop(self) -> WarpdemError | None:
        """Why this rank cannot go on; None if it can."""
        if self._found_here & NOT_FINITE:
            return not_finite(self.state, self.clock, self.fastest())
        if self._found_here & CROSSED:
            return crossed_domain(self.state, self.clock, int(np.flatnonzero(self._of_grain & CROSSED)[0]))
        return None

    @property
    def leaving(self) -> tuple[np.ndarray, np.ndarray]:
        """Memory slots of the own grains that the last update found in an outlet, and the number of the outlet of each."""
        gone = np.flatnonzero(self._of_grain & IN_OUTLET)
        return gone, self._of_grain[gone] >> OUTLET_NUMBER

    def make(self) -> None:
        """As ``NeighborLists``."""
        self._last_refresh = self._last_rebuild = self.clock.step_number
        self.rebuild()

    def remove(self, gone: np.ndarray, ghosts: np.ndarray) -> None:
        """Grains in slots ``gone`` have left the domain, and those of others of which ``ghosts`` are the copies."""
        with changed(self.state.record) as record:
            record[ghosts, 0] = grain.REMOVED_X
        self._remove(gone)

    def in_outlets(self) -> np.ndarray:
        """Whether each own grain is in an outlet at present, shape (owned,)."""
        if not (self.state.slots and self.built and self.model.features.domain.outlets):
            return np.zeros(self.state.owned, dtype=bool)
        inside: np.ndarray = (self.build.check(0.0).of_grain[: self.state.owned] & IN_OUTLET) > 0
        return inside

    def rebuild(self) -> None:
        """Build both lists for the grains that are here now."""
        if self.state.slots:
            self._batch.set_time()
            self._rebuild_outer(sort=True)
            self._rebuild_inner()
        else:
            self.before_build()
            self.forget_outer()
            self.known = 0
            self.set_totals([0, 0, 0])
            self.rebuilds += 1
        self._count()

    def _count(self) -> None:
        """Take note of a build; a rank without grains built nothing, and takes note of it too."""
        if not self.state.slots:
            self.inner_rebuilds += 1
        elif self.model.features.backend.resident:
            self.batches_inside = 0  # nothing is evaluated while ghosts are under way
        elif self.contact_count:
            # lanes without a contact too: they hold a pair of grains, whose positions are read
            owner, partner = (slots.numpy().ravel()[: self.totals[0]] for slots in (self.owner, self.partner))
            ghost = (owner >= self.state.owned) | (partner >= self.state.owned)
            if ghost.any():
                self.batches_inside = int(ghost.argmax()) // self.model.features.backend.lanes
