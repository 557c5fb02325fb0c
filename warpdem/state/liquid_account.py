"""The liquid of a run in a checkpoint, and what a run that starts from one takes over: no count is lost on the way."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from warpdem.kernels.contact.films import FILM_AT
from warpdem.kernels.contact.liquid import COUNT
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.view import RunView


def gifts(lists: ListedContacts, slots: int) -> np.ndarray:
    """What bridges that broke in the last force call give to the grain in each memory slot [counts], shape (slots,), int64.

    The next motion of a grain adds it to its film.
    """
    out = np.zeros(slots, dtype=np.int64)
    if lists.contact_count and lists.owner is not None:
        assert lists.partner is not None and lists.slot_force is not None
        assert lists.slot_i is not None and lists.slot_j is not None
        force = lists.slot_force.numpy()
        for side, of_side in ((lists.owner, lists.slot_i), (lists.partner, lists.slot_j)):
            slot = of_side.numpy().ravel()
            real = slot < len(force) - 1
            np.add.at(out, side.numpy().ravel()[real], force[slot[real], -1].astype(np.int64))
    return out


def _unsaved(view: RunView) -> np.ndarray:
    """Gifts of bridges between a grain and one that has left, which no contact of the checkpoint tells of, by memory slot."""
    lists, state = view.contacts, view.state
    given = gifts(lists, state.slots)
    if not given.any() or len(state) == state.slots:
        return np.zeros_like(given)
    assert lists.owner is not None and lists.partner is not None and lists.slot_i is not None
    assert lists.slot_j is not None and lists.slot_force is not None
    force, counted = lists.slot_force.numpy(), np.zeros_like(given)
    lane = lists.real_lanes()
    for side, of_side in ((lists.owner, lists.slot_i), (lists.partner, lists.slot_j)):
        np.add.at(counted, side.numpy().ravel()[lane], force[of_side.numpy().ravel()[lane], -1].astype(np.int64))
    return given - counted


def films(view: RunView) -> np.ndarray:
    """Films of the grains in order of id, as of ``kernels.contact.films.FILM_AT``, shape (n, 3), int64."""
    state = view.state
    assert state.film is not None
    out = state.film.numpy()[state.rank].copy()
    out[:, FILM_AT.returned] += _unsaved(view)[state.rank]
    return out


def saved(view: RunView) -> dict[str, Any] | None:
    """What a checkpoint holds of the liquid beside the films, as JSON; None without liquid."""
    state, liquid = view.state, view.model.liquid
    if liquid is None:
        return None
    assert state.film is not None
    gone = ~state.here
    left = state.liquid_left + state.film.numpy()[gone].sum(axis=0)
    left[FILM_AT.returned] += _unsaved(view)[gone].sum()
    return {"quantum": liquid.quantum, "most_from_film": liquid.most_from_film, "left": [int(counts) for counts in left]}


def restore(view: RunView, data: Mapping[str, Any]) -> None:
    """Take over what ``saved`` gave."""
    if view.model.liquid is not None:
        view.state.liquid_left = np.array(data["liquid"]["left"], dtype=np.int64)


def starting_films(data: dict[str, Any], kept: bool, kept_at_walls: np.ndarray) -> np.ndarray:
    """Films of the grains of a checkpoint that another scene starts from, in order of id, shape (n, 3), int64.

    Bridges that do not go on give their liquid back, half to each grain, all of it at a wall; what walls have given so far
    counts as brought.

    Args:
        data: of the checkpoint.
        kept: whether the bridges between grains go on.
        kept_at_walls: which contact points at walls go on, shape (points,).
    """
    n = len(data["id"])
    if data.get("liquid") is None:
        return np.zeros((n, FILM_AT.width), dtype=np.int64)
    out = np.array(data["film"], dtype=np.int64)
    place = {side: np.searchsorted(data["id"], data["pair"][:, side]) for side in (0, 1)}
    counts = np.maximum(data[f"pair_own_{COUNT}"], 0.0).astype(np.int64)
    for side, name in enumerate("ij"):
        np.add.at(out[:, FILM_AT.returned], place[side], data[f"pair_share_{name}"][:, -1].astype(np.int64))
        if not kept:
            np.add.at(out[:, FILM_AT.returned], place[side], counts // 2)
    if f"wall_contact_{COUNT}" in data:
        at_walls = data[f"wall_contact_{COUNT}"]
        held = np.where(at_walls > 0.0, at_walls, np.maximum(-2.0 - at_walls, 0.0)).astype(np.int64)
        back = np.where(kept_at_walls & (at_walls > 0.0), 0, held)
        np.add.at(out[:, FILM_AT.returned], np.searchsorted(data["id"], data["wall_contact_grain"]), back)
    out[:, FILM_AT.drawn] = 0
    return out
