"""The pieces of a frame, one of each rank: taken out, and put together in the order of a frame that was written as a whole."""

from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.core.snapshot import ClumpShots, ContactNetwork, Snapshot

Arrays = dict[str, np.ndarray]
"""Arrays by name, with a row for each grain, contact or clump."""


def piece_of(snapshot: Snapshot, own: np.ndarray) -> Snapshot:
    """The grains ``own`` of a frame with their contacts, of two grains those of the lower id; of the clumps all, no loads.

    Args:
        snapshot: The frame.
        own: Mask of the grains, shape (n,).
    """
    contacts = snapshot.contacts
    if contacts is not None:
        mine = np.isin(contacts.i, snapshot.id[own])
        contacts = replace(contacts, **_rows(contacts, mine))
    return replace(snapshot, **_rows(snapshot, own), contacts=contacts, loads={})


def without_grains(snapshot: Snapshot) -> Snapshot:
    """The frame without grains, contacts and clumps: arrays without rows."""
    nothing = piece_of(snapshot, np.zeros(len(snapshot.id), dtype=bool))
    clumps = snapshot.clumps
    return nothing if clumps is None else replace(nothing, clumps=replace(clumps, **_rows(clumps, slice(0))))


def joined_grains(pieces: list[Snapshot]) -> Snapshot:
    """The grains of all pieces by id; what belongs to the whole frame is that of the first."""
    rows = joined([{name: getattr(piece, name) for name in _held(piece)} for piece in pieces])
    of_grains: dict[str, Any] = in_rows(rows, order_by_id(rows["id"]))
    return replace(pieces[0], **of_grains)


def joined(pieces: list[Arrays]) -> Arrays:
    """The rows of all pieces, one piece after the other."""
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]} if len(pieces) > 1 else pieces[0]


def in_rows(arrays: Arrays, order: np.ndarray | None) -> Arrays:
    """The rows in another order; None: as they are."""
    return arrays if order is None else {name: values[order] for name, values in arrays.items()}


def order_by_id(ids: np.ndarray) -> np.ndarray | None:
    """Order of grains or clumps in a frame; None if it is theirs already."""
    return None if (ids[1:] > ids[:-1]).all() else np.argsort(ids, kind="stable")


def order_of_contacts(contacts: Arrays) -> np.ndarray:
    """Order of contacts in a frame: those of two grains by the ids, then those with walls by grain and wall, the last first.

    A grain's several points on one wall keep theirs: they are in one piece.
    """
    i, j, wall = (contacts[name] for name in ("i", "j", "wall"))
    return np.lexsort((np.where(wall < 0, j, -1 - wall), i, wall >= 0))


def remove_pieces(folder: Path, pattern: str) -> None:
    """Remove the pieces of a run whose results are written over: ranks that there are no more would leave theirs.

    Args:
        folder: where they are.
        pattern: of their names.
    """
    for stale in folder.glob(pattern):
        with suppress(OSError):  # what stays is in no index
            stale.unlink()


def _held(table: Snapshot | ContactNetwork | ClumpShots) -> list[str]:
    """Names of the arrays that have a row for each grain, contact or clump."""
    return [f.name for f in fields(table) if f.name != "gravity" and isinstance(getattr(table, f.name), np.ndarray)]


def _rows(table: Snapshot | ContactNetwork | ClumpShots, which: np.ndarray | slice) -> dict[str, Any]:
    return {name: getattr(table, name)[which] for name in _held(table)}

