"""Conversion of scene files: TOML from a USD stage, a USD stage from TOML, or either one for another folder."""

from collections.abc import Sequence
from pathlib import Path

from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.scene.file import load_scene
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

SUFFIXES = (".toml", ".usda", ".usdc", ".usd")
"""Suffixes of the files that are written."""


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

    Numbers are written in SI. Comments, and content of a stage that is no part of the scene, are not written. Paths of files
    become relative to the folder of ``target``.

    Args:
        source: Scene file, TOML or USD.
        target: File to write; its suffix selects the format.
        at: For the result stage of a run, time of the frame [s]; the last frame by default.
        overwrite: Allow an existing target.
        allow_paths: As for ``load_scene``.
        plugins: As for ``load_scene``.

    Returns:
        Notes on content of the source that the scene cannot hold, so that the target lacks it.

    Raises:
        SceneError: The scene is wrong, or the target exists or has another suffix.
        OutputError: The target cannot be written.
    """
    require_target(source, target, SUFFIXES, overwrite=overwrite)
    scene = load_scene(source, at=at, allow_paths=allow_paths, plugins=plugins)
    tables = scene_tables(scene, relative_to(target.parent))
    if target.suffix.lower() == ".toml":
        with replaced(target) as part:
            part.write_text(toml_text(tables), encoding="utf-8")
        return scene.notes
    from warpdem.scene.write_usd import write_usd_scene

    write_usd_scene(target, tables)
    return scene.notes


def require_target(source: Path, target: Path, suffixes: Sequence[str], *, overwrite: bool) -> None:
    """Raise if a scene file cannot be written to ``target``.

    Raises:
        SceneError: Its suffix is none of ``suffixes``, it exists, or its folder does not.
    """
    if target.suffix.lower() not in suffixes:
        raise SceneError(f"{target}: must end in {', '.join(suffixes)}: the suffix selects the format")
    if target.exists() and (not overwrite or target.resolve() == source.resolve()):
        remedy = "choose another name" + ("" if target.resolve() == source.resolve() else ", or use --overwrite")
        raise SceneError(f"{target}: exists already; {remedy}")
    if not target.parent.is_dir():
        raise SceneError(f"{target}: there is no folder {target.parent}")
