"""Phases of a scene, as scene data: parts of a run, each the scene with changes.

A phase starts from the state in which the one before ended. Its changes stay for those after it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ConfigDict, Field

from warpdem.scene.base import Name, SceneModel


class Phase(SceneModel):
    """A part of a run: its name, and any keys of the scene but grains, start and phases, which it changes.

    Tables are changed key by key; walls, outlets and observers by name, pairs by their materials: what is not there is added.
    Motions, streams and other lists are replaced.
    """

    model_config = ConfigDict(extra="allow")

    name: Name = Field(description="Name, one of a kind: letters, digits, _ and -; results are in a folder of this name.")
    without: list[str] = Field([], description="Names of walls and outlets that are taken away, default none.")

    @property
    def changes(self) -> dict[str, Any]:
        """The keys of the scene that it changes."""
        return self.model_extra or {}


NOT_IN_A_PHASE = ("base", "access", "source", "notes", "title", "grains", "start", "phases")
_NAMED = {"walls": "name", "outlets": "name", "observers": "name", "pairs": "materials"}
"""Lists whose entries are known by a key."""


def changed(data: Mapping[str, Any], phase: Phase) -> dict[str, Any]:
    """Tables of a scene as ``phase`` leaves them."""
    out = {**data, **{key: _merged(key, data.get(key), value) for key, value in phase.changes.items()}}
    for key in ("walls", "outlets"):
        if key in out and isinstance(out[key], list):
            out[key] = [entry for entry in out[key] if not (isinstance(entry, Mapping) and entry.get("name") in phase.without)]
    return out


def key_path_in_phase(key_path: Sequence[str | int], data: Mapping[str, Any], phase: Phase) -> tuple[str | int, ...]:
    """Key path within ``phase`` of a key path in the changed tables; entries that the phase does not name keep theirs."""
    key, number = key_path[0], key_path[1] if len(key_path) > 1 else None
    given = phase.changes.get(key)
    if key not in _NAMED or not isinstance(number, int) or not isinstance(given, list):
        return tuple(key_path)
    keys = [_known_as(key, entry) for entry in given]
    mine = _known_as(key, data[key][number])
    return (key, keys.index(mine), *key_path[2:]) if mine in keys else tuple(key_path)


def _merged(key: str, old: Any, new: Any) -> Any:
    """Value of a top-level key of the scene after a change."""
    if key in _NAMED and isinstance(old, list) and isinstance(new, list):
        entries = {_known_as(key, entry): entry for entry in old}
        for entry in new:
            mine = _known_as(key, entry)
            both = isinstance(entry, Mapping) and isinstance(entries.get(mine), Mapping)
            entries[mine] = {**entries[mine], **entry} if both else entry
        return list(entries.values())
    return _joined(old, new) if key != "frame" else new


def _joined(old: Any, new: Any) -> Any:
    """Tables joined key by key; anything else is replaced."""
    if not (isinstance(old, Mapping) and isinstance(new, Mapping)):
        return new
    return {**old, **{key: _joined(old.get(key), value) for key, value in new.items()}}


def _known_as(key: str, entry: Any) -> Any:
    """What an entry of one of the lists in ``_NAMED`` is known by; itself, as text, if it has no such key."""
    found = entry.get(_NAMED[key]) if isinstance(entry, Mapping) else None
    if found is None:
        return repr(entry)
    return tuple(sorted(map(str, found))) if isinstance(found, (list, tuple)) else found
