"""Work-precision diagram: error of a measure against the time of the steps, a curve for each precision, a point for each step.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), II.10.
"""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpdem.drawing.curves import COLOURS
from warpdem.drawing.figure_file import DPI, require_drawable, write_figure
from warpdem.drawing.work_point import WorkPoint

SIZE = (7.2, 4.6)
"""Width and height [inch]."""
LEAST = 1e-16
"""Errors below are drawn here: a logarithmic axis has no zero."""


def draw_work_precision(
    points: Sequence[WorkPoint], out: Path, *, measure: str, relative: bool, asked: float, scatter: float | None, order: str
) -> None:
    """Draw the diagram.

    Args:
        points: runs, in any order.
        out: file to write: .png, .svg or .pdf.
        measure: what is measured.
        relative: whether errors are shares of the measure.
        asked: error asked for, as the errors of the points.
        scatter: largest error that chance gives a run, as the errors of the points; None where it is not known.
        order: words on the order of the error.

    Raises:
        WarpdemError: the file has no suffix that can be drawn.
    """
    require_drawable(out, DPI)
    figure = Figure(figsize=SIZE, layout="constrained")
    ax = figure.subplots()
    for k, precision in enumerate(sorted({one.precision for one in points})):
        of = sorted((one for one in points if one.precision == precision), key=lambda one: -one.step)
        times, errors = [one.seconds for one in of], [max(one.error, LEAST) for one in of]
        ax.plot(times, errors, "-", marker="os"[k % 2], color=COLOURS[k], label=f"{precision} precision", linewidth=1.4)
        for one, time, error in zip(of, times, errors, strict=True):
            ax.annotate(f"{one.step:.3g} s", (time, error), (6, -12 if k else 4), textcoords="offset points", fontsize="small")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.margins(0.2, 0.12)  # with room for the steps
    _levels(ax, asked, scatter, relative)
    ax.set_xlabel("time of the steps [s]")
    ax.set_ylabel("error of the measure over its value [-]" if relative else "error of the measure [its unit]")
    ax.set_title(f"{measure.replace('$', chr(92) + '$')}: {order}", fontsize="medium", loc="left", wrap=True)
    ax.grid(True, which="major", color="0.9")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize="small")
    write_figure(figure, out, DPI)


def _levels(ax: Axes, asked: float, scatter: float | None, relative: bool) -> None:
    """The error asked for as a line, and chance as an area below its bound."""
    words = f"{100.0 * asked:.3g} %" if relative else f"{asked:.3g}"
    ax.axhline(asked, color="0.35", linestyle="--", linewidth=1.0, label=f"asked: {words}")
    if scatter is not None and scatter > 0.0 and math.isfinite(scatter):
        low = min(ax.get_ylim()[0], 0.5 * scatter)
        ax.axhspan(low, scatter, color="0.9", zorder=0, label="chance: equal runs scatter so far")
        ax.set_ylim(bottom=low)
