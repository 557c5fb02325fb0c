"""What a page embeds: pictures drawn from the frames of a run, and a film that is there."""

from __future__ import annotations

import base64
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from warpdem.drawing.style import Preset
from warpdem.errors import WarpdemError
from warpdem.reports.html import Node, el, number
from warpdem.runs import Run

SIZE = (960, 720)
"""Width and height of a picture [px]."""
LARGEST_FILM = 60_000_000
"""Bytes of the largest film that is embedded [B]: browsers keep the whole page in memory."""


def pictures(run: Run, watch: Callable[[str], None] = lambda message: None, camera: Preset = "auto") -> list[Node]:
    """The first, the middle and the last frame as figures, from the side ``camera``; without frames picture.png, if there.

    Raises:
        WarpdemError: a frame cannot be read.
    """
    try:
        times = run.frames.times
    except WarpdemError:
        there = run.folder / "picture.png"
        return [_figure(there.read_bytes(), "The last frame.", SIZE)] if there.exists() else []
    from warpdem.drawing.rendering import render

    shown = sorted({0, (len(times) - 1) // 2, len(times) - 1})
    figures = []
    with TemporaryDirectory(prefix="warpdem-report-") as made:
        for k in shown:
            watch(f"drawing the frame at {times[k]:.4g} s")
            file = render(run.folder, Path(made) / "picture.png", time=float(times[k]), size=SIZE, camera=camera)
            figures.append(_figure(file.read_bytes(), f"At {number(float(times[k]))} s, seen from the laboratory.", SIZE))
    return figures


def film(run: Run) -> Node | None:
    """A film (.mp4) of the folder, film.mp4 before others; None if there is none. A large one is linked to, beside the page."""
    there = sorted(run.folder.glob("*.mp4"), key=lambda path: (path.name != "film.mp4", path.name))
    if not there:
        return None
    path = there[0]
    if path.stat().st_size > LARGEST_FILM:
        size = f"{path.stat().st_size / 1e6:.0f} MB, too large for the page"
        return el("p", "Film: ", el("a", path.name, href=path.name), f" beside this page ({size}).")
    source = f"data:video/mp4;base64,{base64.b64encode(path.read_bytes()).decode()}"
    video = el("video", controls="", muted="", preload="metadata", src=source, aria_label="Film of the run, without sound")
    return el("figure", video, el("figcaption", f"{path.name}, without sound."))


def _figure(png: bytes, caption: str, size: tuple[int, int]) -> Node:
    source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    image = el("img", src=source, alt=f"Picture of the grains. {caption}", width=size[0], height=size[1])
    return el("figure", image, el("figcaption", caption))
