"""What ``warpdem compare`` says of two runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from warpdem.app.twins import make_twins
from warpdem.errors import SceneError
from warpdem.output.write_tables import plain
from warpdem.reports.comparison import VERDICTS
from warpdem.runs import read
from warpdem.runs.compare import Comparison, Difference, compare


def compared(
    first: Path,
    second: Path,
    *,
    twin: Sequence[Path] = (),
    twins: int = 0,
    columns: Sequence[str] = (),
    start: float | None = None,
    end: float | None = None,
    device: str | None = None,
    threads: int | None = None,
    plugins: Sequence[Path] = (),
    console: Console,
) -> tuple[Comparison, int]:
    """Compare the runs in two folders; makes twins of the first if asked.

    Args:
        first: folder of the run to compare with.
        second: folder of the other one.
        twin: folders of twins of the first.
        twins: number of twins to make, or to find made already, in its folder.
        columns: as ``warpdem.runs.compare.compare``.
        start: as there.
        end: as there.
        device: of the twins, as ``Simulation``.
        threads: of the twins, as ``Simulation``.
        plugins: .py files with models of your own that the scene names.
        console: where to print which twin is run.

    Returns:
        What was found, and the number of twins.

    Raises:
        WarpdemError: a run cannot be read, compared or repeated.
    """
    if not 0 <= twins <= 1000:
        raise SceneError(f"--twins {twins}: must be from 0 to 1000")
    runs = read(first), read(second)
    a, b = (run.history for run in runs)
    compare(a, b, (), columns, start, end)  # refuses what cannot be compared before twins are run
    folders = [*twin, *(make_twins(runs[0], twins, console, device, threads, plugins) if twins else ())]
    others = [read(folder).history for folder in folders]
    return compare(a, b, others, columns, start, end), len(others)


def as_data(found: Comparison, twins: int) -> dict[str, Any]:
    """A comparison for programs: what JSON can hold, infinite numbers as null."""
    each = [{**asdict(one), "verdict": one.verdict} for one in found.differences]
    window = [found.time[0], found.time[-1]]
    only = {"only_first": found.only_first, "only_second": found.only_second}
    made: dict[str, Any] = plain({"verdict": found.verdict, "twins": twins, "columns": each, "window": window, **only})
    return made


def _verdict(one: Difference) -> str:
    """The verdict on a column; if that is "differs", with the number that decided."""
    return one.verdict + (f": {' and '.join(one.reasons)}" if one.reasons else "")


def print_comparison(found: Comparison, twins: int, names: tuple[str, str], console: Console) -> None:
    """A comparison for people."""
    table = Table(Column("column", overflow="fold"), box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for head in (*names, "off / scatter", "p", "curve / scatter", ""):
        table.add_column(head, no_wrap=bool(head))
    for one in found.differences:
        texts = ["-" if number is None else f"{number:.3g}" for number in (one.first, one.second, one.t, one.p, one.curve)]
        style = {"differs": "bold red", "unknown": "yellow"}.get(one.verdict, "")
        table.add_row(Text(one.column), *texts, Text(_verdict(one), style=style))
    console.print(f"means from {found.time[0]:.6g} to {found.time[-1]:.6g} s, {twins} twins of {names[0]}", markup=False)
    console.print(table)
    for name, only in zip(names, (found.only_first, found.only_second), strict=True):
        if only:
            console.print(f"only in {name}: {', '.join(only)}", markup=False)
    console.print(VERDICTS[found.verdict], style="bold")
    if found.verdict == "unknown" and not twins:
        console.print(f"--twins 4 makes four of {names[0]}, each as long a run as that", markup=False)
