"""Text of scene files and TOML in it: whatever a file holds, it becomes tables of bounded depth or an error in words."""

import re
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warpdem.core import memory
from warpdem.errors import SceneError
from warpdem.scene.messages import shorten

BYTES_PER_BYTE = 20
"""Memory that parsing takes per byte of a TOML file [-]: lists of short numbers take most."""
MOST_LEVELS = 32
"""Tables and lists within each other: the deepest key of a scene has a dozen levels above it."""
INTEGERS = -(2**63), 2**63 - 1
"""Whole numbers that TOML knows."""
_LONG_INTEGER = re.compile(r"\d[\d_]{400,}")
_MARKS = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16", b"\0\0\xfe\xff": "UTF-32"}
"""How files in other encodings begin."""


class NotToml(ValueError):
    """A text is not valid TOML, or nested or long beyond what a scene may be; the text says why."""


def kind_of(file: Path) -> str | None:
    """What stands in the place of a file that cannot be read to its end: "a folder", "a pipe", ...; None for a file.

    Raises:
        OSError: There is nothing, or it cannot be looked at.
    """
    mode = file.stat().st_mode
    kinds = {stat.S_ISDIR: "a folder", stat.S_ISFIFO: "a pipe", stat.S_ISSOCK: "a socket"}
    kinds |= {stat.S_ISCHR: "a device", stat.S_ISBLK: "a device"}
    return next((name for test, name in kinds.items() if test(mode)), None)


def read_text(file: Path) -> str:
    """Text of a file in UTF-8, without its byte order mark.

    Raises:
        SceneError: It is in another encoding or no text, or needs more memory than there is.
        OSError: It cannot be read.
    """
    size = file.stat().st_size
    memory.require(BYTES_PER_BYTE * size, str(file), f"a scene file of {size} bytes", "keep grains in a state file (.npz)")
    data = file.read_bytes()
    if name := next((name for mark, name in _MARKS.items() if data.startswith(mark)), None):
        raise SceneError(f"{file}: is text in {name}; a scene file is in UTF-8: save it as that")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{file}: no text in UTF-8 (byte {error.start}); a scene is a TOML file") from None
    if (place := data.find(b"\0")) >= 0:
        raise SceneError(f"{file}: holds a zero byte (byte {place}): no text, or one in UTF-16; a scene file is in UTF-8")
    return text


def parsed(text: str) -> dict[str, Any]:
    """Tables of a TOML text.

    Raises:
        NotToml: It is not valid, with the place; nested too deeply; or holds a number too long to be one.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NotToml(str(error)) from None
    except RecursionError:
        raise NotToml(f"nested too deeply: tables and lists may lie at most {MOST_LEVELS} levels within each other") from None
    except ValueError as error:  # Python refuses to read integers of thousands of digits
        found = _LONG_INTEGER.search(text)
        if found is None:
            raise NotToml(str(error)) from None
        start = text.rfind("\n", 0, found.start()) + 1
        place = f"(at line {text.count(chr(10), 0, start) + 1}, column {found.start() - start + 1})"
        raise NotToml(f"a whole number of {len(found[0])} digits; allowed are those from -2^63 to 2^63 - 1 {place}") from None


def too_much(data: Mapping[str, Any]) -> tuple[tuple[str | int, ...], Any, str] | None:
    """What in the tables of a scene is nested too deeply or too large a whole number: place, value and words; None if nothing.

    Without recursion, for the tables may come from anywhere.
    """
    todo: list[tuple[tuple[str | int, ...], Any]] = [((), data)]
    while todo:
        place, here = todo.pop()
        if len(place) > MOST_LEVELS:
            return place[:4], None, f"nested too deeply: at most {MOST_LEVELS} tables and lists may lie within each other"
        for key, value in here.items() if isinstance(here, Mapping) else enumerate(here):
            if isinstance(value, (Mapping, list, tuple)):
                todo.append(((*place, key if isinstance(key, int) else str(key)), value))
            elif type(value) is int and not INTEGERS[0] <= value <= INTEGERS[1]:
                digits = f"{value.bit_length() * 0.30103:.0f}"
                reason = f"a whole number of about {digits} digits; allowed are those from -2^63 to 2^63 - 1, as in TOML"
                return (*place, key if isinstance(key, int) else str(key)), None, reason
    return None


def syntax_error(source: str, text: str, reason: str) -> str:
    """Words on a mistake in TOML, with its line where the reason names one."""
    place = re.search(r"^(.*) \(at line (\d+), column (\d+)\)$", reason, re.DOTALL)
    if place is None:
        return f"{source}: not valid TOML: {reason}"
    number = int(place[2])
    wrong = text.replace("\r\n", "\n").split("\n")[number - 1].strip()
    return f"{source}, line {number}, column {place[3]}: not valid TOML: {place[1]}\n  {shorten(wrong, quote=False)}"
