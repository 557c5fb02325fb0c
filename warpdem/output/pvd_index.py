"""PVD files: the time, the part and the file of each frame of VTK results."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from warpdem.core.atomic_file import replaced
from warpdem.errors import WarpdemError


@dataclass(frozen=True)
class Entry:
    """One line of the index."""

    time: float
    part: int
    name: str
    file: str
    group: str


def write_index(path: Path, entries: list[Entry]) -> None:
    """Write a PVD file."""
    lines = [
        f'<DataSet timestep="{entry.time!r}" group="{entry.group}" part="{entry.part}"'
        f" name={quoteattr(entry.name)} file={quoteattr(entry.file)}/>"
        for entry in entries
    ]
    text = "\n".join(['<VTKFile type="Collection" version="0.1">', "<Collection>", *lines, "</Collection>"])
    with replaced(path) as part:
        part.write_text(f'<?xml version="1.0"?>\n{text}\n</VTKFile>\n', encoding="utf-8")


def read_index(path: Path) -> list[Entry]:
    """Lines of a PVD file.

    Raises:
        WarpdemError: It cannot be read.
    """
    try:
        return [
            Entry(float(e.attrib["timestep"]), int(e.attrib["part"]), *(e.attrib[name] for name in ("name", "file", "group")))
            for e in ElementTree.parse(path).iter("DataSet")
        ]
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise WarpdemError(f"{path}: cannot be read as an index of results ({error!r})") from error
