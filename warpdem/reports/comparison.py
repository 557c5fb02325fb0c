"""The page of a comparison: the verdict, the table of all columns, and the curves with the band of the twins."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from warpdem.reports.chart import Chart
from warpdem.reports.charts import MOST
from warpdem.reports.document import document, page_file, write_page
from warpdem.reports.html import Node, el, table
from warpdem.runs.compare import FAR, LEVEL, Comparison, Difference

VERDICTS = {
    "same": "The runs are the same within the scatter of the twins.",
    "differs": "The runs differ by more than the scatter of the twins.",
    "unknown": "Whether the runs differ is unknown: there are no twins, or too few rows in which all runs have a number.",
}


def write_comparison(found: Comparison, names: tuple[str, str], twins: int, out: Path) -> Path:
    """Write the page of a comparison.

    Args:
        found: what was compared.
        names: of the two runs.
        twins: number of twins of the first.
        out: file to write.

    Raises:
        WarpdemError: its name does not end in .html.
    """
    page_file(out)
    first, second = names
    rows = [_row(one) for one in sorted(found.differences, key=_order)]
    head = ["column", first, second, "scatter", "difference / scatter", "p", "curve / scatter", "twins", "verdict"]
    words = (
        f"Means in time from {found.time[0]:.6g} to {found.time[-1]:.6g} s; of {first} with {twins} twins. p is the "
        "probability that equal runs are so far apart, corrected for the number of columns; below "
        f"{LEVEL:g} they differ. curve is the rms distance of the courses in time over the scatter of the twins, twins the "
        f"largest such distance of one of these; above {FAR:g} times that they differ. Rows in which "
        "a run has no number do not count."
    )
    body = [("Verdict", [el("p", VERDICTS[found.verdict]), table("All columns", head, rows), el("p", words)])]
    shown = sorted(found.differences, key=_order)
    body.append(("Curves", [_chart(found, one, names).figure(f"chart-{k}") for k, one in enumerate(shown[:MOST])]))
    rest = [one.column for one in shown[MOST:]]
    missing = [*found.only_first, *found.only_second, *rest]
    if missing:
        words = "Columns of one run alone, or beyond what a page holds: "
        body.append(("Not shown", [el("p", words, ", ".join(missing), ".")]))
    return write_page(out, document(f"{first} and {second}", "comparison of two runs", [VERDICTS[found.verdict]], body))


def _order(one: Difference) -> tuple[int, float]:
    """Columns that differ first."""
    return ("differs", "unknown", "same").index(one.verdict), one.p if one.p is not None else 1.0


def _row(one: Difference) -> list[Node | str | float | None]:
    return [one.column, one.first, one.second, one.scatter, one.t, one.p, one.curve, one.twins, one.verdict]


def _chart(found: Comparison, one: Difference, names: tuple[str, str]) -> Chart:
    name, _, unit = one.column.rpartition(" [")
    curves: dict[str, np.ndarray] = {names[0]: found.first[one.column][0], names[1]: found.second[one.column]}
    if len(found.first[one.column]) > 1:
        curves["least of it and its twins"] = found.first[one.column].min(axis=0)
        curves["greatest"] = found.first[one.column].max(axis=0)
    return Chart(name, unit.rstrip("]"), found.time, curves)
