"""Valid file names: a name that file systems, VTK or USD do not accept is refused before any file is opened."""

import os
import unicodedata
from pathlib import Path

from warpdem.errors import SceneError

LONGEST_NAME, LONGEST_PATH = 255, 4095
"""Maximum length of the name of a file or folder, and of a path [bytes]."""


def unusable(name: str | Path) -> str | None:
    """Reason why no file can have this name; None if it is valid."""
    text = str(name)
    if not text or any(unicodedata.category(c) == "Cc" for c in text):
        return "must be the name of a file: not empty, and without control characters"
    if any(unicodedata.category(c) == "Cs" for c in text):
        return "must be the name of a file in UTF-8: VTK and USD accept no other encoding"
    longest = max((len(os.fsencode(part)) for part in Path(text).parts), default=0)
    if longest > LONGEST_NAME or len(os.fsencode(text)) > LONGEST_PATH:
        return f"must be the name of a file: at most {LONGEST_NAME} bytes long, with its folders {LONGEST_PATH}"
    try:
        Path(text).expanduser()
    except RuntimeError:
        return "begins with ~, but there is no such home folder: give the whole path"
    return None


def require_usable(option: str, path: Path | None) -> None:
    """Refuse an invalid path on the command line; None is allowed.

    Raises:
        SceneError: It is too long, or holds control characters; names the ``option``.
    """
    if path is not None and (reason := unusable(path)):
        raise SceneError(f"{option} {_printable(path)}: {reason}")


def _printable(name: str | Path) -> str:
    """The first 100 characters of a name, those that cannot be printed as "?"."""
    return "".join(c if c.isprintable() else "?" for c in str(name)[:100])


def expanded(name: str | Path) -> Path:
    """Path with ~ as the home folder.

    Raises:
        SceneError: No file can have this name.
    """
    if reason := unusable(name):
        raise SceneError(f"{_printable(name)}: {reason}")
    return Path(name).expanduser()
