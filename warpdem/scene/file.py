"""Scene files: TOML to ``Scene``, every mistake answered in the words of ``warpdem.scene.messages``; the JSON schema."""

import copy
import difflib
import re
import shlex
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warpdem.core import memory
from warpdem.core.access import Access, access_of_file
from warpdem.core.file_names import expanded
from warpdem.errors import SceneError
from warpdem.scene.messages import PYTHON_ONLY, Place, line, place_text, report, scene_error, shorten, unknown_key
from warpdem.scene.model import Scene
from warpdem.scene.models import is_file, located
from warpdem.scene.read_toml import MOST_LEVELS, NotToml, kind_of, parsed, read_text, syntax_error, too_much
from warpdem.scene.start import NOT_IN_A_PHASE, place_in_phase
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
        path: the file; relative paths in it start from its folder.
        overrides: changes such as "time.end=0.5", "engine.skin='0.1 mm'", "walls.0.scale=0.001": a dotted key with
            list indices, and a value in TOML; what is not TOML is taken as a string.
        allow_paths: folders that the scene may read files from, beside its own folder and what lies below it.
        plugins: .py files with models of your own that the scene may load; code runs from no other.
        at: with the result stage of a run, instant of the frame to start from [s]; the last frame by default.

    Raises:
        SceneError: the file is missing, no TOML or no USD, or the scene is wrong; one message lists all problems.
    """
    file = expanded(path)
    access, origins, time, notes = access_of_file(file.parent, allow_paths, plugins), {}, 0.0, ()
    if file.suffix.lower() in USD_SUFFIXES:
        if not file.is_file():
            raise SceneError(f"{file}: no such file{_similar_files(file)}")
        data, origins, time, notes = usd_scene.read(file, at, access.folders)
    else:
        if at is not None:
            raise SceneError(f"{path}: at = {at:g} s: only the result stage of a run (result.usda) has frames to start from")
        data = _read_toml(file)
    for override in overrides:
        _apply_override(data, override, str(path))
    scene = scene_from_dict(data, file.parent, str(path), access, origins)
    scene = scene.model_copy(update={"notes": tuple(notes)}) if notes else scene
    return scene.later(time) if time > 0.0 else scene


def scene_from_dict(
    data: Mapping[str, Any],
    base: str | Path = ".",
    source: str = "<scene>",
    access: Access | None = None,
    origins: Mapping[Place, str] = {},
) -> Scene:
    """Return the scene of nested tables as TOML gives them.

    Args:
        data: the tables.
        base: folder that relative paths start from.
        source: name of the file, for messages.
        access: files that the scene may read and load as code; None is any, for tables of your own.
        origins: where in the file each place of the tables comes from, for messages.

    Raises:
        SceneError: the scene is wrong, or a file that it names is missing.
    """
    if found := too_much(data):
        raise SceneError(report(source, [line(*found)]))
    for key in PYTHON_ONLY:
        if key in data:
            raise SceneError(report(source, [line((key,), data[key], unknown_key((key,), Scene))]))
    try:
        scene = Scene(**{**data, "base": Path(base), "access": access or Access(), "source": source})
    except ValidationError as error:
        told = scene_error(error, source, Scene, origins)
        raise SceneError(f"{told}{_all_refused(data, Path(base), access or Access())}") from None
    missing = list(_missing_files(scene))
    if missing:
        raise SceneError(report(source, missing))
    return scene


def scene_schema() -> dict[str, Any]:
    """JSON schema of a scene file, for editors; numbers with a unit appear as "number or string"."""
    schema = Scene.model_json_schema()
    parts = {key: {"description": f"Changes of {key}."} for key in Scene.model_fields if key not in NOT_IN_A_PHASE}
    phase = schema["$defs"]["Phase"]
    phase |= {"properties": {**phase["properties"], **parts}, "additionalProperties": False}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


# --- reading ---------------------------------------------------------------------------------------------------------


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        kind = kind_of(file)
        if kind == "a folder":
            raise SceneError(f"{file}: is a folder, not a scene file{_similar_files(file / 'scene.toml')}")
        if kind is not None:
            raise SceneError(f"{file}: is {kind}, not a scene file; give the path of a file on disk")
        text = read_text(file)
    except FileNotFoundError:
        raise SceneError(f"{file}: no such file{_similar_files(file)}") from None
    except OSError as error:
        raise SceneError(f"{shorten(str(file), 200, quote=False)}: cannot be read ({error.strerror})") from None
    try:
        return parsed(text)
    except NotToml as error:
        raise SceneError(syntax_error(str(file), text, str(error))) from None


def _similar_files(file: Path) -> str:
    """Words on files of like name or kind beside a missing one, or on the missing folder; empty if there are none."""
    try:
        names = sorted(entry.name for entry in file.parent.iterdir() if entry.is_file())
    except OSError:
        return f"; there is no folder {file.parent}"
    by_lower = {name.lower(): name for name in names}
    close = [by_lower[name] for name in difflib.get_close_matches(file.name.lower(), by_lower, n=3)]
    same_kind = [name for name in names if Path(name).suffix.lower() == file.suffix.lower() != ""]
    found = close or same_kind[:3]
    return f"; similar files there: {', '.join(found)}" if found else ""


def _apply_override(data: dict[str, Any], override: str, source: str) -> None:
    """Set one key of the tables; missing tables on the way are made."""

    def wrong(reason: str) -> SceneError:
        return SceneError(f"{source}: override {shorten(override)}: {reason}")

    key, equals, text = override.partition("=")
    # walls[0].scale, as messages write it, means walls.0.scale
    parts = [part.strip() for part in re.sub(r"\[(\d+)\]", r".\1", key).split(".")]
    if not equals or not all(parts):
        raise wrong('must be KEY=VALUE, such as "time.end=0.5"')
    if len(parts) > MOST_LEVELS:
        raise wrong(f"nested too deeply: at most {MOST_LEVELS} tables and lists may lie within each other")
    here: Any = data
    for depth, part in enumerate(parts):
        place = place_text(tuple(parts[:depth])) or "the scene"
        if isinstance(here, list):
            if not part.isdecimal() or len(part) > 18 or int(part) >= len(here):
                raise wrong(f"{place} is a list of {len(here)}; an index from 0 to {len(here) - 1} must follow")
            part = int(part)
        elif not isinstance(here, dict):
            raise wrong(f"{place} = {shorten(here)} has no keys")
        if depth == len(parts) - 1:
            here[part] = _parse_value(text.strip(), wrong)
        else:
            here = here[part] if isinstance(here, list) else here.setdefault(part, {})


def _parse_value(text: str, wrong: typing.Callable[[str], SceneError]) -> Any:
    try:
        table = parsed(f"value = {text}")
    except NotToml as error:
        # the shell takes quotes away, so that 0.1 mm and hertz arrive bare
        if not text or text[0] in "[{\"'":
            raise wrong(f"the value is not valid TOML: {error}") from None
        return text
    return copy.deepcopy(table["value"]) if len(table) == 1 else text


def _all_refused(data: Mapping[str, Any], base: Path, access: Access) -> str:
    """A last line that names all files of code which the scene may not load, where there are several."""
    names = dict.fromkeys(name for key in ("contact", "fields", "observers", "phases") for name in _code(data.get(key)))
    files = list(dict.fromkeys(located(name, base) for name in names if access.plugin_refusal(name, base)))
    if len(files) < 2:
        return ""
    return f"\nif you trust all {len(files)} files say --plugin {shlex.join(files)}, or load_scene(..., plugins={files})"


def _code(part: Any) -> Iterator[str]:
    """Names of files of code within a part of the tables."""
    if isinstance(part, str) and is_file(part):
        yield part
    for inner in part.values() if isinstance(part, Mapping) else part if isinstance(part, list) else ():
        yield from _code(inner)


def _missing_files(scene: Scene) -> Iterator[str]:
    """Problems with the files that the scene and its phases name."""
    for place, name in _named_files(scene):
        if refusal := scene.access.refusal(name, scene.base):
            yield line(place, name, refusal)
            continue
        file = scene.resolve(name)
        if not file.exists():
            yield line(place, name, f"no such file: {file}{_similar_files(file)}")
        elif kind := kind_of(file):
            yield line(place, name, f"{file} is {kind}, not a file")
        elif reason := memory.refusal(size := file.stat().st_size, f"a file of {size} bytes", "take a smaller one"):
            yield line(place, name, reason)


def _named_files(scene: Scene) -> Iterator[tuple[Place, str]]:
    """Place and name of each file; of a phase those that are new in it."""
    yield from scene.files()
    known = {name for _, name in scene.files()}
    for k, phase in enumerate(scene.phases):
        one = scene.phase(k)
        for place, name in one.files():
            if place[0] not in ("grains", "start") and name not in known:
                yield ("phases", k, *place_in_phase(place, one.model_dump(mode="json"), phase)), name
                known.add(name)
