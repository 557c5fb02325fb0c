"""The sections of a report, each made from run.json or history.csv; one that has nothing to say is left out."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from warpdem.core.timers import speed_text, stepping
from warpdem.reports import methods
from warpdem.reports.chart import Chart
from warpdem.reports.charts import STORED
from warpdem.reports.html import Node, el, number, table
from warpdem.reports.pairs import headed
from warpdem.runs import History
from warpdem.runs.history import TIME

SHORT_TEXT = 200
"""Characters of a value of the scene that its tables show."""


def overview(record: Mapping[str, Any]) -> list[Node]:
    """Numbers on one look."""
    met, seconds = record.get("extremes", {}), record.get("seconds", {})
    step, clumps = record.get("time_step", {}), record.get("clumps") or {}
    overlaps = [met[key] for key in ("pair_overlap_share", "wall_overlap_share") if met.get(key) is not None]
    steps, grains, of_steps = record.get("steps"), record.get("grains"), stepping(seconds)
    rows: list[tuple[str, str | None]] = [
        ("simulated", _with_unit(record.get("time"), "s")),
        ("grains at the end", _plain(grains)),
        ("clumps at the end", _plain(sum(of["count"] for of in clumps.values())) if clumps else None),
        ("time steps", _plain(steps)),
        ("time step", _with_unit(step.get("used"), "s")),
        ("largest overlap", f"{number(100 * max(overlaps), 3)} % of a radius" if overlaps else None),
        ("wall time", _with_unit(seconds.get("total"), "s")),
        ("speed", speed_text(of_steps / steps, grains) if steps and grains and of_steps else None),
        ("device", f"{record['device']}, {record.get('threads')} threads" if record.get("device") else None),
    ]  # fmt: skip
    return [el("dl", *(el("div", el("dt", name), el("dd", text)) for name, text in rows if text is not None), class_="facts")]


def warnings(record: Mapping[str, Any]) -> list[Node]:
    """What the run warned of and what its guards noticed; says so if there is nothing."""
    found = [str(message) for message in record.get("warnings", ())]
    found += [f"{guard}: {message}" for guard, message in record.get("noticed", {}).items()]
    notes = [str(message) for message in record.get("notes", ())]
    out = [el("ul", *(el("li", message) for message in found), class_="warnings")] if found else [el("p", "No warnings.")]
    if notes:
        out.append(el("h3", "Notes"))
        out.append(el("ul", *(el("li", message) for message in notes)))
    return out


def scene(record: Mapping[str, Any]) -> list[Node]:
    """Materials, pairs, walls, motions and all else that the scene gives; the whole of it as JSON."""
    given = record.get("scene_data")
    if not isinstance(given, Mapping):
        return [el("p", f"The scene is not in run.json ({given or 'none'}); its hash is {record.get('scene_hash')}.")]
    out = []
    materials = given.get("materials", {})
    out += _rows_of("Materials", [{"name": name, **material} for name, material in materials.items()])
    read = record.get("pair_keys")
    out += _rows_of("Pairs of materials", [headed(pair, read) for pair in given.get("pairs", ())])
    out += _rows_of("Walls", given.get("walls", ()))
    for key, title in (("grains", "Grains at the start"), ("streams", "Streams"), ("outlets", "Outlets"), ("fields", "Fields")):
        out += _rows_of(title, given.get(key, ()))
    named = ("gravity", "contact", "clumps", "frame", "borders", "time", "output", "engine", "measures")
    rest = {key: given.get(key) for key in named}
    shown = [[key, _short(value)] for key, value in rest.items() if value]
    out += [table("Other tables of the scene, in SI units", ["key", "value"], shown, "wide")] if shown else []
    whole = json.dumps(given, indent=1)
    out.append(el("details", el("summary", "The whole scene, all defaults filled in"), el("pre", whole, tabindex=0)))
    return out


def plan(record: Mapping[str, Any]) -> list[Node]:
    """What was compiled and run, and what was left out."""
    lines = [str(line).split(None, 1) for line in record.get("plan", ())]
    runs = [line[1] for line in lines if line[0] == "runs" and len(line) > 1]
    left = [" ".join(line).removeprefix("left out").strip() for line in lines if line[0] != "runs"]
    out = [el("ul", *(el("li", line) for line in runs))] if runs else []
    if left:
        listed = el("ul", *(el("li", line) for line in left))
        out.append(el("details", el("summary", f"Left out, {len(left)} features"), listed))
    return out


def time_step(record: Mapping[str, Any]) -> list[Node]:
    """The time step as a share of each limit."""
    step, limits = record.get("time_step"), record.get("limits")
    if not step:
        return []
    out = [el("p", f"Time step {number(step['used'])} s, set by: {step.get('binding') or 'time.step'}.")]
    if not limits:
        return [*out, el("p", "This run.json, of an older version, has no table of limits.")]
    rows: list[list[Node | str | float | None]] = []
    for row in limits:
        share, allowed = row["share"], row["auto_share"]
        over = share is not None and share > (1.0 if allowed is None else allowed * (1.0 + 1e-9))
        # a meter has no bounds of its own: the text beside it is what counts
        meter = _meter(share, allowed, row["name"]) if share is not None else "nothing limits"
        note = ("above what auto keeps" if allowed is not None else "above it") if over else ""
        note = " ".join(filter(None, [note, "(a longer step is refused)" * row["refused"]]))
        rows.append([row["name"], row["seconds"], share, allowed, meter, note])
    head = ["limit", "limit [s]", "step / limit", "auto keeps below", "share", "note"]
    return [*out, table("Time step against its limits", head, rows)]


def energy_budget(history: History) -> list[Node]:
    """Terms of the budget over the whole run, and what does not close."""
    if "integration_error [J]" not in list(history):
        return [el("p", "The budget was not kept: add ", el("code", "[measures] energy = true"), " to the scene for it.")]
    terms = [h for h in history if h in ("work_walls [J]", "work_fields [J]", "carried_in [J]") or h.startswith("dissipated_")]
    stored = sum(history[f"{name} [J]"][-1] - history[f"{name} [J]"][0] for name in STORED)
    rows: list[list[Any]] = [[h.rpartition(" [")[0].replace("_", " "), float(history[h][-1])] for h in terms]
    rows.append(["change of the stored energy", float(stored)])
    error = float(history["integration_error [J]"][-1])
    turned_over = sum(abs(float(history[h][-1])) for h in terms)
    share = f" ({number(100 * abs(error) / turned_over, 2)} % of the sum of all terms)" if turned_over else ""
    rows.append(["error of the time integration", error])
    words = "What is put in less what is dissipated is the change of the stored energy, but for"
    return [table("Energy budget over the run [J]", ["term", "J"], rows), el("p", f"{words} {number(error, 3)} J{share}.")]


def wall_loads(history: History, walls: Iterable[str]) -> list[Node]:
    """Mean load on each wall over the second half of the run, its scatter, and the largest force."""
    time = history[TIME]
    if not len(time):
        return []
    late = time >= 0.5 * (time[0] + time[-1])
    rows: list[list[Node | str | float | None]] = []
    for wall in walls:
        names = [f"{wall} force {axis} [N]" for axis in "xyz"] + [f"{wall} torque {axis} [N m]" for axis in "xyz"]
        names.append(f"{wall} power [W]")
        if any(name not in list(history) for name in names):
            continue
        force = np.linalg.norm([history[name] for name in names[:3]], axis=0)
        means = [_mean_and_scatter(history[name][late]) for name in names]
        rows.append([wall, *means, float(np.nanmax(force))])
    if not rows:
        return []
    head = ["wall", *(f"force {axis} [N]" for axis in "xyz"), *(f"torque {axis} [N m]" for axis in "xyz"), "power [W]",
            "largest force [N]"]  # fmt: skip
    words = "Mean ± standard deviation of the rows of the second half of the run; vectors in laboratory axes."
    return [table("Loads of the grains on the walls", head, rows), el("p", words)]


def flows(record: Mapping[str, Any]) -> list[Node]:
    """What left and what came in."""
    left = [[name, way["grains"], way["mass"]] for name, way in record.get("left", {}).items()]
    came = [[way["name"], way["grains"], way["mass"]] for way in methods.named_streams(record)]
    out = [table("Grains that left", ["through", "grains", "mass [kg]"], left)] if left else []
    return out + ([table("Grains that came in", ["by", "grains", "mass [kg]"], came)] if came else [])


def timings(record: Mapping[str, Any]) -> list[Node]:
    """Wall time by stage."""
    seconds = {name: value for name, value in record.get("seconds", {}).items() if name != "total" and value >= 0.005}
    rows = [[name, value] for name, value in sorted(seconds.items(), key=lambda item: -item[1])]
    return [table("Wall time by stage [s]", ["stage", "s"], rows)] if rows else []


def method_text(record: Mapping[str, Any]) -> list[Node]:
    """Text for a publication, equations of the models, what to cite."""
    out = [el("p", paragraph) for paragraph in methods.sentences(record)]
    for role, model in record.get("models", {}).items():
        summary = el("summary", f"{role}: {model['name']}")
        out.append(el("details", summary, el("pre", str(model.get("doc", "")), tabindex=0)))
    out.append(el("h3", "To cite"))
    out.append(el("pre", methods.citation(record), tabindex=0))
    return out


def origin(record: Mapping[str, Any]) -> list[Node]:
    """Versions and hashes."""
    rows = [[name, str(version)] for name, version in record.get("versions", {}).items()]
    rows += [[key.replace("_", " "), str(record[key])] for key in ("scene_hash", "state_hash") if record.get(key)]
    return [table("Versions and hashes", ["what", "value"], rows, "wide")] if rows else []


def figures(charts: Iterable[Chart], key: Callable[[], str]) -> list[Node]:
    """Charts as elements; ``key`` gives each an id of its own."""
    return [chart.figure(key()) for chart in charts]


def _rows_of(title: str, items: Any) -> list[Node]:
    """A table of similar tables of the scene: the keys that one of them has, their name first."""
    items = [item for item in items or () if isinstance(item, Mapping)]
    keys = list(dict.fromkeys(key for item in items for key, value in item.items() if _says(value)))
    first = next((key for key in ("name", "materials", "material", "model") if key in keys), None)
    keys = [key for key in keys if key != first]
    if not items:
        return []
    rows: list[list[Node | str | float | None]] = []
    for k, item in enumerate(items):
        name: str = _short(item.get(first)) if first else str(k)
        rows.append([name, *(_cell(item.get(key)) for key in keys)])
    return [table(f"{title}, in SI units", [first or "number", *(key.replace("_", " ") for key in keys)], rows)]


def _says(value: Any) -> bool:
    """Whether a value says more than that there is nothing; zero does."""
    return value is not None and value is not False and value not in ([], {}, "")


def _cell(value: Any) -> Node | str | float | None:
    if not _says(value):
        return None
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value
    return _short(value)


def _short(value: Any) -> str:
    """A value of the scene in few words."""
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        text = " and ".join(value)
    elif isinstance(value, str):
        text = value
    else:
        text = json.dumps(_without_defaults(value), ensure_ascii=False)
    return text if len(text) <= SHORT_TEXT else f"{text[:SHORT_TEXT]} …"


def _without_defaults(value: Any) -> Any:
    """A value without empty entries."""
    if isinstance(value, Mapping):
        kept = {key: _without_defaults(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item not in (None, [], {}, "")}
    return [_without_defaults(item) for item in value] if isinstance(value, list) else value


def _meter(share: float, allowed: float | None, name: str) -> Node:
    """A bar from 0 to the limit, with a mark at what auto keeps below."""
    width, most = 120.0, max(1.0, share)
    svg = el("svg", viewBox=f"0 0 {width:g} 12", width=width, height=12, role="img", aria_label=f"{name}: {number(share, 3)}",
             class_="meter")  # fmt: skip
    svg.append(el("rect", x=0, y=2, width=f"{width / most:.1f}", height=8, class_="room"))
    over = share > (1.0 if allowed is None else allowed * (1.0 + 1e-9))
    svg.append(el("rect", x=0, y=2, width=f"{max(1.0, width * share / most):.1f}", height=8, class_="over" if over else "used"))
    if allowed is not None and allowed <= most:
        at = f"{width * allowed / most:.1f}"
        svg.append(el("line", x1=at, x2=at, y1=0, y2=12, class_="axis"))
    return svg


def _mean_and_scatter(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    return f"{number(float(known.mean()), 4)} ± {number(float(known.std()), 2)}" if len(known) else "\u2013"


def _with_unit(value: Any, unit: str) -> str | None:
    return f"{number(float(value))} {unit}" if isinstance(value, int | float) and math.isfinite(value) else None


def _plain(value: Any) -> str | None:
    return f"{value:,}".replace(",", "\u202f") if isinstance(value, int) else None
