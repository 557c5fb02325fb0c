"""A state file for ``grains.file`` of a scene, made of grains that another program wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.exchange.grains import ForeignGrains
from warpdem.exchange.lammps_data import read_data
from warpdem.exchange.lammps_dump import BROKEN, opened, read_dump
from warpdem.exchange.text_columns import read_mercury, read_yade
from warpdem.filling.grain_file import CSV_COLUMNS

READERS: dict[str, Callable[[Path, int | None], ForeignGrains]] = {
    "lammps-dump": read_dump,
    "lammps-data": lambda path, step: read_data(path),
    "yade": lambda path, step: read_yade(path),
    "mercury": read_mercury,
}
"""Formats that are read, LIGGGHTS's as LAMMPS's."""
SUFFIXES = {".dump": "lammps-dump", ".lammpstrj": "lammps-dump", ".lmp": "lammps-data", ".lammps": "lammps-data"}
"""Formats by suffix; others are recognised by their first lines."""
LENGTHS = {"si": 1.0, "cgs": 1e-2, "mm": 1e-3, "um": 1e-6}
"""Metres of a unit of length of the file, all else in it being in seconds [m]."""
FORMATS = (".npz", ".csv")


def format_of(path: Path) -> str:
    """Format of a file by its name, or by its first lines.

    Raises:
        SceneError: it is not known by either.
    """
    suffix = [part for part in path.suffixes if part.lower() != ".gz"][-1:]
    if suffix and suffix[0].lower() in SUFFIXES:
        return SUFFIXES[suffix[0].lower()]
    try:
        with opened(path) as file:
            begin = file.read(4000)
    except BROKEN as error:
        raise SceneError(f"{path}: cannot be read ({error})") from error
    lines = [line.split() for line in begin.splitlines() if line.strip()]
    if begin.startswith("ITEM:"):
        return "lammps-dump"
    if any(words[1:2] == ["atoms"] for words in lines[:20]):
        return "lammps-data"
    if lines and len(lines[0]) == 8 and lines[0][0].isdecimal():
        return "mercury"
    if begin.startswith("#format x_y_z_r") or (lines and len(lines[0]) == 4):
        return "yade"
    raise SceneError(f"{path}: its format is not known by its name or its first lines; give --format {' | '.join(READERS)}")


def write_state_file(
    source: Path,
    target: Path,
    *,
    kind: str | None = None,
    step: int | None = None,
    only_type: int | None = None,
    unit: str = "si",
    overwrite: bool = False,
) -> list[str]:
    """Write the grains of a file of another program as a state file.

    Args:
        source: the file.
        target: .npz or .csv.
        kind: one of `READERS`; recognised by the name or the first lines of the file if not given.
        step: time step of a dump, or number of the time of MercuryDPM; the last one if not given.
        only_type: only grains of this type, which has a material of its own in the scene.
        unit: one of `LENGTHS`.
        overwrite: allow a target that exists.

    Returns:
        What was read, and what was not, in words.

    Raises:
        SceneError: the source cannot be read, or the target not be written.
    """
    if target.suffix.lower() not in FORMATS:
        raise SceneError(f"{target}: a state file ends in {' or '.join(FORMATS)}")
    if target.exists() and not overwrite:
        raise SceneError(f"{target}: is there already; take another name, or give --overwrite")
    if not source.is_file():
        raise SceneError(f"{source}: no such file")
    if unit not in LENGTHS:
        raise SceneError(f"--units {unit}: is unknown; allowed are {', '.join(LENGTHS)}")
    kind = kind or format_of(source)
    if kind not in READERS:
        raise SceneError(f"--format {kind}: is unknown; allowed are {', '.join(READERS)}")
    if step is not None and kind in ("lammps-data", "yade"):
        raise SceneError(f"--step {step}: a file of the format {kind} holds one time only")
    grains = READERS[kind](source, step)
    types = np.unique(grains.type).tolist() if grains.type is not None else []
    chosen = np.ones(len(grains.radius), bool)
    if only_type is not None:
        if only_type not in types:
            raise SceneError(f"--type {only_type}: {source} has the types {', '.join(map(str, types)) or 'of no grain'}")
        chosen = np.asarray(grains.type == only_type)
    if not chosen.any():
        raise SceneError(f"{source}: holds no grains")
    metre = LENGTHS[unit]
    arrays: dict[str, np.ndarray] = {"position": grains.position[chosen] * metre, "radius": grains.radius[chosen] * metre}
    if grains.velocity is not None:
        arrays["velocity"] = grains.velocity[chosen] * metre
    if grains.spin is not None:
        arrays["spin"] = grains.spin[chosen]
    if grains.id is not None:
        arrays["id"] = grains.id[chosen]
    _write(target, arrays)
    notes = [f"{int(chosen.sum())} grains of {grains.when}, format {kind}, radius {arrays['radius'].min():.6g} to "
             f"{arrays['radius'].max():.6g} m"]  # fmt: skip
    if only_type is None and len(types) > 1:
        notes.append(f"types {', '.join(map(str, types))} are all in it; --type N takes one of them, for a material of its own")
    if grains.ignored:
        words = "the density is that of the scene's material, friction begins anew"
        notes.append(f"not taken: {', '.join(grains.ignored)} ({words})")
    return notes


def _write(target: Path, arrays: dict[str, np.ndarray]) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    with replaced(target) as part:
        if target.suffix.lower() == ".npz":
            np.savez(part, allow_pickle=False, **arrays)
            return
        names = [name for key in arrays for name in CSV_COLUMNS[key]]
        table = np.hstack([values.reshape(len(values), -1).astype(float) for values in arrays.values()])
        formats = ["%d" if name == "id" else "%.17g" for name in names]
        np.savetxt(part, table, delimiter=",", header=",".join(names), comments="", fmt=formats)
