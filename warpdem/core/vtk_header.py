"""What the tags of a VTK file in XML claim to hold: VTK takes the memory for it before it looks whether it is there."""

import os
from pathlib import Path
from xml.parsers import expat

THINGS_PER_BYTE = 100
"""Points, cells or numbers that a byte of a file may stand for [-]: some tens where arrays of equal numbers are compressed."""
COUNTED = "Points", "Cells", "Verts", "Lines", "Strips", "Polys", "Tuples", "Components"
COUNTS = tuple(f"NumberOf{what}" for what in COUNTED)
"""Attributes that say how many of something follow."""


def overclaim(file: Path | str) -> str | None:
    """What a file names more of than it can hold, in words; None if nothing. What is no XML is left to VTK."""
    size = os.path.getsize(file)
    most, what = 0, ""

    def begin(name: str, attributes: dict[str, str]) -> None:
        nonlocal most, what
        for key in COUNTS:
            text = attributes.get(key, "0").strip()
            if text.isdecimal() and (count := int(text[:30])) > most:
                most, what = count, key

    parser = expat.ParserCreate()
    parser.StartElementHandler = begin
    with open(file, "rb") as held:
        try:
            while block := held.read(1 << 16):
                if b"<AppendedData" in block:  # bytes that are no XML follow
                    parser.Parse(block[: block.index(b"<AppendedData")], False)
                    break
                parser.Parse(block, False)
        except expat.ExpatError:
            pass  # VTK tells what is wrong
    if most <= THINGS_PER_BYTE * size:
        return None
    return f"its header says {what} = {most}, and it is {size} bytes long: truncated or damaged?"
