"""Grains in columns of text: YADE's ``export.text`` (x y z r) and the .data files of MercuryDPM."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from warpdem.errors import SceneError
from warpdem.exchange.grains import ForeignGrains
from warpdem.exchange.lammps_dump import BROKEN, opened

MERCURY = 14
"""Numbers of a grain in a .data file of MercuryDPM in three dimensions: position, velocity, radius, orientation (3), angular
velocity (3), species."""


def read_yade(path: Path) -> ForeignGrains:
    """Grains of a file of YADE's ``export.text`` or ``export.textExt``: lines ``x y z r`` with whatever follows.

    Raises:
        SceneError: it cannot be read, or has lines of less than four numbers.
    """
    try:
        with opened(path) as file:
            rows = [line.split()[:4] for line in file if line.strip() and not line.startswith("#")]
        table = np.array(rows, float).reshape(len(rows), -1)
    except (*BROKEN, ValueError) as error:
        raise SceneError(f"{path}: cannot be read as lines 'x y z r' of numbers ({error})") from error
    if len(rows) and table.shape[1] != 4:
        raise SceneError(f"{path}: its lines have {table.shape[1]} numbers; x y z r are needed")
    table = table.reshape(-1, 4)
    return ForeignGrains(table[:, :3], table[:, 3], when="text")


def read_mercury(path: Path, step: int | None = None) -> ForeignGrains:
    """Grains of a .data file of MercuryDPM: for each time a line ``N time xmin ymin zmin xmax ymax zmax``, and N grains.

    Args:
        path: the file.
        step: number of the time, from 0; the last one if not given.

    Raises:
        SceneError: it cannot be read, is cut off, or has no such time.
    """
    number, lines, head = -1, [], [""]
    try:
        with opened(path) as file:
            for line in file:
                if not line.strip():
                    continue
                head, number = line.split(), number + 1
                count = int(head[0])
                if len(head) != 8 or count < 0:
                    raise ValueError(f"{line.strip()[:60]!r} is no 'N time' with six borders")
                lines = [*islice(file, count)]
                if len(lines) < count:
                    raise ValueError(f"{len(lines)} of {count} grains are there at time {head[1]}: the file is cut off")
                if number == step:
                    break
        if number < 0 or (step is not None and number != step):
            raise ValueError(f"it has {number + 1} times" + (f", none of the number {step}" if step is not None else ""))
        table = np.loadtxt(lines, ndmin=2) if lines else np.zeros((0, MERCURY))
        if table.shape[1] != MERCURY:
            raise ValueError(f"its grains have {table.shape[1]} numbers, must have {MERCURY}")
    except (*BROKEN, ValueError, IndexError) as error:
        raise SceneError(f"{path}: cannot be read as a .data file of MercuryDPM ({error})") from error
    kind = table[:, 13].astype(np.int64)
    ignored = ("orientation",)
    return ForeignGrains(table[:, :3], table[:, 6], table[:, 3:6], table[:, 10:13], None, kind, f"time {head[1]}", ignored)
