"""Curves of history.csv: one panel per unit for a run, one per column for several runs over each other."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpdem.drawing.figure_file import DPI, require_drawable, write_figure
from warpdem.errors import WarpdemError
from warpdem.runs import History, read
from warpdem.runs.names import run_names

ENERGIES = ("kinetic", "rotational", "elastic", "potential")
"""Columns that are drawn if none are named."""
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Colours of Okabe and Ito, which people who see colours differently can distinguish; then each again with another dash."""
DASHES = ("-", "--", ":", "-.")
PANEL = (7.2, 2.9)
"""Width and height of a panel [inch]."""
MOST_PANELS = 24


def plot(
    folders: Path | str | Sequence[Path | str],
    out: Path | str,
    *,
    columns: Sequence[str] = (),
    x: str = "time",
    start: float | None = None,
    end: float | None = None,
    log: bool = False,
    dpi: float = DPI,
) -> Path:
    """Draw columns of history.csv as curves.

    Args:
        folders: Folder of a run, or folders of several, whose curves are drawn over each other.
        out: File to write: .png, .svg or .pdf.
        columns: Names of columns with or without unit, ``*`` and ``?`` stand for any signs; the energies if none are given.
        x: Column on the horizontal axis.
        start: Only rows from this value of ``x`` on [its unit].
        end: Only rows up to this value of ``x`` [its unit].
        log: Logarithmic vertical axes.
        dpi: Pixels in an inch of a .png [1/inch]; a panel is 7.2 inches wide.

    Returns:
        The file written.

    Raises:
        WarpdemError: A run cannot be read, has no such column or no row in the range, or the file cannot be drawn.
    """
    paths = [Path(folders)] if isinstance(folders, str | Path) else [Path(each) for each in folders]
    out = Path(out)
    if not paths:
        raise WarpdemError("no folder of results is given")
    require_drawable(out, dpi)
    runs = {name: read(path).history for name, path in zip(run_names(paths), paths, strict=True)}
    first = next(iter(runs.values()))
    headers = first.matching(columns or ENERGIES)
    for history in runs.values():
        for name in headers:
            history.header(name)  # refuses what one of them lacks
    between = -math.inf if start is None else start, math.inf if end is None else end
    write_figure(drawn(runs, headers, x, between, log), out, dpi)
    return out


def drawn(runs: dict[str, History], headers: Sequence[str], x: str, between: tuple[float, float], log: bool) -> Figure:
    """The figure: curves of ``headers`` against ``x`` for each run by its name, with ``x`` in the range ``between``."""
    first = next(iter(runs.values()))
    panels: dict[str, list[str]] = {}
    for header in headers:
        panels.setdefault(header if len(runs) > 1 else first.unit(header), []).append(header)
    if len(panels) > MOST_PANELS:
        raise WarpdemError(f"{len(panels)} panels would be drawn, at most {MOST_PANELS}: name fewer columns")
    figure = Figure(figsize=(PANEL[0], 0.5 + PANEL[1] * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (title, named) in zip(axes, panels.items(), strict=True):
        curves = [(header, name) for header in named for name in runs]
        for k, (header, name) in enumerate(curves):
            history = runs[name]
            inside = (history[x] >= between[0]) & (history[x] <= between[1])
            if not inside.any():
                low, high = between
                raise WarpdemError(f"{history.source}: has no row from {low:g} to {high:g} of {history.header(x)!r}")
            label = name if len(runs) > 1 else header.rpartition(" [")[0]
            _line(ax, history[x][inside], history[header][inside], k, label, log)
        ax.set_ylabel(title if len(runs) > 1 else (named[0] if len(named) == 1 else f"[{title}]"))
        ax.grid(True, color="0.9")
        ax.spines[["top", "right"]].set_visible(False)
        if log:
            ax.set_yscale("log")
        if len(curves) > 1:
            ax.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[-1].set_xlabel(first.header(x))
    return figure


def _line(ax: Axes, x: np.ndarray, y: np.ndarray, k: int, label: str, log: bool) -> None:
    if log and not (y > 0.0).any():
        raise WarpdemError(f"{label!r} has no value above 0, and cannot be drawn on a logarithmic axis")
    few = len(x) < 3  # which a line alone would not show
    style = DASHES[k // len(COLOURS) % len(DASHES)]
    ax.plot(x, y, style, color=COLOURS[k % len(COLOURS)], label=label, linewidth=1.4, marker="o" if few else None)
