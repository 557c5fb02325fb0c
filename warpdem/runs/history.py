"""history.csv as columns: NumPy arrays by name, with or without their unit."""

from __future__ import annotations

import csv
import fnmatch
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from warpdem.core.nearest import nearest
from warpdem.errors import WarpdemError

TIME = "time [s]"
"""The column that orders the rows."""


class NoColumn(WarpdemError, KeyError):
    """The history has no such column: the message names the file and what there is."""

    __str__ = Exception.__str__  # that of KeyError would put the message in quotes


class History(Mapping[str, np.ndarray]):
    """Rows of a run's history by column: ``history["kinetic [J]"]``, or ``history["kinetic"]`` without the unit.

    It iterates over its headers, so that ``pandas.DataFrame(dict(history))`` and ``polars.DataFrame(dict(history))`` are the
    whole table.

    Args:
        source: where it comes from, for messages.
        columns: the numbers of each column [its unit] by header, all of one length.
    """

    def __init__(self, source: str, columns: Mapping[str, np.ndarray]) -> None:
        self.source = source
        self._columns = dict(columns)
        self._short: dict[str, list[str]] = {}
        for header in self._columns:
            self._short.setdefault(header.rpartition(" [")[0] or header, []).append(header)

    def header(self, name: str) -> str:
        """The header, with its unit, of a column that is named with or without it.

        Raises:
            NoColumn: there is no such column, or several have this name with different units.
        """
        if name in self._columns:
            return name
        found = self._short.get(name, [])
        if len(found) > 1:
            raise NoColumn(f"{self.source}: {name!r} may be {' or '.join(map(repr, found))}: give the unit too")
        if not found:
            hint = nearest(name, list(self._short)) or f"; there are {', '.join(map(repr, self._columns)) or 'none'}"
            raise NoColumn(f"{self.source}: has no column {name!r}{hint}")
        return found[0]

    def unit(self, name: str) -> str:
        """Unit of a column; ``-`` for a pure number."""
        return self.header(name).rpartition(" [")[2].rstrip("]")

    def matching(self, patterns: Sequence[str]) -> list[str]:
        """Headers that the patterns name, in the order of the patterns: whole names or with ``*`` and ``?``, unit or not.

        Raises:
            NoColumn: a pattern matches no column.
        """
        found: dict[str, None] = {}
        for pattern in patterns:
            if not any(sign in pattern for sign in "*?"):
                found[self.header(pattern)] = None
                continue
            # brackets stand around units: they are no sets of characters here
            literal = pattern.replace("[", "[[]")
            shorts = {header: short for short, headers in self._short.items() for header in headers}
            hits = [h for h in self._columns if fnmatch.fnmatchcase(h, literal) or fnmatch.fnmatchcase(shorts[h], literal)]
            if not hits:
                raise NoColumn(f"{self.source}: no column matches {pattern!r}; there are {', '.join(map(repr, self._columns))}")
            found |= dict.fromkeys(hits)
        return list(found)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self._columns.values()), ()))

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns[self.header(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __contains__(self, name: object) -> bool:
        return name in self._columns or len(self._short.get(str(name), ())) == 1

    def __repr__(self) -> str:
        names = [*self._columns]
        shown = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
        reach = f" to {self[TIME][-1]:.6g} s" if TIME in self._columns and self.rows else ""
        return f"<History of {self.source}: {self.rows} rows{reach}, {len(names)} columns: {shown}>"


def read_history(path: Path | str) -> History:
    """Read history.csv; a last row that a killed run left unfinished is dropped.

    Raises:
        WarpdemError: the file is missing, or no table of numbers with a header.
    """
    path = Path(path)
    try:
        whole = path.read_text(encoding="utf-8").rpartition("\n")[0]
    except (OSError, UnicodeDecodeError) as error:
        raise WarpdemError(f"{path}: cannot be read ({error})") from error
    header, _, body = whole.partition("\n")
    names = next(csv.reader([header]), [])
    if len(set(names)) < max(len(names), 1):
        raise WarpdemError(f"{path}: its first line is no header of a history: {header[:80]!r}")
    try:
        # of a file without rows loadtxt would warn
        table = np.loadtxt(io.StringIO(body), delimiter=",", ndmin=2) if body.strip() else np.zeros((0, len(names)))
    except ValueError as error:
        raise WarpdemError(f"{path}: is no table of numbers ({error})") from error
    if table.shape[1] != len(names):
        raise WarpdemError(f"{path}: its rows have {table.shape[1]} numbers, its header {len(names)} names")
    return History(str(path), {name: table[:, k] for k, name in enumerate(names)})


def joined(source: str, parts: Sequence[tuple[float, History]]) -> History:
    """The histories of phases as one in the time of all; a column that a phase lacks is not a number in its rows.

    Where one phase ends and the next begins, the row of the end stays.

    Args:
        source: where they come from, for messages.
        parts: time at which each begins [s], and its history.
    """
    names = list(dict.fromkeys(name for _, part in parts for name in part))
    columns: dict[str, list[np.ndarray]] = {name: [] for name in names}
    for k, (begin, part) in enumerate(parts):
        rows = np.ones(part.rows, dtype=bool) if k == 0 or TIME not in part else part[TIME] > 0.0
        for name in names:
            values = part[name][rows] if name in list(part) else np.full(int(rows.sum()), np.nan)
            columns[name].append(values + begin if name == TIME else values)
    return History(source, {name: np.concatenate(values) for name, values in columns.items()})
