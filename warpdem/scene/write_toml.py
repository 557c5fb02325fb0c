"""Tables as a readable TOML file: rows of numbers on lines of their own, small tables on one line.

The libraries that write TOML put each number of an array on its own line (tomli-w) or take a minute for 20 000 rows
(tomlkit 0.15).
"""

import json
import re
from collections.abc import Iterator
from typing import Any

WIDTH = 100
"""Maximum number of characters of an array or a small table on one line [-]."""


def toml_text(data: dict[str, Any]) -> str:
    """Text of a TOML file; ``data`` holds tables, lists, strings, numbers and truth values.

    Raises:
        TypeError: A value has another type.
    """
    return "\n".join(_lines(data, ())).strip("\n") + "\n"


def _lines(table: dict[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Lines of a table; values first, since the lines after the header of a table belong to that table."""
    below = {key: value for key, value in table.items() if _has_head(value, path)}
    yield from (f"{_key(key)} = {_block(value)}" for key, value in table.items() if key not in below)
    for key, value in below.items():
        here = (*path, key)
        name = ".".join(map(_key, here))
        if isinstance(value, list):
            for entry in value:
                yield from ("", f"[[{name}]]", *_lines(entry, here))
        elif value and all(_has_head(entry, here) for entry in value.values()):
            yield from _lines(value, here)  # tables only: their own headers imply this one
        else:
            yield from ("", f"[{name}]", *_lines(value, here))


def _has_head(value: Any, path: tuple[str, ...]) -> bool:
    """Whether a value is a table, or a list of tables, under a header of its own."""
    if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
        return not path or any(not _is_short(entry) for entry in value)
    if not isinstance(value, dict):
        return False
    return not path or (len(path) == 1 and path[0] in ("materials", "borders")) or not _is_short(value)


def _is_short(value: Any) -> bool:
    return len(_inline(value)) <= WIDTH if not _is_long(value) else False


def _is_long(value: Any) -> bool:
    """Whether a value is certainly too long for a line; avoids formatting a large array twice."""
    entries = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return len(entries) > WIDTH // 2 or any(_is_long(entry) for entry in entries)


def _block(value: Any) -> str:
    """A value on one line, or one entry per line."""
    if not isinstance(value, list) or _is_short(value):
        return _inline(value)
    if all(isinstance(entry, (int, float)) for entry in value):
        rows = [", ".join(map(_inline, value[i : i + 8])) for i in range(0, len(value), 8)]
    else:
        rows = [_inline(entry) for entry in value]
    return "\n".join(["[", *(f"  {row}," for row in rows), "]"])


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{_key(k)} = {_inline(v)}' for k, v in value.items())} }}" if value else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, str):
        # JSON strings are valid TOML strings except for one control character
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (bool, int, float)):
        return str(value).lower()
    raise TypeError(f"TOML has no {type(value).__name__}")


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _inline(key)
