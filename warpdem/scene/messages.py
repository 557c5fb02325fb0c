"""What is wrong with a scene, in words: file, key, value and what is allowed, from the errors of the scene's models."""

import decimal
import json
import re
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from warpdem.errors import SceneError
from warpdem.scene.models import nearest
from warpdem.scene.start import Phase

MAX_PROBLEMS = 7
"""Problems listed in one message [-]: two lines each, so that it stays on one screen."""
PYTHON_ONLY = ("base", "access", "source", "notes")
"""Keys of the scene that only Python may set: they say where it came from and what it may reach."""

Place = tuple[str | int, ...]


def scene_error(
    error: ValidationError, source: str, root: type[BaseModel], origins: Mapping[Place, str] = {}
) -> SceneError:
    """The error of a user for one of pydantic; one message lists all problems.

    Args:
        error: what the validation of the scene raised.
        source: name of the file.
        root: model of the whole scene, which knows its keys.
        origins: where in the file each place of the tables comes from.
    """
    details = error.errors(include_url=False)
    problems = [_translate(detail, root) + _origin(detail["loc"], origins) for detail in details]
    return SceneError(report(source, list(dict.fromkeys(problems))))


def _origin(loc: Place, origins: Mapping[Place, str]) -> str:
    """A line with the prim or attribute that a place, or the nearest table around it, comes from; empty if none is known."""
    place = tuple(part for part in loc if not str(part).startswith("~"))
    found = next((origins[place[:n]] for n in range(len(place), -1, -1) if place[:n] in origins), "")
    return f"\n      at {found}" if found else ""


def report(source: str, problems: list[str]) -> str:
    """The message for problems of a file, the first ``MAX_PROBLEMS`` of them in full."""
    head = f"{source}: " + ("one problem" if len(problems) == 1 else f"{len(problems)} problems")
    shown = problems[:MAX_PROBLEMS]
    if len(problems) > MAX_PROBLEMS:
        shown.append(f"  ... and {len(problems) - MAX_PROBLEMS} more")
    return "\n".join([head, *shown])


def line(place: Place, value: Any, text: str) -> str:
    """Two lines for one problem: key and value, then what is wrong."""
    key = place_text(place) or "the scene"
    # a table or None says nothing: the keys in question are in the text
    shown = "" if value is None or isinstance(value, (dict, BaseModel)) else f" = {shorten(value)}"
    return f"  {key}{shown}\n      {text}"


def _translate(detail: Mapping[str, Any], root: type[BaseModel]) -> str:
    """Two lines for one error of pydantic, in the words of a scene file."""
    # parts that start with ~ are tags of scene.py that choose between a number and a table
    place = tuple(part for part in detail["loc"] if not str(part).startswith("~"))
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "extra_forbidden":
        return line(place, value, unknown_key(place, root))
    if kind == "missing":
        return line(place, None, f"missing: {_description(place, root)}")
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
            text += _toml_form(place, kind, root)
    else:
        text = detail["msg"].replace("Input should", "must")
    return line(place, value, text)


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


def _toml_form(place: Place, kind: str, root: type[BaseModel]) -> str:
    """How such a value is written in TOML, for parts of the scene that are tables."""
    key = ".".join(str(part) for part in place if isinstance(part, str))
    if kind != "list_type":
        return f", such as [{key}]" if key and not any(isinstance(part, int) for part in place) else ""
    return f" of tables: write [[{key}]]" if _models_at((*place, 0), root) else ""


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


def shorten(value: Any, width: int = 60, quote: bool = True) -> str:
    """Value as in TOML on one line, cut to a width."""
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
    """A number with two digits that is not above ``value``: what a message tells to take is accepted."""
    return _rounded(value, decimal.ROUND_DOWN)


def rounded_up(value: float) -> str:
    """A number with two digits that is not below ``value``, > 0."""
    return _rounded(value, decimal.ROUND_UP)


def _rounded(value: float, rounding: str) -> str:
    return f"{float(decimal.Context(prec=2, rounding=rounding).create_decimal(value)):g}"


def visible(text: str) -> str:
    """A text without characters that a terminal would obey or not show, these in the notation of Python."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def unknown_key(place: Place, root: type[BaseModel], also: Sequence[str] = ()) -> str:
    """Nearest known key beside an unknown one (``also`` are known there), and where in the scene the key does exist."""
    *parent, key = place
    models = _models_at(parent, root)
    siblings = [name for model in models for name in model.model_fields if model is not root or name not in PYTHON_ONLY]
    siblings += also
    elsewhere = [place for place in _all_keys(root) if place.rsplit(".", 1)[-1] == key and key not in PYTHON_ONLY]
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


def _models_at(place: Sequence[str | int], root: type[BaseModel]) -> list[type[BaseModel]]:
    """The models that the table at a place may follow, none if there is no table of known keys."""
    if place[:1] in (("phases",), ["phases"]) and place[2:3] and place[2] not in Phase.model_fields:
        place = place[2:]  # a phase holds keys of the scene
    here: list[tuple[type[BaseModel], str]] = [(root, "")]
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


def _description(place: Place, root: type[BaseModel]) -> str:
    """Return what the model says of a key."""
    *parent, key = place
    return next(model.model_fields[key].description for model in _models_at(parent, root) if key in model.model_fields)
