"""The page of a sweep: its table, and every result against every key that was varied by numbers."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from warpdem.reports.chart import Chart
from warpdem.reports.charts import MOST
from warpdem.reports.document import document, write_page
from warpdem.reports.html import Node, el, table

PAGE = "sweep.html"
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def write_sweep_page(
    folder: Path,
    title: str,
    rows: Sequence[Mapping[str, str]],
    results: Sequence[Mapping[str, float]],
    states: Sequence[tuple[str, str]],
) -> Path:
    """Write sweep.html.

    Args:
        folder: of the sweep.
        title: what was varied.
        rows: values of each row by key.
        results: results of each row by name.
        states: status of each row, and why it failed.
    """
    keys = list(dict.fromkeys(key for row in rows for key in row))
    names = list(results[0])
    done = sum(status == "done" for status, _ in states)
    lines: list[list[Node | str | float | None]] = []
    for k, (row, found, (status, why)) in enumerate(zip(rows, results, states, strict=True), 1):
        given: list[Node | str | float | None] = [row.get(key) or None for key in keys]
        link: Node | str = el("a", "run", href=f"{k:04d}/") if status != "wrong" else "wrong"
        lines.append([str(k), *given, *(found[name] for name in names), status, link, why])
    body = [("Rows", [table("All rows", ["row", *keys, *names, "status", "folder", "why"], lines)])]
    charts = []
    for key in keys:
        x = np.array([_number(row.get(key, "")) for row in rows])
        if np.isfinite(x).sum() < 2 or len(np.unique(x[np.isfinite(x)])) < 2:
            continue
        order = np.argsort(x)
        order = order[np.isfinite(x[order])]
        for name in names:
            y = np.array([found[name] for found in results])
            if np.isfinite(y[order]).any():
                charts.append(Chart(f"{name} against {key}", "-", x[order], {name: y[order]}, key, dots=True))
    number = itertools.count()
    drawn = [chart.figure(f"chart-{next(number)}") for chart in charts[:MOST]]
    if len(charts) > MOST:
        drawn.append(el("p", f"{len(charts) - MOST} more charts are not drawn: see sweep.csv."))
    if drawn:
        body.append(("Results", drawn))
    line = f"{done} of {len(rows)} rows are done."
    return write_page(folder / PAGE, document(title, "sweep", [line], body))


def _number(text: str) -> float:
    """The number that a value is, without its unit; nan if it begins with none."""
    found = NUMBER.match(text.strip().strip("\"'"))
    return float(found[0]) if found else float("nan")
