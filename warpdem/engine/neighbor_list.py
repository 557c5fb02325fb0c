"""Host side of the lists: which grains and features may touch, when to look again, and what is carried over."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from warpdem.engine.buffers import Rooms
from warpdem.engine.flights import Flights
from warpdem.engine.newcomers import Newcomers
from warpdem.filling.size_grids import RowRoom, finest_cell, grids_for, size_classes, starts
from warpdem.kernels import grain
from warpdem.kernels.contact.dissipation import ENTRY
from warpdem.kernels.contact.pairs import share_width
from warpdem.kernels.lists.flight import BEYOND_NEAR, BEYOND_REACH, OFF_PATH
from warpdem.kernels.step.motion import BEYOND
from warpdem.state.listed_contacts import CONTACT_ARRAYS, ListedContacts
from warpdem.state.particles import changed

REFRESH_STEPS = (30, 100)  # steps between refreshes that the margin is steered to
CLASS_BLOCK = 256  # grains whose contacts are sorted by class together
REBUILD_STEPS = 120  # steps between rebuilds below which the skin grows (if it may)
MARGIN_SHARES = (0.02, 0.5)  # of the skin: bounds of the margin
LEAST_ROOM = 12  # room per row of the near list to begin with
KEPT_SHARE = 0.75  # of the slots in memory that hold a grain, at least: with fewer the lists are made anew without the others
NOBODY = np.zeros(0, dtype=np.int64)
RENEWALS = 64  # near lists that a device makes at most before the grains are sorted in memory again


def morton_order(position: np.ndarray, cell: float, device="cpu") -> np.ndarray:
    """Order of points (n, 3) [m] along a Z-order curve of cells of edge ``cell`` [m]; ties keep their order.

    Sorted on ``device`` by radix, on a CPU too twice as fast as NumPy's stable sort.
    """
    n = len(position)
    index = ((position - position.min(axis=0)) / cell).astype(np.uint64)
    index = np.minimum(index, np.uint64(2**21 - 1))
    for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):  # fmt: skip
        index = (index | (index << np.uint64(shift))) & np.uint64(mask)
    code = index[:, 0] | (index[:, 1] << np.uint64(1)) | (index[:, 2] << np.uint64(2))
    # the second half of both is room for the sort
    key = wp.array(np.pad(code.astype(np.int64), (0, n)), dtype=wp.int64, device=device)
    slot = wp.array(np.pad(np.arange(n, dtype=np.int32), (0, n)), dtype=wp.int32, device=device)
    wp.utils.radix_sort_pairs(key, slot, n)
    return slot.numpy()[:n].copy()


def class_starts(touching: np.ndarray, near: np.ndarray, lanes: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Number of the first contact of either class of each grain, int32, and the packs in all.

    Within a block of grains the contacts that touch come first and fill whole packs, then the others do: a pack holds one
    class, and both classes of a block find its grains in the cache.
    """
    n = len(touching)
    first = np.arange(0, n, CLASS_BLOCK)
    block = np.arange(n) // CLASS_BLOCK
    sums = [np.add.reduceat(count, first) for count in (touching, near)]
    room = [-(-s // lanes) * lanes for s in sums]
    begin = np.concatenate([[0], np.cumsum(room[0] + room[1])])
    inside = [np.cumsum(count) - count - (np.cumsum(s) - s)[block] for count, s in zip((touching, near), sums, strict=True)]
    out = begin[block] + inside[0], begin[block] + room[0][block] + inside[1]
    return out[0].astype(np.int32), out[1].astype(np.int32), int(begin[-1]) // lanes


@dataclass
class Spare:
    """Where a device that makes lists keeps what it carries over from the old ones, and what lasts no longer."""

    memory: wp.array
    """Of the contacts, as ``Lists.memory``."""
    contact: wp.array
    """Contact of each pair of the near list; in the same place, for it is known before the memory is copied."""
    listed: wp.array
    """Of the kernel ``select_contacts``."""


class Lists:
    """Near list, contact list and wall rows of a simulation.

    Attributes:
        skin: gap below which a pair is in the near list [m].
        rebuilds: how often the near list was made.
        refreshes: how often the contact list was made.
        version: how often it was made by the host, in other arrays.
        totals: lanes of the packs, shares of their rows, grains beside walls.
        near: start, count, slot and contact of the near list, None before the first.
        known: grains that the lists were made for.
        rows: slots beside walls, None without.
        force_parity: parity of the step of the last force call.
        renewals_left: near lists that the device may still make before the host's next.
        margin: gap below which a near pair is in the contact list [m].
        due: what ``Stepper.advance`` has left to be seen to.
    """

    def __init__(self, sim) -> None:
        self.sim = sim
        self.real = sim.plan.backend.real
        radius = sim.expected.radius
        mean = float(radius.mean()) if len(radius) else 1.0
        skin = sim.scene.engine.skin
        self._skin_bounds = (0.4 * mean, 2.0 * mean) if skin == "auto" else (skin, skin)
        longest = min((length for length in sim.plan.domain.period if length), default=np.inf)
        room = 0.5 * longest - 2.0 * float(radius.max(initial=0.0)) - sim.plan.contact.gap  # beyond, a grain meets two images
        self._skin_bounds = tuple(min(bound, 0.95 * room) for bound in self._skin_bounds)
        self.skin = self._skin_bounds[0]
        self.margin = 0.2 * self.skin
        self.rebuilds = 0
        self.refreshes = self.version = 0
        self._last_refresh = self._last_rebuild = 0
        self.renewals_left = self._renewals = self._rebuilds_then = 0
        n = len(sim.state)
        self.near = None
        self.due = 0
        self.known = n
        self._near_room = RowRoom(LEAST_ROOM)
        self.near_reference = None
        self.contact_count = self.row_count = 0
        self.totals = [0, 0, 0]
        self.force_parity = 1
        self.near_feature = None
        self.reference = None
        self.rows = sim.new_rows(n, 0) if sim.plan.walls.present else None
        self.rooms = Rooms(sim.device, exact=sim.plan.backend.resident)
        self.flights = Flights(self)
        self._newcomers = Newcomers(self)
        self.memory = self.rooms.zeros((0, max(sim.plan.contact.memory, 1), sim.plan.backend.lanes), self.real)

    # -- what the loop reads ------------------------------------------------------------------

    @property
    def reach(self) -> float:
        """How far a grain may move before the contact list is out of date [m]."""
        alone = len(self.sim.state) < 2 and not self.sim.plan.walls.present
        return 1.0e300 if alone else 0.5 * self.margin

    def update(self, grown: bool = False, force_rebuild: bool = False) -> None:
        """Make the lists valid for the present positions, without the grains that have left the domain.

        ``grown``: grains have come in.
        """
        sim = self.sim
        due, self.due = self.due, 0
        force_rebuild |= grown and (sim.plan.backend.resident or not self.rebuilds)
        changed = grown or force_rebuild or self.near is None
        if not changed and not due:
            return
        record = sim.state.record.numpy()
        position = record[:, grain.POSITION]
        if (changed or due & BEYOND) and not np.isfinite(position).all():
            sim.guards.stop_not_finite()
        gone = sim.leaving() if sim.plan.domain.outlets or any(sim.plan.domain.period) else np.zeros(0, dtype=int)
        if len(gone):
            self._leave(gone)
            # the books of energy are kept by contact: what a partner's spring has lost would be told twice
            force_rebuild |= sim.plan.measures.energy or len(sim.state) < KEPT_SHARE * sim.state.slots
        if not (changed or force_rebuild or due & BEYOND):
            return
        placement = sim.stepper.placements()
        sim.guards.lists_built(record, placement)
        self.force_parity = (sim.step_number - 1) & 1
        force_rebuild |= self.near is None
        fast = self.flights.slots
        if not force_rebuild:
            with sim.clock("lists"):
                held, fast = self._held()
                if held and not grown:
                    return
                force_rebuild = held is None or (grown and not self._let_in(placement))
        if not grown and not force_rebuild:
            self.margin = self.next_margin
        self._last_refresh = sim.step_number
        if force_rebuild:
            self._adapt_skin()
            with sim.clock("lists"):
                self._rebuild(placement, fast)
            if not len(sim.state):
                return
        with sim.clock("refresh"):
            self._refresh(placement)

    def _held(self) -> tuple[bool | None, np.ndarray]:
        """Whether the lists hold, False where only the contact list does not, None where the near list does not.

        Some grains may fly from now on so that they do; and which were meant to, or fly, is told too.
        """
        steps, known = self.sim.step_number - self._last_refresh, set(self.flights.slots)
        since = self.sim.step_number - self._last_rebuild
        stray = self.flights.stray()
        due = stray & (BEYOND_NEAR | OFF_PATH)
        hasty = steps < REFRESH_STEPS[0] or (due.any() and since < REBUILD_STEPS)
        stray, wanted = self.flights.take(stray, hasty)
        fast = np.union1d(self.flights.slots, wanted)
        if (stray & (BEYOND_NEAR | OFF_PATH)).any():
            return None, fast
        new = [slot for slot in self.flights.slots if slot not in known]
        unlisted = False  # all that is in the rows of those that fly is in the contact list
        if new:
            unlisted = self.near[1].numpy()[new].any() or (self.rows and np.diff(self.rows.first.numpy())[new].any())
        return not (stray & BEYOND_REACH).any() and not unlisted, fast

    def _let_in(self, placement: np.ndarray) -> bool:
        """Whether newcomers could be added to the lists as they are.

        No path was laid against them: they fly too, along paths against those of the others, or all paths are laid anew.
        """
        known, flying = self.known, self.flights.slots
        if not self._newcomers.add(placement):
            return False
        if not len(flying):
            return True
        new = known + np.flatnonzero(self.sim.state.here[known:])
        for slots in (new, self.flights.slots):
            if len(self.flights.lay(slots)) == len(slots):
                return True
        return False

    @property
    def next_margin(self) -> float:
        """Margin of the next contact list [m], steered by the steps since the last."""
        steps = self.sim.step_number - self._last_refresh
        if self.refreshes and steps < REFRESH_STEPS[0]:
            return min(1.4 * self.margin, MARGIN_SHARES[1] * self.skin)
        if self.refreshes and steps > REFRESH_STEPS[1]:
            return max(self.margin / 1.4, MARGIN_SHARES[0] * self.skin)
        return self.margin

    def make(self) -> None:
        """Make all lists for the present positions."""
        sim = self.sim
        placement = sim.stepper.placements()
        self._last_refresh = self._last_rebuild = sim.step_number
        self._rebuild(placement)
        self._refresh(placement)

    def _leave(self, gone: np.ndarray) -> None:
        """Grains in slots ``gone`` meet nobody any more; the lists hold for the others as they are."""
        sim = self.sim
        sim.state.leave(gone)
        self.flights.leave(gone)
        gone = gone[gone < self.known]  # one that has just come in is in no list
        if sim.plan.walls.present and len(gone):
            for array in (self.rows.candidates, self.rows.place_count):
                with changed(array) as values:
                    values[..., gone] = 0

    def _adapt_skin(self) -> None:
        """A wider skin where near lists were made often; once it is right the device makes the next ones alone."""
        made, steps = self.rebuilds - self._rebuilds_then, self.sim.step_number - self._last_rebuild
        wider = self.skin
        if made and steps < REBUILD_STEPS * made:
            wider = min(1.25 * self.skin, self._skin_bounds[1])
        self._renewals = min(2 * self._renewals, RENEWALS) if wider == self.skin and self._renewals else 1
        self.renewals_left = self._renewals
        self.skin, self._last_rebuild, self._rebuilds_then = wider, self.sim.step_number, self.rebuilds

    def bodies(self, position: np.ndarray, placement: np.ndarray) -> list[np.ndarray]:
        """Positions in the body axes of each wall motion that moves relative to the frame."""
        return [
            (position - p[9:12]) @ p[:9].reshape(3, 3) for p in placement[: self.sim.plan.walls.moving]
        ]

    # -- near list ------------------------------------------------------------------------------

    def _rebuild(self, placement: np.ndarray, fast: np.ndarray = NOBODY) -> None:
        """New near lists; those that have left the domain are dropped, and those in slots ``fast`` fly if they can."""
        sim, lists = self.sim, self.sim.kernels.lists
        state = sim.state
        kept = np.flatnonzero(state.here)
        record = state.record.numpy()
        position, radius = record[:, grain.POSITION][kept], record[:, grain.RADIUS][kept]
        old_id = wp.clone(state.id)
        sim.stepper.forget()
        self.flights.land()
        self.select_inputs = self.fill_inputs = None
        known = self.known
        n = self.known = len(kept)
        if n == 0:
            state.reorder(kept)
            self.contact_count = self.row_count = 0
            self.totals = [0, 0, 0]
            self.near = None
            return
        beyond = sim.plan.contact.gap + self.skin
        classes = size_classes(radius)
        order = morton_order(position, finest_cell(radius, classes, beyond), sim.device)
        position, radius, classes, order = position[order], radius[order], classes[order], kept[order]
        state.reorder(order)
        old_place = self.rooms.upload(np.where(order < known, order, -1).astype(np.int32), wp.int32)
        self.near_reference = self.rooms.room("near_reference", (n, 1 + sim.plan.walls.moving), wp.vec3d)
        self.near_reference.assign(np.stack([position, *self.bodies(position, placement)], axis=1))
        self.grids = grids_for(position, radius, classes, beyond, sim.device)
        wp.launch(lists.insert_grains, n, [self.grids, state.record], device=sim.device)
        start, count, slot = self._near_rows(self.grids, classes)
        contact = self.rooms.zeros(slot.shape, wp.int32)
        if self.near is None:
            contact.fill_(-1)
        else:
            inputs = [state.id, start, count, slot, old_place, old_id, *self.near, contact]
            sim.threads.split(lists.carry_contacts, n, inputs, sim.device)
        self.near = (start, count, slot, contact)
        if sim.plan.walls.present:
            self._rebuild_walls(placement, old_place)
        self.rebuilds += 1
        if len(fast):
            self.flights.lay_anew(np.flatnonzero(np.isin(order, fast)))

    def _near_rows(self, grids, classes: np.ndarray) -> tuple[wp.array, wp.array, wp.array]:
        """Start and count of the row of each grain, and the rows."""
        sim, n, count = self.sim, len(classes), self.rooms.zeros(len(classes), wp.int32)
        near, shared = sim.kernels.lists.near_rows, [grids, sim.state.record, sim.state.id, self.skin]
        if sim.plan.backend.resident:  # counted first: a second search is cheaper there than room that is not used
            nothing = self.rooms.zeros(0, wp.int32)
            sim.threads.split(near, n, [*shared, nothing, count, nothing], sim.device)
            sim.guards.lists_fit(int(count.numpy().sum(dtype=np.int64)), count)
            start_host = starts(count.numpy())
            start = self.rooms.upload(start_host, wp.int32)
            slot = self.rooms.zeros(self.rooms.capacity("near", int(start_host[-1])), wp.int32)
            sim.threads.split(near, n, [*shared, start, count, slot], sim.device)
            return start, count, slot
        while True:
            start_host = self._near_room.starts(classes)
            start, slot = self.rooms.upload(start_host, wp.int32), self.rooms.zeros(int(start_host[-1]), wp.int32)
            sim.threads.split(near, n, [*shared, start, count, slot], sim.device)
            if self._near_room.holds(classes, count.numpy()):
                return start, count, slot
            sim.guards.lists_fit(self._near_room.entries(classes), count)

    def _rebuild_walls(self, placement: np.ndarray, old_place: wp.array) -> None:
        sim, n = self.sim, self.sim.state.slots
        near = sim.kernels.walls.near_features
        count = self.rooms.zeros(n, wp.int32)
        nothing = self.rooms.zeros(0, wp.int32)
        placements = self.rooms.upload(placement, wp.types.vector(18, wp.float64))
        shared = [sim.state.record, 0.5 * self.skin, sim.walls.surface, *sim.walls.mesh_arrays, placements]
        sim.threads.split(near, n, [0, *shared, nothing, count, nothing], sim.device)
        sim.guards.lists_fit(int(count.numpy().sum(dtype=np.int64)), count)
        start_host = starts(count.numpy())
        start = self.rooms.upload(start_host, wp.int32)
        slots = self.rooms.capacity("slots", int(start_host[-1]))
        feature = self.rooms.zeros(slots, wp.int32)
        sim.threads.split(near, n, [1, *shared, start, count, feature], sim.device)
        self.near_feature = feature
        rows = sim.new_rows(n, slots)
        rows.first = start
        inputs = [self.force_parity, old_place, self.rows, rows]
        sim.threads.split(sim.kernels.walls.carry_places, n, inputs, sim.device)
        self.rows = rows

    # -- contact list ---------------------------------------------------------------------------

    def _refresh(self, placement: np.ndarray) -> None:
        sim, lists, plan = self.sim, self.sim.kernels.lists, self.sim.plan
        state, n = sim.state, sim.state.slots
        start, count, slot, contact = self.near
        rooms, room = self.rooms, self.rooms.room
        listed = rooms.zeros(slot.shape, wp.int32) if plan.backend.resident else room("listed", slot.shape, wp.int32)
        touching, close, width = (room(name, (n,), wp.int32) for name in ("touching", "close", "width"))
        split = sim.threads.split
        self.select_inputs = {
            "record": state.record, "id": state.id, "start": start, "count": count, "slot": slot, "margin": self.margin,
            "flight": self.flights.path, "listed": listed, "touching": touching, "close": close, "width": width,
        }  # fmt: skip
        split(lists.select_contacts, n, [*self.select_inputs.values()], sim.device)
        touching_host, close_host, packs = class_starts(touching.numpy(), close.numpy(), plan.backend.lanes)
        row_start_host = starts(width.numpy())
        self.contact_count = int(row_start_host[-1]) // 2
        touching_start, close_start = rooms.keep("touching_start", touching_host), rooms.keep("close_start", close_host)
        row_start = rooms.keep("row_start", row_start_host)
        shares = int(row_start_host[-1])
        self.totals = [packs * plan.backend.lanes, shares, 0]
        packs, shares = rooms.capacity("packs", packs), rooms.capacity("shares", shares)
        lanes = plan.backend.lanes
        lane_shape = packs, lanes
        memory_shape = packs, max(plan.contact.memory, 1), lanes
        row_shape = shares + 1, share_width(plan.contact.spins)
        row = self._rows_of_shares(row_shape, memory_shape, slot.shape[0])
        self.entry = room("entry", (shares + 1 if plan.measures.energy else 0, ENTRY), self.real)
        owner, partner = room("owner", lane_shape, wp.int32), room("partner", lane_shape, wp.int32)
        slot_i, slot_j = room("slot_i", lane_shape, wp.int32), room("slot_j", lane_shape, wp.int32)
        kind = room("kind", (packs if plan.contact.table else 0, plan.backend.lanes), wp.int32)
        self.trial = room("trial", memory_shape if len(plan.backend.scheme.STAGES) > 1 else (0, 1, lanes), self.real)
        constants = room("constants", (0 if plan.backend.resident else packs, lists.constants_width, lanes), self.real)
        # what fills the last pack of a class: two grains with no stiffness, whose shares go to a row that nobody reads
        owner.zero_()
        partner.fill_(min(1, n - 1))
        constants.zero_()
        kind.zero_()
        slot_i.fill_(shares)
        slot_j.fill_(shares)
        memory = self.spare.memory if plan.backend.resident else room(f"memory{self.version & 1}", memory_shape, self.real)
        self.fill_inputs = {
            "record": state.record, "inverse": state.inverse, "kinds": state.kind, "materials": plan.contact.materials,
            "coefficients": sim.coefficients, "id": state.id, "start": start, "count": count, "slot": slot,
            "listed": listed, "touching_start": touching_start, "close_start": close_start, "row_start": row_start,
            "memory": self.memory, "contact": contact, "owner": owner, "partner": partner, "kind": kind,
            "constants": constants, "slot_i": slot_i, "slot_j": slot_j, "next": memory,
        }  # fmt: skip
        split(lists.fill_contacts, n, [*self.fill_inputs.values()], sim.device)
        if plan.backend.resident:
            self.memory = room("memory", memory_shape, self.real)
            wp.copy(self.memory, memory)
            self.select_inputs["listed"] = self.fill_inputs["listed"] = self.spare.listed
        else:
            self.memory = memory  # the other one holds what is carried over next time
        self.owner, self.partner, self.kind, self.constants = owner, partner, kind, constants
        self.row_start, self.row, self.slot_i, self.slot_j = row_start, row, slot_i, slot_j
        position = state.record.numpy()[:, grain.POSITION]
        self.reference = room("reference", (n, 1 + plan.walls.moving), wp.vec3d)
        self.reference.assign(np.stack([position, *self.bodies(position, placement)], axis=1))
        self.flights.unplace()
        if plan.walls.present:
            self._refresh_walls(placement)
        self.refreshes += 1
        self.version += 1

    def _rows_of_shares(self, shape: tuple[int, int], memory: tuple[int, int, int], near: int) -> wp.array:
        """Rows that the forces are summed in, of ``shape``.

        A device that makes lists itself has its scratch there, ``spare``: no force is known while lists are made.
        """
        if not self.sim.plan.backend.resident:
            return self.rooms.room("row", shape, self.real)
        width, device = wp.types.type_size_in_bytes(self.real), self.sim.device
        carried = -(-max(width * int(np.prod(memory)), 4 * near) // 8) * 8
        room = self.rooms.room("row", (max(int(np.prod(shape)), -(-(carried + 4 * near) // width)),), self.real)
        self.spare = Spare(
            memory=wp.array(ptr=room.ptr, shape=memory, dtype=self.real, device=device),
            contact=wp.array(ptr=room.ptr, shape=near, dtype=wp.int32, device=device),
            listed=wp.array(ptr=room.ptr + carried, shape=near, dtype=wp.int32, device=device),
        )
        return wp.array(ptr=room.ptr, shape=shape, dtype=self.real, device=device)

    def contact_constants(self) -> wp.array:
        """What does not change of each listed contact, shape (packs, numbers, lanes): a GPU does not keep it."""
        sim, lists, plan = self.sim, self.sim.kernels.lists, self.sim.plan
        if not plan.backend.resident:
            return self.constants
        out = self.rooms.zeros((self.owner.shape[0], lists.constants_width, plan.backend.lanes), self.real)
        inputs = [sim.state.record, sim.state.inverse, sim.coefficients, self.owner, self.partner, self.kind, out]
        wp.launch(lists.contact_constants, self.owner.size, inputs, device=sim.device)
        return out

    def _refresh_walls(self, placement: np.ndarray) -> None:
        sim, rows = self.sim, self.rows
        placements = self.rooms.upload(placement, wp.types.vector(18, wp.float64))
        sim.threads.split(sim.kernels.walls.close_features, sim.state.slots, self.close_inputs(placements)[1:], sim.device)
        near = np.flatnonzero(rows.candidates.numpy()).astype(np.int32)
        self.row_count = self.totals[2] = len(near)
        if sim.plan.backend.resident:  # room for the rows that the device finds
            near = np.pad(near, (0, sim.state.slots - len(near)))
        rows.grain = self.rooms.keep("wall_grain", near)

    def close_inputs(self, placements: wp.array) -> list:
        """Arguments of ``close_features`` for the walls at ``placements``."""
        near = self.near_feature, self.flights.path, self.rows
        return [0, self.sim.state.record, 0.5 * self.margin, self.sim.walls.surface, placements, *near]

    # -- made on the device -----------------------------------------------------------------------

    def refreshed_on_device(self, times: int, step: int, totals: list[int]) -> None:
        """Contact list and wall rows were made anew, at last at ``step``: their number is all that the host keeps of them."""
        self.refreshes += times
        self._last_refresh = step
        self.totals, self.contact_count, self.row_count = totals, totals[1] // 2, totals[2]

    def renewed_on_device(self, times: int) -> None:
        """The near list was made anew."""
        if times:
            self.flights.land()
        self.rebuilds += times
        self.renewals_left -= times

    # -- reading --------------------------------------------------------------------------------

    def listed(self) -> ListedContacts:
        """The contacts, to be read."""
        arrays = {name: getattr(self, name, None) for name in (*CONTACT_ARRAYS, "entry")}
        return ListedContacts(
            self.sim.state, self.contact_count, self.row_count, **arrays, constants=self.contact_constants, walls=self.rows
        )
