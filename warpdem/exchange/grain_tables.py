"""Tables of grains: a row per grain and frame, as CSV or Parquet."""

from __future__ import annotations

import csv
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from warpdem.core.snapshot import Snapshot
from warpdem.errors import SceneError
from warpdem.exchange.lab import View, in_view


def columns_of(grains: Snapshot, view: View) -> dict[str, np.ndarray]:
    """Columns of a frame by name with unit, shapes (n,)."""
    seen = in_view(grains, view)
    vectors = {"": ("position", "m"), "v": ("velocity", "m/s"), "omega": ("spin", "rad/s"), "f": ("force", "N")}
    columns = {
        "time [s]": np.full(len(grains.id), grains.time),
        "id": np.asarray(grains.id),
        "type": np.asarray(grains.type),
        "group": np.asarray(grains.group),
        "radius [m]": np.asarray(grains.radius, float),
        "mass [kg]": np.asarray(grains.mass, float),
    }
    for name, (key, unit) in vectors.items():
        columns |= {f"{name}{axis} [{unit}]": np.asarray(getattr(seen, key)[:, k], float) for k, axis in enumerate("xyz")}
    return columns


class CsvTable:
    """A CSV file that frames are appended to."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._begun = False

    def __enter__(self) -> CsvTable:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()

    def write(self, columns: dict[str, np.ndarray]) -> None:
        """Append the rows of a frame."""
        if not self._begun:
            self._writer.writerow(columns)
            self._begun = True
        self._writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


class ParquetTable:
    """A Parquet file that frames are appended to, a row group each.

    Raises:
        SceneError: pyarrow is not installed.
    """

    def __init__(self, path: Path) -> None:
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError as error:
            raise SceneError('a .parquet file needs pyarrow: pip install "warpdem[tables]", or take .csv') from error
        self._arrow: Any = pyarrow
        self._path, self._writer = path, None

    def __enter__(self) -> ParquetTable:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._writer is not None:
            self._writer.close()

    def write(self, columns: dict[str, np.ndarray]) -> None:
        """Append the rows of a frame."""
        table = self._arrow.table(columns)
        if self._writer is None:
            self._writer = self._arrow.parquet.ParquetWriter(self._path, table.schema)
        assert self._writer is not None
        self._writer.write_table(table)
