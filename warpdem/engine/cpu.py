"""The executor of a CPU: the host decides, list builds are split over threads, a batch of steps is one launch per thread.

The kernel of that launch, ``kernels.step.loop.run``, is the sequence of ``program.Step`` fused: its threads meet after each
phase, and none of them comes back to Python before the batch is done or a grain has moved too far.
"""

import time
from collections.abc import Callable

import numpy as np
import warp as wp

from warpdem.core.threads import Threads, ranges
from warpdem.engine.batch import Batch
from warpdem.engine.buffers import BufferPool
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.host_build import HostLaunch
from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.pace import Pace
from warpdem.engine.structs import Structs
from warpdem.kernels.step.loop import SPAN
from warpdem.kernels.wall.surface import Surface
from warpdem.model.compiled import step_kernels
from warpdem.model.model import Model
from warpdem.state.clock import Clock
from warpdem.state.particles import State

SCHEDULE_STEPS = (256, 4096)  # whose schedule is written to the device at once; a batch ends with it
GRAIN_STEPS = 200_000  # of a batch that takes about as long as people wait for an answer to Ctrl-C


class CpuStorage:
    """Arrays of the lists, of just the length that they need; the contact history goes back and forth between two."""

    rows_are_counted = False

    def __init__(self, device: wp.Device) -> None:
        self.pool = BufferPool(device, exact=False)

    def selection(self, entries: int) -> wp.array:
        """As ``host_build.Storage``."""
        return self.pool.buffer("listed", (entries,), wp.int32)

    def force_slots(self, shape: tuple[int, int], history: tuple[int, int, int], entries: int, real: type) -> wp.array:
        """As ``host_build.Storage``."""
        return self.pool.buffer("row", shape, real)

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
    """

    def __init__(self, model: Model, state: State, clock: Clock, threads: Threads) -> None:
        self._model, self._state, self._clock, self._threads = model, state, clock, threads
        self.threads = threads.count
        self.storage = CpuStorage(model.device)
        self.launch = HostLaunch(model.device, threads)
        self.pace = Pace()

    def steps_ahead(self) -> int:
        """Steps of the next schedule: a short one would cost few grains more than their steps."""
        low, high = SCHEDULE_STEPS
        return min(max(GRAIN_STEPS // max(len(self._state), 1), low), high)

    def load_kernels(self) -> None:
        """Load the kernels of the steps and the lists, the last first: ``app.compile_ahead`` compiles from the other end."""
        for kernel in reversed(step_kernels(self._model.kernels)):
            wp.load_module(kernel.module, device=self._model.device)

    def forget(self) -> None:
        """Let go of arrays of the lists: nothing of them is kept."""

    def advance(
        self, count: int, forces_first: bool, hold: bool, lists: NeighborLists, structs: Structs, batch: Batch
    ) -> tuple[int, int]:
        """One launch per thread for the whole batch; as ``Engine.advance``."""
        model, control, threads = self._model, batch.control, self._threads
        base, _ = batch.row()
        grains, contacts, wall_contacts = structs.arguments()
        max_threads = threads.at_work(len(self._state))
        n = self.pace.threads(max_threads) if threads.as_pays else max_threads
        kernel = model.kernels.loop.run
        wp.load_module(kernel.module, device=model.device)  # loading is not safe from several threads
        thread_ranges = np.zeros(control.thread_ranges.shape, dtype=np.int32)
        thread_ranges[:n] = np.hstack([ranges(m, n) for m in (contacts.owner.shape[0], self._state.slots, lists.row_count)])
        control.thread_ranges.assign(thread_ranges)
        control.meeting.zero_()
        control.moved.zero_()
        surface = model.walls.surface if model.walls is not None else Surface()
        before = base, count, int(forces_first), int(hold), self._clock.step_number & 1
        after = control, model.coefficients, model.features.contact.materials, model.dt, lists.max_displacement

        def job(thread: int) -> Callable[[], None]:
            inputs = [thread, n, *before, grains, contacts, wall_contacts, surface, *after]
            return lambda: wp.launch(kernel, dim=1, inputs=inputs, device=model.device)

        wall, used = time.perf_counter(), time.process_time()
        threads.together([job(t) for t in range(n)])
        if count == 0:
            return 0, 0
        done = int(control.done.numpy()[0])
        if max_threads > 1:
            self.pace.done(max_threads, done, time.perf_counter() - wall, time.process_time() - used)
        return done, int(np.bitwise_or.reduce(control.moved.numpy()[::SPAN]))
