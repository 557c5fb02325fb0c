"""A scene as plain tables, for a file in another folder or format: numbers in SI, only the keys that were given."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from warpdem.scene.model import Scene
from warpdem.scene.user_models import is_file

FILE_KEYS = ("mesh", "file", "usd", "checkpoint", "tile")
"""Keys whose values are paths of files."""
MODEL_KEYS = ("normal", "tangential", "rolling", "twisting", "liquid", "model")
"""Keys whose values are models: a name, or the path of a file."""
Rename = Callable[[Path], str]


def names_file(key: str, value: Any) -> bool:
    """Whether the value of a key is the path of a file."""
    return isinstance(value, str) and (key in FILE_KEYS or (key in MODEL_KEYS and is_file(value)))


def relative_to(folder: Path) -> Rename:
    """Function that makes paths relative to ``folder``; absolute where no relative path exists, as between two drives."""

    def rename(file: Path) -> str:
        try:
            return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
        except ValueError:
            return file.resolve().as_posix()

    return rename


def scene_tables(scene: Scene, rename: Rename) -> dict[str, Any]:
    """The tables of a scene, as read from TOML, with arrays as lists.

    Args:
        scene: Any scene.
        rename: Gives the path of a file as it is written in the tables.
    """
    tables: dict[str, Any] = _tables(scene.model_dump(mode="json", exclude_unset=True), scene, rename)
    return tables


def _tables(value: Any, scene: Scene, rename: Rename, key: str = "") -> Any:
    if isinstance(value, dict):
        return {k: _tables(v, scene, rename, k) for k, v in value.items() if v is not None}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        entries = [_tables(entry, scene, rename) for entry in value]
        # a single motion is written as a table, not as a list
        return entries[0] if key in ("frame", "motion") and len(entries) == 1 else entries
    return rename(scene.resolve(value)) if names_file(key, value) else value
