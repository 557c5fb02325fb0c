"""Motions of meshes: fix move/mesh as ``walls[].motion``."""

from __future__ import annotations

import itertools
import math
from typing import Any

from warpdem.exchange.liggghts.deck import Deck, Fix, numbers


def motions(deck: Deck) -> dict[str, Any]:
    """Motions of the meshes by their names: one table each, or a list, outermost first.

    Of motions at the same time LIGGGHTS moves the later one's axis with the earlier one, so the earlier is outside; of motions
    one after the other both axes are at rest, so the later is outside.
    """
    found: dict[str, list[tuple[Fix, dict[str, Any]]]] = {}
    for fix in deck.of_style("move/mesh"):
        table = _motion(fix)
        mesh = fix.after("mesh")
        if table is None or mesh is None:
            deck.notes.append(f"{fix.command}: this motion is not converted")
            continue
        if fix.start:
            table["start"] = fix.start
        if fix.until is not None and fix.until < deck.end:
            table["until"] = fix.until
        found.setdefault(mesh[0], []).append((fix, table))
    out: dict[str, Any] = {}
    for name, parts in found.items():
        one_by_one = all(a.until is not None and a.until <= b.start for (a, _), (b, _) in itertools.pairwise(parts))
        tables = [table for _, table in (reversed(parts) if one_by_one else parts)]
        out[name] = tables[0] if len(tables) == 1 else tables
    return out


def _motion(fix: Fix) -> dict[str, Any] | None:
    """The table of a motion; None where its style has none."""
    style = fix.words[2]
    if style == "linear":
        return {"velocity": numbers(fix.words[3:6], fix.command)}
    origin, axis, period = fix.numbers("origin", 3), fix.numbers("axis", 3), fix.numbers("period")
    if period is None or period[0] == 0.0:
        return None
    if style == "wiggle":
        amplitude = fix.numbers("amplitude", 3)
        return None if amplitude is None else {"amplitude": amplitude, "frequency": 1.0 / period[0]}
    if axis is None or style not in ("rotate", "riggle"):
        return None
    about: dict[str, Any] = {"axis": axis} | ({"origin": origin} if origin and any(origin) else {})
    rate = 2.0 * math.pi / period[0]
    if style == "rotate":
        return about | {"rate": rate}
    swing = fix.numbers("amplitude")  # in degrees: the angle is A sin(w t), its rate A w cos(w t)
    if swing is None:
        return None
    wave = {"amplitude": math.radians(swing[0]) * rate, "frequency": 1.0 / period[0], "phase": 0.5 * math.pi}
    return about | {"sinusoid": wave}
