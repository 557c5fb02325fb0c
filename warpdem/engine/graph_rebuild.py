"""Launches that make the near list anew inside a captured graph; what they do, ``kernels.renewal`` says."""

import warp as wp

from warpdem.kernels.step.graph import NEAR


class Renewal:
    """The launches over the arrays of ``launches``, those of the graph."""

    def __init__(self, launches) -> None:
        self.launch, self.number, self.rows, self.n = launches.launch, launches.number, launches.rows, launches.n
        self.sim, self.resident, self.scratch = launches.sim, launches.resident, launches.scratch
        self.kernels, self.lists = self.sim.kernels.renewal, self.sim.lists
        self.skin = self.lists.skin
        self.start, self.count, self.slot, self.contact = self.lists.near
        # where the new list is until it takes its place: arrays that the making of the contact list, next, writes anew
        self.next_start, self.next_count = self.scratch.next_start, launches.select["width"]
        self.next_slot, self.next_contact = launches.select["listed"], self.lists.spare.contact
        self.features, self.first = launches.select["close"], launches.fill["row_start"]
        self.near_feature = self.lists.near_feature

    def __call__(self) -> None:
        """Make the list, if the clock says that it is out of date and may be made here."""
        clock = self.resident.clock
        self.launch(self.kernels.ask, 1, clock)
        wp.capture_if(clock[NEAR : NEAR + 1], self._search)

    def _search(self) -> None:
        """What the list would be, and whether there is room for it."""
        sim, scratch, grids = self.sim, self.scratch, self.lists.grids
        clock, record, near = self.resident.clock, sim.state.record, sim.kernels.lists
        grids.head.zero_()
        self.launch(near.insert_grains, self.n, grids, record)
        self._near_rows(scratch.nothing)
        self._number(self.next_count, scratch.entries, self.next_start)
        if sim.plan.walls.present:
            self._near_features(0)
            self._number(self.features, scratch.slots, self.first)
        room = self.near_feature.shape[0] if sim.plan.walls.present else 0
        self.launch(self.kernels.judge_room, 1, scratch.entries, self.slot.shape[0], scratch.slots, room, clock)
        wp.capture_if(clock[NEAR : NEAR + 1], self._put_in_place)

    def _near_rows(self, start: wp.array) -> None:
        """Count the neighbours of each grain, or write them from ``start`` on."""
        sim, found = self.sim, (self.next_count, self.next_slot)
        inputs = 0, self.lists.grids, sim.state.record, sim.state.id, self.skin, start, *found
        self.launch(sim.kernels.lists.near_rows, self.n, *inputs)

    def _near_features(self, fill: int) -> None:
        """Count the features near each grain, or write their numbers."""
        sim, nothing = self.sim, self.scratch.nothing
        first, feature = (self.first, self.near_feature) if fill else (nothing, nothing)
        shared = [sim.state.record, 0.5 * self.skin, sim.walls.surface, *sim.walls.mesh_arrays, self.resident.placements]
        self.launch(sim.kernels.walls.near_features, self.n, 0, fill, *shared, first, self.features, feature)

    def _number(self, count: wp.array, total: wp.array, start: wp.array) -> None:
        """Where the row of each grain begins; ``total[1]`` is the length of all."""
        nothing = self.scratch.nothing
        self.number((nothing, nothing, count, nothing), total, (nothing, nothing, start, nothing))

    def _put_in_place(self) -> None:
        """The contacts are carried over, and the list takes the place of the old one."""
        sim, resident, id = self.sim, self.resident, self.sim.state.id
        old = self.start, self.count, self.slot, self.contact
        fresh = self.next_start, self.next_count, self.next_slot
        self._near_rows(self.next_start)
        inputs = 0, id, *fresh, self.scratch.nothing, id, *old, self.next_contact
        self.launch(sim.kernels.lists.carry_contacts, self.n, *inputs)
        self.launch(self.kernels.put_in_place, self.n, *fresh, self.next_contact, *old, self.lists.flights.path)
        if sim.plan.walls.present:
            self._near_features(1)
            self.launch(self.kernels.move_places, self.n, self.first, resident.clock, self.rows)
            self.launch(self.kernels.settle_places, self.n, self.first, resident.clock, self.rows)
        marked = sim.state.record, resident.placements, self.lists.flights.path, self.lists.near_reference
        self.launch(sim.kernels.resident.mark, self.n, *marked)
