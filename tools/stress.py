"""Hard scenes, each with an invariant and its limit: `python tools/stress.py`.

    python tools/stress.py               some minutes; writes tools/results/stress.md and stress.json
    python tools/stress.py --short       those of continuous integration, under a minute
    python tools/stress.py --full        also those of a million steps and more
    python tools/stress.py --only lattice impact

A scene holds when it runs to its end and the measured number stays within the limit. A few cannot run and must say so
themselves: "refused" before anything is computed, "stopped" by a guard; those are named beforehand, with the physical
reason. The scenes are in stress_contacts.py and stress_domains.py.
"""

import json
import math
import platform
import time
from pathlib import Path
from typing import Annotated

import stress_contacts
import stress_domains
import warp as wp
from cyclopts import App, Parameter
from stress_scenes import Case

from warpdem import SceneError, StabilityError

RESULTS = Path(__file__).resolve().parent / "results"
TIERS = ("short", "default", "full")
CASES = [*stress_contacts.CASES, *stress_domains.CASES]
app = App(help=__doc__)


def run(case: Case) -> dict:
    """Run one scene; returns its row of the table."""
    begin = time.perf_counter()
    measured, said, verdict = math.nan, "", "held"
    try:
        measured = float(case.measure())
        verdict = "held" if measured <= case.limit else "broken"
    except SceneError as error:
        verdict, said = "refused", str(error)
    except StabilityError as error:
        verdict, said = "stopped", str(error)
    return {
        "scene": case.scene,
        "invariant": case.invariant,
        "measured": None if math.isnan(measured) else measured,
        "limit": None if math.isnan(case.limit) else case.limit,
        "verdict": verdict,
        "expected": case.expected,
        "good": verdict == case.expected,
        "reason": case.reason,
        "said": said,
        "seconds": round(time.perf_counter() - begin, 2),
    }


def chosen(tier: str, words: list[str]) -> list[Case]:
    """The cases up to a tier whose scene holds one of the words (all, without words)."""
    return [
        case
        for case in CASES
        if TIERS.index(case.tier) <= TIERS.index(tier) and (not words or any(word in case.scene for word in words))
    ]


def table(rows: list[dict]) -> str:
    """The rows as Markdown."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.2g}"

    lines = ["| scene | invariant | measured | limit | verdict |", "| --- | --- | --- | --- | --- |"]
    for row in rows:
        verdict = row["verdict"] + (f": {row['reason']}" if row["reason"] else "")
        verdict += "" if row["good"] else f" (**expected: {row['expected']}**; {row['said']})"
        cells = (row["scene"], row["invariant"], number(row["measured"]), number(row["limit"]), verdict)
        lines.append(f"| {' | '.join(cells)} |")
    held = sum(row["verdict"] == "held" for row in rows)
    good = sum(row["good"] for row in rows)
    return "\n".join([f"{len(rows)} scenes, {held} held, {good} as expected.", "", *lines, ""])


@app.default
def main(
    short: Annotated[bool, Parameter(negative="")] = False,
    full: Annotated[bool, Parameter(negative="")] = False,
    only: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    out: Path = RESULTS,
) -> int:
    """Run the scenes and write the table.

    Args:
        short: only those of continuous integration.
        full: also the long ones.
        only: those whose name holds one of these words; nothing is written.
        out: folder for stress.md and stress.json; nothing is written with --short.

    Returns:
        0 when every scene does what is expected of it.
    """
    wp.config.log_level = wp.LOG_WARNING
    tier = "short" if short else "full" if full else "default"
    rows = []
    for case in chosen(tier, only or []):
        rows.append(row := run(case))
        mark = "ok " if row["good"] else "BAD"
        print(f"{mark} {row['seconds']:7.2f} s  {row['verdict']:8} {row['measured']!s:24.24} {case.scene}")
        if not row["good"]:
            print(f"      {row['said'] or 'limit'} {case.limit}")
    if not short and not only:
        out.mkdir(parents=True, exist_ok=True)
        about = {"tier": tier, "warp": wp.config.version, "python": platform.python_version(), "device": "cpu"}
        (out / "stress.json").write_text(json.dumps(about | {"rows": rows}, indent=1) + "\n")
        (out / "stress.md").write_text(f"# Stress table\n\n`python tools/stress.py{' --full' if full else ''}`: {table(rows)}")
    print(table(rows).splitlines()[0])
    return 0 if all(row["good"] for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(app())
