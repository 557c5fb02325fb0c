"""Efficiency of the pool of a sweep: `python tools/bench/pool.py`.

Equal rows of a scene of the gallery, all through one worker and then through several, a thread each, as the command
`warpdem sweep` runs them, its start included. Efficiency is the time with one worker over workers times the time with all of
them. Beside it what does not depend on the pool: how much longer the steps of a row take where others run, and the processor
time of each pass: where that is the same, other work on the machine has taken the cores.
"""

import csv
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

from cyclopts import App
from rich.console import Console

from bench.window import commit, machine
from warpdem.app.demo import gallery
from warpdem.core.timers import stepping


@dataclass(frozen=True)
class Passed:
    """One pass of all rows."""

    workers: int
    wall: float
    """Wall time of the command [s]."""
    processor: float
    """Processor time of the command and its rows [s]."""
    of_rows: float
    """Median wall time of a row, without the start of its process [s]."""
    of_steps: float
    """Median wall time of the steps of a row [s]."""


def processor_time() -> float:
    """Processor time of all processes that this one has started and that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def passed(scene: Path, folder: Path, workers: int, rows: int, end: float) -> Passed:
    """Run a sweep of ``rows`` rows of ``scene``, each to ``end`` [s]."""
    titles = ",".join(f"row{k}" for k in range(rows))
    command = [sys.executable, "-P", "-m", "warpdem", "sweep", str(scene), "--grid", f"title={titles}", f"time.end={end}",
               "--out", str(folder), "--workers", str(workers), "--threads", "1", "--device", "cpu", "--quiet"]  # fmt: skip
    begin, before = time.perf_counter(), processor_time()
    subprocess.run(command, check=True)
    wall, processor = time.perf_counter() - begin, processor_time() - before
    with (folder / "sweep.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    if len({row["state_hash"] for row in table}) != 1 or {row["status"] for row in table} != {"done"}:
        sys.exit(f"{folder}: the rows differ, or are not done")
    records = [json.loads(path.read_text()) for path in folder.glob("*/run.json")]
    steps = statistics.median(stepping(record["seconds"]) for record in records)
    return Passed(workers, wall, processor, statistics.median(float(row["wall_time [s]"]) for row in table), steps)


app = App(help=__doc__, version_flags=())


@app.default
def main(*, demo: str = "drum_test", end: float = 0.5, rows: int = 8, workers: int = 2) -> None:
    """Run the passes and print what came out.

    Args:
        demo: Scene of the gallery.
        end: Time at which a row ends [s].
        rows: How many rows, best a multiple of ``workers``.
        workers: How many at once in the second pass.
    """
    console = Console(highlight=False)
    scene = gallery()[demo].file
    with tempfile.TemporaryDirectory() as place:
        passed(scene, Path(place) / "first", 1, 1, end)  # compiles
        alone, together = (passed(scene, Path(place) / str(n), n, rows, end) for n in (1, workers))
    console.print(f"{machine()['processor']}, {machine()['cores']} cores; {commit()[:12]}; {rows} rows of {demo} to {end:g} s")
    for one in (alone, together):
        took = f"{one.wall:.1f} s, of processors {one.processor:.1f} s"
        console.print(f"{one.workers} workers: {took}; a row {one.of_rows:.2f} s, its steps {one.of_steps:.2f} s")
    console.print(
        f"efficiency {alone.wall / (workers * together.wall):.3f}; "
        f"steps take {together.of_steps / alone.of_steps:.3f} times as long beside others"
    )


if __name__ == "__main__":
    sys.exit(app())
