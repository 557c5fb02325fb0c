"""Reading of TOML: any file gives tables of bounded depth, or a clear error."""

import re
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from warpdem.core import memory
from warpdem.core.key_path import KeyPath
from warpdem.errors import SceneError
from warpdem.scene.messages import shorten

BYTES_PER_BYTE = 20
"""Memory that parsing needs per byte of a TOML file [-]: lists of short numbers need most."""
MOST_LEVELS = 32
"""Maximum nesting of tables and lists: the deepest key of a scene has a dozen levels above it."""
INTEGERS = -(2**63), 2**63 - 1
"""Range of integers in TOML."""
_LONG_INTEGER = re.compile(r"\d[\d_]{400,}")
_MARKS = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16", b"\0\0\xfe\xff": "UTF-32"}
"""Byte order marks of other encodings."""


class InvalidToml(ValueError):
    """A text is not valid TOML, nested too deeply, or holds too long a number; the message gives the reason."""


def non_file_type(file: Path) -> str | None:
    """Type of a path that is no regular file: "a folder", "a pipe", ...; None for a file.

    Raises:
        OSError: It does not exist, or cannot be accessed.
    """
    mode = file.stat().st_mode
    types = {stat.S_ISDIR: "a folder", stat.S_ISFIFO: "a pipe", stat.S_ISSOCK: "a socket"}
    types |= {stat.S_ISCHR: "a device", stat.S_ISBLK: "a device"}
    return next((name for test, name in types.items() if test(mode)), None)


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
        raise SceneError(f"{file}: is text in {name}; a scene file is in UTF-8: save it in UTF-8")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{file}: no text in UTF-8 (byte {error.start}); a scene is a TOML file") from None
    if (offset := data.find(b"\0")) >= 0:
        raise SceneError(f"{file}: holds a zero byte (byte {offset}): no text, or text in UTF-16; a scene file is in UTF-8")
    return text


def parsed(text: str) -> dict[str, Any]:
    """Tables of a TOML text.

    Raises:
        InvalidToml: It is not valid, with line and column; nested too deeply; or holds too long a number.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidToml(str(error)) from None
    except RecursionError:
        raise InvalidToml(f"nested too deeply: tables and lists may be nested at most {MOST_LEVELS} levels") from None
    except ValueError as error:  # Python refuses to read integers of thousands of digits
        found = _LONG_INTEGER.search(text)
        if found is None:
            raise InvalidToml(str(error)) from None
        start = text.rfind("\n", 0, found.start()) + 1
        position = f"(at line {text.count(chr(10), 0, start) + 1}, column {found.start() - start + 1})"
        reason = f"a whole number of {len(found[0])} digits; allowed are those from -2^63 to 2^63 - 1 {position}"
        raise InvalidToml(reason) from None


def find_excess(data: Mapping[str, Any]) -> tuple[KeyPath, Any, str] | None:
    """Value of a scene that is nested too deeply, or too large an integer: key path, value and reason; None if there is none.

    It uses no recursion, since the tables may be nested to any depth.
    """
    todo: list[tuple[KeyPath, Any]] = [((), data)]
    while todo:
        key_path, table = todo.pop()
        if len(key_path) > MOST_LEVELS:
            return key_path[:4], None, f"nested too deeply: at most {MOST_LEVELS} tables and lists may be nested"
        for key, value in table.items() if isinstance(table, Mapping) else enumerate(table):
            if isinstance(value, (Mapping, list, tuple)):
                todo.append(((*key_path, key if isinstance(key, int) else str(key)), value))
            elif type(value) is int and not INTEGERS[0] <= value <= INTEGERS[1]:
                digits = f"{value.bit_length() * 0.30103:.0f}"
                reason = f"a whole number of about {digits} digits; allowed are those from -2^63 to 2^63 - 1, as in TOML"
                return (*key_path, key if isinstance(key, int) else str(key)), None, reason
    return None


def syntax_error(source: str, text: str, reason: str) -> str:
    """Message on a TOML error, with its line if the reason names one."""
    position = re.search(r"^(.*) \(at line (\d+), column (\d+)\)$", reason, re.DOTALL)
    if position is None:
        return f"{source}: not valid TOML: {reason}"
    number = int(position[2])
    wrong = text.replace("\r\n", "\n").split("\n")[number - 1].strip()
    return f"{source}, line {number}, column {position[3]}: not valid TOML: {position[1]}\n  {shorten(wrong, quote=False)}"
