"""The picture: the curves of each case above, the wall seconds of each setting below."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from bench.answer.cases import Case
from bench.answer.compare import Done, curves
from paper.common import save


def draw(found: dict[str, Case], runs: Sequence[Done], rows: Sequence[dict[str, Any]], labels: dict[str, str],
         path: Path) -> None:  # fmt: skip
    """Draw all cases that were run.

    Args:
        found: Cases by name.
        runs: Their runs.
        rows: Of `compare.costs`.
        labels: What each setting is called.
        path: PNG to write.
    """
    there = [name for name in found if any(run.case == name for run in runs)]
    settings = [s for s in labels if any(run.setting == s for run in runs)]
    colours = {s: f"C{k}" for k, s in enumerate(settings)}
    figure, grid = plt.subplots(
        2, len(there), figsize=(4.6 * len(there), 7), squeeze=False, height_ratios=(3, 2), layout="constrained"
    )
    for column, name in enumerate(there):
        case, axes = found[name], grid[0, column]
        mine = [run for run in runs if run.case == name]
        time = np.linspace(0.0, min(run.rows.time[-1] for run in mine), 301)
        for s in settings:
            group = [run for run in mine if run.setting == s]
            if not group:
                continue
            lines = curves(case, group, time)
            axes.fill_between(time, lines.min(axis=0), lines.max(axis=0), color=colours[s], alpha=0.25, lw=0)
            axes.plot(time, lines.mean(axis=0), color=colours[s], lw=1.2, label=f"{labels[s]} ({len(group)})")
        axes.set(title=f"{name}, {case.count} grains", xlabel="time [s]", ylabel=case.title)
        axes.legend(fontsize=7, title="mean and envelope of (runs)", title_fontsize=7)
        _bars(grid[1, column], [row for row in rows if row["case"] == name], settings, colours, labels)
    save(figure, path)


def _bars(
    axes: Axes, rows: list[dict[str, Any]], settings: list[str], colours: dict[str, str], labels: dict[str, str]
) -> None:
    """Wall seconds of a case, and how many times those of warpdem's own step they are."""
    order = sorted(rows, key=lambda row: (row["threads"], settings.index(row["setting"])))[::-1]
    axes.barh(range(len(order)), [row["wall"] for row in order], color=[colours[row["setting"]] for row in order])
    for k, row in enumerate(order):
        ratio = "" if row["over_own"] is None else f", {row['over_own']:.2f} x"
        axes.text(row["wall"], k, f" {row['wall']:.3g} s{ratio}", va="center", fontsize=7)
    axes.set_yticks(range(len(order)), [f"{labels[row['setting']]} on {row['threads']}" for row in order], fontsize=7)
    axes.set(xlabel="wall seconds to the answer", xlim=(0.0, 1.35 * max(row["wall"] for row in order)))
