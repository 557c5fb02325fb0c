"""Run time against error: `python tools/bench/work_precision/measure.py --help`; what the problems are: problems.py, README.md.

Each problem is solved with every integrator, time step and precision. The error is measured on a few copies of the problem over
its whole duration, the time on a batch of many copies on one thread, after some steps that compile and warm up. Times of long
runs are scaled from their first steps: the work per step is steady in these problems. The bed is its own batch: it is timed
in full.
"""

import json
import platform
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Literal, get_args

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # tools/

import numpy as np
import warp as wp
from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table

import warpdem
from bench.window import OtherLoad, commit, machine
from bench.work_precision.compare import DEFAULT, cheapest, claims, cost_key, frontier, others_win
from bench.work_precision.plot import plot
from bench.work_precision.problems import PROBLEMS, Problem, Setting
from warpdem.scene.models import model
from warpdem.scene.settings import Engine

INTEGRATORS = get_args(Engine.model_fields["integrator"].annotation)
PRECISIONS = get_args(Engine.model_fields["precision"].annotation)
TIMED_STEPS = 2000  # longest run that is timed in full
FEWEST_STEPS = 100
WARM_STEPS = 5
RESULTS = Path(__file__).resolve().parents[1] / "results"
QUICK = 2  # with --quick: how many times fewer steps of the reference

Name = Literal["free_grain", "damped_contact", "oblique_impact", "turning_disk", "bed"]
ALL = list(get_args(Name))


def follow(problem: Problem, setting: Setting, copies: int, twin: int = 0) -> tuple[np.ndarray, float]:
    """Figures at the samples of a run, shape (samples, copies, k), and the seconds that its steps took.

    Raises:
        StabilityError: the run became unstable.
        SceneError: the scene refuses the setting.
    """
    sim = problem.simulation(setting, copies, twin)
    stops = setting.steps * np.arange(1, problem.samples + 1) // problem.samples
    figures, seconds = [], 0.0
    sim.step(1)  # compiles
    for stop in stops:
        begin = time.perf_counter()
        sim.step(int(stop) - sim.step_number)
        seconds += time.perf_counter() - begin
        figures.append(problem.figures(sim))
    sim.threads.close()
    return np.stack(figures), seconds


def batch_seconds(problem: Problem, setting: Setting, copies: int, repeats: int) -> float:
    """Seconds of a whole run of ``copies`` copies on one thread: median over the repeats, start and compilation apart.

    A run of few steps is repeated until FEWEST_STEPS have been timed.
    """
    timed = min(setting.steps, TIMED_STEPS)
    problem.simulation(setting, 1).step(WARM_STEPS)
    found = []
    for _ in range(max(repeats, FEWEST_STEPS // timed)):
        sim = problem.simulation(setting, copies)
        sim.contacts()  # lists and forces of the start
        begin = time.perf_counter()
        sim.step(timed)
        found.append(time.perf_counter() - begin)
        sim.threads.close()
    return median(found) * setting.steps / timed


def measure(problem: Problem, setting: Setting, reference: np.ndarray, copies: int, repeats: int) -> dict:
    """One setting of a problem: error, force calls, and seconds unless ``copies`` is 0; error None if it broke down."""
    calls = len(model("integrator", setting.integrator).STAGES)
    result = {
        "integrator": setting.integrator,
        "precision": setting.precision,
        "steps": setting.steps,
        "step": problem.duration / setting.steps,
        "calls_per_step": calls,
        "force_calls": calls * setting.steps,
        "error": None,
        "seconds": None,
        "stopped": None,
    }
    try:
        figures, whole = follow(problem, setting, problem.error_copies)
        if np.isfinite(figures).all():
            result["error"] = problem.error(figures, reference)
        else:
            result["stopped"] = "not finite"
        if copies:
            result["seconds"] = batch_seconds(problem, setting, copies, repeats) if problem.batch else whole
    except warpdem.StabilityError as error:
        result["stopped"] = str(error)
    return result


def reference_of(problem: Problem, steps: int | None) -> tuple[np.ndarray, float | None]:
    """What the figures should be, and the rms distance of the twins of a chaotic problem from it."""
    if steps is None:
        return problem.exact(problem.error_copies), None
    setting = Setting(*DEFAULT, steps)
    reference, _ = follow(problem, setting, problem.error_copies)
    away = [
        problem.error(follow(problem, setting, problem.error_copies, twin + 1)[0], reference)
        for twin in range(problem.twins)
    ]
    return reference, float(np.sqrt(np.mean(np.square(away)))) if away else None


def bench(
    problem: Problem,
    *,
    copies: int = 10_000,
    steps: Sequence[int] | None = None,
    reference_steps: int | None = None,
    integrators: Sequence[str] = INTEGRATORS,
    precisions: Sequence[str] = PRECISIONS,
    repeats: int = 3,
    console: Console | None = None,
) -> dict:
    """Run all settings of one problem and return what its JSON file holds.

    Args:
        problem: the problem.
        copies: Copies in the batch that is timed; 0 measures force calls only.
        steps: Numbers of steps; those of the problem if not given.
        reference_steps: Steps of the reference; those of the problem if not given.
        integrators: Integrators to compare.
        precisions: Precisions to compare.
        repeats: Timed runs of each setting.
        console: Where progress goes.
    """
    console = console or Console(highlight=False)
    skipped = {}
    if not problem.has_pairs:
        skipped = {p: "no grain touches another: nothing is computed in single precision" for p in precisions if p != "double"}
    load = OtherLoad()
    steps_of_reference = None if problem.reference_steps is None else reference_steps or problem.reference_steps
    reference, noise = reference_of(problem, steps_of_reference)
    settings = []
    for precision in (p for p in precisions if p not in skipped):
        for integrator in integrators:
            try:
                problem.simulation(Setting(integrator, precision, max(steps or problem.steps)), 1)
            except warpdem.SceneError as error:
                skipped[f"{integrator} {precision}"] = str(error)
                continue
            for count in steps or problem.steps:
                settings.append(measure(problem, Setting(integrator, precision, count), reference, copies, repeats))
            newest = settings[-len(steps or problem.steps) :]
            errors = " ".join("stopped" if s["error"] is None else f"{s['error']:.1e}" for s in newest)
            console.print(f"{problem.name} {integrator} {precision}: {errors}")
    timed = [s for s in settings if s["error"] is not None]
    key = cost_key(timed)
    rows = cheapest(settings if key == "force_calls" else timed, key)
    return {
        "problem": problem.name,
        "title": problem.title,
        "error_is": problem.error_is,
        "duration": problem.duration,
        "copies": (copies if problem.batch else 1) if copies else None,
        "reference_steps": steps_of_reference,
        "noise": noise,
        "machine": machine(),
        "versions": {"warpdem": warpdem.__version__, "warp": wp.config.version, "python": platform.python_version()},
        "commit": commit(),
        "time": time.strftime("%Y-%m-%d %H:%M:%S"),
        "other_load_cores": load.cores(),
        "cost": key,
        "settings": settings,
        "skipped": skipped,
        "frontier": [[s["integrator"], s["precision"], s["steps"]] for s in frontier(timed, key)],
        "cheapest": rows,
        "others_win": others_win(rows),
        "claims": claims(problem.name, settings, key),
    }


def print_report(report: dict, console: Console) -> None:
    """Cheapest settings and claims of one problem."""
    key = report["cost"]
    table = Table(title=f"{report['title']}: cheapest setting for a given error", title_justify="left")
    for name in ("error", "integrator", "precision", key.replace("_", " "), "exact_drift, double"):
        table.add_column(name)
    for row in report["cheapest"]:
        default = "-" if row["default"] is None else f"{row['default']:.3g}"
        table.add_row(f"{row['error']:.0e}", row["integrator"], row["precision"], f"{row[key]:.3g}", default)
    console.print(table)
    for line in report["others_win"]:
        console.print(line)
    for claim in report["claims"]:
        console.print(f"{'holds' if claim['holds'] else 'FAILS'}: {json.dumps(claim)}")
    for what, why in report["skipped"].items():
        console.print(f"{what} left out: {why}")


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    problem: list[Name] = ALL,
    quick: bool = False,
    copies: int = 10_000,
    repeats: int = 3,
    out: Path = RESULTS,
) -> None:
    """Measure; write error_PROBLEM.json and error_PROBLEM.png.

    Args:
        problem: Problems to run.
        quick: Every second step size without the finest, coarser references; for a look.
        copies: Copies in the batch that is timed; 0 compares force calls only, which other load does not disturb.
        repeats: Timed runs of each setting.
        out: Folder of the results.
    """
    console = Console(highlight=False)
    out.mkdir(parents=True, exist_ok=True)
    for name in problem:
        one = PROBLEMS[name]
        reference = one.reference_steps
        report = bench(
            one,
            copies=copies,
            steps=one.steps[:-2:2] if quick else None,
            reference_steps=reference // QUICK if quick and reference else None,
            repeats=repeats,
            console=console,
        )
        print_report(report, console)
        (out / f"error_{name}.json").write_text(json.dumps(report, indent=1) + "\n")
        plot(report, out / f"error_{name}.png")
        console.print(f"wrote {out / f'error_{name}'}.json and .png")


if __name__ == "__main__":
    sys.exit(app())
