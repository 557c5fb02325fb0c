"""Writes the report of a run: reads its folder, puts the sections on a page, and the page into one file."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

from warpdem.drawing.style import Preset
from warpdem.errors import WarpdemError
from warpdem.reports import pictures, sections
from warpdem.reports.charts import MOST, charts_of
from warpdem.reports.document import document, page_file, write_page
from warpdem.reports.html import Node, el
from warpdem.runs import History, Run, read
from warpdem.runs.run import RECORD

NAME = "report.html"
"""File of the report in the folder of the run."""


def report(
    folder: Path | str,
    out: Path | str | None = None,
    *,
    draw: bool = True,
    camera: Preset = "auto",
    watch: Callable[[str], None] = lambda message: None,
) -> Path:
    """Write the report of a run: one HTML page that needs no network and no file beside it.

    Args:
        folder: Folder of the results; the run may be unfinished.
        out: File to write; ``report.html`` in the folder if not given.
        draw: Whether frames are drawn, which takes seconds each.
        camera: Side from which they are, as ``render`` has it.
        watch: Called with what is being done, where that takes seconds.

    Returns:
        The file written.

    Raises:
        WarpdemError: There is no run in the folder, or one of its files cannot be read.
    """
    run = read(folder)
    target = page_file(run.folder / NAME if out is None else Path(out))
    return write_page(target, page(run, draw, camera, watch))


def page(run: Run, draw: bool, camera: Preset, watch: Callable[[str], None]) -> Node:
    """The whole page as a tree."""
    body: list[tuple[str, list[Node]]] = []
    last = run.last
    body.append(("Overview", sections.overview(last)))
    body.append(("Warnings", sections.warnings(last)))
    shown = pictures.pictures(run, watch, camera) if draw else []
    film = pictures.film(run)
    grid = [el("div", *shown, class_="pictures")] if shown else []
    body.append(("Pictures", [*grid, *([film] if film is not None else [])]))
    history, broken = _history(run)
    if history is not None and history.rows:
        body += _curves(history, _walls(run, history))
    elif broken:
        body.append(("History", [el("p", broken)]))
    for number, one in enumerate(run.phases or (run,), 1):
        name = f"Phase {number}, {one.record.get('title') or one.folder.name}: " if run.phases else ""
        record = one.record
        body.append((f"{name}Scene", sections.scene(record)))
        body.append((f"{name}Time step", sections.time_step(record)))
        body.append((f"{name}What was run", sections.plan(record) + sections.flows(record) + sections.timings(record)))
    body.append(("Methods and citation", sections.method_text(last)))
    body.append(("Versions", sections.origin(last)))
    record, status = run.record, run.status
    when = datetime.fromtimestamp((run.folder / RECORD).stat().st_mtime, UTC).strftime("%Y-%m-%d %H:%M UTC")
    badge = el("span", status, class_=f"status {'good' if status == 'done' else 'bad'}")
    line: list[Node | str] = [badge, f" {record.get('scene') or ''}, {when}"]
    title = str(record.get("title") or record.get("scene") or run.folder.name)
    return document(title, "report of a run", line, [(name, nodes) for name, nodes in body if nodes])


def _history(run: Run) -> tuple[History | None, str]:
    """The history, or why there is none."""
    try:
        return run.history, ""
    except WarpdemError as error:
        return None, str(error)


def _walls(run: Run, history: History) -> list[str]:
    """Names of the walls of all phases, whose columns begin with them."""
    names: dict[str, None] = {}
    for one in run.phases or (run,):
        given = one.record.get("scene_data")
        if isinstance(given, Mapping):
            names |= dict.fromkeys(str(wall["name"]) for wall in given.get("walls", ()))
    if names:
        return list(names)
    return [header.removesuffix(" force x [N]") for header in history if header.endswith(" force x [N]")]


def _curves(history: History, walls: list[str]) -> list[tuple[str, list[Node]]]:
    """Sections of the history: energy, walls, grains, measures."""
    charts = charts_of(history, walls)
    keys = (f"chart-{number}" for number in itertools.count())
    room = MOST
    dropped: list[str] = []
    made: dict[str, list[Node]] = {}
    for name, found in charts.items():
        made[name] = [chart.figure(next(keys)) for chart in found[:room]]
        dropped += [chart.title for chart in found[room:]]
        room -= len(made[name])
    if dropped:
        words = f"{len(dropped)} more charts are not drawn ({'; '.join(dropped)}): see history.csv, or warpdem plot."
        made["measures"].append(el("p", words))
    return [
        ("Energy", made["energy"] + sections.energy_budget(history)),
        ("Walls", sections.wall_loads(history, walls) + made["walls"]),
        ("Grains", made["grains"]),
        ("Measures", made["measures"]),
    ]
