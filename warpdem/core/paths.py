"""What a scene may reach: the one rule for every path that a scene, a stage or a checkpoint names.

A scene that is read from a file reads files in its own folder and below, in folders that were given for it, and in the
scenes installed with the package; links count by what they lead to. It loads code only from files that were given by name,
and reaches no network. A scene that Python code makes is that code's own: nothing is kept from it.
"""

import os
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from warpdem import kernels
from warpdem.errors import SceneError

SCENES = Path(kernels.__file__).resolve().parent.parent / "scenes"
"""The scenes that come with the package, in a checkout as in a wheel beside the kernels."""


LONGEST_NAME, LONGEST_PATH = 255, 4095
"""Bytes of the name of a file or folder, and of a path, that file systems take [-]."""


def unusable(name: str | Path) -> str | None:
    """Why no file can have this name, in words; None if one can."""
    text = str(name)
    if not text or any(unicodedata.category(c) == "Cc" for c in text):
        return "must be the name of a file: not empty, and without control characters"
    if any(unicodedata.category(c) == "Cs" for c in text):
        return "must be the name of a file in UTF-8: VTK and USD know no others"
    longest = max((len(os.fsencode(part)) for part in Path(text).parts), default=0)
    if longest > LONGEST_NAME or len(os.fsencode(text)) > LONGEST_PATH:
        return f"must be the name of a file: at most {LONGEST_NAME} bytes long, with its folders {LONGEST_PATH}"
    try:
        Path(text).expanduser()
    except RuntimeError:
        return "begins with ~, but there is no such home folder: give the whole path"
    return None


def require_usable(option: str, path: Path | None) -> None:
    """Refuse a path on the command line that no file or folder can have; None is none.

    Raises:
        SceneError: It is too long, or holds control characters; names the ``option``.
    """
    if path is not None and (reason := unusable(path)):
        raise SceneError(f"{option} {_printable(path)}: {reason}")


def _printable(name: str | Path) -> str:
    """The begin of a name, as it may be shown."""
    return "".join(c if c.isprintable() else "?" for c in str(name)[:100])


def expanded(name: str | Path) -> Path:
    """Path with ~ as the home folder.

    Raises:
        SceneError: No file can have this name.
    """
    if reason := unusable(name):
        raise SceneError(f"{_printable(name)}: {reason}")
    return Path(name).expanduser()


@dataclass(frozen=True)
class Access:
    """What a scene may reach; None is no bound."""

    folders: tuple[Path, ...] | None = None
    """Folders that hold, at any depth, all files that the scene may read."""
    plugins: tuple[Path, ...] | None = None
    """Files that the scene may load as code."""

    def refusal(self, name: str | Path, base: Path = Path()) -> str | None:
        """Why the file ``name`` must not be read, in words with the remedy; None if it may.

        Args:
            name: path as the scene has it; a relative one starts from ``base``, ~ is the home folder.
            base: folder of the scene.
        """
        if re.match(r"\w[\w+.-]+:", str(name)):  # two letters or more: C: is a drive
            return "is an address: nothing is read over a network; give the path of a file"
        if reason := unusable(name):
            return reason
        try:
            file = (base / Path(name).expanduser()).resolve()
        except (OSError, RuntimeError) as error:  # links in a circle, among others
            return f"leads nowhere: {error}"
        if self.folders is None or any(file.is_relative_to(folder) for folder in self.folders):
            return None
        listed = ", ".join(str(folder) for folder in self.folders if folder != SCENES)
        return (
            f"leads to {file}, outside the folders that this scene may read: {listed}; put it there, or to allow it "
            f'say --allow-path {file.parent}, or load_scene(..., allow_paths=["{file.parent}"])'
        )

    def plugin_refusal(self, name: str | Path, base: Path = Path()) -> str | None:
        """Why the file ``name`` must not be loaded as code, as ``refusal``."""
        if reason := unusable(name):
            return reason
        file = (base / Path(name).expanduser()).resolve()
        if self.plugins is None or file in self.plugins:
            return None
        return (
            "is code, and a scene by itself runs none; if you trust this file say "
            f'--plugin {file}, or load_scene(..., plugins=["{file}"])'
        )


def access_of_file(base: Path, allow_paths: Iterable[str | Path] = (), plugins: Iterable[str | Path] = ()) -> Access:
    """What a scene read from a file in ``base`` may reach.

    Args:
        base: folder of the file.
        allow_paths: further folders that it may read from.
        plugins: files that it may load as code.

    Raises:
        SceneError: one of ``allow_paths`` is no folder, or one of ``plugins`` no Python file.
    """
    folders, files = [Path(base), SCENES], []
    for folder in allow_paths:
        if not Path(folder).expanduser().is_dir():
            raise SceneError(f"--allow-path {folder}: no such folder")
        folders.append(Path(folder).expanduser())
    for file in plugins:
        if Path(file).suffix != ".py" or not Path(file).expanduser().is_file():
            raise SceneError(f"--plugin {file}: must be an existing file that ends in .py")
        files.append(Path(file).expanduser())
    return Access(tuple(dict.fromkeys(f.resolve() for f in folders)), tuple(f.resolve() for f in files))
