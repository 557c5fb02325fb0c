"""Counts in the tags of an XML VTK file: VTK allocates memory for them before it checks whether the data is there."""

import os
from pathlib import Path
from xml.parsers import expat

ENTRIES_PER_BYTE = 100
"""Points, cells or numbers that one byte of a file may encode [-]: some tens where arrays of equal numbers are compressed."""
COUNTED = "Points", "Cells", "Verts", "Lines", "Strips", "Polys", "Tuples", "Components"
COUNTS = tuple(f"NumberOf{what}" for what in COUNTED)
"""Attributes that hold a number of entries."""


def excessive_count(file: Path | str) -> str | None:
    """Reason why a count in a file is larger than the file can hold; None if none is. Other XML errors are left to VTK."""
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
    with open(file, "rb") as stream:
        try:
            while block := stream.read(1 << 16):
                if b"<AppendedData" in block:  # raw bytes follow, which are no XML
                    parser.Parse(block[: block.index(b"<AppendedData")], False)
                    break
                parser.Parse(block, False)
        except expat.ExpatError:
            pass  # VTK reports the fault
    if most <= ENTRIES_PER_BYTE * size:
        return None
    return f"its header declares {what} = {most}, but it is only {size} bytes long: truncated or damaged?"
