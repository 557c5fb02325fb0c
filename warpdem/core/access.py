"""What a scene may reach: the one rule for every path that a scene, a stage or a checkpoint names.

A scene that is read from a file reads files in its own folder and below, in folders that were given for it, and in the
scenes installed with the package; links count by what they lead to. It loads code only from files that were given by name,
and reaches no network. A scene that Python code makes is that code's own: nothing is kept from it.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from warpdem import kernels
from warpdem.core.file_names import unusable
from warpdem.errors import SceneError

SCENES = Path(kernels.__file__).resolve().parent.parent / "scenes"
"""The scenes that come with the package, in a checkout as in a wheel beside the kernels."""


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
