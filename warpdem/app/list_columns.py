"""The columns of histories in words: what ``warpdem plot --list`` prints."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from warpdem.runs import read


def print_columns(folders: Sequence[Path], patterns: Sequence[str], console: Console) -> None:
    """Print the columns of each run with their first, least, greatest and last values.

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
        table = Table("column", "first", "least", "greatest", "last", box=None, pad_edge=False)
        for header in history.matching(patterns) if patterns else history:
            values = history[header]
            known = values[np.isfinite(values)]
            if len(known):
                numbers = values[0], known.min(), known.max(), values[-1]
            else:
                numbers = (np.nan,) * 4
            table.add_row(Text(header), *(f"{value:.6g}" for value in numbers))
        console.print(table)
