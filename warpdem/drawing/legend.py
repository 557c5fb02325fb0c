"""What is written over a picture: scale bars, time, axes and names of the panes, typeset by Matplotlib."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from warpdem.drawing.colours import CATEGORIES, Scale
from warpdem.drawing.ruler import Ruler

_DPI = 72  # so that a point is a pixel
_LETTER, _BOLD_LETTER = 0.55, 0.68
"""Mean width of a letter over the size of the text [-]."""
_AXES = {"x": "#c0392b", "y": "#2e8b57", "z": "#2c6fbb"}


@dataclass(frozen=True)
class Bar:
    """One scale bar."""

    scale: Scale
    title: str
    names: tuple[str, ...] = ()
    """Names of the categories of a categorical field; those beyond the names are shown by number."""


@dataclass(frozen=True)
class Pane:
    """What is written over one of the pictures side by side."""

    heading: str
    """Bold line, such as the time."""
    lines: str
    """What stands below it in grey."""
    axes: np.ndarray
    """Right, up and forward direction of its camera as rows, shape (3, 3)."""
    ruler: Ruler | None = None
    """Bar at its lower edge."""


def font_size(height: int) -> float:
    """Size of the text in a picture of ``height`` pixels [pixel]."""
    return max(5.0, height / 46.0)


def bar_width(height: int) -> int:
    """Width of the column of the scale bars [pixel]."""
    return round(7.2 * font_size(height))


def heading(name: str, time: str, width: float, height: int) -> str:
    """Bold line of a pane: its name, if it has one, and the time; a name that does not fit is shortened in its middle.

    Args:
        name: Name of the run, may be empty.
        time: The time as text.
        width: Width of the pane [pixel].
        height: Height of the picture [pixel].
    """
    if not name:
        return time
    letters = max(int(width / (_BOLD_LETTER * font_size(height))) - len(time) - 4, 3)
    if len(name) > letters:
        # runs of a series differ at the end of their names
        name = f"{name[: letters // 3]}…{name[len(name) - (letters - letters // 3 - 1) :]}"
    return f"{name}   {time}"


def ink_on(background: str) -> str:
    """Colour of text and lines that can be read on a background."""
    return "#2b2f33" if np.dot(to_rgb(background), (0.299, 0.587, 0.114)) > 0.45 else "#e8eaec"


class Legend:
    """Writes over one picture after another; only what changes with time is drawn again."""

    def __init__(self, size: tuple[int, int], bars: list[Bar], panes: int, background: str) -> None:
        self._size, self._panes = size, panes
        self._font, self._column = font_size(size[1]), bar_width(size[1])
        self._ink = ink_on(background)
        figure = self._figure()
        for k, bar in enumerate(bars):
            self._draw_bar(figure, bar, k, len(bars))
        self._bars = _pixels(figure)

    def draw(self, image: np.ndarray, panes: list[Pane]) -> np.ndarray:
        """The image with everything written over it, shape (height, width, 3), uint8."""
        figure = self._figure()
        width, height = self._size
        step = (width - self._column) / self._panes
        for k, pane in enumerate(panes):
            left, gap = k * step + 0.7 * self._font, 1.35 * self._font
            text: dict[str, Any] = {"transform": None, "va": "top", "ha": "left", "color": self._ink}
            figure.text(left, height - 0.6 * self._font, pane.heading, size=self._font, weight="bold", **text)
            figure.text(
                left, height - 0.6 * self._font - gap, pane.lines, size=0.78 * self._font, alpha=0.8, linespacing=1.3, **text
            )
            if pane.ruler is not None:
                self._draw_ruler(figure, (k + 1) * step - 1.5 * self._font, pane.ruler)
            self._draw_axes(figure, (k * step + 2.6 * self._font, 2.6 * self._font), pane.axes)
        return _over(_over(image, self._bars), _pixels(figure))

    def _figure(self) -> Figure:
        figure = Figure(figsize=(self._size[0] / _DPI, self._size[1] / _DPI), dpi=_DPI)
        figure.patch.set_alpha(0.0)
        FigureCanvasAgg(figure)
        return figure

    def _draw_bar(self, figure: Figure, bar: Bar, k: int, count: int) -> None:
        width, height = self._size
        font, column = self._font, self._column
        length = (0.62 if count == 1 else 0.76 / count) * height
        middle = height * (1.0 - (k + 0.5) / count)
        if bar.scale.field.is_category:
            categories = bar.scale.categories
            names = [bar.names[n] if n < len(bar.names) else str(n) for n in categories]
            handles = [
                Patch(facecolor=CATEGORIES[n % len(CATEGORIES)], label=_short(name))
                for n, name in zip(categories, names, strict=True)
            ]
            figure.legend(
                handles=handles[:24], title=bar.title, loc="center left", fontsize=0.8 * font, frameon=False,
                title_fontsize=0.85 * font, bbox_to_anchor=((width - column) / width, middle / height), labelcolor=self._ink,
                handlelength=1.0, handleheight=1.0, alignment="left",
            ).get_title().set_color(self._ink)  # fmt: skip
            return
        rectangle = ((width - column + 0.6 * font) / width, (middle - 0.5 * length) / height, font / width, length / height)
        axes = figure.add_axes(rectangle)
        colours = ScalarMappable(Normalize(*bar.scale.limits), bar.scale.map)
        form = ScalarFormatter(useMathText=True)
        form.set_powerlimits((-2, 4))
        ticks = MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
        drawn = figure.colorbar(colours, cax=axes, extend=bar.scale.beyond, extendfrac=0.04, format=form, ticks=ticks)
        drawn.outline.set_linewidth(0.05 * font)
        drawn.outline.set_edgecolor(self._ink)
        axes.tick_params(labelsize=0.8 * font, colors=self._ink, width=0.05 * font, length=0.25 * font)
        axes.yaxis.get_offset_text().set(size=0.8 * font, color=self._ink, ha="left")
        axes.yaxis.set_offset_position("left")
        size = min(0.85 * font, length / (_LETTER * max(len(bar.title), 1)))  # no longer than the bar
        axes.set_ylabel(bar.title, size=size, color=self._ink, labelpad=0.35 * font)

    def _draw_ruler(self, figure: Figure, right: float, ruler: Ruler) -> None:
        """A bar with a stop at each end, and its length above it."""
        left, low, stop = right - ruler.pixels, 1.6 * self._font, 0.35 * self._font
        path = [left, left, left, right, right, right], [low - stop, low + stop, low, low, low - stop, low + stop]
        line = Line2D(*path, color=self._ink, lw=0.14 * self._font, transform=None)
        line.set_solid_joinstyle("miter")
        figure.add_artist(line)
        middle, style = 0.5 * (left + right), {"transform": None, "color": self._ink, "ha": "center", "va": "bottom"}
        figure.text(middle, low + 0.5 * self._font, ruler.words, size=0.85 * self._font, **style)  # type: ignore[arg-type]

    def _draw_axes(self, figure: Figure, middle: tuple[float, float], axes: np.ndarray) -> None:
        """The three directions of the view's axes, seen by the camera."""
        right, up, forward = axes
        for k in np.argsort(-forward):  # the nearest last
            name, colour = list(_AXES.items())[k]
            arrow = 1.7 * self._font * np.array([right[k], up[k]])
            if np.linalg.norm(arrow) < 0.3 * self._font:
                continue  # the axis points at the camera
            tip = np.array(middle) + arrow
            line = Line2D([middle[0], tip[0]], [middle[1], tip[1]], color=colour, lw=0.12 * self._font, transform=None)
            line.set_solid_capstyle("round")
            figure.add_artist(line)
            at = tip + 0.45 * self._font * arrow / np.linalg.norm(arrow)
            style: dict[str, Any] = {"transform": None, "color": colour, "ha": "center", "va": "center"}
            figure.text(float(at[0]), float(at[1]), name, size=0.75 * self._font, **style)


def _short(name: str) -> str:
    return name if len(name) <= 12 else f"{name[:11]}…"


def _pixels(figure: Figure) -> np.ndarray:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.asarray(canvas.buffer_rgba()).copy()  # type: ignore[no-untyped-call]


def _over(image: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """The layer, shape (h, w, 4), over the image, shape (h, w, 3); uint8."""
    shown = layer[..., 3] > 0
    out = image.copy()
    length = layer[shown][:, 3:].astype(float) / 255.0
    out[shown] = np.round(length * layer[shown][:, :3] + (1.0 - length) * image[shown]).astype(np.uint8)
    return out
