"""The lists themselves: who may touch whom, contact history, force slots and wall contacts, and how they are read."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.engine.buffers import BufferPool
from warpdem.kernels.lists.path import Flight
from warpdem.kernels.measure.budget import wall_entry
from warpdem.kernels.wall import record as wall_record
from warpdem.kernels.wall.contact_points import Hit
from warpdem.model.model import Model
from warpdem.state.clock import Clock
from warpdem.state.listed_contacts import CONTACT_ARRAYS, ListedContacts
from warpdem.state.particles import State


class OuterList(NamedTuple):
    """Pairs closer than their allowances: of each grain a row of neighbors in ascending order of id."""

    start: wp.array
    """(n + 1,) first entry of each row, and the end of the last; rows may be longer than what they hold."""
    neighbors: wp.array
    """(n,) how many each grain has."""
    slot: wp.array
    """(entries,) memory slot of the neighbor."""
    contact: wp.array
    """(entries,) number of the pair in the inner list, -1 where it is in none; kept in the row of the lower id."""
    allowance: wp.array
    """(n,) how far each grain may move while the list holds [m]."""


@dataclass
class NewOuterList:
    """An outer list while it is built, and where the grains were in the old one."""

    start: wp.array
    count: wp.array
    slot: wp.array
    contact: wp.array
    allowance: wp.array
    capacity_start: wp.array
    """(n + 1,) of the rows that a first search writes; of size 0: it only counts."""
    old_slot: wp.array
    """(n,) slot of each grain in the old list, -1 where it is in none; of size 0: the same."""
    old_id: wp.array
    """Ids by slot of the old list."""
    feature_count: wp.array
    """(n,) wall features near each grain."""
    met: wp.array
    """(n, ``candidates.MET``) wall features stored by the counting pass; (n, 0): none are."""
    first: wp.array
    """(n + 1,) first wall slot of each grain."""

    @property
    def rows(self) -> OuterList:
        """The list alone."""
        return OuterList(self.start, self.count, self.slot, self.contact, self.allowance)


class ContactLists:
    """Arrays of the outer and the inner list; empty until they are built.

    Attributes:
        outer: the outer list; empty before the first.
        known: grains that the lists were built for, in the first memory slots.
        skin: gap below which a pair of slow grains is in the outer list [m].
        inner_share: share of the allowances within which a pair is in the inner list [-].
        horizon: steps that an outer list shall hold, for which fast grains are allowed to move further [-].
        most_allowance: of a grain, at most [m]; half the skin is the least.
        rebuilds, inner_rebuilds: how often the outer and the inner list were built.
        version: how often the host built them, in other arrays.
        contact_count: contacts between grains in the inner list.
        batches_inside: contact batches, from the first on, in which no grain is a ghost.
        row_count: grains beside a wall.
        wall_contacts: struct of ``kernels.wall.contact``; None without walls.
        force_parity: parity of the step of the last force call.
        flight: path of each grain in flight (``kernels.lists.path``), of size 0 when none flies.
        owner, partner, kind, slot_i, slot_j: of each lane of the contact batches, shape (batches, lanes): memory slots of the
            grains, number of their coefficients, force slots.
        constants, history: numbers of each contact that stay and that change, shape (batches, numbers, lanes).
        trial: what a stage within a step makes of ``history``; ``next_history``: where it is carried over to.
        slot_start: (n + 1,) first force slot of each grain.
        listed: of each entry of the outer list: -1, or its number in the row and whether it touches (``select_contacts``).
        touching, near, width: (n,) contacts of either class that a grain owns, and its force slots.
        touching_start, near_start: (n,) where those contacts begin.
        near_feature: wall features within the allowance, in the wall slots of their grain.
        grids: cell grids of the grains.
        given_order: order in memory that the next outer list brings the grains to in place of its own; None for its own.
        slot_force: pair force on one grain in each force slot; the last belongs to no grain.
    """

    # built by ``host_build``
    outer: OuterList
    new: NewOuterList
    grids: Any
    rows_are_counted: bool
    near_feature: wp.array
    listed: wp.array
    touching: wp.array
    near: wp.array
    width: wp.array
    touching_start: wp.array
    near_start: wp.array
    slot_start: wp.array
    owner: wp.array
    partner: wp.array
    kind: wp.array
    slot_i: wp.array
    slot_j: wp.array
    constants: wp.array
    trial: wp.array
    slot_force: wp.array
    next_history: wp.array

    def __init__(self, model: Model, state: State, clock: Clock, pool: BufferPool, skin: float) -> None:
        self.model, self.state, self.clock, self.pool = model, state, clock, pool
        self.real = model.features.backend.real
        n, axes = len(state), 1 + model.features.walls.moving
        self.skin, self.inner_share, self.horizon, self.most_allowance = skin, 0.2, 0.0, 0.5 * skin
        self.rebuilds = self.inner_rebuilds = self.version = 0
        self.known = n
        self.force_parity = 1
        self.given_order: np.ndarray | None = None
        self.forget_outer()
        self.reference, self.outer_reference = (wp.zeros((0, axes), dtype=wp.vec3d, device=model.device) for _ in range(2))
        self.flight = wp.zeros(0, dtype=Flight, device=model.device)
        self.contact_count = self.row_count = self.batches_inside = 0
        self.totals = [0, 0, 0]
        self._views: dict[str, tuple[wp.array, int, wp.array]] = {}  # of the arrays that ``_used`` gave: array, batches, view
        self.wall_contacts: Any = self.new_wall_contacts(n, 0) if model.features.walls.present else None
        self.history = pool.zeros((0, max(model.features.memory, 1), model.features.backend.lanes), self.real)

    @property
    def built(self) -> bool:
        """Whether there is an outer list."""
        return self.outer.start.size > 0

    def forget_outer(self) -> None:
        """No outer list, and nothing to be carried over to the next."""
        start, count, slot, contact = (self.pool.zeros(0, wp.int32) for _ in range(4))
        self.outer = OuterList(start, count, slot, contact, self.pool.zeros(0, wp.float64))

    @property
    def slot_force_vectors(self) -> wp.array:
        """``slot_force`` as an array of vectors."""
        return array_view(self.slot_force, self.slot_force.shape[:1], self.model.kernels.pairs.PairForce)

    @property
    def share_that_holds(self) -> float:
        """Share of its allowance that a grain may move while the inner list holds [-]."""
        alone = len(self.state) < 2 and not self.model.features.walls.present
        return 1.0e300 if alone else self.inner_share

    def set_totals(self, totals: list[int]) -> None:
        """Take note of the length of the inner list: lanes, force slots, grains beside a wall."""
        self.totals, self.contact_count, self.row_count = totals, totals[1] // 2, totals[2]
        self._views.clear()  # they would keep arrays that others take the place of
        self.batches_inside = totals[0] // self.model.features.backend.lanes

    def inner_built(self) -> None:
        """Take note that the host has built the inner list."""
        self.inner_rebuilds += 1
        self.version += 1

    def set_outer(self, start: np.ndarray, count: np.ndarray, slot: np.ndarray, contact: np.ndarray) -> None:
        """Take over an outer list, for the next build to carry its contacts over; arguments as ``OuterList``."""
        rows = [self.pool.upload(a.astype(np.int32), wp.int32) for a in (start, count, slot, contact)]
        self.outer = OuterList(rows[0], rows[1], rows[2], rows[3], self.pool.zeros(len(count), wp.float64))
        self.known = len(count)

    def new_wall_contacts(self, grains: int, slots: int) -> Any:
        """Wall contacts of ``grains`` grains with ``slots`` slots in all."""
        features, device = self.model.features, self.model.device
        contacts = self.model.kernels.WallContacts()
        contacts.first = wp.zeros(grains + 1, dtype=wp.int32, device=device)
        contacts.candidates = wp.zeros(grains, dtype=wp.int32, device=device)
        contacts.load = wp.zeros(grains, dtype=wp.types.vector(6, wp.float64), device=device)
        for name in ("feature", "hit_state", "hit_mask"):
            setattr(contacts, name, wp.zeros(slots, dtype=wp.int32, device=device))
        contacts.hit = wp.zeros(slots, dtype=Hit, device=device)
        contacts.found = wp.zeros(slots, dtype=wall_record.Found, device=device)
        result = wall_record.result_type(features.contact.moments, features.measures.wear)
        contacts.result = wp.zeros(slots, dtype=result, device=device)
        generations = 2 if len(features.backend.scheme.STAGES) == 1 else 3
        contacts.point_count = wp.zeros((generations, grains), dtype=wp.int32, device=device)
        if features.measures.energy:
            contacts.entry = wp.zeros(grains, dtype=wall_entry(features.measures.losses).vector(wp.float64), device=device)
            contacts.power = wp.zeros((grains, features.measures.scene_walls), dtype=wp.float64, device=device)
        if self.model.liquid is not None:
            contacts.film = self.state.film
            contacts.wall_film = wp.array(self.model.liquid.wall_film, dtype=wp.float64, device=device)
        contacts.point = wp.zeros((generations, slots), dtype=wall_record.history_type(features.contact.history), device=device)
        return contacts

    def give_films_to_walls(self) -> None:
        """Let the wall contacts know the films of the grains, whose array may have changed."""
        film, walls = self.state.film, self.wall_contacts
        if walls is not None and film is not None and walls.film is not film:
            walls.film = film

    def settle_liquid(self) -> None:
        """Before lists are built: bridges take what films have given, and those that no list would hold go to the films."""
        model, state, liquid = self.model, self.state, self.model.liquid
        if liquid is None or not self.contact_count:
            return
        assert state.film is not None
        lanes = model.features.backend.lanes
        inputs = [
            lanes, liquid.quantum, state.record, self.owner, self.partner, self.kind, model.coefficients, self.slot_i,
            self.slot_j, self.slot_force_vectors, self.history, state.film,
        ]  # fmt: skip
        wp.launch(model.kernels.films.settle_contacts, self.totals[0], [0, *inputs], device=model.device)

    # -- reading --------------------------------------------------------------------------------

    def view(self) -> ListedContacts:
        """The contacts of the inner list, to be read."""
        arrays: dict[str, Any] = {name: getattr(self, name, None) for name in CONTACT_ARRAYS}
        for name in ("owner", "partner", "slot_i", "slot_j", "history"):
            if arrays[name] is not None:  # before the first list there are none
                arrays[name] = self._used(name)
        return ListedContacts(
            self.state, self.model.features.contact.history, self.contact_count, self.row_count, **arrays,
            constants=self.contact_constants, walls=self.wall_contacts,
        )  # fmt: skip

    def _used(self, name: str) -> wp.array:
        """The contact batches of an array that the list uses, without the capacity that it has to spare."""
        array: wp.array = getattr(self, name)
        batches = self.totals[0] // self.model.features.backend.lanes
        if batches >= array.shape[0]:
            return array
        of, length, used = self._views.get(name, (None, 0, array))
        if of is not array or length != batches:  # kept: making a view takes longer than reading a few numbers
            empty = (0, *array.shape[1:])
            used = array[:batches] if batches else wp.empty(empty, dtype=array.dtype, device=array.device)
            self._views[name] = array, batches, used
        return used

    def contact_constants(self) -> wp.array:
        """What does not change of each listed contact, shape (batches, numbers, lanes): a GPU does not keep it."""
        batches, state, features = self.model.kernels.batches, self.state, self.model.features
        if self.constants.size:
            return self._used("constants")
        owner, partner, kind = map(self._used, ("owner", "partner", "kind"))
        out = self.pool.zeros((owner.shape[0], batches.constants_width, features.backend.lanes), self.real)
        inputs = [state.record, state.inverse, self.model.coefficients, owner, partner, kind, out]
        wp.launch(batches.contact_constants, owner.size, inputs, device=self.model.device)
        return out
