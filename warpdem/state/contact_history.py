"""Contact history and forces of the last force call: taken out for a checkpoint, and put back."""

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpdem.kernels.contact.columns import VECTORS, Columns
from warpdem.kernels.contact.dissipation import ENTRY
from warpdem.kernels.contact.pairs import pair_force_width
from warpdem.kernels.lists.numbering import starts
from warpdem.kernels.wall import record as wall_record
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.view import RunView

if TYPE_CHECKING:
    from warpdem.engine.neighbor_list import NeighborLists


def read(view: RunView) -> dict[str, np.ndarray]:
    """History and forces of all contacts: arrays of a checkpoint."""
    return _pair_contacts(view) | wall_contacts(view)


def springs_width(at: Columns) -> int:
    """Numbers of the springs, which stand first in the contact history ``at`` and in ``pair_memory`` of a checkpoint."""
    return sum(size for name, size in at.sizes if name in VECTORS)


def _listed(contacts: ListedContacts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ids (lower, higher) of the listed contacts, and their two force slots."""
    if not contacts.contact_count:
        return np.zeros((0, 2), dtype=np.int64), np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    owner, partner, slot_i, slot_j = contacts.owner, contacts.partner, contacts.slot_i, contacts.slot_j
    assert owner is not None and partner is not None and slot_i is not None and slot_j is not None  # there are contacts
    ids, real = contacts.state.id.numpy(), contacts.real_lanes()
    pair = np.stack([ids[a.numpy().ravel()[real]] for a in (owner, partner)], axis=1)
    return pair, slot_i.numpy().ravel()[real], slot_j.numpy().ravel()[real]


def _pair_contacts(view: RunView) -> dict[str, np.ndarray]:
    """History and pair forces of the listed grain-grain contacts."""
    contacts, features = view.contacts, view.model.features
    pair, i, j = _listed(contacts)
    at, force_width = features.contact.history, pair_force_width(features.contact.spins)
    width = max(at.width, 1)
    memory, row = np.zeros((0, width)), np.zeros((0, force_width))
    if len(pair):
        assert contacts.history is not None and contacts.row is not None
        memory = contacts.history.numpy().transpose(0, 2, 1).reshape(-1, width)[contacts.real_lanes()]
        row = contacts.row.numpy()
    vectors = springs_width(at)
    springs = memory[:, :vectors] if vectors else np.zeros((len(pair), 1))
    out = {"pair": pair, "pair_memory": springs, "pair_share_i": row[i], "pair_share_j": row[j]}
    out |= {f"pair_own_{name}": memory[:, at.of(name)] for name in at.names if name not in VECTORS}
    if features.measures.energy:
        entry = np.zeros((0, ENTRY))
        if len(pair):
            assert contacts.entry is not None  # a copy has none, and is never asked
            entry = contacts.entry.numpy()
        out |= {"pair_entry_i": entry[i], "pair_entry_j": entry[j]}
    return out


def wall_contacts(view: RunView) -> dict[str, np.ndarray]:
    """History and forces of the grain-wall contacts, and the wall load of each grain in order of id."""
    contacts, state = view.contacts, view.state
    walls = contacts.walls
    if walls is None:
        return {}
    parity, g = view.clock.step_number & 1, contacts.wall_grains
    slot, holder = contacts.place_slots(parity, g)
    out = {f"place_{name}": values for name, values in contacts.places(parity, slot).items()}
    out["place_grain"] = state.id.numpy()[holder]
    load = np.where(walls.candidates.numpy()[:, None] > 0, walls.load.numpy(), 0.0)
    out["wall_load"] = load[state.rank]
    if view.model.features.measures.energy:
        out |= {f"wall_{name}": getattr(walls, name).numpy()[state.rank] for name in ("entry", "power")}
    return out


def remember(lists: "NeighborLists", data: dict[str, Any]) -> None:
    """Take over the contact history, for the first rebuild to carry it to the grains that touch.

    Args:
        data: ids of the grains in their order (``id``), ``pair``, its springs ``pair_memory`` and the law's own scalars
            ``pair_own_*``, and where there are walls the ``place_*`` of a checkpoint.
    """
    features, n = lists.model.features, len(lists.state)
    at = features.contact.history
    pair, memory = data["pair"], np.zeros((len(data["pair"]), max(at.width, 1)))
    springs = springs_width(at)
    memory[:, :springs] = data["pair_memory"][:, :springs]
    for name in at.names:
        if name not in VECTORS:
            memory[:, at.of(name)] = data[f"pair_own_{name}"]
    owner, partner = (np.searchsorted(data["id"], pair[:, k]) for k in (0, 1))
    order = np.lexsort((partner, owner))
    count = np.bincount(owner, minlength=n)
    lists.set_outer(starts(count), count, partner[order], order)
    padded = np.concatenate([memory, np.zeros((-len(memory) % features.backend.lanes, memory.shape[1]))])
    batches = padded.reshape(-1, features.backend.lanes, memory.shape[1]).transpose(0, 2, 1)
    lists.history = lists.pool.upload(batches, lists.real)
    if features.walls.present and "place_grain" in data:
        _put_places(lists, data, n)


def restore(lists: "NeighborLists", data: dict[str, Any]) -> None:
    """Lists for the present positions with the contact history and the forces of a checkpoint."""
    if len(lists.state) == 0:
        return
    lists.force_parity = lists.clock.step_number & 1
    remember(lists, data)
    lists.make()
    _put_forces(lists, data)


def _put_places(lists: "NeighborLists", data: dict[str, Any], n: int) -> None:
    """Slots that hold the wall contacts of a checkpoint, for the rebuild to carry over."""
    grains = np.searchsorted(data["id"], data["place_grain"])
    order = np.argsort(grains, kind="stable")
    count = np.bincount(grains, minlength=n).astype(np.int32)
    walls = lists.new_wall_contacts(n, len(grains))
    walls.first = lists.pool.upload(starts(count), wp.int32)
    walls.place_count = lists.pool.upload(np.stack([count, count]), wp.int32)
    memory = walls.place.numpy()
    at = wall_record.columns(lists.model.features.contact.history)
    memory[lists.force_parity] = wall_record.packed(at, data, memory.shape[-1])[order]
    walls.place.assign(memory)
    lists.wall_contacts = walls


def _put_forces(lists: "NeighborLists", data: dict[str, Any]) -> None:
    """Pair forces, wall loads and wall contact forces of a checkpoint, in their slots of the new lists."""
    state = lists.state
    contacts = lists.view()
    pair, i, j = _listed(contacts)
    row, entry = np.zeros(lists.row.shape), np.zeros(lists.entry.shape)
    saved = {tuple(p): k for k, p in enumerate(data["pair"].tolist())}
    known = [(c, saved[tuple(p)]) for c, p in enumerate(pair.tolist()) if tuple(p) in saved]
    if known:
        here, there = np.array(known).T
        row[i[here]], row[j[here]] = data["pair_share_i"][there], data["pair_share_j"][there]
        if lists.model.features.measures.energy and "pair_entry_i" in data:
            entry[i[here]], entry[j[here]] = data["pair_entry_i"][there], data["pair_entry_j"][there]
    lists.row.assign(row)
    lists.entry.assign(entry)
    if lists.wall_contacts is None:
        return
    load = np.zeros((len(state), 6))
    load[state.rank] = data["wall_load"]
    lists.wall_contacts.load.assign(load)
    for name in ("entry", "power") if lists.model.features.measures.energy and "wall_entry" in data else ():
        values = np.zeros_like(data[f"wall_{name}"])
        values[state.rank] = data[f"wall_{name}"]
        getattr(lists.wall_contacts, name).assign(values)
    slot, holder = contacts.place_slots(lists.force_parity, contacts.wall_grains)
    order = np.argsort(data["place_grain"], kind="stable")
    mine = np.argsort(state.id.numpy()[holder], kind="stable")
    result = lists.wall_contacts.result.numpy()
    result[slot[mine]] = wall_record.packed(wall_record.RESULT, data, result.shape[-1])[order]
    lists.wall_contacts.result.assign(result)
