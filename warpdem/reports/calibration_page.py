"""The page of a calibration: values with errors, targets and what was met, runs against each parameter."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.reports.chart import Chart
from warpdem.reports.charts import MOST
from warpdem.reports.document import document, write_page
from warpdem.reports.html import Node, el, table

PAGE = "calibration.html"


def write_calibration_page(
    folder: Path, title: str, result: Mapping[str, Any], values: np.ndarray, measures: np.ndarray, scenes: Sequence[str]
) -> Path:
    """Write calibration.html.

    Args:
        folder: of the calibration.
        title: what was calibrated.
        result: what calibration.json holds.
        values: values of the parameters in each run, shape (n, p).
        measures: measures of each target in each run, nan for none, shape (n, targets).
        scenes: files with the best values, relative to the folder.
    """
    parameters, targets = result["parameters"], result["targets"]
    percent = f"{100.0 * result['confidence']:g} %"
    rows: list[list[Node | str | float | None]] = [
        [one["name"], one["value"], one["low"], one["high"], one["error"], one["unit"],
         "yes" if one["known"] else "no", f"{100.0 * one['simulated']:.0f} %"] for one in parameters
    ]  # fmt: skip
    head = ["parameter", "value", f"from ({percent})", "to", "standard error", "unit", "determined", "by chance in runs"]
    found = [table("Values and errors of the parameters", head, rows)]
    if result["notes"]:
        found.append(el("ul", *(el("li", note) for note in result["notes"]), class_="warnings"))
    links = [el("li", el("a", path, href=path)) for path in scenes]
    found.append(el("p", "Scenes with these values:"))
    found.append(el("ul", *links))
    rows = [[one["name"], one["target"], one["uncertainty"], one["fitted"], one["off"], one["scatter"], one["checked"],
             float(one["checks"])] for one in targets]  # fmt: skip
    head = ["target", "value", "uncertainty", "fitted", "off / uncertainty", "scatter of a run", "last runs", "number"]
    met = [table("What was measured and what the runs give", head, rows)]
    if result["chance"] is not None:
        met.append(el("p", f"Probability that a model which meets the targets is off by so much: {result['chance']:.2g}."))
    body: list[tuple[str, Sequence[Node]]] = [("Parameters", found), ("Targets", met)]
    if len(parameters) > 1:
        names = [one["name"] for one in parameters]
        lines: list[list[Node | str | float | None]] = [
            [name, *row] for name, row in zip(names, result["correlation"], strict=True)
        ]
        body.append(("Correlation", [table("Correlation of the errors", ["parameter", *names], lines)]))
    number, charts = itertools.count(), []
    for a, one in enumerate(parameters):
        order = np.argsort(values[:, a], kind="stable")
        unit = f" [{one['unit']}]" if one["unit"] else ""
        for t, target in enumerate(targets):
            curves = {"runs": measures[order, t], "target": np.full(len(order), target["target"])}
            charts.append(Chart(f"{target['name']} against {one['name']}", "-", values[order, a], curves,
                                one["name"] + unit, dots=True))  # fmt: skip
    drawn = [chart.figure(f"chart-{next(number)}") for chart in charts[:MOST]]
    body.append(("Runs", drawn))
    line = f"{result['runs']} runs of each experiment in {len(result['rounds'])} rounds; {result['failed']} without a measure."
    return write_page(folder / PAGE, document(title, "calibration", [line], body))
