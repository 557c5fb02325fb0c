"""The array structs of the step: which arrays of state and lists its kernels read and write."""

from typing import Any

import warp as wp

from warpdem.core.array_view import array_view
from warpdem.engine.contact_lists import ContactLists
from warpdem.engine.list_structs import put
from warpdem.kernels.measure.budget import Momenta
from warpdem.model.model import Model
from warpdem.state.particles import State


def packed(array: wp.array, dtype: type) -> wp.array:
    """The same memory as an array of vectors."""
    return array_view(array, array.shape[:-1], dtype)


class Structs:
    """Structs of grains, contact batches and wall contacts over the present arrays; only what has changed is written."""

    def __init__(self, model: Model, state: State, lists: ContactLists) -> None:
        self._model, self._state, self._lists = model, state, lists
        self._no_wall_contacts = model.kernels.WallContacts()
        self.forget()

    def forget(self) -> None:
        """Let go of the arrays, before others take their place."""
        structs = self._model.kernels.structs
        self._grains, self._contacts = structs.Grains(), structs.ContactBatches()
        self._packed: dict[str, tuple[wp.array, wp.array]] = {}  # array and its packed view

    def arguments(self) -> tuple[Any, Any, Any]:
        """``Grains`` and ``ContactBatches`` of ``kernels.step.structs``, ``WallContacts`` of ``kernels.wall.evaluate``."""
        walls = self._lists.wall_contacts
        self._lists.give_films_to_walls()
        return self._grains_now(), self._contacts_now(), walls if walls is not None else self._no_wall_contacts

    def _view(self, name: str, array: wp.array, dtype: type) -> wp.array:
        """``packed``, made once for each array."""
        there = self._packed.get(name)
        if there is None or there[0] is not array:
            there = self._packed[name] = array, packed(array, dtype)
        return there[1]

    def _grains_now(self) -> Any:
        model, features, state, lists = self._model, self._model.features, self._state, self._lists
        grains, n, device = self._grains, self._state.slots, self._model.device
        put(
            grains, record=state.record, inverse=state.inverse, material=state.material, reference=lists.reference,
            allowance=lists.outer.allowance, slot_start=lists.slot_start, flight=lists.flight,
            slot_force=self._view("slot_force", lists.slot_force, model.kernels.pairs.PairForce),
        )  # fmt: skip
        if state.clumps is not None:
            put(grains, clumps=state.clumps.struct(model.kernels.pairs.clumps.Clumps))
        if state.film is not None:
            put(grains, film=state.film)
        if features.measures.orientation:
            put(grains, orientation=state.orientation)
        if grains.store is None or len(grains.store) != n:
            grains.store = wp.zeros((n, features.backend.scheme.STORE), dtype=wp.vec3d, device=device)
            if features.domain.outlets:
                grains.exit = wp.zeros((n, 2), dtype=wp.int32, device=device)
        for name, dtype in (("energies", model.kernels.structs.Energies), ("momenta", Momenta)):
            if name in features.measures.sums:
                put(grains, **{name: self._view(name, getattr(state, name), dtype)})
        for name in features.measures.sums.keys() & {"wall_work", "flow"}:
            put(grains, **{name: getattr(state, name)})
        return grains

    def _contacts_now(self) -> Any:
        features, lists = self._model.features, self._lists
        fields = {name: getattr(lists, name) for name in ("owner", "partner", "slot_i", "slot_j", "constants", "history")}
        trial = lists.trial if len(features.backend.scheme.STAGES) > 1 else lists.history
        put(self._contacts, **fields, trial=trial)
        if features.backend.ranks:
            self._contacts.owned = self._state.owned
        if features.contact.table:
            put(self._contacts, kind=lists.kind)
        return self._contacts
