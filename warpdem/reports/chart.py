"""A chart: curves over one axis as inline SVG, with the numbers behind it for the page's script, which shows them on hover."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warpdem.reports.html import Node, data, el, number, table

WIDTH, HEIGHT = 720, 250
LEFT, RIGHT, TOP, BOTTOM = 72, 12, 10, 38
"""Size of a chart and its margins [px]."""
POINTS = 600
"""Points of a chart, about: of more rows, the least and the greatest value of each curve in each stretch are drawn."""
CURVES = 8
"""Curves of a chart at most: as many colours there are."""


@dataclass(frozen=True)
class Chart:
    """Curves over one axis."""

    title: str
    """What it shows."""
    unit: str
    """Unit of all curves; ``-`` for pure numbers."""
    x: np.ndarray
    """Values on the horizontal axis [x_unit], ascending, shape (rows,)."""
    curves: Mapping[str, np.ndarray]
    """Values of each curve [unit] by its name, shapes (rows,)."""
    x_title: str = "time [s]"
    dots: bool = False
    """Whether values are dots by themselves instead of points of curves."""

    def figure(self, key: str) -> Node:
        """The chart as an element of a page.

        Args:
            key: id of the element, the only one of this name on the page.
        """
        rows = kept_rows(list(self.curves.values()))
        x, curves = self.x[rows], {name: values[rows] for name, values in self.curves.items()}
        across = span([x])
        up = widened(*span(list(curves.values())))
        unit = "" if self.unit == "-" else f" [{self.unit}]"
        svg = el("svg", viewBox=f"0 0 {WIDTH} {HEIGHT}", role="img", aria_labelledby=f"{key}-title")
        svg.append(el("title", f"{self.title}{unit} against {self.x_title}", id=f"{key}-title"))
        _grid(svg, across, up, self.x_title)
        for k, values in enumerate(curves.values()):
            places = _at_x(x, across), _at_y(values, up)
            drawn = _dots(*places) if self.dots else _path(*places)
            svg.append(el("path", class_=f"{'dots' if self.dots else 'curve'} c{k}", d=drawn))
        svg.append(el("line", class_="cursor", x1=0, x2=0, y1=TOP, y2=HEIGHT - BOTTOM))
        legend = el("ul", *(el("li", el("span", class_=f"key k{k}"), name) for k, name in enumerate(curves)), class_="legend")
        numbers = table(f"{self.title}{unit}", ["curve", "first", "least", "greatest", "mean", "last"],
                        [[name, *summary(values)] for name, values in self.curves.items()])  # fmt: skip
        shown = data({
            "x": [_rounded(value) for value in x], "range": [_rounded(value) for value in across],
            "curves": [[name, [_rounded(value) for value in values]] for name, values in curves.items()],
            "frame": [LEFT, WIDTH - RIGHT, WIDTH],
        })  # fmt: skip
        return el(
            "figure",
            el("figcaption", el("strong", self.title), unit),
            legend,
            el("div", svg, class_="plot", tabindex=0, role="group",
               aria_label=f"{self.title}: arrow keys step through the values"),
            el("output", "\u00a0", class_="readout"),
            el("details", el("summary", "Numbers"), numbers),
            shown,
            class_="chart", id=key,
        )  # fmt: skip


def summary(values: np.ndarray) -> list[float]:
    """First, least, greatest, mean and last of values; nan for those that are none."""
    known = values[np.isfinite(values)]
    if not len(known):
        return [math.nan] * 5
    return [float(v) for v in (values[0], known.min(), known.max(), known.mean(), values[-1])]


def kept_rows(curves: list[np.ndarray]) -> np.ndarray:
    """Rows to draw: all, or of many the ends and the least and greatest of each curve in each stretch, shape (k,)."""
    count = len(curves[0])
    if count <= POINTS:
        return np.arange(count)
    stretches = np.array_split(np.arange(count), max(1, POINTS // (2 * len(curves))))
    kept = {0, count - 1}
    for values in curves:
        low, high = (np.where(np.isfinite(values), values, fill) for fill in (np.inf, -np.inf))
        for stretch in stretches:
            kept |= {int(stretch[low[stretch].argmin()]), int(stretch[high[stretch].argmax()])}
    return np.array(sorted(kept))


def span(curves: list[np.ndarray]) -> tuple[float, float]:
    """Least and greatest finite value of curves; 0 and 1 if there is none."""
    known = np.concatenate(curves)
    known = known[np.isfinite(known)]
    return (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)


def widened(low: float, high: float) -> tuple[float, float]:
    """Ends of the vertical axis: 5 % of room, zero included where it is near, and some height for a constant."""
    if 0.0 < low < 0.4 * high:
        low = 0.0
    elif low < 0.4 * high < 0.0 or 0.4 * low < high < 0.0:
        high = 0.0
    largest = max(abs(low), abs(high))
    if high - low <= max(1e-12 * largest, 1e-300):  # what differs by round-off alone is a level line
        room = 0.5 * largest if largest > 1e-300 else 1.0
        return low - room, high + room
    room = 0.05 * (high - low)
    return low - room * (low != 0.0), high + room * (high != 0.0)


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round values from ``low`` to ``high``, ``most`` of them at most, at steps of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return [low]
    size = 10.0 ** math.floor(math.log10((high - low) / most))
    step = next(f * size for f in (1.0, 2.0, 5.0, 10.0, 20.0) if (high - low) / (f * size) <= most)
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def _at_x(x: np.ndarray, across: tuple[float, float]) -> np.ndarray:
    width = across[1] - across[0] or 1.0
    return LEFT + (WIDTH - LEFT - RIGHT) * (x - across[0]) / width


def _at_y(values: np.ndarray, up: tuple[float, float]) -> np.ndarray:
    return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (values - up[0]) / (up[1] - up[0])


def _dots(x: np.ndarray, y: np.ndarray) -> str:
    """An SVG path of strokes so short that their round ends are dots."""
    return "".join(f"M{a:.1f} {b:.1f}h0.1" for a, b in zip(x, y, strict=True) if math.isfinite(b)) or "M0 0"


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """An SVG path, broken where a value is not finite."""
    parts, pen = [], "M"
    for a, b in zip(x, y, strict=True):
        if math.isfinite(b):
            parts.append(f"{pen}{a:.1f} {b:.1f}")
            pen = "L"
        else:
            pen = "M"
    if len(parts) == 1:
        parts.append("h0.1")  # a dot, by its round ends
    return "".join(parts) or "M0 0"


def _grid(svg: Node, across: tuple[float, float], up: tuple[float, float], x_title: str) -> None:
    bottom = HEIGHT - BOTTOM
    for value in ticks(*up, 5):
        y = f"{float(_at_y(np.array(value), up)):.1f}"
        svg.append(el("line", class_="grid", x1=LEFT, x2=WIDTH - RIGHT, y1=y, y2=y))
        svg.append(el("text", number(value, 6), x=LEFT - 8, y=y, dy="0.32em", class_="end"))
    for value in ticks(*across, 8):
        x = f"{float(_at_x(np.array(value), across)):.1f}"
        svg.append(el("line", class_="axis", x1=x, x2=x, y1=bottom, y2=bottom + 4))
        svg.append(el("text", number(value, 6), x=x, y=bottom + 16, class_="middle"))
    svg.append(el("line", class_="axis", x1=LEFT, x2=WIDTH - RIGHT, y1=bottom, y2=bottom))
    svg.append(el("text", x_title, x=(LEFT + WIDTH - RIGHT) / 2, y=HEIGHT - 4, class_="middle"))


def _rounded(value: float) -> float | None:
    return float(f"{value:.5g}") if math.isfinite(value) else None
