"""The array structs of a list build: which arrays of state and lists its kernels read and write.

A struct is made once; only arrays that are others than before are written to it, so that a build of lists of the same capacity
costs the host no more than to compare them.
"""

from typing import Any

import warp as wp

from warpdem.engine.contact_lists import ContactLists, OuterList
from warpdem.kernels.lists.displacement import References
from warpdem.kernels.lists.neighbors import NeighborRows
from warpdem.kernels.lists.numbering import Counts, Starts
from warpdem.model.model import Model
from warpdem.state.particles import State


def put(struct: Any, **fields: Any) -> Any:
    """Write to a struct what is not in it yet; return it."""
    for name, value in fields.items():
        if getattr(struct, name) is not value:
            setattr(struct, name, value)
    return struct


def rows_of(rows: OuterList, struct: Any = None) -> Any:
    """``NeighborRows`` of an outer list, in ``struct`` if there is one."""
    struct = NeighborRows() if struct is None else struct
    return put(struct, start=rows.start, count=rows.neighbors, slot=rows.slot, contact=rows.contact, allowance=rows.allowance)


class ListStructs:
    """Structs of the kernels in ``kernels.lists`` over the present arrays."""

    def __init__(self, model: Model, state: State, lists: ContactLists) -> None:
        self._state, self._lists = state, lists
        kernels, self._Clumps = model.kernels, model.kernels.pairs.clumps.Clumps
        self._grains, self._contacts = kernels.neighbors.ListedGrains(), kernels.batches.ListedContacts()
        self._grains.through = model.apart
        self._outer, self._new, self._references = NeighborRows(), NeighborRows(), References()
        self._counts, self._starts = Counts(), Starts()

    def grains(self) -> Any:
        """``ListedGrains``."""
        s = self._state
        put(self._grains, record=s.record, inverse=s.inverse, material=s.material, id=s.id, owned=s.owned)
        return put(self._grains, clumps=s.clumps.struct(self._Clumps)) if s.clumps is not None else self._grains

    def outer(self) -> Any:
        """``NeighborRows`` of the outer list."""
        return rows_of(self._lists.outer, self._outer)

    def new(self) -> Any:
        """``NeighborRows`` of the outer list that is being built."""
        return rows_of(self._lists.new.rows, self._new)

    def references(self, outer_share: float) -> Any:
        """``References``; share of its allowance that a grain may move while the outer list holds [-]."""
        a = self._lists
        return put(
            self._references, inner=a.reference, outer=a.outer_reference, flight=a.flight, allowance=a.outer.allowance,
            inner_share=a.share_that_holds, outer_share=outer_share,
        )  # fmt: skip

    def counts(self) -> Any:
        """``Counts`` of the inner list."""
        a = self._lists
        candidates = a.wall_contacts.candidates if a.wall_contacts is not None else None
        return put(self._counts, touching=a.touching, near=a.near, slots=a.width, candidates=candidates)

    def starts(self) -> Any:
        """``Starts`` of the inner list."""
        a = self._lists
        wall_grain = a.wall_contacts.grain if a.wall_contacts is not None else None
        return put(self._starts, touching=a.touching_start, near=a.near_start, slot=a.slot_start, wall_grain=wall_grain)

    def contacts(self) -> Any:
        """``ListedContacts``, with the history that is carried over."""
        a = self._lists
        return put(
            self._contacts, owner=a.owner, partner=a.partner, kind=a.kind, constants=a.constants, slot_i=a.slot_i,
            slot_j=a.slot_j, history=a.next_history,
        )  # fmt: skip


def of_each(count: wp.array, start: wp.array) -> tuple[Any, Any]:
    """``Counts`` and ``Starts`` of one thing alone: how many each grain has (n,), and where they begin (n + 1,)."""
    return put(Counts(), slots=count), put(Starts(), slot=start)
