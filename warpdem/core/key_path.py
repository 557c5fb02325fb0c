"""Key paths of a scene: the keys and list indices that lead to a value in its tables."""

import json
import re

KeyPath = tuple[str | int, ...]
"""Keys and list indices, outermost first, such as ("walls", 0, "scale")."""


def key_text(key_path: KeyPath) -> str:
    """Dotted key, such as walls[0].scale."""
    text = ""
    for part in key_path:
        if isinstance(part, int) or part.isdecimal():
            text += f"[{part}]"
        else:
            name = part if re.fullmatch(r"[\w-]+", part) else json.dumps(part, ensure_ascii=False)
            text += f".{name}" if text else name
    return text
