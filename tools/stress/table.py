"""Hard scenes, each with an invariant and its limit: `python tools/stress/table.py`.

    python tools/stress/table.py               some minutes; writes tools/stress/results/stress.md and stress.json
    python tools/stress/table.py --short       those of continuous integration, under a minute
    python tools/stress/table.py --full        also those of a million steps and more
    python tools/stress/table.py --only lattice impact

A scene holds when it runs to its end and the measured number stays within the limit. A few cannot run and must say so
themselves: "refused" before anything is computed, "stopped" by a guard; those are named beforehand, with the physical
reason. The scenes are in contacts.py and domains.py.
"""

import json
import math
import platform
import sys
import textwrap
import time
from pathlib import Path
from typing import Annotated

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import warp as wp
from cyclopts import App, Parameter

from stress import contacts, domains
from stress.cases import Case
from warpdem import SceneError, StabilityError

RESULTS = Path(__file__).resolve().parent / "results"
TIERS = ("short", "default", "full")
CASES = [*contacts.CASES, *domains.CASES]
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
    """The rows as a list in Markdown."""
    lines = []
    for row in rows:
        verdict = row["verdict"] + (f": {row['reason']}" if row["reason"] else "")
        verdict += "" if row["good"] else f" (**expected: {row['expected']}**; {row['said']})"
        numbers = "".join(f", {key} {row[key]:.2g}" for key in ("measured", "limit") if row[key] is not None)
        said = row["invariant"] + numbers if numbers else "to be " + row["invariant"]
        line = f"{row['scene']}: {said}: {verdict}"
        lines.append(textwrap.fill(line, 118, initial_indent="* ", subsequent_indent="  ", break_on_hyphens=False))
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
        command = f"python tools/stress/table.py{' --full' if full else ''}"
        (out / "stress.md").write_text(f"# Stress table\n\n`{command}`: {table(rows)}")
    print(table(rows).splitlines()[0])
    return 0 if all(row["good"] for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(app())
