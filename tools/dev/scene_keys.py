"""Write the keys of scenes into scenes/README.md (materials, laws, pairs) and scenes/KEYS.md: `python tools/dev/scene_keys.py`.

The lists are made of the descriptions that the schema has, so they are of the code; a test compares the two.
"""

import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from warpdem import Scene
from warpdem.scene import pair_keys
from warpdem.scene.contact import Contact, Material, Pair
from warpdem.scene.messages import PYTHON_ONLY, models_in

KEYS_PAGE = Path(__file__).resolve().parents[2] / "scenes" / "KEYS.md"
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


KEYS_HEAD = """# Every key of a scene

Made by `tools/dev/scene_keys.py` from the descriptions in the code, which are those of the
[schema](scene.schema.json) too. [README.md](README.md) says how they go together, with examples; `NAME` is a name of
your own, `[]` an entry of a list. Numbers are in SI units, or strings with a unit such as "5 mm". Keys of materials,
contact laws and pairs are [there](README.md#materials-contact-laws-and-pairs).
"""


def tables_of(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[type[BaseModel], str]]:
    """The tables that a table holds, and those of theirs, each with its key path; one alone or in a list is named alone."""
    for key, field in model.model_fields.items():
        found: dict[type[BaseModel], str] = {}
        for table, suffix in models_in(field.annotation):
            found[table] = min(suffix, found.get(table, suffix))
        for table, suffix in found.items():
            yield table, f"{prefix}{key}{suffix}"
            yield from tables_of(table, f"{prefix}{key}{suffix}.")


def keys_page() -> str:
    """All tables of a scene but those of ``block``."""
    places: dict[type[BaseModel], list[str]] = {Scene: []}
    for table, place in tables_of(Scene):
        places.setdefault(table, []).append(place)
    parts = [KEYS_HEAD]
    for table, where in places.items():
        if table in (Material, Contact, Pair):
            continue
        said = " ".join((table.__doc__ or "").split("\n\n")[0].split()).replace("``", "`")
        intro = f"In {', '.join(f'`{place}`' for place in where)}: {said}" if where else "What the file itself holds."
        shown = {key: field for key, field in table.model_fields.items() if not (table is Scene and key in PYTHON_ONLY)}
        wrapped = textwrap.fill(intro, WIDTH, break_on_hyphens=False)
        parts.append(f"## {table.__name__}\n\n{wrapped}\n\n" + "\n".join(fields(shown, {})) + "\n")
    return "\n".join(parts)


def main() -> None:
    """Put the lists in their places."""
    KEYS_PAGE.write_text(keys_page(), encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split(START)
    tail = rest.split(END)[1]
    PAGE.write_text(head + START + block() + END + tail, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
