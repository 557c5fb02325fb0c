"""The hourglass in double and in mixed precision: `python tools/hourglass_precision.py [--rpm 120] [--out FILE.json]`.

Mass below the neck against time, from twins of each precision whose starts differ by 1e-9 of a radius (``paper_hourglass``).
The flow is chaotic, so that single runs part whatever is changed: the precisions count as equal when the mean curves differ
by no more than the twins of each do, standardised rms at most 2.5. Some 10 minutes of two idle cores; the numbers go to
`results/hourglass_precision.json`.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import paper_hourglass
from paper_common import SCENES

PRECISIONS = ("double", "mixed")
LARGEST = 2.5  # standardised rms of curves that count as equal


def compare(size: paper_hourglass.Size, rpm: float) -> dict[str, Any]:
    """Numbers of the twins of both precisions in the turning frame, from one settled start."""
    start = paper_hourglass.settled(paper_hourglass.glass(size), SCENES, size.settle, size.device)
    jobs = {}
    for number, precision in enumerate(PRECISIONS):
        for twin in range(size.twins):  # no nudge is used twice
            nudge = number * size.twins + twin
            jobs[precision, twin] = (replace(size, precision=precision), rpm, "frame", start, nudge)
    found = paper_hourglass.finished(jobs, size.device)
    curves = {p: np.array([found[p, twin].passed for twin in range(size.twins)]) for p in PRECISIONS}
    return {
        "rpm": rpm,
        "grains": len(start["radii"]),
        "twins": size.twins,
        "standardised_rms": paper_hourglass.standardised_rms(*curves.values()),
        "largest_difference_of_means": float(np.abs(curves["double"].mean(axis=0) - curves["mixed"].mean(axis=0)).max()),
        "largest_spread_of_twins": float(max(np.ptp(curve, axis=0).max() for curve in curves.values())),
        "largest_overlap_share": max(r.overlap for r in found.values()),
        "time_s": np.round(found["double", 0].time, 9).tolist(),
        "share_passed": {p: np.round(curve, 5).tolist() for p, curve in curves.items()},
    }


def main() -> int:
    """Run, write and judge: 0 when the curves are equal, else 1."""
    parser = argparse.ArgumentParser(description=__doc__.split("`")[0])
    parser.add_argument("--rpm", type=float, default=120.0, help="rate of the half turn")
    parser.add_argument("--twins", type=int, default=8)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "hourglass_precision.json")
    options = parser.parse_args()
    numbers = compare(paper_hourglass.Size(twins=options.twins), options.rpm)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(numbers) + "\n")
    print(f"standardised rms {numbers['standardised_rms']:.2f}, at most {LARGEST}")
    return 0 if numbers["standardised_rms"] <= LARGEST else 1


if __name__ == "__main__":
    raise SystemExit(main())
