"""A LIGGGHTS script as the tables of a scene."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from warpdem.errors import SceneError
from warpdem.exchange.liggghts.contact import Law, Properties, material_tables, pair_tables
from warpdem.exchange.liggghts.deck import Deck, numbers, read_deck
from warpdem.exchange.liggghts.insertion import Insertion
from warpdem.exchange.liggghts.walls import wall_tables

AXES = "xyz"
MAX_OVERLAP = 0.5
"""Of the radius, at which a converted run stops [-]."""


def scene_of_script(path: Path, folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Tables of a scene that does what a script does, and notes on what is other or missing.

    Args:
        path: the script; its paths are relative to its folder.
        folder: of the scene file, which paths in the tables are relative to.

    Raises:
        SceneError: the script cannot be read, or lacks what contacts need.
    """
    deck = read_deck(path)

    def path_of(name: str) -> str:
        return os.path.relpath(path.parent.resolve() / name, folder.resolve()).replace(os.sep, "/")

    law, properties = Law(deck), Properties(deck)
    insertion = Insertion(deck, path_of)
    portions = insertion.distributions.all
    densities = {portion.type: portion.density for portion in portions}
    radius = 0.5 * sum(p.mean for p in portions) / len(portions) if portions else None
    materials = material_tables(properties, densities, deck)
    density = next(iter(materials.values()))["density"]
    tables: dict[str, Any] = {
        "title": f"From {path.name}, a script of LIGGGHTS",
        "gravity": _gravity(deck),
        "materials": materials,
        "contact": law.contact,
        "pairs": pair_tables(properties, law, radius, density, deck),
        "grains": insertion.grains,
        "streams": insertion.streams,
        "walls": wall_tables(deck, path_of),
        "borders": _borders(deck),
        "time": _time(deck),
        "output": _output(deck),
        "engine": _engine(deck),
    }
    for command in deck.start_files:
        words = "make a state file of its grains (warpdem grains) and name it as 'file' of an entry of [[grains]]"
        deck.notes.append(f"{command}: {words}")
    return {key: table for key, table in tables.items() if table}, list(dict.fromkeys(deck.notes + deck.unused()))


def _gravity(deck: Deck) -> list[float]:
    """Gravity [m/s2]."""
    found = [fix for fix in deck.of_style("gravity") if fix.until is None]
    if not found:
        return [0.0, 0.0, 0.0]
    direction = found[-1].numbers("vector", 3)
    if direction is None:
        raise SceneError(f"{found[-1].command.place}: only 'fix ... gravity g vector x y z' is converted")
    length = sum(x * x for x in direction) ** 0.5
    strength = numbers(found[-1].words[:1], found[-1].command)[0]
    return [strength * x / length + 0.0 for x in direction]


def _borders(deck: Deck) -> dict[str, Any]:
    """Periodic and open borders of the domain; shrink-wrapped ones are none."""
    words = deck.regions.get(deck.domain or "", ())
    if words[:1] != ("block",):
        return {}
    try:
        low_high = [float(word) for word in words[1:7]]
    except ValueError:
        deck.notes.append(f"region {deck.domain}: its borders are not numbers, so none are converted")
        return {}
    out: dict[str, Any] = {}
    for k, kind in enumerate(deck.boundary):
        both = {"min": low_high[2 * k], "max": low_high[2 * k + 1]}
        if kind == "p":
            out[AXES[k]] = {"kind": "periodic", **both}
        elif "f" in kind:
            out[AXES[k]] = {"kind": "open", **both}
    return out


def _time(deck: Deck) -> dict[str, Any]:
    """End of the run; the step is left to the scene."""
    if not deck.end:
        raise SceneError(f"{deck.path}: the script has no run, so the end of the run is not known")
    words = 'step = "auto" in its place: warpdem check says how both compare with the limits'
    deck.notes.append(f"timestep {deck.timestep:g} s: {words}")
    return {"end": deck.end}


def _output(deck: Deck) -> dict[str, Any]:
    """Intervals of frames and of rows of history.csv, as of dump and thermo."""
    out = {}
    if deck.frames:
        out["interval"] = min(deck.frames * deck.timestep, deck.end)
    if deck.rows:
        out["history_interval"] = min(deck.rows * deck.timestep, out.get("interval", deck.end))
    return out


def _engine(deck: Deck) -> dict[str, Any]:
    """Allowed overlap: LIGGGHTS has no limit, and scripts for it are often of softer grains than the scene's default allows."""
    words = "LIGGGHTS lets grains overlap without limit; check says how deep impacts of these materials are"
    deck.notes.append(f"engine.max_overlap = {MAX_OVERLAP}: {words}")
    return {"max_overlap": MAX_OVERLAP}
