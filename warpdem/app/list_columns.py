"""The columns of histories in words: what ``warpdem plot --list`` prints."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from warpdem.reports.chart import summary
from warpdem.runs import read


def print_columns(folders: Sequence[Path], patterns: Sequence[str], console: Console) -> None:
    """Print the columns of each run with their first, least, greatest, mean and last values.

    Args:
        folders: of the runs.
        patterns: only the columns that these name, as ``History.matching``; all if there are none.
        console: where to print.

    Raises:
        WarpdemError: a run cannot be read, or a pattern matches no column.
    """
    for folder in folders:
        history = read(folder).history
        console.print(f"{history.source}: {history.rows} rows", markup=False)
        table = Table("column", "first", "least", "greatest", "mean", "last", box=None, pad_edge=False)
        for header in history.matching(patterns) if patterns else history:
            table.add_row(Text(header), *(f"{value:.6g}" for value in summary(history[header])))
        console.print(table)
