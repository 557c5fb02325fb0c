"""Writes the report of a run: reads its folder, puts the sections on a page, and the page into one file."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import Any

from warpdem.core.atomic_file import replaced
from warpdem.errors import WarpdemError
from warpdem.reports import pictures, sections
from warpdem.reports.charts import MOST, charts_of
from warpdem.reports.html import Node, el, page_text, raw
from warpdem.runs import History, Run, read

NAME = "report.html"
"""File of the report in the folder of the run."""


def report(
    folder: Path | str,
    out: Path | str | None = None,
    *,
    draw: bool = True,
    watch: Callable[[str], None] = lambda message: None,
) -> Path:
    """Write the report of a run: one HTML page that needs no network and no file beside it.

    Args:
        folder: Folder of the results; the run may be unfinished.
        out: File to write; ``report.html`` in the folder if not given.
        draw: Whether frames are drawn, which takes seconds each.
        watch: Called with what is being done, where that takes seconds.

    Returns:
        The file written.

    Raises:
        WarpdemError: There is no run in the folder, or one of its files cannot be read.
    """
    run = read(folder)
    target = run.folder / NAME if out is None else Path(out)
    if target.suffix.lower() not in (".html", ".htm"):
        raise WarpdemError(f"{target}: a report is an HTML page; take a name that ends in .html")
    text = page_text(page(run, draw, watch))
    target.parent.mkdir(parents=True, exist_ok=True)
    with replaced(target) as part:
        part.write_text(text, encoding="utf-8")
    return target


def page(run: Run, draw: bool, watch: Callable[[str], None]) -> Node:
    """The whole page as a tree."""
    body: list[tuple[str, list[Node]]] = []
    last = run.last
    body.append(("Overview", sections.overview(last)))
    body.append(("Warnings", sections.warnings(last)))
    shown = pictures.pictures(run, watch) if draw else []
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
    return _document(run, [(title, nodes) for title, nodes in body if nodes])


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


def _document(run: Run, body: list[tuple[str, list[Node]]]) -> Node:
    record: Mapping[str, Any] = run.record
    title = str(record.get("title") or record.get("scene") or run.folder.name)
    when = datetime.fromtimestamp((run.folder / "run.json").stat().st_mtime, UTC).strftime("%Y-%m-%d %H:%M UTC")
    style, script = (resources.files("warpdem.reports").joinpath(name).read_text("utf-8") for name in ("page.css", "page.js"))
    head = el(
        "head",
        el("meta", charset="utf-8"),
        el("title", f"{title} \u2013 report of a run"),
        el("meta", name="viewport", content="width=device-width, initial-scale=1"),
        el("meta", name="generator", content="warpdem"),
        # the page may be sent on: whatever a scene's texts say, nothing is loaded from anywhere
        el("meta", http_equiv="Content-Security-Policy",
           content="default-src 'none'; img-src data:; media-src data: 'self' file:; style-src 'unsafe-inline'; "
                   "script-src 'unsafe-inline'"),
        raw("style", style),
    )  # fmt: skip
    status = run.status
    links = [el("li", el("a", name, href=f"#part-{k}")) for k, (name, _) in enumerate(body)]
    header = el(
        "header",
        el("h1", title),
        el("p", el("span", status, class_=f"status {'good' if status == 'done' else 'bad'}"),
           f" {record.get('scene') or ''}, {when}"),
        el("button", "Light or dark", type="button", id="theme"),
    )  # fmt: skip
    parts = [
        el("section", el("h2", name, id=f"part-{k}"), *nodes, aria_labelledby=f"part-{k}")
        for k, (name, nodes) in enumerate(body)
    ]
    contents = el("nav", el("ul", *links), aria_label="Contents")
    main = el("main", *parts, id="main")
    skip = el("a", "To the report", href="#main", class_="skip")
    return el("html", head, el("body", skip, header, contents, main, raw("script", script)), lang="en")
