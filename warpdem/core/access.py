"""File access of a scene: the one rule for every path that a scene, a stage or a checkpoint names.

A scene that is read from a file may read files in its own folder and below, in folders allowed by the caller, and in the
scenes installed with the package; a link counts by its target. It loads code only from files that the caller names, and
reads nothing over a network. A scene made by Python code has no restriction.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from warpdem.core.file_names import unusable
from warpdem.errors import SceneError

SCENES = Path(str(import_module("warpdem.kernels").__file__)).resolve().parent.parent / "scenes"
"""The scenes that come with the package, in a checkout as in a wheel beside the kernels."""


@dataclass(frozen=True)
class Access:
    """Files that a scene may use; None for no restriction."""

    folders: tuple[Path, ...] | None = None
    """Folders that hold, at any depth, all files that the scene may read."""
    plugins: tuple[Path, ...] | None = None
    """Files that the scene may load as code."""

    def refusal(self, name: str | Path, base: Path = Path()) -> str | None:
        """Reason why the file ``name`` must not be read, with the remedy; None if it may.

        Args:
            name: Path as the scene gives it; a relative path starts from ``base``, ~ is the home folder.
            base: Folder of the scene.
        """
        if re.match(r"\w[\w+.-]+:", str(name)):  # two letters or more: C: is a drive
            return "is an address: nothing is read over a network; give the path of a file"
        if reason := unusable(name):
            return reason
        try:
            file = (base / Path(name).expanduser()).resolve()
        except (OSError, RuntimeError) as error:  # links in a circle, among others
            return f"cannot be resolved: {error}"
        if self.folders is None or any(file.is_relative_to(folder) for folder in self.folders):
            return None
        listed = ", ".join(str(folder) for folder in self.folders if folder != SCENES)
        return (
            f"leads to {file}, outside the folders that this scene may read: {listed}; put it there, or allow it "
            f'with --allow-path {file.parent} or load_scene(..., allow_paths=["{file.parent}"])'
        )

    def plugin_refusal(self, name: str | Path, base: Path = Path()) -> str | None:
        """Reason why the file ``name`` must not be loaded as code, as ``refusal``."""
        if reason := unusable(name):
            return reason
        file = (base / Path(name).expanduser()).resolve()
        if self.plugins is None or file in self.plugins:
            return None
        return (
            "is code, which a scene may not load by itself; if you trust this file, allow it with "
            f'--plugin {file} or load_scene(..., plugins=["{file}"])'
        )


def access_of_file(base: Path, allow_paths: Iterable[str | Path] = (), plugins: Iterable[str | Path] = ()) -> Access:
    """Access of a scene read from a file in ``base``.

    Args:
        base: Folder of the file.
        allow_paths: Further folders that it may read from.
        plugins: Files that it may load as code.

    Raises:
        SceneError: One of ``allow_paths`` is no folder, or one of ``plugins`` no Python file.
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
