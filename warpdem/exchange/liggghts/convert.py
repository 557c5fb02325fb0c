"""A LIGGGHTS script as a scene file."""

from __future__ import annotations

from pathlib import Path

from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.exchange.liggghts.scene import scene_of_script
from warpdem.scene.convert import require_target
from warpdem.scene.file import load_scene
from warpdem.scene.write_toml import toml_text


def convert_script(source: Path, target: Path, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write a scene file that does what a script of LIGGGHTS does.

    What is other or missing stands at its head, and so does what the scene file still lacks.

    Args:
        source: the script; files that it names are relative to its folder.
        target: .toml file to write.
        overwrite: allow an existing target.

    Returns:
        What is other or missing, in words.

    Raises:
        SceneError: the script cannot be read or lacks what contacts need; the target exists or has another suffix.
    """
    require_target(source, target, (".toml",), overwrite=overwrite)
    if not source.is_file():
        raise SceneError(f"{source}: no such file")
    tables, notes = scene_of_script(source, target.parent)
    _write(target, source, toml_text(tables), notes)
    try:
        load_scene(target)
    except SceneError as error:
        notes.append(f"the scene is not complete: {error}")
        _write(target, source, toml_text(tables), notes)
    return tuple(notes)


def _write(target: Path, source: Path, text: str, notes: list[str]) -> None:
    head = f"Converted from {source.name}. What is other or missing:"
    lines = [head, *(f"  {line}" for note in notes for line in note.splitlines())]
    with replaced(target) as part:
        part.write_text("".join(f"# {line}\n" for line in lines) + "\n" + text, encoding="utf-8")
