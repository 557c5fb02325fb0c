"""A run that keeps rows of its history in memory: the columns of history.csv, at the times that a program asks for."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np

from warpdem.measure import observation
from warpdem.measure.column import Readings
from warpdem.measure.run_readings import RunReadings
from warpdem.output.history import history_columns, history_row, reads_grains
from warpdem.runs.history import History


class Rows:
    """Rows of numbers, the first of each its time [s]."""

    def __init__(self) -> None:
        self._numbers = array("d")
        self._width = 1

    def add(self, row: Sequence[float]) -> None:
        """Append a row; those of its time and later ones, as of a run that has gone back to a checkpoint, give way."""
        self._width = len(row)
        while self._numbers and self._numbers[-self._width] >= row[0]:
            del self._numbers[-self._width :]
        self._numbers.extend(row)

    def table(self) -> np.ndarray:
        """All rows, shape (rows, columns)."""
        return np.array(self._numbers).reshape(-1, self._width)


class RecordedRun(RunReadings):
    """A run with its history; whoever inherits it provides ``rows``.

    Attributes:
        rows: the rows so far.
    """

    rows: Rows

    @property
    def history(self) -> History:
        """The rows recorded so far by column, as those of history.csv: by ``record``, ``run(record=...)`` and ``run_scene``.

        ``pandas.DataFrame(dict(sim.history))`` is the whole table.
        """
        scene, table = self.live.model.scene, self.rows.table()
        headers = [column.header for column in history_columns(scene)]
        table = table if len(table) else np.zeros((0, len(headers)))
        return History(scene.source, {header: table[:, k] for k, header in enumerate(headers)})

    def record(self) -> None:
        """Add a row of the present time to ``history``; one of the same time gives way."""
        columns = history_columns(self.live.model.scene)
        view = self.view if reads_grains(columns) else self.evaluated
        self.rows.add(history_row(columns, Readings(view, observation.observed(view))))
