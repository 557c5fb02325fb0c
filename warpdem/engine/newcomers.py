"""Inserted grains are appended to the lists as they are: those of the others hold, and need not be rebuilt.

A newcomer has a higher id than all others, so it comes last in the row of each neighbor: where the rows have room for it,
nothing moves. It gets a row of its own, and slots beside walls, behind all others. All arrays have room for those to come.
"""

from typing import Any

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.engine.batch import Batch
from warpdem.engine.contact_lists import ContactLists, OuterList
from warpdem.engine.list_structs import ListStructs
from warpdem.kernels import grain
from warpdem.kernels.clump import NONE
from warpdem.kernels.lists.numbering import starts
from warpdem.kernels.lists.path import Flight

ROOM = 0.125  # for those to come, of what is there [-]
ROW = 8  # neighbors that a newcomer's row has room for beyond those it finds


def grown(array: wp.array, rows: int, axis: int = 0) -> wp.array:
    """A longer array of its own with the contents of ``array``, and room for at least ``rows`` along ``axis``."""
    shape = list(array.shape)
    if shape[axis] >= rows:
        return array
    there = (slice(None),) * axis + (slice(0, shape[axis]),)
    shape[axis] = rows + int(ROOM * rows) + 64
    out: wp.array = wp.zeros(tuple(shape), dtype=array.dtype, device=array.device)
    out.numpy()[there] = array.numpy()
    return out


def first_rows(array: wp.array, rows: int) -> wp.array:
    """View of the first ``rows`` of an array, whose memory it holds."""
    return array_view(array, (rows, *array.shape[1:]), array.dtype)


class Newcomers:
    """Appends grains to the outer list and to the wall slots, on a CPU.

    Args:
        lists: built for the grains in the first ``lists.known`` slots; those behind were inserted since.
        batch: placements of the wall motions at present.
    """

    def __init__(self, lists: ContactLists, batch: Batch) -> None:
        self.lists, self.batch = lists, batch
        self.model, self.state, self.pool = lists.model, lists.state, lists.pool
        self._kept: dict[str, wp.array] = {}

    def add(self) -> bool:
        """Whether there was capacity for them; else the lists are as they were, and must be rebuilt."""
        lists, state = self.lists, self.state
        record, known, n = state.record.numpy(), lists.known, state.slots
        if n == known:  # none was inserted: a rebuild was requested
            return False
        new = np.arange(known, n)
        allowance = self._allowances(new)
        pairs = self._neighbours(record, allowance.numpy(), known)
        start, count, slot, contact, _ = lists.outer
        partner, added = np.unique(pairs[pairs[:, 1] < known, 1], return_counts=True)
        room = np.diff(start.numpy())
        if (count.numpy()[partner] + added > room[partner]).any():
            return False
        rows = np.bincount(pairs[:, 0] - known, minlength=n - known)
        begin = start.numpy()[-1] + starts(rows + ROW)
        if begin[-1] > slot.shape[0]:
            slot, contact = grown(slot, int(begin[-1])), grown(contact, int(begin[-1]))
        start = self.pool.upload(np.concatenate([start.numpy()[:-1], begin]), wp.int32)
        count = self.pool.upload(np.concatenate([count.numpy(), np.zeros(n - known, dtype=np.int32)]), wp.int32)
        contact.numpy()[begin[0] : begin[-1]] = -1
        first, fill, entry, numbers = start.numpy(), count.numpy(), slot.numpy(), contact.numpy()
        for i, j in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]:  # ids ascend with the slots of newcomers
            for a, b in ((i, j), (j, i)) if j < known else ((i, j),):
                entry[first[a] + fill[a]] = b
                numbers[first[a] + fill[a]] = -1
                fill[a] += 1
        ids = state.id.numpy()
        for i in new:
            row = slice(first[i], first[i] + fill[i])
            entry[row] = entry[row][np.argsort(ids[entry[row]], kind="stable")]
        lists.outer = OuterList(start, count, slot, contact, allowance)
        self._save_reference(new)
        if self.model.walls is not None:
            self._beside_walls(new)
        lists.known = n
        return True

    def _allowances(self, new: np.ndarray) -> wp.array:
        """How far each grain may move while the lists hold, the newcomers among them."""
        lists, batch, n = self.lists, self.batch, int(new[-1]) + 1
        out = grown(self._whole("allowances", lists.outer.allowance), n)
        self._kept["allowances"], out = out, first_rows(out, n)
        limits = lists.horizon, 0.5 * lists.skin, lists.most_allowance
        self._launch_for(
            new, self.model.kernels.displacement.set_allowances, self.state.record, batch.control, batch.clock,
            self.model.dt, *limits, out,
        )  # fmt: skip
        return out

    def _neighbours(self, record: np.ndarray, allowance: np.ndarray, known: int) -> np.ndarray:
        """Slots of newcomers and of all that are near each, shape (pairs, 2); two newcomers are named in both orders."""
        model, here, beyond = self.model, self.state.here, self.model.features.contact.gap
        position, radius = record[:, grain.POSITION], record[:, grain.RADIUS]
        new = np.arange(known, len(record))
        low, high = position[new].min(axis=0), position[new].max(axis=0)
        most = radius[new].max() + model.expected.radius.max() + beyond + allowance[known:].max() + allowance.max()
        middle, half = 0.5 * (low + high), 0.5 * (high - low) + most
        close = np.flatnonzero(here)
        for k in (2, 0, 1):
            separation = position[close, k] - middle[k]
            if period := model.domain.period[k]:
                separation -= period * np.rint(separation / period)
            close = close[np.abs(separation) <= half[k]]
        apart = model.scene.apart if model.features.contact.apart else None
        kind = self.state.material.numpy()
        of = self.state.clumps.of_grain.numpy() if self.state.clumps is not None else None
        out = [np.zeros((0, 2), dtype=np.int64)]
        for i in new[here[new]]:
            separation = model.domain.nearest(position[i] - position[close])
            far = (radius[i] + radius[close] + beyond + allowance[i] + allowance[close]) * (1.0 + 1.0e-12)
            near = close[(np.einsum("ij,ij->i", separation, separation) < far * far) & (close != i)]
            if of is not None and of[i] != NONE:
                near = near[of[near] != of[i]]
            if apart is not None:
                near = near[~apart[kind[i], kind[near]]]
            out.append(np.stack([np.full(len(near), i), near], axis=1))
        return np.concatenate(out)

    def _save_reference(self, new: np.ndarray) -> None:
        """Positions from which the displacement of newcomers counts."""
        lists, n = self.lists, int(new[-1]) + 1
        whole = grown(self._whole("outer reference", lists.outer_reference), n)
        self._kept["outer reference"], lists.outer_reference = whole, first_rows(whole, n)
        no_flight = wp.zeros(0, dtype=Flight, device=self.model.device)
        self._launch_for(
            new, self.model.kernels.displacement.save_reference, self.state.record, self.batch.placements, no_flight,
            lists.outer_reference,
        )  # fmt: skip

    def _launch_for(self, new: np.ndarray, kernel: wp.Kernel, *inputs: Any) -> None:
        """Launch over newcomers alone."""
        wp.launch(kernel, dim=len(new), inputs=[int(new[0]), *inputs], device=self.model.device)

    def _whole(self, name: str, view: wp.array) -> wp.array:
        """The array with room that ``view`` is the first rows of, or itself."""
        kept = self._kept.get(name)
        return kept if kept is not None and kept.ptr == view.ptr else view

    def _beside_walls(self, new: np.ndarray) -> None:
        """Slots of newcomers beside walls, behind those of the others."""
        lists, walls = self.lists, self.model.walls
        assert walls is not None
        contacts, n, used = lists.wall_contacts, int(new[-1]) + 1, int(lists.wall_contacts.first.numpy()[new[0]])
        near, nothing = self.model.kernels.walls.near_features, self.pool.zeros(0, wp.int32)
        grains = ListStructs(self.model, self.state, lists).grains()
        count, met = self.pool.zeros(n, wp.int32), self.pool.zeros((n, 0), wp.int32)
        shared = grains, lists.outer.allowance, walls.surface, walls.trees, self.batch.placements, met
        self._launch_for(new, near, 0, *shared, nothing, count, nothing)
        begin = used + starts(count.numpy()[new])
        for name, axis in WALL_ROWS.items():
            setattr(contacts, name, grown(getattr(contacts, name), n + 1, axis))
        if self.model.features.measures.energy:
            contacts.entry, contacts.power = grown(contacts.entry, n), grown(contacts.power, n)
        for name, axis in WALL_SLOTS.items():
            setattr(contacts, name, grown(getattr(contacts, name), int(begin[-1]), axis))
        lists.near_feature = grown(lists.near_feature, int(begin[-1]))
        contacts.first.numpy()[new[0] : n + 1] = begin
        contacts.candidates.numpy()[new] = 0
        contacts.point_count.numpy()[:, new] = 0
        self._launch_for(new, near, 1, *shared, contacts.first, count, lists.near_feature)


WALL_ROWS = {"first": 0, "candidates": 0, "load": 0, "point_count": 1}
"""Arrays of the wall contacts that are as long as there are grains, by the axis of the grains."""
WALL_SLOTS = {"feature": 0, "hit_state": 0, "hit_mask": 0, "hit": 0, "found": 0, "result": 0, "point": 1}
"""Those that are as long as there are slots."""
