"""Overrides of single keys of a scene, as ``--set`` gives them: "walls.0.scale=0.001"."""

import copy
import re
import typing
from typing import Any

from warpdem.core.key_path import key_text
from warpdem.errors import SceneError
from warpdem.scene.messages import shorten
from warpdem.scene.read_toml import MOST_LEVELS, InvalidToml, parsed


def apply_override(data: dict[str, Any], override: str, source: str) -> None:
    """Set one key of the tables; missing tables along the key path are created."""

    def wrong(reason: str) -> SceneError:
        return SceneError(f"{source}: override {shorten(override)}: {reason}")

    key, equals, text = override.partition("=")
    # walls[0].scale, as messages write it, means walls.0.scale
    parts = [part.strip() for part in re.sub(r"\[(\d+)\]", r".\1", key).split(".")]
    if not equals or not all(parts):
        raise wrong('must be KEY=VALUE, such as "time.end=0.5"')
    if len(parts) > MOST_LEVELS:
        raise wrong(f"nested too deeply: at most {MOST_LEVELS} tables and lists may be nested")
    parent: Any = data
    for depth, part in enumerate(parts):
        parent_key = key_text(tuple(parts[:depth])) or "the scene"
        if isinstance(parent, list):
            if not part.isdecimal() or len(part) > 18 or int(part) >= len(parent):
                raise wrong(f"{parent_key} is a list of {len(parent)}; an index from 0 to {len(parent) - 1} must follow")
        elif not isinstance(parent, dict):
            raise wrong(f"{parent_key} = {shorten(parent)} has no keys")
        index: Any = int(part) if isinstance(parent, list) else part
        if depth == len(parts) - 1:
            parent[index] = _parse_value(text.strip(), wrong)
        else:
            parent = parent[index] if isinstance(parent, list) else parent.setdefault(index, {})


def _parse_value(text: str, wrong: typing.Callable[[str], SceneError]) -> Any:
    try:
        table = parsed(f"value = {text}")
    except InvalidToml as error:
        # the shell removes quotes, so that 0.1 mm and hertz arrive without them
        if not text or text[0] in "[{\"'":
            raise wrong(f"the value is not valid TOML: {error}") from None
        return text
    return copy.deepcopy(table["value"]) if len(table) == 1 else text
