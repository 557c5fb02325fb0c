"""The array structs of the step: which arrays of state and lists its kernels read and write."""

from typing import Any

import warp as wp

from warpdem.engine.contact_lists import ContactLists
from warpdem.kernels.measure.budget import Energies, Momenta
from warpdem.model.model import Model
from warpdem.state.particles import State


def packed(array: wp.array, dtype: type) -> wp.array:
    """The same memory as an array of vectors."""
    return wp.array(ptr=array.ptr, shape=array.shape[:-1], dtype=dtype, device=array.device)


class Structs:
    """Structs of grains, contact batches and wall contacts over the present lists."""

    def __init__(self, model: Model, state: State, lists: ContactLists) -> None:
        self._model, self._state, self._lists = model, state, lists
        self._built: tuple[Any, Any, Any] | None = None
        self._version = -1  # of the lists that they belong to

    def forget(self) -> None:
        """Let go of the arrays, before others take their place."""
        self._built, self._version = None, -1

    def arguments(self) -> tuple[Any, Any, Any]:
        """``Grains`` and ``ContactBatches`` of ``kernels.step.loop``, ``WallContacts`` of ``kernels.wall.contact``."""
        lists = self._lists
        if self._built is None or self._version != lists.version:
            wall_contacts = lists.wall_contacts if lists.wall_contacts is not None else self._model.kernels.WallContacts()
            self._built = self._grains(), self._contact_batches(), wall_contacts
            self._version = lists.version
        self._built[0].flight = lists.flight  # paths are assigned between two list builds too
        return self._built

    def _grains(self) -> Any:
        model, features, state, lists = self._model, self._model.features, self._state, self._lists
        grains = model.kernels.loop.Grains()
        grains.record, grains.inverse, grains.kind = state.record, state.inverse, state.kind
        if features.measures.orientation:
            grains.orientation = state.orientation
        grains.reference, grains.row_start = lists.reference, lists.row_start
        grains.store = wp.zeros((state.slots, features.backend.scheme.STORE), dtype=wp.vec3d, device=model.device)
        grains.row = packed(lists.row, model.kernels.pairs.PairForce)
        grains.entry = packed(lists.entry, model.kernels.pairs.Entry)
        if features.domain.outlets:
            grains.exit = wp.zeros((state.slots, 2), dtype=wp.int32, device=model.device)
        for name, dtype in (("energies", Energies), ("momenta", Momenta)):
            if name in features.measures.sums:
                setattr(grains, name, packed(getattr(state, name), dtype))
        for name in features.measures.sums.keys() & {"wall_work", "flow"}:
            setattr(grains, name, getattr(state, name))
        return grains

    def _contact_batches(self) -> Any:
        features, lists = self._model.features, self._lists
        contacts = self._model.kernels.loop.ContactBatches()
        for name in ("owner", "partner", "slot_i", "slot_j", "constants", "history"):
            setattr(contacts, name, getattr(lists, name))
        contacts.trial = lists.trial if len(features.backend.scheme.STAGES) > 1 else lists.history
        if features.contact.table:
            contacts.kind = lists.kind
        return contacts
