"""The executor of a CPU: the host decides, list builds are split over threads, a batch of steps is one launch per thread.

The kernel of that launch, ``kernels.step.loop.run``, is the sequence of ``program.Step`` fused: its threads meet after each
phase, and none of them comes back to Python before the batch is done or a grain has moved too far.
"""

import time

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.core.threads import Threads, ranges
from warpdem.engine.batch import Batch
from warpdem.engine.buffers import BufferPool
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.cpu_lists import ThreadedBuild, threads_for_lists
from warpdem.engine.host_build import HostLaunch
from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.pace import Pace
from warpdem.engine.structs import Structs
from warpdem.kernels.lists.cells import COPIED, SPARE
from warpdem.kernels.step.structs import BOUNDARY, SPAN, Steps
from warpdem.model.compiled import step_kernels
from warpdem.model.model import Model
from warpdem.state.clock import Clock
from warpdem.state.particles import State

SCHEDULE_STEPS = (256, 4096)  # whose schedule is written to the device at once; a batch ends with it
GRAIN_STEPS = 200_000  # of a batch that takes about as long as people wait for an answer to Ctrl-C


class CpuStorage:
    """Arrays of the lists with spare capacity; the contact history goes back and forth between two."""

    rows_are_counted = False

    def __init__(self, device: wp.Device) -> None:
        self.pool = BufferPool(device, exact=True)

    def selection(self, entries: int) -> wp.array:
        """As ``host_build.Storage``."""
        return self.pool.buffer("listed", (entries,), wp.int32)

    def copies(self, grains: int) -> wp.array:
        """As ``host_build.Storage``; in the memory of what the inner list selects, which is built after it."""
        columns, rows = COPIED, grains + SPARE
        memory = self.pool.buffer("listed", (2 * columns * rows,), wp.int32)
        return array_view(memory, (columns, rows), wp.float64)

    def force_slots(self, shape: tuple[int, int], history: tuple[int, int, int], entries: int, real: type) -> wp.array:
        """As ``host_build.Storage``."""
        return self.pool.buffer("slot force", shape, real)

    def next_history(self, shape: tuple[int, int, int], version: int, real: type) -> wp.array:
        """As ``host_build.Storage``."""
        return self.pool.buffer(f"memory{version & 1}", shape, real)

    def adopt_history(self, lists: ContactLists) -> None:
        """As ``host_build.Storage``."""
        lists.history = lists.next_history


class CpuExecutor:
    """Runs batches of steps on CPU threads.

    Attributes:
        pace: how many of the threads are used while other programs want the cores too.
        exchange: address of the function that steps call in a run over several processes (``kernels.step.exchange``), else 0.
    """

    def __init__(self, model: Model, state: State, clock: Clock, threads: Threads) -> None:
        self._model, self._state, self._clock, self._threads = model, state, clock, threads
        self.threads = threads.count
        self.storage = CpuStorage(model.device)
        self.launch = HostLaunch(model.device, threads)
        self.pace, self._steps = Pace(), Steps()
        self.exchange = 0

    def steps_ahead(self) -> int:
        """Steps of the next schedule: a short one would cost few grains more than their steps."""
        low, high = SCHEDULE_STEPS
        return min(max(GRAIN_STEPS // max(len(self._state), 1), low), high)

    def list_build(self, lists: ContactLists, batch: Batch) -> ThreadedBuild:
        """What builds the lists."""
        return ThreadedBuild(self._model, self._state, lists, batch, self.launch, self.storage, self._threads_of_lists)

    def _threads_of_lists(self, grains: int) -> int:
        return threads_for_lists(grains, self._at_work()[0])

    def _at_work(self) -> tuple[int, int]:
        """Threads of the next batch, and how many there would be on a machine with nothing else to do."""
        most = self._threads.at_work(len(self._state))
        return self.pace.threads(most) if self._threads.as_pays else most, most

    def load_kernels(self) -> None:
        """Load the kernels of the steps and the lists, the last first: ``app.compile_ahead`` compiles from the other end."""
        for kernel in reversed(step_kernels(self._model.kernels)):
            wp.load_module(kernel.module, device=self._model.device)

    def forget(self) -> None:
        """Let go of arrays of the lists."""
        self.launch.forget()

    def advance(
        self, count: int, forces_first: bool, hold: bool, lists: NeighborLists, structs: Structs, batch: Batch
    ) -> tuple[int, int]:
        """One launch per thread for the whole batch; as ``Engine.advance``."""
        model, control, report, steps = self._model, batch.control, batch.report, self._steps
        grains, contacts, wall_contacts = structs.arguments()
        n, most = self._at_work()
        kernel = model.kernels.loop.run
        # views of the memory that the kernel reads and writes
        thread_ranges, moved = control.thread_ranges.numpy(), report.moved.numpy()
        batches, inside = lists.totals[0] // model.features.backend.lanes, lists.batches_inside
        several = [ranges(m, n) for m in (inside, self._state.owned, lists.row_count, batches - inside)]
        thread_ranges[:n] = np.hstack(several)
        thread_ranges[:n, BOUNDARY:] += inside
        for counts in (report.arrivals, report.taken):
            counts.numpy()[:] = 0
        moved[:] = 0
        steps.row, steps.count, steps.parity = batch.row()[0], count, self._clock.step_number & 1
        steps.forces_first, steps.hold, steps.inner_share = int(forces_first), int(hold), lists.share_that_holds
        steps.exchange = self.exchange

        wall, used = time.perf_counter(), time.process_time()
        self.launch.on_each(kernel, n, steps, batch.model, control, grains, contacts, wall_contacts, report)
        if count == 0:
            return 0, 0
        done = int(report.done.numpy()[0])
        if most > 1 and not self.exchange:  # there threads wait for other processes too
            self.pace.done(most, done, time.perf_counter() - wall, time.process_time() - used)
        return done, int(np.bitwise_or.reduce(moved[::SPAN]))
