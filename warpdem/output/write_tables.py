"""Tables of a run: ``history.csv`` (one row per sample) and ``run.json`` (what was run, how, with what result)."""

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from warpdem.core.atomic_file import not_written, replaced
from warpdem.errors import WarpdemError
from warpdem.measure.residence import Departed


def write_departures(path: Path, departed: Departed, groups: Sequence[str], materials: Sequence[str]) -> None:
    """Write a table of the grains that have left, a row each, in the order in which they did.

    Args:
        path: file to write, usually ``departures.csv``; replaced whole.
        departed: the grains.
        groups: names of the scene's groups.
        materials: names of its materials.

    Raises:
        OutputError: it cannot be written.
    """
    with replaced(path) as part, open(part, "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["id [-]", "group", "material", "diameter [m]", "outlet", "came [s]", "left [s]", "residence [s]"])
        for k in range(len(departed.id)):
            times = departed.came[k], departed.left[k], departed.residence[k]
            which = departed.id[k], groups[departed.group[k]], materials[departed.type[k]], _digits(2.0 * departed.radius[k])
            rows.writerow([*which, departed.way_out[k], *map(_digits, times)])


class HistoryWriter:
    """Append rows of numbers to a CSV file; every row is on disk when ``write`` returns."""

    def __init__(self, path: Path, columns: Sequence[str], *, resume: bool = False):
        """Start the file with its header.

        Args:
            path: File to write, usually ``history.csv``.
            columns: Names with units, such as ``"time [s]"``; the first one orders the rows.
            resume: Keep the rows of an earlier run that come before the first new row.

        Raises:
            WarpdemError: ``resume`` is asked for and the columns of the file are others.
        """
        self._path = Path(path)
        self._columns = list(columns)
        self._earlier: list[list[str]] = []
        if resume and self._path.exists():
            self._earlier = self._read_rows()
        self._file: TextIO | None = None

    def write(self, values: Sequence[float]) -> None:
        """Append one row, numbers with all their digits.

        Args:
            values: One number per column, in their order.

        Raises:
            ValueError: The count of numbers is not the count of columns.
            OutputError: The row cannot be written.
        """
        if len(values) != len(self._columns):
            raise ValueError(f"{self._path}: {len(values)} values for {len(self._columns)} columns")
        file = self._file or self._open(first=float(values[0]))
        try:
            csv.writer(file, lineterminator="\n").writerow([_digits(value) for value in values])
            file.flush()
        except OSError as error:
            raise not_written(self._path, error) from error

    def close(self) -> None:
        """Close the file; a writer that got no row leaves a header alone."""
        file = self._file or self._open(first=math.inf)
        try:
            file.close()
        except OSError as error:
            raise not_written(self._path, error) from error

    @property
    def earlier(self) -> list[list[float]]:
        """Rows of the earlier run that is resumed."""
        return [[float(value) for value in row] for row in self._earlier]

    def _open(self, first: float) -> TextIO:
        kept = [row for row in self._earlier if float(row[0]) < first]
        with replaced(self._path) as part, open(part, "w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([self._columns, *kept])
        self._file = open(self._path, "a", newline="", encoding="utf-8")
        return self._file

    def _read_rows(self) -> list[list[str]]:
        # a killed run may have left its last row unfinished, cut within its last number
        whole, _, _ = self._path.read_text(encoding="utf-8", errors="replace").rpartition("\n")
        header, *rows = list(csv.reader(whole.splitlines())) or [self._columns]
        if header != self._columns:
            raise WarpdemError(f"{self._path}: cannot go on, its columns are {header}; this run writes {self._columns}")
        return [row for row in rows if len(row) == len(header)]


def write_run_record(path: Path, data: dict[str, Any]) -> None:
    """Write ``data`` as JSON, atomically.

    NumPy numbers and arrays become plain numbers and lists, paths become text, and numbers that JSON cannot hold
    (infinite, not a number) become null.
    """
    with replaced(Path(path)) as part:
        part.write_text(json.dumps(plain(data), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _digits(value: float) -> str:
    return str(int(value)) if isinstance(value, (int, np.integer)) else repr(float(value))


def plain(value: Any) -> Any:
    """What JSON can hold of a value: NumPy numbers, arrays and paths as plain ones, numbers that are none as null."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
