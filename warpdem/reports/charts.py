"""Which charts a history gives: energies, each wall's loads, and what the scene's measures ask for, by name and unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from warpdem.reports.chart import CURVES, Chart
from warpdem.runs import History
from warpdem.runs.history import TIME

MOST = 60
"""Charts of a page at most; what else there is, is named."""
STORED = ("kinetic", "rotational", "elastic", "potential", "fields")
GENERAL = ("grains [-]", "largest_overlap [-]", "largest_approach_speed [m/s]")
TITLES = {
    "grains [-]": "Grains in the domain",
    "largest_overlap [-]": "Largest overlap so far, over the radius",
    "largest_approach_speed [m/s]": "Largest approach speed so far",
}
NOT_DRAWN = (TIME, "frame_angle [rad]")


def charts_of(history: History, walls: Sequence[str]) -> dict[str, list[Chart]]:
    """Charts by the section that they belong to: energy, walls, grains, measures; columns that are always zero are left out.

    Args:
        history: of the run.
        walls: names of its walls, which columns begin with.
    """
    left = [header for header in history if header not in NOT_DRAWN]

    def take(headers: Sequence[str]) -> list[str]:
        found = [header for header in headers if header in left]
        for header in found:
            left.remove(header)
        return [header for header in found if np.any(np.nan_to_num(history[header]) != 0.0)]

    out: dict[str, list[Chart]] = {"energy": [], "walls": [], "grains": [], "measures": []}
    out["energy"] += _chart(history, "Energy in the laboratory", take([f"{name} [J]" for name in STORED]))
    dissipated = [h for h in left if h.startswith(("dissipated_", "elastic_"))]
    out["energy"] += _chart(history, "Dissipated and elastic energy by its kind", take(dissipated))
    works = [h for h in left if h.endswith(" work [J]") or h in ("work_walls [J]", "work_fields [J]", "carried_in [J]")]
    of_walls = [h for h in works if h.endswith(" work [J]")]
    works = [h for h in works if len(of_walls) != 1 or h not in of_walls]  # of one wall it is the work of all
    left = [h for h in left if h not in of_walls or h in works]
    out["energy"] += _chart(history, "Work and energy carried in", take(works))
    out["energy"] += _chart(history, "Energy that the time integration lost or made", take(["integration_error [J]"]))
    for wall in walls:
        for quantity in ("force", "torque"):
            unit = "N" if quantity == "force" else "N m"
            headers = take([f"{wall} {quantity} {axis} [{unit}]" for axis in "xyz"])
            out["walls"] += _chart(history, f"{wall}: {quantity} of the grains on it", headers, f"{wall} {quantity} ")
        headers = take([f"{wall} power [W]"])
        out["walls"] += _chart(history, f"{wall}: power of its motion on the grains", headers, f"{wall} ")
    out["grains"] += _chart(history, "Centre of mass", take([f"centre_{axis} [m]" for axis in "xyz"]))
    for header in GENERAL:
        out["grains"] += _chart(history, TITLES[header], take([header]))
    for title, headers in _groups(left):
        out["measures"] += _chart(history, title, take(headers))
    return out


def _groups(headers: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Columns of one unit and one beginning, which is their title."""
    groups: dict[tuple[str, str], list[str]] = {}
    for header in headers:
        name, _, unit = header.rpartition(" [")
        words = name.split(" ")
        begin = " ".join(words[:-1]) if len(words) > 1 else name.rpartition("_")[0] or name
        groups.setdefault((begin, unit), []).append(header)
    for (begin, _), named in groups.items():
        yield begin if len(named) > 1 else named[0].rpartition(" [")[0], list(named)


def _chart(history: History, title: str, headers: Sequence[str], prefix: str = "") -> Iterator[Chart]:
    """Charts of columns of one unit, ``CURVES`` curves each; none without columns."""
    for k in range(0, len(headers), CURVES):
        part = headers[k : k + CURVES]
        curves = {h.rpartition(" [")[0].removeprefix(prefix).replace("_", " "): history[h] for h in part}
        more = f" ({k // CURVES + 1})" if len(headers) > CURVES else ""
        yield Chart(title + more, history.unit(part[0]), history[TIME], curves)
