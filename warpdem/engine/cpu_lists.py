"""The list build of a CPU: its threads check the lists and build the inner one in a launch each (``kernels.lists.inner``)."""

from collections.abc import Callable

import warp as wp

from warpdem.engine.batch import Batch
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.host_build import Found, HostBuild, HostLaunch, Storage
from warpdem.engine.list_structs import put
from warpdem.kernels.lists.inner import BUILD, CHECK, CHOSEN, FILLED, FOUND, SPAN, TOTALS, Scratch
from warpdem.kernels.lists.numbering import BLOCK
from warpdem.model.model import Model
from warpdem.state.particles import State


class ThreadedBuild(HostBuild):
    """Builds lists on CPU threads.

    Args:
        model, state, lists, batch, launch, storage: as of ``HostBuild``.
        threads: gives the threads that work on so many grains.
    """

    def __init__(
        self, model: Model, state: State, lists: ContactLists, batch: Batch, launch: HostLaunch, storage: Storage,
        threads: Callable[[int], int],
    ) -> None:  # fmt: skip
        super().__init__(model, state, lists, batch, launch, storage)
        self._threads, self._scratch = threads, Scratch()
        self._report = storage.pool.zeros(SPAN * (1 + batch.control.thread_ranges.shape[0]), wp.int32)
        self._read = self._report.numpy()  # the same memory
        self._arrivals, self._work = batch.report.arrivals.numpy(), model.kernels.inner.Work()
        self._no_wall_contacts, no_feature = model.kernels.WallContacts(), storage.pool.zeros(0, wp.int32)
        lists.near_feature = no_feature
        self._sized_for, self._sized_walls = (-1, -1), None
        self.size_by_grains()
        self.size_by_contacts()

    def check(self, outer_share: float, inner_share: float | None = None) -> Found:
        """As ``HostBuild``."""
        mode = CHECK
        if inner_share is not None:
            mode = CHECK | BUILD
            self._give_arrays_length()
        self._run(mode, inner_share or 0.0, outer_share)
        built = bool(self._read[CHOSEN])
        if built:
            self._take_over(inner_share or 0.0)
        else:
            self.batch.set_time()  # for what the host launches next
        return Found(int(self._read[FOUND]), self._scratch.found.numpy(), built)

    def inner(self) -> None:
        """As ``HostBuild``."""
        self._give_arrays_length()
        self._run(BUILD, self.lists.inner_share, 0.0)
        self._take_over(self.lists.inner_share)

    def _give_arrays_length(self) -> None:
        """Give the arrays their length where it is another than that of the list before."""
        a = self.lists
        sized_for = self.state.slots, a.outer.slot.shape[0]
        if sized_for != self._sized_for or a.wall_contacts is not self._sized_walls:
            self.size_by_grains()
            self._sized_for, self._sized_walls = sized_for, a.wall_contacts
        shape = a.owner.shape[0], a.next_history.shape[1], a.owner.shape[1]
        a.next_history = self.storage.next_history(shape, a.version, a.real)

    def _run(self, mode: int, inner_share: float, outer_share: float) -> None:
        """Launch the kernel; arguments as there."""
        a, b, m, n, structs = self.lists, self.batch, self.model, self.state.slots, self.program.structs
        found = self.storage.pool.buffer("found", (n,), wp.int32)
        put(self._scratch, listed=a.listed, sums=b.scratch(n).sums, found=found, report=self._report)
        self._arrivals[:] = 0
        put(
            self._work, mode=mode, schedule_row=b.row()[0], inner_share=inner_share, unused_slot=a.slot_force.shape[0] - 1,
            near_feature=a.near_feature, old_history=a.history,
        )  # fmt: skip
        read = structs.grains(), structs.outer(), structs.references(outer_share)
        a.give_films_to_walls()
        walls = a.wall_contacts if a.wall_contacts is not None else self._no_wall_contacts
        self.launch.on_each(
            m.kernels.inner.build_inner, self._threads(n), self._work, b.model, b.control, b.watched, *read, b.report,
            self._scratch, structs.counts(), structs.starts(), structs.contacts(), walls,
        )  # fmt: skip

    def _take_over(self, inner_share: float) -> None:
        """Let the list that was built be the inner list; longer arrays first where those there were too short."""
        a = self.lists
        a.set_totals(self._read[TOTALS].tolist())
        if not self._read[FILLED]:  # too short
            self.size_by_contacts()
            self._run(BUILD, inner_share, 0.0)
        self.storage.adopt_history(a)
        a.inner_built()


def threads_for_lists(grains: int, threads: int) -> int:
    """Threads of ``threads`` that work on the lists of so many grains: each takes whole blocks of them."""
    return max(1, min(threads, grains // BLOCK))
