"""What readings, looks and checkpoints cost: `python tools/bench/readings.py --help`.

A settled bed makes some steps on one thread; then each of these is repeated, and the least processor time counts: a row of
the history (all columns of the scene), a look of the guards, a checkpoint saved, read and restored. Beside the time: the
memory that saving takes beyond the run's own.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench.states import Settings, bed, given_bed, scene_of
from bench.window import commit, machine
from warpdem.measure.column import Readings
from warpdem.output.history import history_columns, history_row
from warpdem.state import checkpoint, checkpoint_file


def least(job: Callable[[], object], repeats: int) -> float:
    """Least processor time of so many calls [s], after one that loads what it needs."""
    job()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        job()
        times.append(time.process_time() - begin)
    return min(times)


def resident_bytes(peak: bool = False) -> int:
    """Resident memory of this process, or its peak since ``forget_peak`` [B]; 0 where the system does not tell."""
    name = "VmHWM" if peak else "VmRSS"
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith(name)), 0)


def forget_peak() -> None:
    """Begin the peak of the resident memory anew; nothing where the system cannot."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def measured(sim: warpdem.Simulation, repeats: int, folder: Path) -> dict[str, float]:
    """Times [s] and memory [B] of one run."""
    columns, path = history_columns(sim.scene), folder / "state.h5"
    forget_peak()
    before = resident_bytes()
    sim.save_checkpoint(path)
    found: dict[str, float] = {
        "memory": before,
        "memory_of_saving": max(resident_bytes(peak=True) - before, 0),
        "row": least(lambda: history_row(columns, Readings(sim.view)), repeats),
        "look": least(sim.guards.judge, repeats),
        "save": least(lambda: sim.save_checkpoint(path), repeats),
        "read": least(lambda: checkpoint_file.read(path), repeats),
    }
    data = checkpoint_file.read(path)
    return found | {"restore": least(lambda: checkpoint.restore(sim, data), repeats)}


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    states: Path | None = None,
    grains: Sequence[int] = (2000, 20_000),
    steps: int = 50,
    repeats: int = 5,
    settle: int = 20_000,
    out: Path = Path("bench_readings.json"),
) -> None:
    """Measure, print a table and write JSON.

    Args:
        states: Folder of states bed_N.npz; states are made if not given.
        grains: Numbers of grains.
        steps: Steps before the readings.
        repeats: Calls of each, of which the quickest counts.
        settle: Steps that a bed made here settles.
        out: JSON file to write.
    """
    console, results = Console(highlight=False), []
    names = ("row", "look", "save", "read", "restore")
    table = Table(box=SIMPLE, title="processor time per grain (us), and memory (MB)", title_justify="left")
    for name in ("grains", *names, "run", "saving takes"):
        table.add_column(name, justify="right")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for count in grains:
            start = given_bed(count, states) if states else bed(count, folder, Settings(), settle)
            sim = warpdem.Simulation(scene_of(start, "full", Settings()), threads=1)
            sim.step(steps)
            n, found = len(sim.state), measured(sim, repeats, folder)
            results.append({"grains": n, **found})
            memory = (f"{found[name] / 1e6:.0f}" for name in ("memory", "memory_of_saving"))
            table.add_row(str(n), *(f"{found[name] / n * 1e6:.3g}" for name in names), *memory)
    console.print(table)
    out.write_text(json.dumps({"machine": machine(), "commit": commit(), "results": results}, indent=1))


if __name__ == "__main__":
    app()
