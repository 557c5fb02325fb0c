"""Where the time of a step goes, on one thread: `python tools/bench/profile_step.py --help`.

Of each case the whole step over windows of many steps, lists included, and within it the lists; then each phase alone, launched
over and over at one time: contacts between grains, walls, motion with the sums of the forces on a grain. What is left of the
whole is the host's, and what phases lose to each other in the caches. Wall time counts, the
least of each, so the machine has to be quiet (`load`).
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import warp as wp
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench.states import OWN_GLASS, Model, Precision, Settings, Start, bed, given_bed, mid_discharge, scene_of
from bench.window import OtherLoad, commit, machine

PARTS = ("pairs", "walls", "motion", "lists", "rest")
Case = Literal["bed", "hourglass"]


def least(launch: Callable[[], Any], repeats: int) -> float:
    """Least wall time of one launch [s]; several in a row where the clock is too coarse for one."""
    begin = time.perf_counter()
    launch()
    many = max(1, round(2e-3 / max(time.perf_counter() - begin, 1e-6)))
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        for _ in range(many):
            launch()
        times.append((time.perf_counter() - begin) / many)
    return min(times)


def phases(sim: warpdem.Simulation, repeats: int) -> dict[str, float]:
    """Least wall time of each phase of the present step [s]; the motion goes on with each launch."""
    engine, loop, lists = sim.engine, sim.kernels.loop, sim.lists
    grains, contacts, walls = engine.structs.arguments()
    (base, _), n = engine.batch.row(), len(sim.state)
    batches = lists.totals[0] // sim.plan.backend.lanes  # the arrays are longer
    batch = engine.batch
    shared = batch.model, batch.control, grains
    calls: dict[str, tuple[wp.Kernel, list[Any]]] = {
        "pairs": (loop.pair_forces, [1, batches, base, 0, *shared, contacts, batch.report]),
        "walls": (loop.wall_forces, [1, lists.row_count, base, 0, sim.step_number & 1, *shared, walls, batch.report]),
        "motion": (loop.move, [n, base, 0, *shared, walls, batch.report, lists.share_that_holds]),
    }
    out = {}
    for name, (kernel, inputs) in calls.items():
        command = wp.launch(kernel, dim=1, inputs=inputs, device=sim.device, record_cmd=True)
        out[name] = least(command.launch, repeats)
    return out


def windows(sim: warpdem.Simulation, steps: int, repeats: int) -> tuple[float, float]:
    """Wall time of a step and, within it, of the lists [s]: of the quickest window."""
    found = []
    for _ in range(repeats):
        before, begin = spent_on_lists(sim), time.perf_counter()
        sim.step(steps)
        found.append(((time.perf_counter() - begin) / steps, (spent_on_lists(sim) - before) / steps))
    return min(found)


def spent_on_lists(sim: warpdem.Simulation) -> float:
    """Wall time so far that the run's own timers give to the lists [s]."""
    return sum(sim.seconds.get(stage, 0.0) for stage in ("lists", "refresh"))


def profile(start: Start, model: Model, settings: Settings) -> dict[str, Any]:
    """Times of one case [ns per grain and step]."""
    sim = warpdem.Simulation(scene_of(start, model, settings), threads=1)
    sim.step(settings.warm)
    n, load = len(sim.state), OtherLoad()
    whole, lists = windows(sim, settings.steps, settings.repeats)
    sim.step(1)  # lists and forces are those of the present time
    found = phases(sim, settings.repeats)
    found |= {"lists": lists, "rest": whole - lists - sum(found.values())}
    times = {name: 1e9 * seconds / n for name, seconds in {**found, "step": whole}.items()}
    contacts = 2.0 * sim.lists.contact_count / n
    sim.threads.close()
    return {"state": start.name, "model": model, "grains": n, "listed_per_grain": contacts, **times, "load": load.cores()}


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    states: Path | None = None,
    mesh: str | None = None,
    cases: Sequence[Case] = ("bed", "hourglass"),
    grains: Sequence[int] = (2000, 20_000),
    models: Sequence[Model] = ("full", "frictionless"),
    warm: int = 50,
    steps: int = 200,
    repeats: int = 15,
    precision: Precision = "double",
    settle: int = 20_000,
    flow: float = 0.12,
    work: Path | None = None,
    out: Path | None = None,
) -> None:
    """Measure and print a table.

    Args:
        states: Folder of states bed_N.npz and glass_N.npz; states are made if not given.
        mesh: Mesh of glass_N.npz in metres; {n} stands for the number of grains.
        cases: Settled beds, an hourglass in mid-discharge.
        grains: Numbers of grains of the beds.
        models: Contact models.
        warm: Steps before the windows.
        steps: Steps of each window.
        repeats: Windows, and launches of each phase, of which the quickest counts.
        precision: Of the contact law.
        settle: Steps that a bed made here settles.
        flow: Simulated time from turning the hourglass over to the windows [s].
        work: Folder that keeps states; a temporary one if not given.
        out: JSON file to write.
    """
    settings, rows = Settings(warm=warm, steps=steps, repeats=repeats, precision=precision), []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(work or temporary).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        for case in cases:
            for count in grains if case == "bed" else (OWN_GLASS[0],):
                if case == "hourglass":
                    start = mid_discharge(count, states, mesh, folder, settings, flow)
                else:
                    start = given_bed(count, states) if states else bed(count, folder, settings, settle)
                rows += [profile(start, model, settings) for model in models]
    title = "wall time on one thread, ns per grain and step, and share of the step"
    table = Table(box=SIMPLE, title=title, title_justify="left")
    for name in ("state", "model", "step", *PARTS, "listed", "load"):
        table.add_column(name, justify="left" if name in ("state", "model") else "right", no_wrap=True)
    for row in rows:
        parts = (f"{row[name]:.1f} {row[name] / row['step']:.0%}" for name in PARTS)
        table.add_row(
            row["state"], row["model"], f"{row['step']:.1f}", *parts, f"{row['listed_per_grain']:.1f}", f"{row['load']:.1f}"
        )
    Console(highlight=False, width=None if sys.stdout.isatty() else 140).print(table)
    if out is not None:
        out.write_text(json.dumps({"machine": machine(), "commit": commit(), "cases": rows}, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(app())
