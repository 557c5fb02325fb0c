"""Contact history and forces of the last force call: taken out for a checkpoint, and put back."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warpdem.kernels.contact.columns import LOAD, TWIST, VECTORS, Columns
from warpdem.kernels.contact.liquid import COUNT
from warpdem.kernels.lists.numbering import starts
from warpdem.kernels.wall import record as wall_record
from warpdem.state.blocks import Rows, each_block
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.particles import changed
from warpdem.state.view import RunView

if TYPE_CHECKING:
    from warpdem.engine.neighbor_list import NeighborLists


def read(view: RunView) -> dict[str, Rows | np.ndarray]:
    """History and forces of all contacts: arrays of a checkpoint."""
    return _pair_contacts(view) | wall_contacts(view)


def within(data: Mapping[str, Any]) -> dict[str, Any]:
    """Of a checkpoint, what ``restore`` takes: ids of the grains, and arrays of contacts."""
    return {name: data[name] for name in data if name == "id" or name.startswith(("pair", "wall_"))}


def springs_width(at: Columns) -> int:
    """Numbers of the springs, which stand first in the contact history ``at`` and in ``pair_history`` of a checkpoint."""
    return sum(size for name, size in at.sizes if name in VECTORS)


def _pair_contacts(view: RunView) -> dict[str, Rows | np.ndarray]:
    """History and pair forces of the listed grain-grain contacts."""
    contacts, features = view.contacts, view.model.features
    at, force_width = features.contact.history, features.contact.pair_force_width
    springs = springs_width(at)
    own = [name for name in at.names if name not in VECTORS]
    if not contacts.contact_count:
        real = wp.dtype_to_numpy(features.backend.real)
        none: dict[str, Rows | np.ndarray] = {"pair": np.zeros((0, 2), dtype=np.int64)}
        none |= {"pair_history": np.zeros((0, max(springs, 1)), dtype=real)}
        none |= {f"pair_share_{side}": np.zeros((0, force_width), dtype=real) for side in "ij"}
        none |= {f"pair_own_{name}": np.zeros(0, dtype=real) for name in own}
        impulses = {"pair_impulses": np.zeros((0, features.impulses.width), dtype=real)}
        return none | (impulses if features.measures.energy else {})
    assert contacts.owner is not None and contacts.partner is not None and contacts.history is not None
    assert contacts.slot_i is not None and contacts.slot_j is not None and contacts.slot_force is not None
    lane, ids, history = _live_lanes(view), view.state.id.numpy(), contacts.history.numpy()
    owner, partner = contacts.owner.numpy().ravel(), contacts.partner.numpy().ravel()
    count, lanes = len(lane), history.shape[2]

    def pair(part: slice) -> np.ndarray:
        return np.stack([ids[side[lane[part]]] for side in (owner, partner)], axis=1)

    def remembered(columns: int | slice) -> Callable[[slice], np.ndarray]:
        return lambda part: history[lane[part] // lanes, columns, lane[part] % lanes]

    def in_slots(values: np.ndarray, slot: np.ndarray) -> Rows:
        return Rows((count, *values.shape[1:]), values.dtype, lambda part: values[slot[lane[part]]])

    unsprung = np.zeros((count, 1), dtype=history.dtype)
    out: dict[str, Rows | np.ndarray] = {"pair": Rows((count, 2), ids.dtype, pair)}
    out["pair_history"] = Rows((count, springs), history.dtype, remembered(slice(springs))) if springs else unsprung
    slots = (("i", contacts.slot_i.numpy().ravel()), ("j", contacts.slot_j.numpy().ravel()))
    out |= {f"pair_share_{side}": in_slots(contacts.slot_force.numpy(), slot) for side, slot in slots}
    out |= {f"pair_own_{name}": Rows((count,), history.dtype, remembered(at.of(name))) for name in own}
    if features.measures.energy:
        kept = features.impulses.width
        out["pair_impulses"] = Rows((count, kept), history.dtype, remembered(slice(at.width, at.width + kept)))
    return out


def _live_lanes(view: RunView) -> np.ndarray:
    """Numbers of the lanes whose contact has a force or a history, in order of both ids: the same however pairs are listed."""
    contacts, ids = view.contacts, view.state.id.numpy()
    assert contacts.owner is not None and contacts.partner is not None and contacts.history is not None
    assert contacts.slot_i is not None and contacts.slot_j is not None and contacts.slot_force is not None
    lane, history, force = contacts.real_lanes(), contacts.history.numpy(), contacts.slot_force.numpy()
    slots = [side.numpy().ravel() for side in (contacts.slot_i, contacts.slot_j)]

    def live(part: slice) -> np.ndarray:
        some, lanes = lane[part], history.shape[2]
        out = history[some // lanes, :, some % lanes].any(axis=1)
        for slot in slots:
            out |= force[slot[some]].any(axis=1)
        return out

    alive = Rows((len(lane), history.shape[1]), history.dtype, live)
    kept = lane[np.concatenate([np.zeros(0, dtype=bool), *(block for _, block in each_block(alive))])]
    owner, partner = (side.numpy().ravel()[kept] for side in (contacts.owner, contacts.partner))
    order: np.ndarray = np.lexsort((ids[partner], ids[owner]))
    return kept[order]


def wall_contacts(view: RunView) -> dict[str, Rows | np.ndarray]:
    """History and forces of the grain-wall contacts, and the wall load of each grain in order of id."""
    contacts, state = view.contacts, view.state
    walls, rank = contacts.walls, state.rank
    if walls is None:
        return {}
    parity, g = view.clock.step_number & 1, contacts.wall_grains
    g = g[np.argsort(state.id.numpy()[g])]
    slot, holder = contacts.point_slots(parity, g)
    points = contacts.contact_points(parity, slot)
    out: dict[str, Rows | np.ndarray] = {f"wall_contact_{name}": values for name, values in points.items()}
    out["wall_contact_grain"] = state.id.numpy()[holder]
    load, candidates = walls.load.numpy(), walls.candidates.numpy()

    def wall_load(part: slice) -> np.ndarray:
        return np.where(candidates[rank[part], None] > 0, load[rank[part]], 0.0)

    out["wall_load"] = Rows((len(rank), *load.shape[1:]), load.dtype, wall_load)
    if view.model.features.measures.energy:
        out |= {f"wall_{name}": Rows.picked(getattr(walls, name).numpy(), rank) for name in ("entry", "power")}
    return out


def remember(lists: "NeighborLists", data: dict[str, Any]) -> None:
    """Take over the contact history, for the first rebuild to carry it to the grains that touch.

    ``pair_impulses``, of the last force call of the run that goes on, are taken over where they are given.

    Args:
        data: ids of the grains in their order (``id``), ``pair``, its springs ``pair_history`` and the law's own scalars
            ``pair_own_*``, and where there are walls the ``wall_contact_*`` of a checkpoint.
    """
    features, n = lists.model.features, len(lists.state)
    at = features.contact.history
    # no file of an older version has the load, nor a start from another scene, which may lack the twist; the next force call
    # gives the one, and the other begins at zero
    for name in {LOAD, TWIST} & {*at.names}:
        data = {f"pair_own_{name}": np.zeros(len(data["pair"])), **data}
        if "wall_contact_grain" in data:
            data = {f"wall_contact_{name}": np.zeros(len(data["wall_contact_grain"])), **data}
    pair, memory = data["pair"], np.zeros((len(data["pair"]), max(features.memory, 1)))
    springs = springs_width(at)
    memory[:, :springs] = data["pair_history"][:, :springs]
    for name in at.names:
        if name not in VECTORS:
            memory[:, at.of(name)] = data[f"pair_own_{name}"]
    if features.measures.energy and "pair_impulses" in data:
        memory[:, at.width :] = data["pair_impulses"]
    owner, partner = (positions(data["id"], pair[:, k]) for k in (0, 1))
    order = np.argsort(_keys(owner, partner, n))
    count = np.bincount(owner, minlength=n)
    lists.set_outer(starts(count), count, partner[order], order)
    padded = np.concatenate([memory, np.zeros((-len(memory) % features.backend.lanes, memory.shape[1]))])
    batches = padded.reshape(-1, features.backend.lanes, memory.shape[1]).transpose(0, 2, 1)
    lists.history = lists.pool.upload(batches, lists.real)
    if features.walls.present and "wall_contact_grain" in data:
        _put_wall_contacts(lists, data, n)


def restore(lists: "NeighborLists", data: dict[str, Any], since: int = 0) -> None:
    """Lists for the present positions with the contact history and the forces of a checkpoint, ``since`` steps ago."""
    if len(lists.state) == 0:
        return
    lists.force_parity = (lists.clock.step_number - since) & 1
    broken = _just_broken(data)
    if broken.any():  # lists hold them for a force call more: as if there were still something in them
        held = f"pair_own_{COUNT}"
        remember(lists, data | {held: np.where(broken, 1.0, data[held])})
    else:
        remember(lists, data)
    lists.make()
    _put_forces(lists, data)
    if broken.any():
        lane, there = _found(lists.view(), data)
        emptied, lanes = lane[broken[there]], lists.model.features.backend.lanes
        with changed(lists.history) as history:
            history[emptied // lanes, lists.model.features.contact.history.of(COUNT), emptied % lanes] = 0.0


def _just_broken(data: dict[str, Any]) -> np.ndarray:
    """Whether each contact is a bridge that broke in the last force call: its force and gifts are still due, shape (pairs,)."""
    held = data.get(f"pair_own_{COUNT}", np.zeros(0))
    return (held == 0.0) & (data["pair_share_i"] != 0.0).any(axis=1) if len(held) else np.zeros(len(held), dtype=bool)


def _put_wall_contacts(lists: "NeighborLists", data: dict[str, Any], n: int) -> None:
    """Slots that hold the wall contacts of a checkpoint, for the rebuild to carry over."""
    grains = np.searchsorted(data["id"], data["wall_contact_grain"])
    order = np.argsort(grains, kind="stable")
    count = np.bincount(grains, minlength=n).astype(np.int32)
    walls = lists.new_wall_contacts(n, len(grains))
    walls.first = lists.pool.upload(starts(count), wp.int32)
    walls.point_count = lists.pool.upload(np.stack([count, count]), wp.int32)
    memory = walls.point.numpy()
    at = wall_record.columns(lists.model.features.contact.history)
    memory[lists.force_parity] = wall_record.packed(at, data, memory.shape[-1])[order]
    walls.point.assign(memory)
    lists.wall_contacts = walls


def _put_forces(lists: "NeighborLists", data: dict[str, Any]) -> None:
    """Pair forces, wall loads and wall contact forces of a checkpoint, in their slots of the new lists."""
    state, n = lists.state, len(lists.state)
    contacts = lists.view()
    with changed(lists.slot_force) as force:
        force[...] = 0.0
        if contacts.contact_count and len(data["pair"]):
            lane, there = _found(contacts, data)
            for side, slots in (("i", contacts.slot_i), ("j", contacts.slot_j)):
                assert slots is not None
                slot = slots.numpy().ravel()[lane]
                force[slot] = data[f"pair_share_{side}"][there]
    if lists.wall_contacts is None:
        return
    load = np.zeros((n, 6))
    load[state.rank] = data["wall_load"]
    lists.wall_contacts.load.assign(load)
    for name in ("entry", "power") if lists.model.features.measures.energy and "wall_entry" in data else ():
        values = np.zeros_like(data[f"wall_{name}"])
        values[state.rank] = data[f"wall_{name}"]
        getattr(lists.wall_contacts, name).assign(values)
    slot, holder = contacts.point_slots(lists.force_parity, contacts.wall_grains)
    order = np.argsort(data["wall_contact_grain"], kind="stable")
    mine = np.argsort(state.id.numpy()[holder], kind="stable")
    result = lists.wall_contacts.result.numpy()
    result[slot[mine]] = wall_record.packed(wall_record.RESULT, data, result.shape[-1])[order]
    lists.wall_contacts.result.assign(result)


def _found(contacts: ListedContacts, data: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Lanes of the listed contacts that are in a checkpoint, and the number of each there, shapes (k,)."""
    state, n, lane = contacts.state, len(contacts.state), contacts.real_lanes()
    assert contacts.owner is not None and contacts.partner is not None
    position = np.empty(n, dtype=np.int64)  # in order of id, of the grain in each slot
    position[state.rank] = np.arange(n)
    listed = _keys(position[contacts.owner.numpy().ravel()[lane]], position[contacts.partner.numpy().ravel()[lane]], n)
    saved = _keys(positions(data["id"], data["pair"][:, 0]), positions(data["id"], data["pair"][:, 1]), n)
    order = np.argsort(saved)
    at = order[np.minimum(np.searchsorted(saved[order], listed), len(saved) - 1)]
    known = np.flatnonzero(saved[at] == listed)
    return lane[known], at[known]


def positions(ids: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Positions of the ids ``wanted``, all of which there are, in ``ids``, which ascend; shape as ``wanted``."""
    if len(ids) and ids[-1] - ids[0] == len(ids) - 1:  # without a gap
        return wanted - ids[0]
    return np.searchsorted(ids, wanted)


def _keys(owner: np.ndarray, partner: np.ndarray, n: int) -> np.ndarray:
    """One number per pair of grains at these positions of ``n``: the order of the first, then of the second."""
    return owner * np.int64(n) + partner
