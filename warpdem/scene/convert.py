"""A scene file in another format: TOML from a USD stage, a USD stage from TOML, or either one for another folder."""

from collections.abc import Sequence
from pathlib import Path

from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.scene.file import load_scene
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

SUFFIXES = (".toml", ".usda", ".usdc", ".usd")
"""Endings of the files that are written."""


def convert(
    source: Path,
    target: Path,
    *,
    at: float | None = None,
    overwrite: bool = False,
    allow_paths: Sequence[Path] = (),
    plugins: Sequence[Path] = (),
) -> tuple[str, ...]:
    """Write the scene of ``source`` to ``target``: the same scene when it is read again.

    Numbers come out in SI; comments, and what a stage says beside the scene, stay behind. Files that the scene names are
    named from the folder of ``target``.

    Args:
        source: Scene file, TOML or USD.
        target: File to write; its ending says the format.
        at: With the result stage of a run, instant of the frame [s]; the last one by default.
        overwrite: Allow a target that exists.
        allow_paths: As ``load_scene`` takes them.
        plugins: As ``load_scene`` takes them.

    Returns:
        Notes on what of the source the scene has no place for, and the target therefore lacks.

    Raises:
        SceneError: The scene is wrong, or the target exists or has another ending.
        OutputError: The target cannot be written.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise SceneError(f"{target}: must end in {', '.join(SUFFIXES)}: the ending says which format is written")
    if target.exists() and (not overwrite or target.resolve() == source.resolve()):
        remedy = "take another name" + ("" if target.resolve() == source.resolve() else ", or say --overwrite")
        raise SceneError(f"{target}: is there already; {remedy}")
    if not target.parent.is_dir():
        raise SceneError(f"{target}: there is no folder {target.parent}")
    scene = load_scene(source, at=at, allow_paths=allow_paths, plugins=plugins)
    tables = scene_tables(scene, relative_to(target.parent))
    if target.suffix.lower() == ".toml":
        with replaced(target) as part:
            part.write_text(toml_text(tables), encoding="utf-8")
        return scene.notes
    from warpdem.scene.write_usd import write_usd_scene

    write_usd_scene(target, tables)
    return scene.notes
