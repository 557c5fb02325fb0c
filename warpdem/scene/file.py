"""Scene files: a ``Scene`` from TOML or USD, with the messages of ``warpdem.scene.messages``."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warpdem.core.access import Access, access_of_file
from warpdem.core.file_names import expanded
from warpdem.core.key_path import KeyPath
from warpdem.errors import SceneError
from warpdem.scene.file_checks import all_refused, missing_files, similar_files
from warpdem.scene.messages import PYTHON_ONLY, line, report, scene_error, shorten, unknown_key
from warpdem.scene.model import Scene
from warpdem.scene.overrides import apply_override
from warpdem.scene.read_toml import InvalidToml, find_excess, non_file_type, parsed, read_text, syntax_error
from warpdem.scene.walls import SHAPES
from warpdem.usd import scene as usd_scene
from warpdem.usd.stage import USD_SUFFIXES


def load_scene(
    path: str | Path,
    overrides: Sequence[str] = (),
    *,
    allow_paths: Sequence[str | Path] = (),
    plugins: Sequence[str | Path] = (),
    at: float | None = None,
) -> Scene:
    """Return the scene of a TOML file or of a USD stage.

    Args:
        path: The file; relative paths in it start from its folder.
        overrides: Changes such as "time.end=0.5", "engine.skin='0.1 mm'", "walls.0.scale=0.001": a dotted key with
            list indices, and a value in TOML; any other text is taken as a string.
        allow_paths: Folders that the scene may read files from, in addition to its own folder and its subfolders.
        plugins: .py files with your own models that the scene may load; no other code is run.
        at: For the result stage of a run, time of the frame to start from [s]; the last frame by default.

    Raises:
        SceneError: The file is missing, no TOML or no USD, or the scene is wrong; one message lists all problems.
    """
    file = expanded(path)
    access = access_of_file(file.parent, allow_paths, plugins)
    origins: dict[KeyPath, str] = {}
    time, notes = 0.0, list[str]()
    if file.suffix.lower() in USD_SUFFIXES:
        if not file.is_file():
            raise SceneError(f"{file}: no such file{similar_files(file)}")
        data, origins, time, notes = usd_scene.read(file, at, access.folders, ("mesh", *SHAPES))
    else:
        if at is not None:
            raise SceneError(f"{path}: at = {at:g} s: only the result stage of a run (result.usda) has frames to start from")
        data = read_tables(file)
    for override in overrides:
        apply_override(data, override, str(path))
    scene = scene_from_dict(data, file.parent, str(path), access, origins)
    scene = scene.model_copy(update={"notes": tuple(notes)}) if notes else scene
    return scene.later(time) if time > 0.0 else scene


def scene_from_dict(
    data: Mapping[str, Any],
    base: str | Path = ".",
    source: str = "<scene>",
    access: Access | None = None,
    origins: Mapping[KeyPath, str] = {},
) -> Scene:
    """Return the scene of nested tables, as read from TOML.

    Args:
        data: The tables.
        base: Folder that relative paths start from.
        source: Name of the file, for messages.
        access: Files that the scene may read and load as code; None for any, for your own tables.
        origins: Prim or attribute of the file that each key path comes from, for messages.

    Raises:
        SceneError: The scene is wrong, or a file that it names is missing.
    """
    if found := find_excess(data):
        raise SceneError(report(source, [line(*found)]))
    for key in PYTHON_ONLY:
        if key in data:
            raise SceneError(report(source, [line((key,), data[key], unknown_key((key,), Scene))]))
    try:
        scene = Scene(**{**data, "base": Path(base), "access": access or Access(), "source": source})
    except ValidationError as error:
        problems = scene_error(error, source, Scene, origins)
        raise SceneError(f"{problems}{all_refused(data, Path(base), access or Access())}") from None
    missing = list(missing_files(scene))
    if missing:
        raise SceneError(report(source, missing))
    return scene


def read_tables(file: Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        SceneError: It cannot be read, or is no TOML.
    """
    try:
        entry = non_file_type(file)
        if entry == "a folder":
            raise SceneError(f"{file}: is a folder, not a scene file{similar_files(file / 'scene.toml')}")
        if entry is not None:
            raise SceneError(f"{file}: is {entry}, not a scene file; give the path of a file on disk")
        text = read_text(file)
    except FileNotFoundError:
        raise SceneError(f"{file}: no such file{similar_files(file)}") from None
    except OSError as error:
        raise SceneError(f"{shorten(str(file), 200, quote=False)}: cannot be read ({error.strerror})") from None
    try:
        return parsed(text)
    except InvalidToml as error:
        raise SceneError(syntax_error(str(file), text, str(error))) from None
