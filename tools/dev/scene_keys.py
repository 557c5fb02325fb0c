"""Write the keys of materials, contact laws and pairs into scenes/README.md: `python tools/dev/scene_keys.py`.

The list is made of the descriptions that the schema has, so it is of the code; a test compares the two.
"""

import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from pydantic.fields import FieldInfo

from warpdem.scene import pair_keys
from warpdem.scene.contact import Contact, Material, Pair

PAGE = Path(__file__).resolve().parents[2] / "scenes" / "README.md"
START, END = "<!-- keys: made by tools/dev/scene_keys.py -->\n", "<!-- end of keys -->\n"
WIDTH = 120


def bullet(key: str, text: str, laws: list[str]) -> str:
    """One key, wrapped."""
    of = f" ({', '.join(laws)})" if laws else ""
    escaped = text.replace("*", "\\*")
    return textwrap.fill(f"* `{key}`{of}: {escaped}", WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def fields(of: dict[str, FieldInfo], laws: dict[str, list[str]]) -> Iterator[str]:
    """One line or more per key of a table."""
    for key, field in of.items():
        yield bullet(key, field.description or "", laws.get(key, []))


def block() -> str:
    """The list, in Markdown."""
    laws = {
        key: [*(name for _, name in readers), *(["required"] if entry.default is None else [])]
        for key, (entry, readers) in pair_keys.of_package().items()
    }
    tables = (
        ("`[materials.NAME]`", Material.model_fields), ("`[contact]`", Contact.model_fields),
        ("`[[pairs]]`; in brackets the laws that read the key, else all do", Pair.model_fields),
    )  # fmt: skip
    parts = [f"{title}:\n\n" + "\n".join(fields(of, laws)) for title, of in tables]
    return "\n" + "\n\n".join(parts) + "\n\n"


def main() -> None:
    """Put the list in its place on the page."""
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split(START)
    tail = rest.split(END)[1]
    PAGE.write_text(head + START + block() + END + tail, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
