"""The executor of a GPU: many steps as one captured graph, with the list builds inside it; a CPU runs it too when asked to.

The device decides what comes next by the conditions of its clock (``kernels.step.clock``). The host builds the first lists and
those that the device cannot (``host_build``), and captures the launches of ``program`` over the arrays that these have.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import warp as wp

from warpdem.core.threads import Threads
from warpdem.engine.batch import Batch
from warpdem.engine.buffers import BufferPool
from warpdem.engine.contact_lists import ContactLists, NewOuterList
from warpdem.engine.host_build import HostBuild, HostLaunch
from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.program import ListBuild, Step
from warpdem.engine.structs import Structs
from warpdem.kernels.lists import cells, numbering
from warpdem.kernels.step.clock import (
    ASK_HOST,
    BEYOND_LISTS,
    BUILD_INNER,
    BUILD_OUTER,
    CHECK_LISTS,
    HOLD_FORCES,
    INNER_BUILDS,
    LATEST_BUILD,
    OUTER_BUILDS_LEFT,
    OUTER_NOT_BEFORE,
    RUN,
    STEPS_DONE,
    STEPS_LEFT,
    TOTALS,
)
from warpdem.kernels.step.motion import BEYOND, LEFT
from warpdem.model.model import Model
from warpdem.state.clock import Clock
from warpdem.state.particles import State

SCHEDULE_STEPS = 2048  # whose schedule is written to the device at once
BODY = 4  # steps between two looks at the clock: a look costs about a launch, a step in vain three
GRAPHS = 2  # kept: a list may get longer


@dataclass
class BuildScratch:
    """Scratch of a list build on the device; it lies in the array of the force slots, which hold nothing during a build."""

    history: wp.array
    """Contact history carried over, as ``ContactLists.history``."""
    contact: wp.array
    """Contact of each pair of the outer list; in the same memory, for it is read before the history is copied."""
    listed: wp.array
    """What is selected of each entry of the outer list."""


class GraphStorage:
    """Arrays of the lists with spare capacity; the force array is reused as scratch during a build."""

    rows_are_counted = True
    scratch: BuildScratch

    def __init__(self, device: wp.Device) -> None:
        self._device = device
        self.pool = BufferPool(device, exact=True)

    def selection(self, entries: int) -> wp.array:
        """As ``host_build.Storage``."""
        return self.pool.zeros(entries, wp.int32)

    def copies(self, grains: int) -> wp.array:
        """As ``host_build.Storage``: threads read the grains themselves."""
        return self.pool.zeros((0, 0), wp.float64)

    def force_slots(self, shape: tuple[int, int], history: tuple[int, int, int], entries: int, real: type) -> wp.array:
        """As ``host_build.Storage``; ``scratch`` lies in the same memory."""
        width, device = wp.types.type_size_in_bytes(real), self._device
        carried = -(-max(width * int(np.prod(history)), 4 * entries) // 8) * 8
        memory = self.pool.buffer("slot force", (max(int(np.prod(shape)), -(-(carried + 4 * entries) // width)),), real)
        self.scratch = BuildScratch(
            history=wp.array(ptr=memory.ptr, shape=history, dtype=real, device=device),
            contact=wp.array(ptr=memory.ptr, shape=entries, dtype=wp.int32, device=device),
            listed=wp.array(ptr=memory.ptr + carried, shape=entries, dtype=wp.int32, device=device),
        )
        return wp.array(ptr=memory.ptr, shape=shape, dtype=real, device=device)

    def next_history(self, shape: tuple[int, int, int], version: int, real: type) -> wp.array:
        """As ``host_build.Storage``."""
        return self.scratch.history

    def adopt_history(self, lists: ContactLists) -> None:
        """As ``host_build.Storage``."""
        lists.history = self.pool.buffer("memory", lists.next_history.shape, lists.real)
        wp.copy(lists.history, lists.next_history)
        lists.listed = self.scratch.listed


class GraphLaunch:
    """Launches that are captured: each over all its indices."""

    def __init__(self, device: wp.Device) -> None:
        self._device = device

    def __call__(self, kernel: wp.Kernel, count: int, *inputs: Any, split: bool = True) -> None:
        """As ``program.Launch``."""
        if count:
            wp.launch(kernel, dim=count, inputs=[0, *inputs], device=self._device)

    def once(self, kernel: wp.Kernel, *inputs: Any) -> None:
        """As ``program.Launch``."""
        wp.launch(kernel, dim=1, inputs=inputs, device=self._device)


class GraphExecutor:
    """Runs batches of steps as a graph; the clock is all that goes back and forth.

    Attributes:
        inner_builds: inner lists built on the device.
        outer_builds: outer lists built on the device.
        captures: how often a graph was captured.
    """

    threads = 1

    def __init__(self, model: Model, state: State, clock: Clock, threads: Threads) -> None:
        self._model, self._state, self._clock = model, state, clock
        self.storage = GraphStorage(model.device)
        self.launch = HostLaunch(model.device, threads)
        self.inner_builds = self.outer_builds = self.captures = 0
        self._graphs: dict[tuple, tuple[list[wp.Graph], list[wp.array]]] = {}

    def steps_ahead(self) -> int:
        """Steps of the next schedule."""
        return SCHEDULE_STEPS

    def list_build(self, lists: ContactLists, batch: Batch) -> HostBuild:
        """What builds the lists where the device does not."""
        return HostBuild(self._model, self._state, lists, batch, self.launch, self.storage)

    def load_kernels(self) -> None:
        """Nothing: they are compiled where the graph is captured."""

    def forget(self) -> None:
        """Let go of the graphs and their arrays: the host makes others."""
        self._graphs.clear()

    def advance(
        self, count: int, forces_first: bool, hold: bool, lists: NeighborLists, structs: Structs, batch: Batch
    ) -> tuple[int, int]:
        """One launch of the graph, one look at the clock; as ``Engine.advance``."""
        captured = Captured(self._model, self._state, lists, structs, batch, self.storage)
        self._begin(captured, count, forces_first, hold)
        if count:
            self._run(captured)
        del captured.build  # it refers back: without it old arrays are freed at once
        clock = batch.clock.numpy()
        outer = lists.device_builds_left - int(clock[OUTER_BUILDS_LEFT])
        self.outer_builds += outer
        lists.outer_built_on_device(outer, inner_lost=clock[ASK_HOST] > 0 and clock[BUILD_OUTER] > 0)
        if clock[INNER_BUILDS]:
            self.inner_builds += int(clock[INNER_BUILDS])
            latest = self._clock.step_number + int(clock[LATEST_BUILD])
            lists.inner_built_on_device(int(clock[INNER_BUILDS]), latest, clock[TOTALS].tolist())
        # where the host is asked for nothing else, a grain has left
        return int(clock[STEPS_DONE]), int(clock[ASK_HOST] > 0) * (LEFT | BEYOND * int(clock[BEYOND_LISTS] > 0))

    def _begin(self, captured: "Captured", count: int, forces_first: bool, hold: bool) -> None:
        """Set the clock for a batch of ``count`` steps; arguments as of ``advance``."""
        self._set_clock(captured.lists, captured.batch, count, hold)
        if forces_first:
            captured.step.forces(0)

    @staticmethod
    def _set_clock(lists: NeighborLists, batch: Batch, count: int, hold: bool) -> None:
        batch.set_time()
        clock = batch.clock.numpy().copy()
        clock[[STEPS_LEFT, HOLD_FORCES, RUN]] = count, hold, count > 0
        clock[TOTALS] = lists.totals
        clock[OUTER_BUILDS_LEFT] = lists.device_builds_left
        clock[OUTER_NOT_BEFORE] = lists.flights.wanted_before()
        batch.clock.assign(clock)

    def _run(self, captured: "Captured") -> None:
        """Launch the graph of these arrays; step by step where conditional nodes are unknown."""
        if self._model.device.is_cuda and not wp.is_conditional_graph_supported():
            captured.loop()
            return
        wp.capture_launch(self._graphs_of(captured, [captured.loop])[0])

    def _graphs_of(self, captured: "Launches", parts: Sequence[Callable[[], None]]) -> list[wp.Graph]:
        """Graphs of the launches of each of ``parts`` over these arrays, captured at first use."""
        key = captured.key()
        if key not in self._graphs:
            captured.load()
            graphs = []
            for part in parts:
                with wp.ScopedCapture(device=self._model.device) as capture:
                    part()
                graphs.append(capture.graph)
            while len(self._graphs) >= GRAPHS:
                self._graphs.pop(next(iter(self._graphs)))
            self._graphs[key] = graphs, captured.arrays()  # kept: the arrays that they read and write
            self.captures += 1
        return self._graphs[key][0]


class Launches(Protocol):
    """What is captured."""

    def key(self) -> tuple:
        """What the graph holds by value."""

    def load(self) -> None:
        """Compile what the graph launches: not possible within a capture on every system."""

    def arrays(self) -> list[wp.array]:
        """All arrays that the launches read and write."""


class Captured:
    """The launches of a graph over the present arrays, and the decisions of ``program.ListBuild`` made on the device."""

    def __init__(
        self, model: Model, state: State, lists: NeighborLists, structs: Structs, batch: Batch, storage: GraphStorage
    ) -> None:
        self.model, self.state, self.lists, self.batch, self.storage = model, state, lists, batch, storage
        self.launch = GraphLaunch(model.device)
        self.scratch = batch.scratch(state.slots)
        grains, self.contacts, wall_contacts = structs.arguments()
        share = lists.share_that_holds
        self.step = Step(model, state.owned, (grains, self.contacts, wall_contacts), batch, share, self.launch)
        self.build = ListBuild(model, state, lists, batch, self.launch, self)
        # while the outer list is built it is in arrays that the inner list, built next, writes again
        nothing = self.scratch.nothing
        lists.new = NewOuterList(
            start=self.scratch.start, count=lists.width, slot=storage.scratch.listed, contact=storage.scratch.contact,
            allowance=self.scratch.allowance, capacity_start=nothing, old_slot=nothing, old_id=state.id,
            feature_count=lists.near, first=lists.slot_start, met=self.scratch.met,
        )  # fmt: skip

    # -- the loop -------------------------------------------------------------------------------

    def loop(self) -> None:
        """All steps that the clock has left, or those until the host is asked."""
        wp.capture_while(self._condition(RUN), self._body)

    def _condition(self, slot: int) -> wp.array:
        return self.batch.clock[slot : slot + 1]

    def _body(self) -> None:
        for ahead in range(BODY):
            self.step(ahead)
        motions, b = len(self.model.schedule.motions), self.batch
        self.launch.once(self.model.kernels.graph.advance_clock, BODY, motions, b.control, b.clock, b.placements)
        wp.capture_if(self._condition(CHECK_LISTS), self._build_lists)

    def _build_lists(self) -> None:
        """The outer list, if it is out of date and may be built here, then the inner list, unless the host is asked."""
        lists, clock = self.lists, self.batch.clock
        self._settle_liquid()
        self.build.check(self.scratch.nothing, 1.0 - lists.inner_share)
        self.launch.once(self.model.kernels.rebuild.ask_outer, clock)
        wp.capture_if(self._condition(BUILD_OUTER), self.build.build_outer)
        self.launch.once(self.model.kernels.graph.resume, clock)
        wp.capture_if(self._condition(BUILD_INNER), self.build.build_inner)

    def _settle_liquid(self) -> None:
        """As ``ContactLists.settle_liquid``."""
        model, state, lists, contacts = self.model, self.state, self.lists, self.contacts
        if model.liquid is None:
            return
        inputs = [
            model.features.backend.lanes, model.liquid.quantum, state.record, contacts.owner, contacts.partner, contacts.kind,
            model.coefficients, contacts.slot_i, contacts.slot_j, lists.slot_force_vectors, contacts.history, state.film,
        ]  # fmt: skip
        self.launch(model.kernels.films.settle_contacts, contacts.owner.size, *inputs)

    # -- decisions ------------------------------------------------------------------------------

    def outer_fits(self, write: Callable[[], None]) -> None:
        """As ``program.Decisions``."""
        entries, slots = self.lists.outer.slot.shape[0], 0
        if self.model.walls is not None:
            slots = self.lists.near_feature.shape[0]
        lengths = self.scratch.entries, entries, self.scratch.slots, slots
        self.launch.once(self.model.kernels.rebuild.check_outer_capacity, *lengths, self.batch.clock)
        wp.capture_if(self._condition(BUILD_OUTER), write)

    def replace_outer(self) -> None:
        """As ``program.Decisions``."""
        lists = self.lists
        new, old = self.build.structs.new(), self.build.structs.outer()
        self.launch(self.model.kernels.rebuild.replace_outer, self.state.slots, new, old, lists.flight)

    def move_wall_contacts(self) -> None:
        """As ``program.Decisions``."""
        kernels, lists = self.model.kernels.rebuild, self.lists
        for kernel in (kernels.move_wall_contacts, kernels.settle_wall_contacts):
            self.launch(kernel, self.state.slots, lists.new.first, self.batch.clock, lists.wall_contacts)

    def inner_fits(self, write: Callable[[], None]) -> None:
        """As ``program.Decisions``; with the list come the forces of the present positions."""

        def write_and_evaluate() -> None:
            write()
            self.step.forces(0)

        lanes, slots = self.contacts.owner.size, self.lists.slot_force.shape[0] - 1
        self.launch.once(self.model.kernels.graph.check_capacity, lanes, slots, self.batch.clock)
        wp.capture_if(self._condition(BUILD_INNER), write_and_evaluate)

    def adopt_history(self) -> None:
        """As ``program.Decisions``."""
        if self.model.features.memory:
            kernel, new = self.model.kernels.graph.adopt_history, self.storage.scratch.history
            self.launch(kernel, self.contacts.owner.size, new, self.batch.clock, self.contacts.history)

    # -- what was captured ------------------------------------------------------------------------

    def arrays(self) -> list[wp.array]:
        """All arrays that the launches read and write."""
        lists, found = self.lists, []
        for owner in (lists, lists.outer, lists.new, self.state, self.scratch, self.batch):
            values = owner if isinstance(owner, tuple) else vars(owner).values()
            found += [value for value in values if isinstance(value, wp.array)]
        structs = [self.batch.control, self.batch.report, self.step.grains, self.step.wall_contacts, self.contacts, lists.grids]
        if self.model.schedule.dynamic:
            structs.append(self.batch.control.dynamic)
        return found + [x for one in structs for name in one._cls.vars if isinstance(x := getattr(one, name), wp.array)]

    def key(self) -> tuple:
        """What the graph holds by value."""
        lists = self.lists
        numbers = self.state.slots, self.state.owned, self.step.inner_share, lists.inner_share, lists.skin, lists.horizon
        return *numbers, lists.grids.lines, *((array.ptr, *array.shape) for array in self.arrays())

    def load(self) -> None:
        """Compile what the graph launches: not possible within a capture on every system."""
        k = self.model.kernels
        for group in (k.graph, k.rebuild, k.neighbors, k.batches, k.displacement, k.walls, k.films, cells, numbering):
            for thing in vars(group).values() if group is not None else ():
                if isinstance(thing, wp.Kernel):
                    wp.load_module(thing.module, device=self.model.device)
