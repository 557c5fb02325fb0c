"""What ``warpdem calibrate`` does: runs the search, says how far it is and what came out, and writes the page."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from warpdem.calibration.calibrate import RESULT, TABLE, Calibrated
from warpdem.calibration.calibrate import calibrate as search
from warpdem.calibration.experiments import Experiments, How
from warpdem.calibration.file import Calibration, load_calibration
from warpdem.core.cpu_cores import available_cores
from warpdem.core.progress import duration_text, progress_bar
from warpdem.core.run_lock import locked
from warpdem.reports.calibration_page import write_calibration_page
from warpdem.sweep.executors import Factory
from warpdem.sweep.row import OPEN
from warpdem.sweep.sweep import Outcome


def calibrate(
    file: Path,
    folder: Path,
    *,
    on: str | Factory = "local",
    workers: int | None = None,
    threads: int | None = None,
    device: str | None = None,
    precision: str | None = None,
    plugins: Sequence[Path] = (),
    allow_paths: Sequence[Path] = (),
    console: Console,
    quiet: bool = False,
) -> Calibrated:
    """Calibrate to the end.

    Args:
        file: calibration file.
        folder: of the calibration.
        on: what runs the rows, as ``run_sweep``.
        workers: rows at once; as many as there are cores if not given.
        threads: CPU threads of each; the cores over the workers if not given.
        device: as ``Simulation``; "cuda" gives each worker a GPU of its own.
        precision: of the contact law instead of the scenes'.
        plugins: as ``load_scene``.
        allow_paths: as ``load_scene``.
        console: where to print.
        quiet: print errors only.

    Raises:
        WarpdemError: as ``warpdem.calibration.calibrate.calibrate``.
        KeyboardInterrupt: after the rows that ran have written their checkpoints.
    """
    made = load_calibration(file)
    cores = available_cores()
    workers = cores if workers is None else workers
    threads = max(1, cores // max(workers, 1)) if threads is None else threads
    how = How(on, workers, threads, device, precision, plugins, allow_paths)
    begin = time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder), progress_bar(console, quiet, 1000) as bar:
        whole = Experiments(made, file, folder, how, lambda name, outcomes: _show(bar, name, outcomes))

        def tell(words: str) -> None:
            if not quiet:
                console.print(words, markup=False)

        done = search(whole, tell)
        page = write_page(folder, made, done)
    if not quiet:
        print_verdict(done, console)
        seconds = duration_text(time.perf_counter() - begin)
        console.print(f"{len(done.found.x)} runs of each experiment in {seconds}: {folder / TABLE}, {page}", markup=False)
        console.print("best scenes: " + ", ".join(str(path) for path in done.scenes), markup=False)
    return done


def _show(bar: Callable[[int, str], None], name: str, outcomes: Sequence[Outcome]) -> None:
    ended = sum(one.status not in OPEN for one in outcomes)
    bar(1000 * ended // max(1, len(outcomes)), f"{name}: {ended} of {len(outcomes)} runs")


def write_page(folder: Path, made: Calibration, done: Calibrated) -> Path:
    """Write the page of a calibration that has ended."""
    result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    limits = [one.limits for one in made.parameters]
    values = np.array([[one.number(at) for one, at in zip(limits, x, strict=True)] for x in done.found.x.tolist()])
    scenes = [path.relative_to(folder).as_posix() for path in done.scenes]
    return write_calibration_page(folder, made.title or "Calibration", result, values, done.found.y, scenes)


def print_verdict(done: Calibrated, console: Console) -> None:
    """What was found, for people."""
    said = done.verdict
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for head in ("parameter", "value", f"{100.0 * said.confidence:g} % interval", "standard error", ""):
        table.add_column(head, no_wrap=True)
    for one in said.parameters:
        unit = f" {one.unit}" if one.unit else ""
        words = "" if one.known else "not determined by the targets"
        table.add_row(Text(one.name), f"{one.value:.4g}{unit}", f"{one.low:.4g} to {one.high:.4g}", f"{one.error:.2g}",
                      Text(words, style="yellow"))  # fmt: skip
    console.print(table)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for head in ("target", "value", "uncertainty", "fitted", "runs at the best values"):
        table.add_column(head, no_wrap=head != "target")
    for met in said.targets:
        checked = "-" if met.checked is None else f"{met.checked:.4g} ({met.checks})"
        table.add_row(Text(met.name), f"{met.target:.4g}", f"{met.uncertainty:.2g}", f"{met.fitted:.4g}", checked)
    console.print(table)
    for note in said.notes:
        console.print(Text(f"note: {note}", style="yellow"))
