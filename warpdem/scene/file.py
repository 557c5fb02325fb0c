"""Scene files: TOML to ``Scene``, every mistake answered by key, value and what is allowed; the JSON schema."""

import copy
import difflib
import json
import re
import tomllib
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from warpdem.errors import SceneError
from warpdem.paths import Access, access_of_file
from warpdem.scene.model import Scene
from warpdem.scene.models import nearest
from warpdem.scene.start import NOT_IN_A_PHASE, Phase, place_in_phase
from warpdem.usd import scene as usd_scene
from warpdem.usd.stage import USD_SUFFIXES

MAX_PROBLEMS = 7
"""Problems listed in one message [-]: two lines each, so that it stays on one screen."""

Place = tuple[str | int, ...]
# keys of Scene that only Python may set: they say where the scene came from and what it may reach
_PYTHON_ONLY = ("base", "access", "source")


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
    file = Path(path).expanduser()
    access, origins, time = access_of_file(file.parent, allow_paths, plugins), {}, 0.0
    if file.suffix.lower() in USD_SUFFIXES:
        if not file.is_file():
            raise SceneError(f"{file}: no such file{_similar_files(file)}")
        data, origins, time = usd_scene.read(file, at, access.folders)
    else:
        if at is not None:
            raise SceneError(f"{path}: at = {at:g} s: only the result stage of a run (result.usda) has frames to start from")
        data = _read_toml(file)
    for override in overrides:
        _apply_override(data, override, str(path))
    scene = scene_from_dict(data, file.parent, str(path), access, origins)
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
    for key in _PYTHON_ONLY:
        if key in data:
            raise SceneError(_report(source, [_line((key,), data[key], _unknown_key((key,)))]))
    try:
        scene = Scene.model_validate({**data, "base": Path(base), "access": access or Access(), "source": source})
    except ValidationError as error:
        problems = [_translate(detail) + _origin(detail["loc"], origins) for detail in error.errors(include_url=False)]
        raise SceneError(_report(source, list(dict.fromkeys(problems)))) from None
    missing = list(_missing_files(scene))
    if missing:
        raise SceneError(_report(source, missing))
    return scene


def _origin(loc: Place, origins: Mapping[Place, str]) -> str:
    """A line with the prim or attribute that a place, or the nearest table around it, comes from; empty if none is known."""
    place = tuple(part for part in loc if not str(part).startswith("~"))
    found = next((origins[place[:n]] for n in range(len(place), -1, -1) if place[:n] in origins), "")
    return f"\n      at {found}" if found else ""


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
        text = file.read_bytes().decode()
    except FileNotFoundError:
        raise SceneError(f"{file}: no such file{_similar_files(file)}") from None
    except IsADirectoryError:
        raise SceneError(f"{file}: is a folder, not a scene file{_similar_files(file / 'scene.toml')}") from None
    except OSError as error:
        raise SceneError(f"{file}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{file}: no text in UTF-8 (byte {error.start}); a scene is a TOML file") from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(_syntax_error(str(file), text, str(error))) from None


def _syntax_error(source: str, text: str, reason: str) -> str:
    place = re.search(r"^(.*) \(at line (\d+), column (\d+)\)$", reason, re.DOTALL)
    if place is None:
        return f"{source}: not valid TOML: {reason}"
    number = int(place[2])
    line = text.split("\n")[number - 1].strip()
    return f"{source}, line {number}, column {place[3]}: not valid TOML: {place[1]}\n  {_shorten(line, quote=False)}"


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
        return SceneError(f"{source}: override {_shorten(override)}: {reason}")

    key, equals, text = override.partition("=")
    # walls[0].scale, as messages write it, means walls.0.scale
    parts = [part.strip() for part in re.sub(r"\[(\d+)\]", r".\1", key).split(".")]
    if not equals or not all(parts):
        raise wrong('must be KEY=VALUE, such as "time.end=0.5"')
    here: Any = data
    for depth, part in enumerate(parts):
        place = place_text(tuple(parts[:depth])) or "the scene"
        if isinstance(here, list):
            if not part.isdecimal() or int(part) >= len(here):
                raise wrong(f"{place} is a list of {len(here)}; an index from 0 to {len(here) - 1} must follow")
            part = int(part)
        elif not isinstance(here, dict):
            raise wrong(f"{place} = {_shorten(here)} has no keys")
        if depth == len(parts) - 1:
            here[part] = _parse_value(text.strip(), wrong)
        else:
            here = here[part] if isinstance(here, list) else here.setdefault(part, {})


def _parse_value(text: str, wrong: typing.Callable[[str], SceneError]) -> Any:
    try:
        table = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError as error:
        # the shell takes quotes away, so that 0.1 mm and hertz arrive bare
        if not text or text[0] in "[{\"'":
            raise wrong(f"the value is not valid TOML: {error}") from None
        return text
    return copy.deepcopy(table["value"]) if len(table) == 1 else text


def _missing_files(scene: Scene) -> Iterator[str]:
    """Problems with the files that the scene and its phases name."""
    for place, name in _named_files(scene):
        if refusal := scene.access.refusal(name, scene.base):
            yield _line(place, name, refusal)
            continue
        file = scene.resolve(name)
        if file.is_dir():
            yield _line(place, name, f"{file} is a folder, not a file")
        elif not file.exists():
            yield _line(place, name, f"no such file: {file}{_similar_files(file)}")


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


# --- messages --------------------------------------------------------------------------------------------------------


def _report(source: str, problems: list[str]) -> str:
    head = f"{source}: " + ("one problem" if len(problems) == 1 else f"{len(problems)} problems")
    shown = problems[:MAX_PROBLEMS]
    if len(problems) > MAX_PROBLEMS:
        shown.append(f"  ... and {len(problems) - MAX_PROBLEMS} more")
    return "\n".join([head, *shown])


def _line(place: Place, value: Any, text: str) -> str:
    """Two lines for one problem: key and value, then what is wrong."""
    key = place_text(place) or "the scene"
    # a table or None says nothing: the keys in question are in the text
    shown = "" if value is None or isinstance(value, (dict, BaseModel)) else f" = {_shorten(value)}"
    return f"  {key}{shown}\n      {text}"


def _translate(detail: Mapping[str, Any]) -> str:
    """Two lines for one error of pydantic, in the words of a scene file."""
    # parts that start with ~ are tags of scene.py that choose between a number and a table
    place = tuple(part for part in detail["loc"] if not str(part).startswith("~"))
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "extra_forbidden":
        return _line(place, value, _unknown_key(place))
    if kind == "missing":
        return _line(place, None, f"missing: {_description(place)}")
    if kind == "value_error":
        text = str(context["error"])
    elif kind == "scene":
        text = context["reason"]
    elif kind == "literal_error":
        text = (
            "must be "
            + context["expected"].replace("'", '"')
            + nearest(value, re.findall("'(.*?)'", context["expected"]))
        )
    elif kind in _WORDS:
        text = _WORDS[kind].format(**context)
        if kind in ("list_type", "model_type", "model_attributes_type", "dict_type"):
            text += _toml_form(place, kind)
    else:
        text = detail["msg"].replace("Input should", "must")
    return _line(place, value, text)


_WORDS = {
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
    "string_type": "must be a string",
    "list_type": "must be a list",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "greater_than_equal": "must be >= {ge}",
    "too_short": "needs {min_length} or more entries, has {actual_length}",
    "too_long": "takes {max_length} entries at most, has {actual_length}",
    "string_pattern_mismatch": "must be made of letters, digits, _ and - only",
}
"""What pydantic's error types mean here; those not listed speak for themselves."""


def _toml_form(place: Place, kind: str) -> str:
    """How such a value is written in TOML, for parts of the scene that are tables."""
    key = ".".join(str(part) for part in place if isinstance(part, str))
    if kind != "list_type":
        return f", such as [{key}]" if not any(isinstance(part, int) for part in place) else ""
    return f" of tables: write [[{key}]]" if _models_at((*place, 0)) else ""


def place_text(place: Place) -> str:
    """Dotted key, such as walls[0].scale."""
    text = ""
    for part in place:
        if isinstance(part, int) or part.isdecimal():
            text += f"[{part}]"
        else:
            name = part if re.fullmatch(r"[\w-]+", part) else json.dumps(part, ensure_ascii=False)
            text += f".{name}" if text else name
    return text


def _shorten(value: Any, width: int = 60, quote: bool = True) -> str:
    """Value as in TOML on one line, cut to a width."""
    if isinstance(value, np.ndarray):
        return f"array of shape {value.shape}"
    if isinstance(value, (list, tuple)) and len(value) > 8:
        return f"{_shorten(list(value[:3]), width)[:-1]}, ... {len(value)} entries]"
    text = json.dumps(value, ensure_ascii=False, default=str) if quote else value
    return text if len(text) <= width else f"{text[: width - 3]}..."


def _unknown_key(place: Place) -> str:
    """Nearest known key beside an unknown one, and where in the scene the key does exist."""
    *parent, key = place
    models = _models_at(parent)
    siblings = [name for model in models for name in model.model_fields if model is not Scene or name not in _PYTHON_ONLY]
    elsewhere = [place for place in _all_keys(Scene) if place.rsplit(".", 1)[-1] == key and key not in _PYTHON_ONLY]
    if key in siblings:  # of two kinds of table that may stand here
        return f"belongs to another kind of table than the other keys of {place_text(tuple(parent))}"
    # a key that is right in another place needs a close likeness before it counts as misspelt
    near = nearest(key, siblings, 0.8 if elsewhere else 0.6)
    if elsewhere:
        return f"unknown key here; it exists as {', '.join(elsewhere[:4])}{near}"
    return f"unknown key{near or '; known here: ' + ', '.join(siblings)}"


# --- what the models say ---------------------------------------------------------------------------------------------


def _parts(annotation: Any) -> Iterator[tuple[type[BaseModel], str]]:
    """The models inside an annotation such as list[Wall] | None, and how the place of each goes on: "[]", ".NAME", ""."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, ""
        return
    here = {list: "[]", dict: ".NAME"}.get(typing.get_origin(annotation), "")
    for inner in typing.get_args(annotation):
        for model, suffix in _parts(inner):
            yield model, here + suffix


def _models_at(place: Sequence[str | int]) -> list[type[BaseModel]]:
    """The models that the table at a place may follow, none if there is no table of known keys."""
    if place[:1] in (("phases",), ["phases"]) and place[2:3] and place[2] not in Phase.model_fields:
        place = place[2:]  # a phase holds keys of the scene
    here: list[tuple[type[BaseModel], str]] = [(Scene, "")]
    for part in place:
        following = [(model, "") for model, suffix in here if suffix == ("[]" if isinstance(part, int) else ".NAME")]
        for model, suffix in here:
            if not suffix and part in model.model_fields:
                following += _parts(model.model_fields[part].annotation)
        here = following
    return [model for model, suffix in here if not suffix]


def _all_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """All dotted keys of the scene file, such as walls[].scale; what may stand alone or in a list is named alone."""
    for name, field in model.model_fields.items():
        yield f"{prefix}{name}"
        suffixes: dict[type[BaseModel], str] = {}
        for part, suffix in _parts(field.annotation):
            suffixes[part] = min(suffix, suffixes.get(part, suffix))
        for part, suffix in suffixes.items():
            yield from _all_keys(part, f"{prefix}{name}{suffix}.")


def _description(place: Place) -> str:
    """Return what the model says of a key."""
    *parent, key = place
    return next(model.model_fields[key].description for model in _models_at(parent) if key in model.model_fields)
