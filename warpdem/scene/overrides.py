"""Overrides of single keys of a scene, as ``--set`` gives them: "walls.0.scale=0.001"."""

import copy
import re
import typing
from typing import Any

from warpdem.core.key_path import key_text
from warpdem.errors import SceneError
from warpdem.scene.messages import shorten
from warpdem.scene.read_toml import MOST_LEVELS, NotToml, parsed


def apply_override(data: dict[str, Any], override: str, source: str) -> None:
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
        key_path = key_text(tuple(parts[:depth])) or "the scene"
        if isinstance(here, list):
            if not part.isdecimal() or len(part) > 18 or int(part) >= len(here):
                raise wrong(f"{key_path} is a list of {len(here)}; an index from 0 to {len(here) - 1} must follow")
            part = int(part)
        elif not isinstance(here, dict):
            raise wrong(f"{key_path} = {shorten(here)} has no keys")
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
