"""Neighbor list and contacts of grains with each other."""

import functools

import numpy as np
import warp as wp
from warpdem.kernels.api.contact_law import ContactLaw
from warpdem.kernels.api.drift import step_row
from warpdem.kernels.api.grains import Grains, Load
from warpdem.kernels.api.listed_grains import ListedGrains
from warpdem.kernels.lists.cells import SizeGrids, start_lines
from warpdem.kernels.lists.neighbors import NeighborRows
from warpdem.kernels.lists.numbering import Counts, Starts, starts
from warpdem.kernels.lists.path import Flight

EVERYWHERE = 1.0e30  # share of the allowances within which all partners of the neighbor list are evaluated [-]
CAPACITY = 16  # partners per grain that the neighbor list can hold to begin with


class Pairs(ListedGrains):
    """Neighbor list and contacts of grains with each other.

    Args:
        grains: the grains.
        law: contact law.
        skin: gap up to which a pair is in the list [m]; the list is made again once a grain has moved by half of it. No bit of
            the result depends on it.

    Attributes:
        start: where the row of each grain begins in ``neighbor``, ``wp.array`` of int32, shape (n + 1,).
        count: neighbors of each grain, ``wp.array`` of int32, shape (n,).
        neighbor: indices of the neighbors, each row ascending, ``wp.array`` of int32.
        owner: the grain of lower index of each listed pair, ``wp.array`` of int32, shape (pairs, 1).
        partner: the other one, ``wp.array`` of int32, shape (pairs, 1).
        history: contact history of each listed pair, columns as in ``contact.columns.history``: tangential spring [m],
            rolling spring [rad], Coulomb load [N], the normal law's own, as far as there are any; ``wp.array`` of float64,
            shape (pairs, numbers, 1), at least one number.
        rebuilds: how often the list was made.
    """

    def __init__(self, grains: Grains, law: ContactLaw, skin: float) -> None:
        super().__init__(grains, law, skin)
        self._capacity = CAPACITY
        self._old: NeighborRows | None = None
        self._no_walls, self._no_load = self.ints(0), wp.zeros(0, dtype=Load, device=grains.device)
        self.history = wp.zeros((0, max(law.history, 1), 1), dtype=wp.float64, device=grains.device)
        if len(grains) < 2:
            self.owner = self.partner = self.ints((0, 1))
            self.start = self._slot_start = self.ints(len(grains) + 1)
            self._pair_force = wp.zeros(1, dtype=self.kernels.pair_kernels.PairForce, device=grains.device)

    def apply(self, dt: float) -> None:
        """Write the sum of the contact forces and torques on each grain to ``grains.load``, for a step of ``dt`` [s]."""
        g, k = self.grains, self.kernels
        if len(g) > 1:
            self.update()
        row = step_row(dt, (0.0, 0.0, 0.0), g.steps == 0, g.device.alias)
        if len(self.owner):
            model, grains, contacts = k.structs.Model(), k.structs.Grains(), k.structs.ContactBatches()
            model.coefficients, model.dt = self._table, dt
            grains.record, grains.inverse, grains.slot_force = g.record, g.inverse, self._pair_force
            contacts.owner, contacts.partner, contacts.kind = self.owner, self.partner, self._pair
            contacts.slot_i, contacts.slot_j, contacts.history = self._slot_i, self._slot_j, self.history
            self.launch(k.pair_forces, len(self.owner), [row, model, grains, contacts, None])
        self.launch(k.pair_load, len(g), [self._slot_start, self._pair_force, self._no_walls, self._no_load, g.load])

    def _grid(self) -> SizeGrids:
        """One grid of cells as wide as two of the largest grains and the skin."""
        g, position = self.grains, self.grains.position.numpy()
        largest = float(g.radius.numpy().max())
        width = 2.0 * largest + self.law.gap + self.skin
        cells = np.minimum(np.ptp(position, axis=0) / width + 1.0, 256.0).astype(np.int32)
        grid = SizeGrids()
        grid.largest = wp.array([largest + 0.5 * self.skin], dtype=wp.float64, device=g.device)
        grid.per_length = wp.array([1.0 / width], dtype=wp.float64, device=g.device)
        grid.cells = wp.array(cells[None], dtype=wp.vec3i, device=g.device)
        grid.first, grid.lines = self.ints(1), int(cells[1:].prod())
        grid.end, grid.placed = self.ints(int(cells.prod()) + grid.lines), self.ints(2)
        grid.cell, grid.grain = self.ints(len(g)), self.ints(len(g))
        return grid

    def _make(self) -> None:
        g, outer, batches, n = self.grains, self.kernels.neighbors, self.kernels.batches, len(self.grains)
        grid, grains = self._grid(), self.listed()
        self.launch(outer.count_in_cells, n, [0, grid, g.record, self._allowance])
        self.launch(start_lines, grid.lines, [0, grid])
        self.launch(outer.sort_by_cell, n, [0, grid, g.record, self._allowance])
        count = self.ints(n)
        while True:
            start = wp.array(np.arange(n + 1, dtype=np.int32) * self._capacity, device=g.device)
            slot = self.ints(n * self._capacity)
            self.launch(outer.find_neighbors, n, [0, grid, grains, self._allowance, start, count, slot])
            longest = int(count.numpy().max())
            if longest <= self._capacity:
                break
            self._capacity = longest + longest // 4
        rows = NeighborRows()
        rows.start, rows.count, rows.slot, rows.contact = start, count, slot, self.ints(slot.shape, -1)
        rows.allowance = self._allowance
        if self._old is not None:
            self.launch(outer.carry_contacts, n, [0, g.id, self.ints(0), g.id, self._old, rows])
        listed, counts = self.ints(slot.shape), Counts()
        counts.touching, counts.near, counts.slots = self.ints(n), self.ints(n), self.ints(n)
        flight = wp.zeros(0, dtype=Flight, device=g.device)
        none = wp.zeros((0, 1, 1), dtype=batches.real, device=g.device)  # laws with bridges ask there what a contact holds
        self.launch(batches.select_contacts, n, [0, grains, rows, none, EVERYWHERE, flight, listed, counts])
        first = starts(counts.touching.numpy() + counts.near.numpy())
        slot_start = starts(counts.slots.numpy())
        contacts, second = int(first[-1]), first[:-1] + counts.touching.numpy()
        owner, partner, pair, slot_i, slot_j = (self.ints((contacts, 1)) for _ in range(5))
        history = wp.zeros((contacts, max(self.law.history, 1), 1), dtype=wp.float64, device=g.device)
        constants = wp.zeros((0, 1, 1), dtype=wp.float64, device=g.device)
        upload = functools.partial(wp.array, dtype=wp.int32, device=g.device)
        begin, listed_contacts = Starts(), batches.ListedContacts()
        begin.touching, begin.near, begin.slot = upload(first[:-1]), upload(second), upload(slot_start)
        for name, array in (("owner", owner), ("partner", partner), ("kind", pair), ("constants", constants),
                            ("slot_i", slot_i), ("slot_j", slot_j), ("history", history)):  # fmt: skip
            setattr(listed_contacts, name, array)
        law = self.law.materials, self._table
        self.launch(batches.fill_contacts, n, [0, grains, *law, rows, listed, begin, self.history, listed_contacts])
        self._slot_start = begin.slot
        self.start, self.count, self.neighbor = start, count, slot
        self.owner, self.partner, self.history = owner, partner, history
        self._pair, self._slot_i, self._slot_j, self._old = pair, slot_i, slot_j, rows
        self._pair_force = wp.zeros(int(slot_start[-1]) + 1, dtype=self.kernels.pair_kernels.PairForce, device=g.device)
