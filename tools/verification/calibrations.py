"""Whether calibration finds known parameters within the errors that it states: `python tools/verification/calibrations.py`.

Each trial draws friction and restitution, makes targets from 6 runs with them and adds an error of measurement, and calibrates
anew, with other seeds: two experiments with grains, a heap that falls apart (its angle tells friction) and a few grains that
bounce (their mean height tells restitution). A trial holds where all parameters lie in their intervals, 95 % of them by the
default confidence. The runs are made in this process, through the interface that executors of a sweep have.
"""

import json
import math
import shutil
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from cyclopts import App
from rich.console import Console

from warpdem import load_scene, runs
from warpdem.app.calibrate import calibrate
from warpdem.runner import run_scene
from warpdem.sweep.executors import Submit
from warpdem.sweep.quantities import Quantity
from warpdem.sweep.row import FINAL, status_of, write_result
from warpdem.sweep.worker import Task

SCENE = """
title = "grains on a floor"
gravity = [0, 0, -9.81]
[materials.g]
density = 2500
young_modulus = "10 MPa"
poisson_ratio = 0.25
[[pairs]]
materials = ["g", "g"]
restitution = 0.5
friction = 0.4
[[walls]]
name = "floor"
material = "g"
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
[borders]
y = { min = 0, max = 0.012, kind = "periodic" }
[[grains]]
material = "g"
fill = { box = { min = [-0.012, 0, BOTTOM], max = [0.012, 0.012, TOP] }, solid_fraction = SOLID,
         diameter = { uniform = ["3.5 mm", "4.5 mm"] }, seed = 1 }
[time]
end = END
max_speed = "1.2 m/s"
[engine]
max_overlap = 0.3
[output]
formats = ["vtk"]
picture = false
interval = END
history_interval = 0.002
"""
EXPERIMENTS = {
    "heap": ({"BOTTOM": "0.004", "TOP": "0.034", "SOLID": "0.5", "END": "0.2"}, "frame.cone_angle", 0.3),
    "bounce": ({"BOTTOM": "0.03", "TOP": "0.06", "SOLID": "0.06", "END": "0.2"}, "centre_z:mean@0.1:0.2", 3e-4),
}
"""Scene, measure and standard deviation of its measurement [degree; m]."""
RANGES = {"friction": (0.1, 0.9), "restitution": (0.1, 0.9)}
INNER = 0.15
"""True values keep this share of the ranges from their ends."""
OF_TRUTH = 6
"""Runs that a target is the mean of."""


def run_here(folder: Path, scene: Path, changes: list[str]) -> None:
    """Run a scene in this process."""
    run_scene(load_scene(scene, changes), folder, device="cpu", threads=1, quiet=True, overwrite=True, picture=False)


@contextmanager
def in_process(workers: int, threads: int, folder: Path, gpus: int) -> Iterator[Submit]:
    """An executor that runs rows in this process."""

    def submit(task: Task) -> "Future[int]":
        future: Future[int] = Future()
        place = Path(task.folder)
        if status_of(place) not in FINAL:
            words = list(task.arguments)
            run_here(place, Path(words[0]), words[words.index("--set") + 1 :])
            write_result(place, 0, "")
        future.set_result(0)
        return future

    yield submit


def scenes(folder: Path) -> dict[str, Path]:
    """Scene file of each experiment."""
    made = {}
    for name, (words, _, _) in EXPERIMENTS.items():
        text = SCENE
        for word, value in words.items():
            text = text.replace(word, value)
        made[name] = folder / f"{name}.toml"
        made[name].write_text(text.replace("solid_fraction = 0.5,\n        ", "solid_fraction = 0.5,")
                              .replace("solid_fraction = 0.06,\n        ", "solid_fraction = 0.06,"))  # fmt: skip
    return made


def target(scene: Path, measure: str, error: float, true: dict[str, float], random: np.random.Generator) -> tuple[float, float]:
    """A measured value and its standard deviation, chance of the runs that it comes from included."""
    found = []
    for _ in range(OF_TRUTH):
        changes = [f"pairs.0.{name}={value}" for name, value in true.items()]
        folder = scene.parent / "truth"
        run_here(folder, scene, [*changes, f"grains.0.fill.seed={random.integers(10**9, 2 * 10**9)}"])
        found.append(Quantity(measure).of(runs.read(folder)))
    of_runs = float(np.std(found, ddof=1)) / math.sqrt(OF_TRUTH)
    return float(np.mean(found)) + error * float(random.standard_normal()), math.hypot(error, of_runs)


def trial(number: int, runs_each: int, folder: Path, console: Console) -> dict:
    """One trial: true and found values, and whether the intervals hold them."""
    random = np.random.default_rng([20, number])
    shares = INNER + (1.0 - 2.0 * INNER) * random.random(len(RANGES))
    true = {name: low + (high - low) * share for (name, (low, high)), share in zip(RANGES.items(), shares, strict=True)}
    files = scenes(folder)
    text = f"seed = {number}\nruns = {runs_each}\n"
    text += "".join(f'[[parameters]]\nname = "{name}"\nkey = "pairs.0.{name}"\nrange = "{low}:{high}"\n'
                    for name, (low, high) in RANGES.items())  # fmt: skip
    for name, (_, measure, error) in EXPERIMENTS.items():
        value, uncertainty = target(files[name], measure, error, true, random)
        text += f'[[experiments]]\nname = "{name}"\nscene = "{name}.toml"\n[[experiments.targets]]\n'
        text += f'measure = "{measure}"\nvalue = {value}\nuncertainty = {uncertainty}\n'
    file = folder / "trial.toml"
    file.write_text(text)
    done = calibrate(file, folder / "out", on=in_process, console=console, quiet=True)
    rows = []
    for one in done.verdict.parameters:
        held = bool(one.low <= true[one.name] <= one.high)
        rows.append({"name": one.name, "true": true[one.name], "found": one.value, "low": one.low, "high": one.high,
                     "error": one.error, "held": held, "known": one.known})  # fmt: skip
    return {"trial": number, "runs": len(done.found.x), "held": all(row["held"] for row in rows), "parameters": rows}


app = App(help=__doc__, version_flags=())


@app.default
def main(*, trials: int = 20, first: int = 0, runs_each: int = 21, out: Path = Path("calibrations.json")) -> None:
    """Run the trials, print a line of each, and write what came out.

    Args:
        trials: How many.
        first: Number of the first one, which true values and seeds are drawn from.
        runs_each: Most runs of each experiment in a trial.
        out: File to write; trials that it holds are not made again.
    """
    console = Console(highlight=False)
    results = json.loads(out.read_text()) if out.exists() else []
    for number in range(first, first + trials):
        if not any(one["trial"] == number for one in results):
            folder = Path(tempfile.mkdtemp(prefix="calibration"))
            try:
                results.append(trial(number, runs_each, folder, console))
            finally:
                shutil.rmtree(folder)
            out.write_text(json.dumps(results, indent=1) + "\n")
        one = next(one for one in results if one["trial"] == number)
        words = ", ".join(f"{p['name']} {p['true']:.3f}: {p['found']:.3f} ({p['low']:.3f} to {p['high']:.3f})"
                          for p in one["parameters"])  # fmt: skip
        console.print(f"{number}: {'holds' if one['held'] else 'MISSES'} after {one['runs']} runs: {words}", markup=False)
    held = sum(one["held"] for one in results)
    off = [(p["found"] - p["true"]) / p["error"] for one in results for p in one["parameters"]]
    rms = math.sqrt(sum(x * x for x in off) / len(off))
    console.print(f"{held} of {len(results)} trials hold; off by {rms:.2f} of the stated standard error (rms)", markup=False)


if __name__ == "__main__":
    sys.exit(app())
