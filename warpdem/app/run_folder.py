"""The folder of a run: its default name, and what is refused before anything is written."""

import math
import os
from pathlib import Path

from warpdem.core.run_lock import FolderLocked, is_locked, require_unlocked
from warpdem.errors import SceneError
from warpdem.usd.stage import USD_SUFFIXES

CHECKPOINT = "checkpoint.h5"


def named_folder(scene_path: Path) -> Path:
    """``out/NAME``: the name of the scene's file, or of its folder if it is the result stage of a run."""
    is_result = scene_path.stem == "result" and scene_path.suffix.lower() in USD_SUFFIXES
    return Path("out") / (scene_path.resolve().parent.name if is_result else scene_path.stem)


def default_folder(scene_path: Path) -> Path:
    """``out/NAME``, or ``out/NAME-2``, ``out/NAME-3``... when there are results already, or another run is writing there."""
    base = named_folder(scene_path)
    folder, number = base, 1
    while (folder / "run.json").exists() or is_locked(folder):
        number += 1
        folder = base.with_name(f"{base.name}-{number}")
    return folder


def check_request(folder: Path, until: float | None, overwrite: bool) -> None:
    """Refuse to write over the results of another run, and an end that is none; nothing is written.

    Raises:
        SceneError: if ``folder`` holds a run and ``overwrite`` is false, or cannot be written; if ``until`` [s] is not above 0.
        FolderLocked: a SceneError: another run is writing into ``folder``, or has left its results there.
    """
    if until is not None and not 0.0 < until < math.inf:
        raise SceneError(f"--until {until:g}: the time at which the run ends must be above 0 [s]")
    require_unlocked(folder)
    refuse_results(folder, overwrite)
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise SceneError(f"--out {folder}: cannot be written ({there} is no folder to write in)")


def refuse_results(folder: Path, overwrite: bool) -> None:
    """Refuse to write over the results of another run.

    Raises:
        FolderLocked: if ``folder`` holds a run and ``overwrite`` is false.
    """
    if (folder / "run.json").exists() and not overwrite:
        message = f"--out {folder}: holds the results of a run; take another one, or give --overwrite (overwrite=True)"
        raise FolderLocked(folder, message)
