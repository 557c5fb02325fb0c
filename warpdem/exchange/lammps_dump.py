"""LAMMPS dump files in text, plain or gzipped, as LAMMPS, LIGGGHTS and Ovito read and write them (``dump custom``).

ITEM: TIME / ITEM: TIMESTEP / ITEM: NUMBER OF ATOMS / ITEM: BOX BOUNDS pp ff ff / ITEM: ATOMS id type x y z radius ...
"""

from __future__ import annotations

import gzip
import io
import sys
import zlib
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np

from warpdem.core.snapshot import Snapshot
from warpdem.errors import SceneError
from warpdem.exchange.grains import ForeignGrains
from warpdem.exchange.lab import View, in_view

BROKEN = (OSError, EOFError, UnicodeDecodeError, zlib.error)
"""What reading a damaged file raises."""
COLUMNS = "id type x y z radius mass vx vy vz omegax omegay omegaz fx fy fz"
VECTORS = {"velocity": ("vx", "vy", "vz"), "spin": ("omegax", "omegay", "omegaz")}
PLACES = (("x", "y", "z"), ("xu", "yu", "zu"))
SCALED = (("xs", "ys", "zs"), ("xsu", "ysu", "zsu"))
KNOWN = {"id", "type", "radius", "diameter", *(name for names in (*PLACES, *SCALED, *VECTORS.values()) for name in names)}


def opened(path: Path) -> TextIO:
    """A text file, unpacked if its name ends in .gz.

    Raises:
        SceneError: it is not there.
    """
    try:
        file = gzip.open(path, "rb") if path.suffix.lower() == ".gz" else path.open("rb")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror or error})") from error
    return io.TextIOWrapper(file, encoding="utf-8")


def write_frame(file: TextIO, grains: Snapshot, view: View, bounds: np.ndarray, borders: Sequence[str], first: bool) -> None:
    """Append a frame; ids and types are counted from 1, since LAMMPS refuses 0.

    Args:
        file: the dump.
        grains: the frame.
        view: axes that positions and motion are in.
        bounds: least and greatest corner of the box [m], shape (2, 3).
        borders: of each axis, "pp" for periodic or "ff".
        first: whether it is the first frame of the file, which also names the units.
    """
    seen = in_view(grains, view)
    columns = [grains.id[:, None] + 1, grains.type[:, None] + 1, seen.position, grains.radius[:, None], grains.mass[:, None],
               seen.velocity, seen.spin, seen.force]  # fmt: skip
    names, formats = COLUMNS, "%d %d" + " %.9g" * 14
    if grains.orientation is not None and view == "frame":
        columns.append(grains.orientation[:, [1, 2, 3, 0]])
        names, formats = f"{names} quati quatj quatk quatw", formats + " %.9g" * 4
    box = "\n".join(f"{low:.9g} {high:.9g}" for low, high in bounds.T)
    file.write("ITEM: UNITS\nsi\n" if first else "")
    # in the order in which LAMMPS's own reader wants them
    file.write(f"ITEM: TIME\n{grains.time!r}\nITEM: TIMESTEP\n{grains.step}\nITEM: NUMBER OF ATOMS\n{len(grains.id)}\n")
    file.write(f"ITEM: BOX BOUNDS {' '.join(borders)}\n{box}\nITEM: ATOMS {names}\n")
    np.savetxt(file, np.hstack([np.asarray(column, float) for column in columns]), fmt=formats)


def read_dump(path: Path, step: int | None = None) -> ForeignGrains:
    """Grains of a dump.

    Args:
        path: the file, .gz if it is packed.
        step: its TIMESTEP; the last one if not given.

    Raises:
        SceneError: it cannot be read, is truncated, has no such time step, or lacks positions or sizes.
    """
    found: ForeignGrains | None = None
    steps: list[int] = []
    try:
        with opened(path) as file:
            for number, read in _frames(file, path):
                steps.append(number)
                if step is None or number == step:
                    found = read
    except BROKEN as error:
        raise SceneError(f"{path}: cannot be read as a dump ({error})") from error
    if found is None:
        there = f"it goes from {steps[0]} to {steps[-1]}, {len(steps)} of them" if steps else "it has none"
        raise SceneError(f"{path}: has no time step {step if step is not None else ''}: {there}")
    return found


def _frames(file: TextIO, path: Path) -> Iterator[tuple[int, ForeignGrains]]:
    """Each time step of a dump and its grains."""
    head: dict[str, list[str]] = {}
    for line in file:
        if not line.startswith("ITEM:"):
            raise SceneError(f"{path}: is no LAMMPS dump: {line.strip()[:60]!r} stands where an ITEM must")
        words = line.split()[1:]
        kind = " ".join(words)
        if kind.startswith("ATOMS"):
            yield _atoms(file, words[1:], head, path)
            head = {}
        elif kind.startswith("BOX BOUNDS"):
            head["BOX"] = [*islice(file, 3)]
            head["BORDERS"] = words[2:]
        elif kind.startswith("ENTRIES"):
            raise SceneError(f"{path}: is a dump of contacts or of local data (ITEM: ENTRIES), not of grains")
        else:
            head[kind] = [next(file, "")]


def _atoms(file: TextIO, names: Sequence[str], head: dict[str, list[str]], path: Path) -> tuple[int, ForeignGrains]:
    try:
        step, count = int(head["TIMESTEP"][0]), int(head["NUMBER OF ATOMS"][0])
    except (KeyError, ValueError) as error:
        raise SceneError(f"{path}: a frame lacks its TIMESTEP or NUMBER OF ATOMS ({error})") from error
    lines = [*islice(file, min(max(count, 0), sys.maxsize))]
    where = f"{path}: time step {step}"
    if len(lines) < count:
        raise SceneError(f"{where}: {len(lines)} of {count} grains are there: the file is cut off")
    used = [name for name in names if name in KNOWN]
    try:
        # only columns that are taken: others may hold words
        at = [names.index(name) for name in used]
        table = np.loadtxt(lines, usecols=at, ndmin=2) if lines and at else np.zeros((0, len(used)))
    except (ValueError, IndexError) as error:
        raise SceneError(f"{where}: its rows are no numbers ({error})") from error
    return step, _grains(dict(zip(used, table.T, strict=True)), names, head, where, step)


def _grains(
    columns: dict[str, np.ndarray], names: Sequence[str], head: dict[str, list[str]], where: str, step: int
) -> ForeignGrains:
    place = next((p for p in (*PLACES, *SCALED) if all(name in columns for name in p)), None)
    if place is None:
        raise SceneError(f"{where}: has no positions x y z; its columns are {' '.join(names)}")
    position = np.stack([columns[name] for name in place], axis=1)
    if place in SCALED:
        if "xy" in head.get("BORDERS", ()):
            raise SceneError(f"{where}: scaled positions of a box that is no cuboid are not read; dump x y z")
        try:
            box = np.array([line.split()[:2] for line in head.get("BOX", ())], float).reshape(3, 2)
        except ValueError as error:
            raise SceneError(f"{where}: scaled positions need BOX BOUNDS, three lines of two numbers ({error})") from error
        position = box[:, 0] + position * (box[:, 1] - box[:, 0])
    if "radius" not in columns and "diameter" not in columns:
        raise SceneError(f"{where}: has no radius and no diameter; its columns are {' '.join(names)}: dump one of them too")
    radius = columns["radius"] if "radius" in columns else 0.5 * columns["diameter"]
    vectors = {
        key: np.stack([columns[name] for name in parts], axis=1) if all(name in columns for name in parts) else None
        for key, parts in VECTORS.items()
    }
    whole = {key: columns[key].astype(np.int64) if key in columns else None for key in ("id", "type")}
    ignored = tuple(name for name in names if name not in KNOWN)
    return ForeignGrains(position, radius, **vectors, **whole, when=f"time step {step}", ignored=ignored)
