"""The pieces of a frame, one of each rank: taken out, and put together in the order of a frame that was written as a whole."""

from dataclasses import fields, replace
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
    if len(pieces) == 1:
        return pieces[0]
    order = np.argsort(np.concatenate([piece.id for piece in pieces]), kind="stable")
    rows: dict[str, Any] = {
        name: np.concatenate([getattr(piece, name) for piece in pieces])[order] for name in _held(pieces[0])
    }
    return replace(pieces[0], **rows)


def joined_by_id(pieces: list[Arrays]) -> Arrays:
    """The rows of all pieces in order of their ``id``."""
    if len(pieces) == 1:
        return pieces[0]
    return _joined(pieces, np.argsort(np.concatenate([piece["id"] for piece in pieces]), kind="stable"))


def joined_contacts(pieces: list[Arrays]) -> Arrays:
    """The contacts of all pieces: those of two grains by the ids, then those with walls by grain and wall, the last wall first.

    A grain's several points on one wall keep their order: they are in one piece.
    """
    if len(pieces) == 1:
        return pieces[0]
    i, j, wall = (np.concatenate([piece[name] for piece in pieces]) for name in ("i", "j", "wall"))
    return _joined(pieces, np.lexsort((np.where(wall < 0, j, -1 - wall), i, wall >= 0)))


def _held(table: Snapshot | ContactNetwork | ClumpShots) -> list[str]:
    """Names of the arrays that have a row for each grain, contact or clump."""
    return [f.name for f in fields(table) if f.name != "gravity" and isinstance(getattr(table, f.name), np.ndarray)]


def _rows(table: Snapshot | ContactNetwork | ClumpShots, which: np.ndarray | slice) -> dict[str, Any]:
    return {name: getattr(table, name)[which] for name in _held(table)}


def _joined(pieces: list[Arrays], order: np.ndarray) -> Arrays:
    return {name: np.concatenate([piece[name] for piece in pieces])[order] for name in pieces[0]}
