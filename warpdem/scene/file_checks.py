"""Files that a scene names: whether they exist, may be read, and fit into the memory."""

import difflib
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from warpdem.core import memory
from warpdem.core.access import Access
from warpdem.core.key_path import KeyPath
from warpdem.scene.messages import line
from warpdem.scene.model import Scene
from warpdem.scene.models import located
from warpdem.scene.phases import key_path_in_phase
from warpdem.scene.read_toml import non_file_type
from warpdem.scene.user_models import is_file


def similar_files(file: Path) -> str:
    """Hint on files of similar name or type beside a missing one, or on a missing folder; empty if there are none."""
    try:
        names = sorted(entry.name for entry in file.parent.iterdir() if entry.is_file())
    except OSError:
        return f"; there is no folder {file.parent}"
    by_lower = {name.lower(): name for name in names}
    close = [by_lower[name] for name in difflib.get_close_matches(file.name.lower(), by_lower, n=3)]
    same_type = [name for name in names if Path(name).suffix.lower() == file.suffix.lower() != ""]
    found = close or same_type[:3]
    return f"; similar files there: {', '.join(found)}" if found else ""


def missing_files(scene: Scene) -> Iterator[str]:
    """Problems with the files that the scene and its phases name."""
    for key_path, name in _named_files(scene):
        if refusal := scene.access.refusal(name, scene.base):
            yield line(key_path, name, refusal)
            continue
        file = scene.resolve(name)
        if not file.exists():
            yield line(key_path, name, f"no such file: {file}{similar_files(file)}")
        elif entry := non_file_type(file):
            yield line(key_path, name, f"{file} is {entry}, not a file")
        elif reason := memory.refusal(size := file.stat().st_size, f"a file of {size} bytes", "take a smaller one"):
            yield line(key_path, name, reason)


def _named_files(scene: Scene) -> Iterator[tuple[KeyPath, str]]:
    """Key path and name of each file; of a phase only the files that are new in it."""
    yield from scene.files()
    known = {name for _, name in scene.files()}
    for k, phase in enumerate(scene.phases):
        one = scene.phase(k)
        for key_path, name in one.files():
            if key_path[0] not in ("grains", "start") and name not in known:
                yield ("phases", k, *key_path_in_phase(key_path, one.model_dump(mode="json"), phase)), name
                known.add(name)


def all_refused(data: Mapping[str, Any], base: Path, access: Access) -> str:
    """A last line that names all code files that the scene may not load, if there are several."""
    names = dict.fromkeys(name for key in ("contact", "fields", "observers", "phases") for name in _code(data.get(key)))
    files = list(dict.fromkeys(located(name, base) for name in names if access.plugin_refusal(name, base)))
    if len(files) < 2:
        return ""
    return f"\nif you trust all {len(files)} files: --plugin {shlex.join(files)}, or load_scene(..., plugins={files})"


def _code(part: Any) -> Iterator[str]:
    """Names of code files within a part of the tables."""
    if isinstance(part, str) and is_file(part):
        yield part
    for inner in part.values() if isinstance(part, Mapping) else part if isinstance(part, list) else ():
        yield from _code(inner)
