"""The gallery: scenes that are installed with the package, what each says of itself, and copies of them to run.

A scene of the gallery begins with comment lines: a sentence, then what is shown, what must come out, in which results that is
seen, a measure of it, and how long it takes.
"""

import errno
import os
import re
import shlex
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from warpdem.app.run_folder import CHECKPOINT
from warpdem.core.nearest import nearest
from warpdem.errors import OutputError, SceneError
from warpdem.scene.file import load_scene
from warpdem.scene.model import Scene

PARTS = ("Shown", "Must come out", "Seen in", "Measure", "Takes")
"""Words that begin a part of a scene's first comment."""
RESULTS = "results"
"""Folder of what comes out, beside the copied scene."""


@dataclass(frozen=True)
class Demo:
    """A scene of the gallery and what its first lines say."""

    name: str
    file: Path
    """The installed scene file."""
    about: str
    """What it is, in a sentence."""
    shown: str
    """What it is an example of."""
    outcome: str
    """What must come out."""
    seen: str
    """Which of the results tell what came out."""
    measure: str
    """A number of a run, as a result of a sweep: what its accuracy is judged by."""
    takes: str
    """Wall time of a run on two cores, in words."""


def gallery() -> dict[str, Demo]:
    """The installed scenes by name, in alphabetical order.

    Raises:
        SceneError: A scene lacks one of the parts that its first comment must have.
    """
    folder = Path(str(resources.files("warpdem.scenes")))
    return {file.stem: described(file) for file in sorted(folder.glob("*.toml"))}


def described(file: Path) -> Demo:
    """The scene of a file with the parts of its first comment.

    Raises:
        SceneError: One of the parts is missing.
    """
    text = file.read_text(encoding="utf-8")
    comment = re.findall(r"\A(?:#.*\n)*", text)[0].replace("\n#", "\n")[1:]
    # a part ends where the next begins or at an empty line
    found = {"about": re.split(r"\n\s*\n", comment)[0]}
    for part in PARTS:
        match = re.search(rf"^\s*{part}[^:\n]*:(.*?)(?=^\s*(?:{'|'.join(PARTS)})[^:\n]*:|^\s*$|\Z)", comment, re.M | re.S)
        if match is None:
            raise SceneError(f'{file}: its first comment has no part "{part}: ..."')
        found[part] = match[1]
    words = {key: " ".join(value.split()) for key, value in found.items()}
    shown, outcome, seen, measure, takes = (words[part] for part in PARTS)
    return Demo(file.stem, file, words["about"], shown, outcome, seen, measure, takes.rstrip("."))


def scene_named(name: str) -> Demo:
    """A scene of the gallery.

    Raises:
        SceneError: There is no such scene.
    """
    scenes = gallery()
    if name not in scenes:
        hint = nearest(name, list(scenes)) or f"; there are {', '.join(scenes)}"
        raise SceneError(f'demo "{name}": there is no such scene{hint} ("warpdem demo" lists them)')
    return scenes[name]


def load_demo(name: str, overrides: Sequence[str] = ()) -> Scene:
    """Read a scene that is installed with warpdem.

    Args:
        name: Name of the scene, as ``warpdem demo`` lists it.
        overrides: Changes as those of ``load_scene``, "time.end=0.5".

    Raises:
        SceneError: There is no such scene, or a change is wrong.
    """
    return load_scene(scene_named(name).file, overrides)


def copy(name: str, folder: Path) -> Path:
    """Copy a scene of the gallery and the files it names to a new folder.

    Args:
        name: Name of the scene.
        folder: Folder to make.

    Returns:
        The copied scene file.

    Raises:
        SceneError: There is no such scene, or the folder exists.
        OutputError: The folder cannot be written.
    """
    file, target = scene_named(name).file, folder / f"{name}.toml"
    named = [Path(path) for _, path in load_scene(file).files()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()  # one of two that are started at once makes it
    except FileExistsError as error:
        if not folder.exists():  # it is one above that is no folder
            raise OutputError(f"--out {folder}: cannot be written ({os.strerror(errno.ENOTDIR)})") from error
        begun = any((folder / RESULTS).rglob(CHECKPOINT))
        command = shlex.join(["warpdem", "run", str(target), "--out", str(folder / RESULTS), *["--resume"] * begun])
        again = f", or {'go on with' if begun else 'run'} what is there: {command}" if target.exists() else ""
        raise SceneError(f"--out {folder}: is there already; take another folder{again}") from None
    except OSError as error:
        raise OutputError(f"--out {folder}: cannot be written ({error.strerror})") from error
    try:
        for path in (Path(file.name), *named):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file.parent / path, folder / path)
    except OSError as error:
        raise OutputError(f"--out {folder}: cannot be written ({error.strerror})") from error
    return target


def print_gallery(console: Console) -> None:
    """Print a sentence on each scene, and how long it takes."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for scene in gallery().values():
        table.add_row(scene.name, Text(f"{scene.about} ({scene.takes})"))
    console.print(table)
    console.print("warpdem demo NAME copies a scene to the folder NAME and runs it; --about tells more of it instead")


def print_about(name: str, console: Console) -> None:
    """Print all that the first comment of a scene says of it.

    Raises:
        SceneError: There is no such scene.
    """
    scene = scene_named(name)
    console.print(f"{scene.name}: {scene.about}", style="bold", markup=False)
    for part, words in zip(PARTS, (scene.shown, scene.outcome, scene.seen, scene.measure, f"{scene.takes}."), strict=True):
        console.print(f"{part}: {words}", markup=False)


def print_outcome(file: Path, changed: bool, console: Console) -> None:
    """Print what must come out of a copied scene; if it was run ``changed``, that this is of the scene as the file has it.

    And which of its results tell what came out.
    """
    scene = described(file)
    of = " of the scene as it is (this run was another: --set, --until or --precision)" if changed else ""
    console.print(f"must come out{of}: {scene.outcome}", markup=False)
    console.print(f"what came out is seen in {file.parent / RESULTS}: {scene.seen}", markup=False)
