"""The step and the list build: every launch, in its order, written once.

    step                                   list build
      walls that move by their load          check the lists
      for each stage of the integrator       outer list, where it is out of date
        forces of the stage (not the 1st)
        kick, drift, displacement check        allowances of the grains set, grains sorted by cell
      forces at the end of the step            neighbors of each grain and wall features near it, counted and numbered
                                               [do the arrays hold them?] written
                                               contact numbers and wall contacts carried over from the old list
                                               reference positions saved
                                             inner list
                                               contacts and wall features selected, numbered
                                               [do the arrays hold them?] written, contact history carried over
                                               reference positions saved

Two executors run it. ``graph`` captures these launches: the device decides at the capacity checks. On a CPU the host decides
(``host_build``), each launch is split over threads (``cpu``), and the launches of a step are fused into one kernel per thread,
``kernels.step.loop.run``, in the same order; so are those of the check and of the inner list, ``kernels.lists.inner``. What
each launch computes is said where its kernel stands: ``kernels/lists``, ``kernels/step``.
"""

import functools
from collections.abc import Callable
from typing import Any, Protocol

import warp as wp

from warpdem.engine.batch import Batch
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.list_structs import ListStructs, of_each
from warpdem.kernels import KernelSet
from warpdem.kernels.lists import cells, numbering
from warpdem.kernels.step.clock import TOTALS
from warpdem.model.model import Model
from warpdem.state.particles import State


class Launch(Protocol):
    """How a kernel is launched."""

    def __call__(self, kernel: wp.Kernel, count: int, *inputs: Any, split: bool = True) -> None:
        """Launch over ``count`` indices, over threads where ``split``; the kernel's first argument is the first index."""

    def once(self, kernel: wp.Kernel, *inputs: Any) -> None:
        """Launch one thread."""


class Decisions(Protocol):
    """The capacity checks of a list build, and how the old lists are replaced."""

    def outer_fits(self, write: Callable[[], None]) -> None:
        """Go on with ``write`` where the arrays hold the outer list."""

    def replace_outer(self) -> None:
        """Put the rows of the new outer list in the place of the old ones."""

    def move_wall_contacts(self) -> None:
        """Put the wall contacts of the last force call into the new slots."""

    def inner_fits(self, write: Callable[[], None]) -> None:
        """Go on with ``write`` where the arrays hold the inner list."""

    def adopt_history(self) -> None:
        """Put the contact history of the new list where the forces expect it."""


class Step:
    """The launches of a step, each phase with a thread per contact or grain."""

    def __init__(self, model: Model, n: int, structs: tuple[Any, Any, Any], batch: Batch, inner_share: float,
                 launch: Launch) -> None:  # fmt: skip
        self.model, self.n, self.batch, self.launch, self.inner_share = model, n, batch, launch, inner_share
        self.grains, self.contacts, self.wall_contacts = structs

    def __call__(self, ahead: int) -> None:
        """The step that begins ``ahead`` steps from now."""
        self.walls_by_load(ahead)
        for stage in range(self.batch.stages):
            if stage > 0:
                self.forces(ahead, stage)
            self.move(ahead, stage)
        self.forces(ahead + 1)

    def forces(self, ahead: int, stage: int = 0) -> None:
        """All contact forces ``ahead`` steps from now."""
        self.pair_forces(ahead, stage)
        self.wall_forces(ahead, stage)

    def pair_forces(self, ahead: int, stage: int = 0) -> None:
        """Forces of the contacts between grains."""
        kernels, b = self.model.kernels.graph, self.batch
        shared = b.model, b.control, self.grains, self.contacts, b.report, b.clock
        self.launch(kernels.pair_forces, self.contacts.owner.size, ahead, stage, *shared)

    def wall_forces(self, ahead: int, stage: int = 0) -> None:
        """Forces of the contacts with walls."""
        if self.model.walls is not None:
            b = self.batch
            shared = b.model, b.control, self.grains, self.wall_contacts, b.report, b.clock
            self.launch(self.model.kernels.graph.wall_forces, self.n, ahead, stage, *shared)

    def walls_by_load(self, ahead: int) -> None:
        """Kick and drift of the walls that move by the load on them."""
        if self.model.schedule.dynamic:
            self.add_wall_loads(ahead)
            self.advance_walls(ahead)

    def add_wall_loads(self, ahead: int) -> None:
        """Sums of the loads on them."""
        b = self.batch
        shared = b.control, self.grains, self.wall_contacts, b.report, b.clock
        self.launch(self.model.kernels.graph.add_wall_loads, self.n, ahead, *shared)

    def advance_walls(self, ahead: int) -> None:
        """Their motion by these sums."""
        b = self.batch
        self.launch.once(self.model.kernels.graph.advance_walls, ahead, b.model, b.control, b.report, b.clock)

    def move(self, ahead: int, stage: int = 0) -> None:
        """Kick and drift, and whether grains have moved too far for the inner list."""
        b = self.batch
        shared = b.model, b.control, self.grains, self.wall_contacts, b.report, b.clock, self.inner_share
        self.launch(self.model.kernels.graph.move, self.n, ahead, stage, *shared)


class ListBuild:
    """The launches that check and build the lists."""

    def __init__(
        self, model: Model, state: State, lists: ContactLists, batch: Batch, launch: Launch, decide: Decisions
    ) -> None:
        self.model, self.state, self.lists, self.batch = model, state, lists, batch
        self.launch, self.decide = launch, decide
        self.kernels: KernelSet = model.kernels

    @functools.cached_property
    def structs(self) -> ListStructs:
        """What the kernels take; made where they are launched, not where a graph that was captured is replayed."""
        return ListStructs(self.model, self.state, self.lists)

    @property
    def n(self) -> int:
        """Slots of grains."""
        return self.state.slots

    # -- check ----------------------------------------------------------------------------------

    def check(self, found: wp.array, outer_share: float) -> None:
        """How far grains have moved, and what else has become of them (``kernels.lists.displacement``).

        Args:
            found: what is found of each grain, shape (n,); of size 0 for the conditions of the clock only.
            outer_share: of its allowance, that a grain may move while the outer list holds [-].
        """
        b, references = self.batch, self.structs.references(outer_share)
        shared = self.state.record, self.structs.grains().clumps, references, b.control, b.watched, self.model.dt
        self.launch(self.kernels.displacement.check_lists, self.n, *shared, found, b.clock)

    # -- outer list -----------------------------------------------------------------------------

    def build_outer(self) -> None:
        """Pairs and wall features within the allowances, where the arrays hold them."""
        a, scratch = self.lists, self.batch.scratch(self.n)
        self.set_allowances(a.horizon, 0.5 * a.skin, a.most_allowance)
        self._sort_by_cell()
        self.find_neighbors(a.new.capacity_start)
        if a.rows_are_counted:
            self._number(a.new.count, scratch.entries, a.new.start)
        if self.model.walls is not None:
            self._near_features(0)
            self._number(a.new.feature_count, scratch.slots, a.new.first)
        self.decide.outer_fits(self._write_outer)

    def _sort_by_cell(self) -> None:
        """Sort the grains by the cells of the grids that they are in."""
        a, k = self.lists, self.kernels.neighbors
        inputs = a.grids, self.state.record, a.new.allowance
        a.grids.end.zero_()
        a.grids.placed.zero_()
        self.launch(k.count_in_cells, self.n, *inputs, split=False)
        self.launch(cells.start_lines, a.grids.lines, a.grids, split=False)
        self.launch(k.sort_by_cell, self.n, *inputs, split=False)

    def _write_outer(self) -> None:
        a, k = self.lists, self.kernels.neighbors
        if a.rows_are_counted:
            self.find_neighbors(a.new.start)
        if a.built:
            old, new = self.structs.outer(), self.structs.new()
            self.launch(k.carry_contacts, self.n, self.state.id, a.new.old_slot, a.new.old_id, old, new)
        self.decide.replace_outer()
        if self.model.walls is not None:
            self._near_features(1)
            self.decide.move_wall_contacts()
        self._save_reference(a.outer_reference)

    def set_allowances(self, horizon: float, least: float, most: float) -> None:
        """How far each grain may move while the list holds that is built: as far as in ``horizon`` steps, within bounds [m]."""
        a, b, kernel = self.lists, self.batch, self.kernels.displacement.set_allowances
        limits = self.model.dt, horizon, least, most
        self.launch(kernel, self.n, self.state.record, b.control, b.clock, *limits, a.new.allowance)

    def find_neighbors(self, start: wp.array) -> None:
        """Write the neighbors of each grain from ``start`` on, as far as there is capacity, and count them."""
        a, grains = self.lists, self.structs.grains()
        written = a.new.count, a.new.slot
        self.launch(self.kernels.neighbors.find_neighbors, self.n, a.grids, grains, a.new.allowance, start, *written)

    def _near_features(self, write: int) -> None:
        """Count the wall features near each grain, or write their numbers."""
        a, walls, nothing = self.lists, self.model.walls, self.batch.scratch(self.n).nothing
        assert walls is not None
        first, feature = (a.new.first, a.near_feature) if write else (nothing, nothing)
        if self.state.ghosts:  # which are beside no wall here
            a.new.feature_count[self.state.owned :].zero_()
        shared = self.structs.grains(), a.new.allowance, walls.surface, walls.trees, self.batch.placements, a.new.met
        self.launch(self.kernels.walls.near_features, self.state.owned, write, *shared, first, a.new.feature_count, feature)

    # -- inner list -----------------------------------------------------------------------------

    def build_inner(self) -> None:
        """Pairs and wall features within a share of the allowances, where the arrays hold them."""
        a, k, b, structs = self.lists, self.kernels.batches, self.batch, self.structs
        counts = structs.counts()
        selected = structs.grains(), structs.outer(), a.history, a.inner_share, a.flight, a.listed, counts
        self.launch(k.select_contacts, self.n, *selected)
        if self.model.walls is not None:
            near = a.near_feature, a.flight, a.wall_contacts
            shared = self.state.record, a.inner_share, a.outer.allowance, self.model.walls.surface, b.placements
            self.launch(self.kernels.walls.close_features, self.n, *shared, *near)
        self.number(counts, b.clock[TOTALS], structs.starts())
        self.decide.inner_fits(self._write_inner)

    def _write_inner(self) -> None:
        a, k, m, structs = self.lists, self.kernels.batches, self.model, self.structs
        unused_slot, contacts = a.slot_force.shape[0] - 1, structs.contacts()
        self.launch(k.clear_contacts, a.owner.shape[0], structs.grains(), structs.outer(), unused_slot, contacts)
        law = m.features.contact.materials, m.coefficients
        lists = structs.outer(), a.listed, structs.starts(), a.history
        self.launch(k.fill_contacts, self.n, structs.grains(), *law, *lists, contacts)
        self.decide.adopt_history()
        self._save_reference(a.reference)

    # -- both -----------------------------------------------------------------------------------

    def number(self, counts: Any, total: wp.array, starts: Any) -> None:
        """How many there are of what ``counts`` gives per grain, and where each grain begins (``kernels.lists.numbering``)."""
        sums, lanes = self.batch.scratch(self.n).sums, self.model.features.backend.lanes
        self.launch(numbering.sum_blocks, sums.shape[0], lanes, counts, sums)
        self.launch.once(numbering.start_blocks, sums, total)
        self.launch(numbering.start_grains, sums.shape[0], lanes, counts, sums, starts)

    def _number(self, count: wp.array, total: wp.array, start: wp.array) -> None:
        """Where the row of each grain begins; ``total[1]`` is the length of all."""
        counts, starts = of_each(count, start)
        self.number(counts, total, starts)

    def _save_reference(self, reference: wp.array) -> None:
        """Positions of the grains, from which their displacement counts."""
        inputs = self.state.record, self.batch.placements, self.lists.flight, reference
        self.launch(self.kernels.displacement.save_reference, self.n, *inputs)
