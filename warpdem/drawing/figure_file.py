"""Files that a figure is written to: .png, .svg and .pdf; the same figure gives the same bytes."""

from pathlib import Path
from typing import TYPE_CHECKING

from warpdem.core.atomic_file import replaced
from warpdem.errors import WarpdemError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
DPI = 150.0
"""Pixels in an inch of a .png if nothing else is asked for [1/inch]."""
NO_DATE = {"svg": "Date", "pdf": "CreationDate"}


def require_drawable(out: Path, dpi: float) -> None:
    """Refuse a file that no figure can be written to.

    Raises:
        WarpdemError: names what is allowed.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise WarpdemError(f"{out}: suffix {out.suffix!r} cannot be drawn; allowed are {', '.join(SUFFIXES)}")
    if not 20.0 <= dpi <= 1200.0:
        raise WarpdemError(f"dpi {dpi:g} must be from 20 to 1200")


def write_figure(figure: "Figure", out: Path, dpi: float) -> None:
    """Write a figure of Matplotlib.

    Args:
        figure: what is drawn.
        out: as `require_drawable`.
        dpi: pixels in an inch of a .png [1/inch].
    """
    from matplotlib import rc_context

    kind = out.suffix[1:].lower()
    # no date and no random names; text stays text, to be searched and edited
    with replaced(out) as part, rc_context({"svg.fonttype": "none", "svg.hashsalt": "warpdem"}):
        out.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(part, format=kind, dpi=dpi, metadata={} if kind == "png" else {NO_DATE[kind]: None})
