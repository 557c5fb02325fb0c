"""Many steps as one captured graph, lists refreshed inside it: how a GPU runs, and a CPU when asked to."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpdem.engine.graph_rebuild import Renewal
from warpdem.engine.neighbor_list import CLASS_BLOCK
from warpdem.kernels.lists import numbering
from warpdem.kernels.step.graph import (
    CLOCK,
    DONE,
    FAR,
    FRESH,
    GO,
    HOLD,
    LANES,
    LATEST,
    LEFT,
    PARITY,
    REFRESH,
    REFRESHES,
    RENEWALS,
    ROW,
    ROWS,
    SHARES,
    SOON,
    STALE,
)
from warpdem.kernels.step.motion import BEYOND
from warpdem.kernels.step.motion import LEFT as LEFT_DOMAIN
from warpdem.kernels.step.schedule import Placement

BODY = 4  # steps between two looks at the clock: a look costs about a launch, a step in vain three
GRAPHS = 2  # kept: the room of a list may grow


class Resident:
    """Runs batches of steps; the clock is all that goes back and forth.

    Attributes:
        refreshes: how often the contact list was made on the device.
        renewals: how often the near list was made there.
        captures: how often a graph was captured.
    """

    def __init__(self, sim, control) -> None:
        self.sim, self.control = sim, control
        device = sim.device
        self.clock = wp.zeros(CLOCK, dtype=wp.int32, device=device)
        self.placements = wp.zeros(max(len(sim.schedule.motions), 1), dtype=Placement, device=device)
        self.refreshes = self.renewals = self.captures = 0
        self._scratch: Scratch | None = None
        self._graphs: dict[tuple, tuple] = {}

    def forget(self) -> None:
        """Let go of the graphs and their arrays: the host makes others."""
        self._graphs.clear()

    def scratch(self, n: int) -> "Scratch":
        """Scratch for lists of ``n`` grains."""
        if self._scratch is None or self._scratch.next_start.shape[0] != n + 1:
            self._scratch = Scratch.of(n, self.sim.device)
        return self._scratch

    def advance(self, base, count, forces_first, hold, parity, grains, packs, rows, surface) -> tuple[int, int]:
        """As ``Stepper.advance``: one launch of the graph, one look at the clock."""
        lists = self.sim.lists
        clock = np.zeros(CLOCK, dtype=np.int32)
        clock[[ROW, LEFT, PARITY, HOLD, GO]] = base, count, parity, hold, count > 0
        clock[[LANES, SHARES, ROWS]] = lists.totals
        clock[RENEWALS] = lists.renewals_left
        clock[SOON] = lists.flights.wanted_before()
        self.clock.assign(clock)
        launches = Launches(self, grains, rows, surface)
        if forces_first:
            launches.forces(0)
        if count:
            self._run(launches)
        clock = self.clock.numpy()
        renewals = lists.renewals_left - int(clock[RENEWALS])
        self.renewals += renewals
        lists.renewed_on_device(renewals)
        if clock[REFRESHES]:
            self.refreshes += int(clock[REFRESHES])
            latest, totals = self.sim.step_number + int(clock[LATEST]), clock[[LANES, SHARES, ROWS]].tolist()
            lists.refreshed_on_device(int(clock[REFRESHES]), latest, totals)
        # where the host is next for nothing else, a grain has left
        return int(clock[DONE]), int(clock[STALE] > 0) * (LEFT_DOMAIN | BEYOND * int(clock[FAR] > 0))

    def _run(self, launches: "Launches") -> None:
        """Launch the graph of these arrays, captured at first use; step by step where conditional nodes are unknown."""
        device = self.sim.device
        if device.is_cuda and not wp.is_conditional_graph_supported():
            launches.loop()
            return
        key = launches.key()
        if key not in self._graphs:
            launches.load()
            with wp.ScopedCapture(device=device) as capture:
                launches.loop()
            while len(self._graphs) >= GRAPHS:
                self._graphs.pop(next(iter(self._graphs)))
            self._graphs[key] = capture.graph, launches  # kept: the arrays that it reads and writes
            self.captures += 1
        wp.capture_launch(self._graphs[key][0])


@dataclass(frozen=True)
class Scratch:
    """What lists are made with on the device, made before a graph is captured: its branches may not ask for memory."""

    nothing: wp.array
    sums: wp.array
    """Of each block of grains."""
    next_start: wp.array
    """Of the rows of a new near list."""
    entries: wp.array
    """[1]: neighbours in it."""
    slots: wp.array
    """[1]: slots beside walls."""

    @classmethod
    def of(cls, n: int, device) -> "Scratch":
        """Scratch for ``n`` grains."""
        nothing, next_start, entries, slots = (wp.zeros(size, dtype=wp.int32, device=device) for size in (0, n + 1, 3, 3))
        return cls(nothing, wp.zeros(-(-n // CLASS_BLOCK), dtype=numbering.Sums, device=device), next_start, entries, slots)


def addresses(*structs) -> tuple[int, ...]:
    """Where the arrays of structs lie."""
    arrays = [getattr(one, name) for one in structs for name in one._cls.vars]
    return tuple(x.ptr or 0 for x in arrays if isinstance(x, wp.array))


class Launches:
    """The launches of a graph over one set of arrays."""

    def __init__(self, resident: Resident, grains, rows, surface) -> None:
        self.resident, self.sim = resident, resident.sim
        self.grains, self.rows, self.surface = grains, rows, surface
        sim, lists = self.sim, self.sim.lists
        self.kernels = sim.kernels.resident
        self.n, self.reach = sim.state.slots, lists.reach
        self.scratch, self.watched = resident.scratch(self.n), self.sim.guards.travel.watched
        contacts = self.contacts = self.kernels.Contacts()
        for name in ("owner", "partner", "kind", "slot_i", "slot_j", "memory"):
            setattr(contacts, name, getattr(lists, name))
        contacts.trial = lists.trial if len(sim.plan.backend.scheme.STAGES) > 1 else lists.memory
        contacts.next = lists.spare.memory
        self.select = {**lists.select_inputs, "flight": lists.flights.path}
        self.fill = {**lists.fill_inputs, "memory": contacts.memory}

    def key(self) -> tuple:
        """What the graph holds by value, between two near lists made by the host, which forgets all graphs."""
        control, lists = self.resident.control, self.sim.lists
        arrays = [*self.select.values(), *self.fill.values(), lists.near_reference]
        given = [x.ptr if isinstance(x, wp.array) else x for x in arrays]
        more = [x.shape for x in (self.contacts.owner, self.grains.row)]
        structs = addresses(control, self.grains, self.rows, self.contacts, lists.grids)
        return self.n, self.reach, lists.skin, *given, *more, *structs

    def load(self) -> None:
        """Compile what the graph launches: not possible within a capture on every system."""
        sim = self.sim
        for group in (self.kernels, sim.kernels.renewal, sim.kernels.lists, sim.kernels.walls, numbering):
            for thing in vars(group).values() if group is not None else ():
                if isinstance(thing, wp.Kernel):
                    wp.load_module(thing.module, device=sim.device)

    def launch(self, kernel, dim: int, *inputs) -> None:
        """Launch over ``dim`` threads, if any."""
        if dim:
            wp.launch(kernel, dim=dim, inputs=inputs, device=self.sim.device)

    def pair_forces(self, ahead: int, stage: int = 0) -> None:
        """Forces of the contacts between grains ``ahead`` steps from now."""
        inputs = ahead, stage, self.grains, self.contacts, self.resident.control, self.sim.coefficients, self.resident.clock
        self.launch(self.kernels.pair_forces, self.contacts.owner.size, *inputs, self.sim.dt)

    def wall_forces(self, ahead: int, stage: int = 0) -> None:
        """Forces of the contacts with walls ``ahead`` steps from now."""
        if self.sim.plan.walls.present:
            inputs = ahead, stage, self.grains, self.rows, self.surface, self.resident.control, self.sim.coefficients
            more = self.sim.plan.contact.materials, self.resident.clock, self.sim.dt
            self.launch(self.kernels.wall_forces, self.n, *inputs, *more)

    def move(self, ahead: int, stage: int = 0) -> None:
        """The step that begins ``ahead`` steps from now."""
        inputs = ahead, stage, self.grains, self.rows, self.resident.control, self.resident.clock, self.sim.dt, self.reach
        self.launch(self.kernels.move, self.n, *inputs)

    def forces(self, ahead: int, stage: int = 0) -> None:
        """All forces ``ahead`` steps from now."""
        self.pair_forces(ahead, stage)
        self.wall_forces(ahead, stage)

    def loop(self) -> None:
        """All steps that the clock has left, or those until the host is asked."""
        wp.capture_while(self.resident.clock[GO : GO + 1], self._body)

    def _body(self) -> None:
        sim, control, clock = self.sim, self.resident.control, self.resident.clock
        for ahead in range(BODY):
            for stage in range(len(sim.plan.backend.scheme.STAGES)):
                if stage:
                    self.forces(ahead, stage)
                self.move(ahead, stage)
            self.forces(ahead + 1)
        placements = self.resident.placements
        self.launch(self.kernels.tick, 1, BODY, len(sim.schedule.motions), control, clock, placements)
        wp.capture_if(clock[REFRESH : REFRESH + 1], self._select)

    def _select(self) -> None:
        """Whether lists can be made here; the near list first, where it is out of date."""
        sim, lists, control, clock = self.sim, self.sim.lists, self.resident.control, self.resident.clock
        placements = self.resident.placements
        room = 0.5 * lists.skin - self.reach
        self.launch(self.kernels.look, self.n, self.grains, lists.near_reference, control, self.watched, placements,
                     sim.dt, room, clock)  # fmt: skip
        Renewal(self)()
        self.launch(self.kernels.go_on, 1, clock)
        wp.capture_if(clock[FRESH : FRESH + 1], self._list)

    def _list(self) -> None:
        """Which contacts and wall rows there will be, and whether there is room for them."""
        sim, lists, clock, placements = self.sim, self.sim.lists, self.resident.clock, self.resident.placements
        self.launch(sim.kernels.lists.select_contacts, self.n, 0, *self.select.values())
        walls = wall_grain = self.scratch.nothing
        if sim.plan.walls.present:
            self.launch(sim.kernels.walls.close_features, self.n, *lists.close_inputs(placements))
            walls, wall_grain = self.rows.candidates, self.rows.grain
        counts = [self.select[name] for name in ("touching", "close", "width")]
        starts = [self.fill[name] for name in ("touching_start", "close_start", "row_start")]
        self.number([*counts, walls], clock[LANES : ROWS + 1], [*starts, wall_grain])
        self.launch(self.kernels.judge, 1, self.contacts.owner.size, self.grains.row.shape[0] - 1, clock)
        wp.capture_if(clock[FRESH : FRESH + 1], self._fill)

    def number(self, counts: Sequence[wp.array], total: wp.array, starts: Sequence[wp.array]) -> None:
        """Number what ``counts`` say that each grain has: how many in all, and where each begins (``kernels.numbering``)."""
        sums, sizes = self.scratch.sums, (CLASS_BLOCK, self.sim.plan.backend.lanes)
        self.launch(numbering.sum_blocks, sums.shape[0], *sizes, *counts, sums)
        self.launch(numbering.start_blocks, 1, sums, total)
        self.launch(numbering.start_grains, sums.shape[0], *sizes, *counts, sums, *starts)

    def _fill(self) -> None:
        """The contact list and the forces of this instant."""
        sim, n, size = self.sim, self.n, self.contacts.owner.size
        self.launch(self.kernels.clear, size, min(1, n - 1), self.grains.row.shape[0] - 1, self.contacts)
        self.launch(sim.kernels.lists.fill_contacts, n, 0, *self.fill.values())
        if sim.plan.contact.memory:
            self.launch(self.kernels.take_over, size, self.contacts, self.resident.clock)
        marked = self.grains.record, self.resident.placements, self.grains.flight, self.grains.reference
        self.launch(self.kernels.mark, n, *marked)
        self.forces(0)
