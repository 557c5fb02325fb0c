"""Named parts of mesh files with several: the solids of an ASCII STL, the objects and groups of an OBJ."""

import re
from collections.abc import Iterable

import numpy as np

_SOLID = re.compile(rb"^[ \t]*(end)?solid\b[ \t]*([^\r\n]*)", re.IGNORECASE | re.MULTILINE)


class PartProblem(ValueError):
    """A part that a file does not hold."""


def solid_text(text: bytes, part: str) -> bytes:
    """The solids of this name of an ASCII STL file, as the text of a file of their own.

    Raises:
        PartProblem: There is none of this name.
    """
    found, names, begin, name = [], [], 0, ""
    for match in _SOLID.finditer(text):
        if match[1] is None:
            begin, name = match.start(), match[2].decode("utf-8", "replace").strip()
            names.append(name)
        elif name == part:
            found.append(text[begin : match.end()])
    if not found:
        raise PartProblem(refusal(part, names))
    return b"\n".join(found) + b"\n"


def refusal(part: str, names: Iterable[str]) -> str:
    """Why there is no part of this name, with those there are."""
    known = [name for name in dict.fromkeys(names) if name]
    if not known:
        return f"part = {part!r}: its parts have no names: leave part away, or name them in the program that wrote it"
    shown = ", ".join(repr(name) for name in known[:12]) + (f" and {len(known) - 12} more" if len(known) > 12 else "")
    return f"part = {part!r}: it holds no such part; there are {shown}"


class ObjectFaces:
    """Which faces of an OBJ file belong to a part: those below ``o NAME``, or below ``g`` with this name among others."""

    def __init__(self, part: str) -> None:
        self.part, self.names = part, list[str]()
        self._object, self._groups = "", list[str]()
        self.member: list[bool] = []

    def line(self, words: list[bytes]) -> None:
        """Take in a line that is split into words."""
        if words[0] == b"o":
            self._object, self._groups = b" ".join(words[1:]).decode("utf-8", "replace"), []
            self.names.append(self._object)
        elif words[0] == b"g":
            groups = [word.decode("utf-8", "replace") for word in words[1:]]
            self._groups = [*groups, " ".join(groups)]
            self.names += groups
        elif words[0] == b"f":
            self.member.append(self.part == self._object or self.part in self._groups)

    def faces(self) -> np.ndarray:
        """Which of the faces belong to the part, bool, shape (f,).

        Raises:
            PartProblem: None does.
        """
        member = np.array(self.member, dtype=bool)
        if not member.any():
            raise PartProblem(refusal(self.part, self.names))
        return member
