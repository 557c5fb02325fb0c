"""Error messages of a scene: file, key, value and what is allowed, made from the errors of the scene's pydantic models."""

import decimal
import json
import re
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from warpdem.core.key_path import KeyPath, key_text
from warpdem.core.nearest import nearest
from warpdem.errors import SceneError
from warpdem.scene.phases import Phase

MAX_PROBLEMS = 7
"""Problems listed in one message [-]: two lines each, so that it stays on one screen."""
PYTHON_ONLY = ("base", "access", "source", "notes")
"""Keys of the scene that only Python may set: its origin and its access to files."""


def scene_error(
    error: ValidationError, source: str, root: type[BaseModel], origins: Mapping[KeyPath, str] = {}
) -> SceneError:
    """Error for the user from an error of pydantic; one message lists all problems.

    Args:
        error: Error that the validation of the scene raised.
        source: Name of the file.
        root: Model of the whole scene, which knows its keys.
        origins: Prim or attribute of the file that a key path comes from.
    """
    details = error.errors(include_url=False)
    problems = [_translate(detail, root) + _origin(detail["loc"], origins) for detail in details]
    return SceneError(report(source, list(dict.fromkeys(problems))))


def _origin(loc: KeyPath, origins: Mapping[KeyPath, str]) -> str:
    """A line with the prim or attribute that a key, or the nearest table around it, comes from; empty if none is known."""
    key_path = tuple(part for part in loc if not str(part).startswith("~"))
    found = next((origins[key_path[:n]] for n in range(len(key_path), -1, -1) if key_path[:n] in origins), "")
    return f"\n      at {found}" if found else ""


def report(source: str, problems: list[str]) -> str:
    """Message for the problems of a file, the first ``MAX_PROBLEMS`` of them in full."""
    head = f"{source}: " + ("one problem" if len(problems) == 1 else f"{len(problems)} problems")
    shown = problems[:MAX_PROBLEMS]
    if len(problems) > MAX_PROBLEMS:
        shown.append(f"  ... and {len(problems) - MAX_PROBLEMS} more")
    return "\n".join([head, *shown])


def line(key_path: KeyPath, value: Any, text: str) -> str:
    """Two lines for one problem: key and value, then the reason."""
    key = key_text(key_path) or "the scene"
    # a table or None is not shown: the text names the keys
    shown = "" if value is None or isinstance(value, (dict, BaseModel)) else f" = {shorten(value)}"
    return f"  {key}{shown}\n      {text}"


def _translate(detail: Mapping[str, Any], root: type[BaseModel]) -> str:
    """Two lines for one error of pydantic, in the terms of a scene file."""
    # parts that start with ~ are tags that choose between a number and a table
    key_path = tuple(part for part in detail["loc"] if not str(part).startswith("~"))
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "extra_forbidden":
        return line(key_path, value, unknown_key(key_path, root))
    if kind == "missing" and isinstance(key_path[-1], int):  # a row that is too short
        named = max(k for k, part in enumerate(key_path) if isinstance(part, str))
        return line(key_path[:-1], value, f"an entry is missing: {_description(key_path[: named + 1], root)}")
    if kind == "missing":
        return line(key_path, None, f"missing: {_description(key_path, root)}")
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
    elif kind == "string_pattern_mismatch":
        text = "must be made of letters, digits, _ and - only"
        if "/" in context["pattern"]:
            text = 'must be the path of a prim, such as "/World/Drum"'
    elif kind in _WORDS:
        text = _WORDS[kind].format(**context)
        if kind in ("list_type", "model_type", "model_attributes_type", "dict_type"):
            text += _toml_form(key_path, kind, root)
    else:
        text = detail["msg"].replace("Input should", "must")
    return line(key_path, value, text)


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
}
"""Texts for pydantic's error types; those not listed keep pydantic's own text."""


def _toml_form(key_path: KeyPath, kind: str, root: type[BaseModel]) -> str:
    """How such a value is written in TOML, for parts of the scene that are tables."""
    key = ".".join(str(part) for part in key_path if isinstance(part, str))
    if kind != "list_type":
        return f", such as [{key}]" if key and not any(isinstance(part, int) for part in key_path) else ""
    return f" of tables: write [[{key}]]" if _models_at((*key_path, 0), root) else ""


def shorten(value: Any, width: int = 60, quote: bool = True) -> str:
    """Value as in TOML on one line, cut to ``width`` characters."""
    if isinstance(value, np.ndarray):
        return f"array of shape {value.shape}"
    if isinstance(value, (list, tuple)) and len(value) > 8:
        return f"{shorten(list(value[:3]), width)[:-1]}, ... {len(value)} entries]"
    try:
        text = json.dumps(value, ensure_ascii=False, default=str) if quote else value
    except (ValueError, RecursionError):  # a whole number of thousands of digits, tables in tables in tables
        text = f"a {type(value).__name__}"
    text = visible(text[: 4 * width])
    return text if len(text) <= width else f"{text[: width - 3]}..."


def rounded_down(value: float) -> str:
    """A number with two digits that is not above ``value``: a limit that a message recommends is then accepted."""
    return _rounded(value, decimal.ROUND_DOWN)


def rounded_up(value: float) -> str:
    """A number with two digits that is not below ``value``, > 0."""
    return _rounded(value, decimal.ROUND_UP)


def _rounded(value: float, rounding: str) -> str:
    return f"{float(decimal.Context(prec=2, rounding=rounding).create_decimal(value)):g}"


def visible(text: str) -> str:
    """Text with control and invisible characters replaced by their escape sequences in Python's notation."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def unknown_key(key_path: KeyPath, root: type[BaseModel], also: Sequence[str] = ()) -> str:
    """Message for an unknown key (``also`` are known): the most similar known key, and where the key exists."""
    *parent, key = key_path
    models = _models_at(parent, root)
    siblings = [name for model in models for name in model.model_fields if model is not root or name not in PYTHON_ONLY]
    siblings += also
    elsewhere = [other for other in _all_keys(root) if other.rsplit(".", 1)[-1] == key and key not in PYTHON_ONLY]
    if key in siblings:  # two kinds of table are allowed here
        return f"belongs to another kind of table than the other keys of {key_text(tuple(parent))}"
    # a key that is right elsewhere counts as misspelt only if it is very similar to a key allowed here
    near = nearest(key, siblings, 0.8 if elsewhere else 0.6)
    if elsewhere:
        return f"unknown key here; it exists as {', '.join(elsewhere[:4])}{near}"
    return f"unknown key{near or '; known here: ' + ', '.join(siblings)}"


# --- the scene's models ----------------------------------------------------------------------------------------------


def models_in(annotation: Any) -> Iterator[tuple[type[BaseModel], str]]:
    """The models inside an annotation such as list[Wall] | None, and the suffix of the key path of each: "[]", ".NAME", ""."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, ""
        return
    here = {list: "[]", dict: ".NAME"}.get(typing.get_origin(annotation), "")
    for inner in typing.get_args(annotation):
        for model, suffix in models_in(inner):
            yield model, here + suffix


def _models_at(key_path: Sequence[str | int], root: type[BaseModel]) -> list[type[BaseModel]]:
    """The models that the table at a key path may follow, none if there is no table of known keys."""
    if key_path[:1] in (("phases",), ["phases"]) and key_path[2:3] and key_path[2] not in Phase.model_fields:
        key_path = key_path[2:]  # a phase holds keys of the scene
    here: list[tuple[type[BaseModel], str]] = [(root, "")]
    for part in key_path:
        following = [(model, "") for model, suffix in here if suffix == ("[]" if isinstance(part, int) else ".NAME")]
        for model, suffix in here:
            if not suffix and part in model.model_fields:
                following += models_in(model.model_fields[part].annotation)
        here = following
    return [model for model, suffix in here if not suffix]


def _all_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """All dotted keys of the scene file, such as walls[].scale; a part allowed alone or in a list is named alone."""
    for name, field in model.model_fields.items():
        yield f"{prefix}{name}"
        suffixes: dict[type[BaseModel], str] = {}
        for part, suffix in models_in(field.annotation):
            suffixes[part] = min(suffix, suffixes.get(part, suffix))
        for part, suffix in suffixes.items():
            yield from _all_keys(part, f"{prefix}{name}{suffix}.")


def _description(key_path: KeyPath, root: type[BaseModel]) -> str:
    """Description of a key in its model."""
    *parent, key = key_path
    return next(str(model.model_fields[key].description) for model in _models_at(parent, root) if key in model.model_fields)
