"""The list build where the host decides: on a CPU always, on a GPU when the device asks for it.

The host sorts the grains in memory and gives the arrays their length; ``program`` launches the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import warp as wp

from warpdem.core.threads import Threads
from warpdem.engine.batch import Batch
from warpdem.engine.buffers import LONGEST, BufferPool
from warpdem.engine.contact_lists import ContactLists, NewOuterList
from warpdem.engine.list_structs import put
from warpdem.engine.program import ListBuild
from warpdem.engine.stops import too_long_a_list
from warpdem.filling.size_grids import RowCapacity, finest_cell, grids_for, size_classes
from warpdem.kernels import grain
from warpdem.kernels.step.clock import TOTALS
from warpdem.kernels.wall.candidates import MET
from warpdem.model.model import Model
from warpdem.state.particles import State

LEAST_CAPACITY = 12  # of a row of the outer list to begin with


FAST = 0.1
"""Share of the grains that are allowed to move by more than half the skin, about [-]."""
LONGEST_HORIZON = 1200.0
"""Steps that an outer list shall hold at most [-]."""
BUILDS_IN_ORDER = 8
"""Outer lists that a CPU builds before it sorts the grains in memory again: until then they move by a few radii at most."""


class HostLaunch:
    """Launches over CPU threads, each of which takes a range of the indices; on a GPU as a whole."""

    def __init__(self, device: wp.Device, threads: Threads) -> None:
        self._device, self._threads = device, threads
        self._commands: dict[tuple[wp.Kernel, int], tuple[list[Any], list[wp.Launch]]] = {}

    def forget(self) -> None:
        """Let go of the arrays that the last launches were made with."""
        self._commands.clear()

    def __call__(self, kernel: wp.Kernel, count: int, *inputs: Any, split: bool = True) -> None:
        """As ``program.Launch``."""
        if split:
            self._threads.split(kernel, count, inputs, self._device)
        else:
            wp.launch(kernel, dim=count, inputs=[0, *inputs], device=self._device)

    def once(self, kernel: wp.Kernel, *inputs: Any) -> None:
        """As ``program.Launch``."""
        wp.launch(kernel, dim=1, inputs=inputs, device=self._device)

    def on_each(self, kernel: wp.Kernel, threads: int, *inputs: Any) -> None:
        """One launch on each of ``threads`` threads at the same time; first arguments: number of the thread, and of all.

        The launch is recorded at the first call and replayed at later ones, with the inputs that have changed; a struct is read
        at each call. The threads share one interpreter and would otherwise wait for each other while each packs its arguments.
        """
        if (kernel, threads) not in self._commands:
            self._threads.load(kernel, self._device)
            commands = [
                wp.launch(kernel, 1, [t, threads, *inputs], device=self._device, record_cmd=True) for t in range(threads)
            ]
            self._commands[kernel, threads] = [*inputs], commands
        given, commands = self._commands[kernel, threads]
        for at, value in enumerate(inputs):
            if value is not given[at]:
                given[at] = value
                for command in commands:
                    command.set_param_at_index(2 + at, value)
        self._threads.together([command.launch for command in commands])


@dataclass(frozen=True)
class Found:
    """What a check of the lists has found (``kernels.lists.displacement``)."""

    all: int
    """Of all grains: the bits of each."""
    of_grain: np.ndarray
    """(slots,) of each grain."""
    inner_built: bool = False
    """Only the inner list was out of date, and it was built."""


class Storage(Protocol):
    """Where an executor wants the arrays of the lists."""

    pool: BufferPool
    rows_are_counted: bool
    """Neighbors are counted before the rows are written: a second search in place of rows with capacity to spare."""

    def selection(self, entries: int) -> wp.array:
        """Array for what is selected of each entry of the outer list, shape (entries,)."""

    def copies(self, grains: int) -> wp.array:
        """Scratch for what an outer list build copies of the grains (``kernels.lists.cells``), of size 0 if it does not."""

    def force_slots(self, shape: tuple[int, int], history: tuple[int, int, int], entries: int, real: type) -> wp.array:
        """Array of the force slots; shape of the contact history, and entries of the outer list."""

    def next_history(self, shape: tuple[int, int, int], version: int, real: type) -> wp.array:
        """Array that the contact history is carried over to."""

    def adopt_history(self, lists: ContactLists) -> None:
        """Let ``lists.history`` be what was carried over."""


def morton_order(position: np.ndarray, cell: float, device: wp.Device | str = "cpu") -> np.ndarray:
    """Order of points (n, 3) [m] along a Z-order curve of cells of edge ``cell`` [m]; ties keep their order.

    Sorted on ``device`` by radix, on a CPU too twice as fast as NumPy's stable sort.
    """
    n = len(position)
    lowest = np.array([column.min() for column in position.T])  # along the first axis NumPy takes 20 times as long
    index = ((position - lowest) / cell).astype(np.uint64)
    index = np.minimum(index, np.uint64(2**21 - 1))
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):  # fmt: skip
        index = (index | (index << np.uint64(shift))) & np.uint64(mask)
    code = index[:, 0] | (index[:, 1] << np.uint64(1)) | (index[:, 2] << np.uint64(2))
    # the second half of both is scratch of the sort
    key: wp.array = wp.array(np.pad(code.astype(np.int64), (0, n)), dtype=wp.int64, device=device)
    slot: wp.array = wp.array(np.pad(np.arange(n, dtype=np.int32), (0, n)), dtype=wp.int32, device=device)
    wp.utils.radix_sort_pairs(key, slot, n)
    return slot.numpy()[:n].copy()


class HostBuild:
    """Builds both lists for the present positions; the decisions of ``program.ListBuild`` are the host's.

    Args:
        model, state, lists, batch: as of ``program.ListBuild``.
        launch: how kernels are launched.
        storage: where the arrays are.
    """

    def __init__(
        self, model: Model, state: State, lists: ContactLists, batch: Batch, launch: HostLaunch, storage: Storage
    ) -> None:
        self.model, self.state, self.lists, self.batch, self.storage = model, state, lists, batch, storage
        self.launch = launch
        self.program = ListBuild(model, state, lists, batch, launch, self)
        self._row_capacity = RowCapacity(LEAST_CAPACITY)
        self._classes = np.zeros(0, dtype=np.int64)
        self._nothing = storage.pool.zeros(0, wp.int32)
        self._builds_in_order, self._side, self._entries = 0, 0, 0
        self._grids_for = 0.0, 0.0  # skin and largest allowance
        self._capacity_start: wp.array | None = None
        self._old_wall_contacts: Any = None

    def check(self, outer_share: float, inner_share: float | None = None) -> Found:
        """What has become of each grain.

        Args:
            outer_share: of its allowance, that a grain may move while the outer list holds [-].
            inner_share: of the inner list that may be built at once where it alone is out of date [-]; None for none.
        """
        found = self.storage.pool.buffer("found", (self.state.slots,), wp.int32)
        self.batch.set_time()
        self.program.check(found, outer_share)
        of_grain = found.numpy()
        return Found(int(np.bitwise_or.reduce(of_grain, initial=0)), of_grain)

    # -- outer list -----------------------------------------------------------------------------

    def outer(self, sort: bool = True) -> np.ndarray | None:
        """Build the outer list; before it, sort the grains in memory, without those that have left, where that is due.

        Args:
            sort: sort whether it is due or not.

        Returns:
            Slot that each grain had before, shape (n,); None where no grain is left.
        """
        a, state, known = self.lists, self.state, self.lists.known
        self._side = 1 - self._side
        a.rows_are_counted = self.storage.rows_are_counted
        same = state.slots == len(state) == known == len(self._classes)  # none has come or gone since they were sorted
        stays = same and a.built and self._builds_in_order < BUILDS_IN_ORDER and self._grids_for == (a.skin, a.most_allowance)
        if sort or not stays or a.rows_are_counted:
            old_id = wp.clone(state.id)
            order = self._sort()
            if order is None:
                return None
            old_slot = self.storage.pool.upload(np.where(order < known, order, -1).astype(np.int32), wp.int32)
            self._builds_in_order, self._capacity_start = 0, None
        else:
            order, old_id, old_slot = np.arange(state.slots), state.id, self._nothing
            self._builds_in_order += 1
        a.known = n = len(order)
        nothing, counts = self._nothing, [self._array(name, n) for name in ("neighbors", "near features")]
        a.new = NewOuterList(
            start=self._array("rows", n + 1), count=counts[0], slot=nothing, contact=nothing,
            allowance=self._array("allowances", n, wp.float64), capacity_start=nothing, old_slot=old_slot, old_id=old_id,
            feature_count=counts[1], first=self._array("wall slots", n + 1), met=self._met(n),
        )  # fmt: skip
        if not a.rows_are_counted:
            self._give_rows_capacity()
        a.grids.copies = self.storage.copies(n)
        self._look_ahead()
        self.program.build_outer()
        a.rebuilds += 1
        return order

    def _look_ahead(self) -> None:
        """Let ``lists.horizon`` be the steps in which all but the fast ones go no further than half the skin."""
        a, least = self.lists, 0.5 * self.lists.skin
        if a.most_allowance > least:
            self.program.set_allowances(1.0, 0.0, np.inf)
            distance = float(np.quantile(a.new.allowance.numpy(), 1.0 - FAST))
            a.horizon = min(least / distance, LONGEST_HORIZON) if distance > 0.0 else LONGEST_HORIZON

    def _array(self, name: str, size: int, dtype: type = wp.int32) -> wp.array:
        """Array of an outer list: on a CPU one of two, since the list before is still needed; else of its own."""
        pool = self.storage.pool
        if self.storage.rows_are_counted:
            return pool.zeros(size, dtype)
        return pool.buffer(f"{name} {self._side}", (size,), dtype)

    def _met(self, n: int) -> wp.array:
        """Array for the wall features that the counting pass stores; none on a GPU, where memory counts for more."""
        kept = MET if self.model.walls is not None and not self.storage.rows_are_counted else 0
        return self.storage.pool.buffer("met", (n, kept), wp.int32)

    def _sort(self) -> np.ndarray | None:
        """Sort the grains in memory, without those that have left, and make the cell grids; return as ``outer``."""
        a, state, pool = self.lists, self.state, self.storage.pool
        kept, record = np.flatnonzero(state.here), state.record.numpy()
        n = len(kept)
        if n == 0:
            state.reorder(kept)
            a.known = 0
            a.forget_outer()
            a.set_totals([0, 0, 0])
            return None
        position, radius = record[:, grain.POSITION][kept], record[:, grain.RADIUS][kept]
        places = position if state.clumps is None else state.places_to_sort_by(kept)
        gap = self.model.features.contact.gap
        classes = size_classes(radius)
        if a.given_order is not None:
            order, a.given_order = a.given_order, None
        else:
            order = morton_order(places, finest_cell(radius, classes, gap + a.skin), self.model.device)
        self._classes, order = classes[order], kept[order]
        state.reorder(order)
        a.outer_reference = pool.buffer("outer reference", (n, 1 + self.model.features.walls.moving), wp.vec3d)
        widest = float(radius.max()) + a.most_allowance
        a.grids = grids_for(position, radius + 0.5 * a.skin, classes, gap, self.model.device, widest)
        self._grids_for = a.skin, a.most_allowance
        return order

    def _give_rows_capacity(self) -> None:
        """Rows as long as the size of their grain asks for: one search counts and writes."""
        new = self.lists.new
        if self._capacity_start is None:
            start = self._row_capacity.starts(self._classes)
            self._entries, self._capacity_start = int(start[-1]), self.storage.pool.upload(start, wp.int32)
        new.start = new.capacity_start = self._capacity_start
        new.slot = self._array("partners", self._entries)

    def outer_fits(self, write: Callable[[], None]) -> None:
        """As ``program.Decisions``: give the arrays the length that the list has."""
        a, new, scratch, pool = self.lists, self.lists.new, self.batch.scratch(self.state.slots), self.storage.pool
        if a.rows_are_counted:
            new.slot = pool.zeros(self._length("near", scratch.entries, new.count), wp.int32)
        else:
            while not self._row_capacity.holds(self._classes, new.count.numpy()):
                entries = self._row_capacity.entries(self._classes)
                if entries > LONGEST:
                    raise too_long_a_list(self.state, a.clock, entries, new.count)
                self._capacity_start = None
                self._give_rows_capacity()
                self.program.find_neighbors(new.capacity_start)
        new.contact = self._array("contacts", new.slot.shape[0])
        if not a.built:
            new.contact.fill_(-1)
        if self.model.walls is not None:
            a.near_feature = self._array("near feature", self._length("slots", scratch.slots, new.feature_count))
        write()

    def _length(self, name: str, total: wp.array, count: wp.array) -> int:
        """Length that the array ``name`` needs for ``total[1]`` entries."""
        entries = int(total.numpy()[1])
        if entries >= LONGEST:
            raise too_long_a_list(self.state, self.lists.clock, int(count.numpy().sum(dtype=np.int64)), count)
        return self.storage.pool.capacity(name, entries)

    def replace_outer(self) -> None:
        """As ``program.Decisions``."""
        self.lists.outer = self.lists.new.rows

    def move_wall_contacts(self) -> None:
        """As ``program.Decisions``."""
        a = self.lists
        wall_contacts = self._free_wall_contacts(self.state.slots, a.near_feature.shape[0])
        put(wall_contacts, first=a.new.first)
        if self.state.film is not None:
            put(wall_contacts, film=self.state.film)
        inputs = a.force_parity, a.new.old_slot, a.wall_contacts, wall_contacts
        self.launch(self.model.kernels.walls.carry_wall_contacts, self.state.slots, *inputs)
        if not (a.rows_are_counted or self.model.features.measures.energy):  # of those some arrays must be zero
            self._old_wall_contacts = a.wall_contacts
        a.wall_contacts = wall_contacts

    def _free_wall_contacts(self, grains: int, slots: int) -> Any:
        """Wall contacts for that many: those of the list before the last, if they have that length."""
        old, self._old_wall_contacts = self._old_wall_contacts, None
        if old is None or (old.candidates.shape[0], old.feature.shape[0]) != (grains, slots):
            return self.lists.new_wall_contacts(grains, slots)
        old.candidates.zero_()
        old.point_count.zero_()
        return old

    # -- inner list -----------------------------------------------------------------------------

    def inner(self) -> None:
        """Build the inner list."""
        self.size_by_grains()
        self.program.build_inner()
        self.lists.inner_built()

    def size_by_grains(self) -> None:
        """Give the arrays of the inner list that have an entry per grain their length."""
        a, n, buffer = self.lists, self.state.slots, self.storage.pool.buffer
        a.listed = self.storage.selection(a.outer.slot.shape[0])
        for name in ("touching", "near", "width", "touching_start", "near_start"):
            setattr(a, name, buffer(name, (n,), wp.int32))
        a.slot_start = buffer("slot start", (n + 1,), wp.int32)
        a.reference = buffer("reference", (n, 1 + self.model.features.walls.moving), wp.vec3d)
        a.give_films_to_walls()
        if a.wall_contacts is not None:
            put(a.wall_contacts, grain=buffer("wall grain", (n,), wp.int32))

    def inner_fits(self, write: Callable[[], None]) -> None:
        """As ``program.Decisions``: give the arrays the length that the list has."""
        self.lists.set_totals(self.batch.clock.numpy()[TOTALS].tolist())
        self.size_by_contacts()
        write()

    def size_by_contacts(self) -> None:
        """Give the arrays of the inner list that have an entry per contact the length that ``lists.totals`` asks for."""
        a, features, pool = self.lists, self.model.features, self.storage.pool
        law, width = features.contact, features.backend.lanes
        batches, slots = pool.capacity("contact batches", a.totals[0] // width), pool.capacity("force slots", a.totals[1])
        lanes, history = (batches, width), (batches, max(features.memory, 1), width)
        a.slot_force = self.storage.force_slots((slots + 1, law.pair_force_width), history, a.outer.slot.shape[0], a.real)
        for name in ("owner", "partner", "slot_i", "slot_j"):
            setattr(a, name, pool.buffer(name, lanes, wp.int32))
        a.kind = pool.buffer("kind", lanes if law.table else (0, width), wp.int32)
        a.trial = pool.buffer("trial", history if self.batch.stages > 1 else (0, 1, width), a.real)
        kernels = self.model.kernels.batches
        a.constants = pool.buffer(
            "constants", (batches if kernels.keeps_constants else 0, kernels.constants_width, width), a.real
        )
        a.next_history = self.storage.next_history(history, a.version, a.real)

    def adopt_history(self) -> None:
        """As ``program.Decisions``."""
        self.storage.adopt_history(self.lists)
