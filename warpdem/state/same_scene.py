"""Which scene may go on from a checkpoint: the one it was saved of, but for keys that change no bit."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpdem.core.access import Access, access_of_file
from warpdem.errors import SceneError
from warpdem.scene.model import Scene

MAY_CHANGE = {
    "output.checkpoint_interval", "output.checkpoint_wall_time", "output.picture", "engine.skin", "engine.guards",
    "engine.max_overlap", "start.checkpoint",
}  # fmt: skip
"""Keys of a scene that change no bit of a state or a frame: a run may go on with others. A start's contents count, not its
place."""


def scene_of(data: Mapping[str, Any], plugins: Sequence[str | Path] = ()) -> Scene:
    """The scene that a checkpoint belongs to; it loads code from no other files than ``plugins``."""
    from warpdem.scene.file import scene_from_dict

    access = Access(plugins=access_of_file(Path(), plugins=plugins).plugins)
    return scene_from_dict(data["scene"], data["base"], data["source"], access)


def refuse_other(data: Mapping[str, Any], scene: Scene, files: dict[str, str], scene_hash: str) -> None:
    """Refuse to go on with another scene than that of a checkpoint, or the same with other files.

    Args:
        data: the checkpoint, as ``read`` gives it.
        scene: validated scene.
        files: its ``model.digests.file_digests``.
        scene_hash: its ``model.digests.scene_hash``.

    Raises:
        SceneError: with the keys that differ, unless all are among `MAY_CHANGE`.
    """
    if data["scene_hash"] == scene_hash:
        return
    changed = _changed(data["scene"], scene.model_dump(mode="json"))
    keys = [key for key in changed if key not in MAY_CHANGE]
    named = [place for place in {**data["files"], **files} if data["files"].get(place) != files.get(place)]
    if keys or named or not changed:
        raise SceneError(f"{data['path']}: belongs to another scene than {scene.source}: {_told(keys, named)}")


def _changed(there: dict[str, Any], here: dict[str, Any]) -> list[str]:
    """Keys whose values differ, those of tables that both have one by one: output.interval."""
    out = []
    for key in {**here, **there}:
        old, new = there.get(key), here.get(key)
        if old != new:
            if isinstance(old, dict) and isinstance(new, dict):
                out += [f"{key}.{inner}" for inner in _changed(old, new)]
            else:
                out.append(key)
    return out


def _told(keys: list[str], files: list[str]) -> str:
    """What differs between the scene of a checkpoint and that of the run, and the remedy."""
    if not keys:
        return f"other contents of the file of {', '.join(files)}; nothing was changed"
    said = f"other values of {', '.join(keys)}; nothing was changed; repeat the same --set options, if any were given"
    if any(key.startswith("output.") for key in keys):
        said += "; what is written, and how often, is the same in all of a run: the part before is there already"
    if "time.end" in keys:
        said += "; to end at another time, keep time.end and say --until"
    return said
