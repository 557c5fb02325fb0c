"""Phases of a scene, as scene data: parts of a run, each the scene with changes.

A phase starts from the state in which the one before ended. Its changes stay for those after it.
"""

from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict, Field

from warpdem.core.key_path import KeyPath
from warpdem.scene.base import Name, SceneModel


class Phase(SceneModel):
    """A part of a run: its name, and the keys of the scene that it changes, any but grains, start and phases.

    Tables are changed key by key; walls, outlets and observers by name, pairs by their materials; new entries are added.
    Motions, streams and other lists are replaced.
    """

    model_config = ConfigDict(extra="allow")

    name: Name = Field(description="Unique name: letters, digits, _ and -; results are written to a folder of this name.")
    without: list[str] = Field([], description="Names of walls and outlets that are removed, default none.")

    @property
    def changes(self) -> dict[str, Any]:
        """The keys of the scene that it changes."""
        return self.model_extra or {}


NOT_IN_A_PHASE = ("base", "access", "source", "notes", "title", "grains", "start", "phases")
_NAMED = {"walls": "name", "outlets": "name", "observers": "name", "pairs": "materials"}
"""Lists whose entries are identified by a key."""


def changed(data: Mapping[str, Any], phase: Phase) -> dict[str, Any]:
    """Tables of a scene after the changes of ``phase``."""
    out = {**data, **{key: _merged(key, data.get(key), value) for key, value in phase.changes.items()}}
    for key in ("walls", "outlets"):
        if key in out and isinstance(out[key], list):
            out[key] = [entry for entry in out[key] if not (isinstance(entry, Mapping) and entry.get("name") in phase.without)]
    return out


def key_path_in_phase(key_path: KeyPath, data: Mapping[str, Any], phase: Phase) -> KeyPath:
    """Key path within ``phase`` of a key path in the changed tables; entries that the phase does not name keep theirs."""
    key, number = str(key_path[0]), key_path[1] if len(key_path) > 1 else None
    given = phase.changes.get(key)
    if key not in _NAMED or not isinstance(number, int) or not isinstance(given, list):
        return tuple(key_path)
    identifiers = [_identifier(key, entry) for entry in given]
    own = _identifier(key, data[key][number])
    return (key, identifiers.index(own), *key_path[2:]) if own in identifiers else tuple(key_path)


def _merged(key: str, old: Any, new: Any) -> Any:
    """Value of a top-level key of the scene after a change."""
    if key in _NAMED and isinstance(old, list) and isinstance(new, list):
        entries = {_identifier(key, entry): entry for entry in old}
        for entry in new:
            own = _identifier(key, entry)
            both = isinstance(entry, Mapping) and isinstance(entries.get(own), Mapping)
            if both and key == "pairs":  # what does not touch has no coefficients to keep
                both = False not in (entry.get("contact"), entries[own].get("contact"))
            entries[own] = {**entries[own], **entry} if both else entry
        return list(entries.values())
    return _merged_tables(old, new) if key != "frame" else new


def _merged_tables(old: Any, new: Any) -> Any:
    """Tables merged key by key; any other value is replaced."""
    if not (isinstance(old, Mapping) and isinstance(new, Mapping)):
        return new
    return {**old, **{key: _merged_tables(old.get(key), value) for key, value in new.items()}}


def _identifier(key: str, entry: Any) -> Any:
    """Identifier of an entry of one of the lists in ``_NAMED``; the entry as text if it lacks the key."""
    found = entry.get(_NAMED[key]) if isinstance(entry, Mapping) else None
    if found is None:
        return repr(entry)
    return tuple(sorted(map(str, found))) if isinstance(found, (list, tuple)) else found
