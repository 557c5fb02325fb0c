"""A sweep as a whole: checks all rows, runs those that are not done, and writes the table of results after each."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from pathlib import Path

from warpdem.core.atomic_file import replaced
from warpdem.core.run_lock import locked
from warpdem.errors import SceneError, WarpdemError
from warpdem.output.history import history_columns
from warpdem.runs import read
from warpdem.runs.run import RECORD
from warpdem.scene.file import load_scene
from warpdem.scene.model import Scene
from warpdem.sweep.executors import Factory, executor, require
from warpdem.sweep.quantities import Quantity
from warpdem.sweep.row import FINAL, folder_of, record_of, status_of, why
from warpdem.sweep.table import Row, overrides
from warpdem.sweep.worker import Task

TABLE, PLAN = "sweep.csv", "sweep.json"
"""Table of results, and what the sweep is made of."""
MOST_WRONG = 10
"""Wrong rows that a message names."""
LOOK = 0.2
"""Time between two looks whether the kernels of the first row are compiled [s]."""


class RowsFailed(WarpdemError):
    """Rows of a sweep have failed; the others are done."""

    exit_code = 3


@dataclass(frozen=True)
class Outcome:
    """What came out of a row."""

    number: int
    """Number of the row, from 1."""
    row: Row
    """Its values by column."""
    status: str
    """As ``row.status_of``."""
    why: str
    """What it said if it failed."""
    wall_seconds: float
    """Wall time of its run [s], of the last attempt; nan if it is not done."""
    state_hash: str
    """Hash of its final state; empty if it is not done."""
    results: dict[str, float]
    """Its quantities by their texts; nan if it is not done."""


@dataclass(frozen=True)
class Sweep:
    """A scene, its rows, and how each is run."""

    scene: Path
    folder: Path
    rows: list[Row]
    quantities: list[Quantity]
    plugins: Sequence[Path] = ()
    allow_paths: Sequence[Path] = ()

    def check(self, skip_wrong: bool = False) -> list[str]:
        """Read the scene of every row; for each the reason why it is wrong, empty for those that are not.

        Raises:
            SceneError: rows are wrong and ``skip_wrong`` is not given, or a quantity is no column of a scene.
        """
        reasons = []
        for row in self.rows:
            try:
                scene = load_scene(self.scene, overrides(row), allow_paths=self.allow_paths, plugins=self.plugins)
                reasons.append("")
            except SceneError as error:
                reasons.append(str(error))
                continue
            self._check_quantities(scene)
        wrong = [(number, reason) for number, reason in enumerate(reasons, 1) if reason]
        if wrong and (not skip_wrong or len(wrong) == len(self.rows)):
            named = "\n".join(f"row {number}: {reason}" for number, reason in wrong[:MOST_WRONG])
            more = f"\nand {len(wrong) - MOST_WRONG} more" if len(wrong) > MOST_WRONG else ""
            remedy = "" if len(wrong) == len(self.rows) else "; mend them, or give --skip-wrong"
            raise SceneError(f"{len(wrong)} of {len(self.rows)} rows are wrong, and nothing was run{remedy}:\n{named}{more}")
        return reasons

    def _check_quantities(self, scene: Scene) -> None:
        needing = [quantity.text for quantity in self.quantities if quantity.needs_frame]
        if needing and not {"vtk", "vtkhdf"} & {*scene.output.formats}:
            raise SceneError(f'result {needing[0]!r}: the scene writes no frames; let output.formats hold "vtk" or "vtkhdf"')
        headers = [column.header for column in history_columns(scene)]
        for quantity in self.quantities if not scene.phases else ():
            quantity.check(headers)

    def outcome(self, number: int, reason: str) -> Outcome:
        """What came out of row ``number``, from its folder; ``reason`` is why it is not run."""
        folder = folder_of(self.folder, number)
        status, record = "wrong" if reason else status_of(folder), record_of(folder)
        results = {quantity.text: math.nan for quantity in self.quantities}
        if status == "done":
            run = read(folder)
            results = {quantity.text: quantity.of(run) for quantity in self.quantities}
            record = run.last
        wall = record.get("seconds", {}).get("total", math.nan)
        state = str(record.get("state_hash", "")) if status == "done" else ""
        said = reason or (why(folder) if status != "done" else "")
        return Outcome(number, self.rows[number - 1], status, said, float(wall), state, results)

    def claim(self) -> None:
        """Note what the sweep is made of, or refuse a folder that holds another.

        Rows may be added at the end, and results asked for be others.

        Raises:
            SceneError: the folder holds a sweep of another scene or with other rows.
        """
        plan = {"scene": str(self.scene.resolve()), "rows": self.rows}
        path = self.folder / PLAN
        if path.exists():
            try:
                there = json.loads(path.read_text(encoding="utf-8"))
                rows, scene = list(there["rows"]), there["scene"]
            except (OSError, ValueError, KeyError, TypeError) as error:
                raise SceneError(f"{path}: cannot be read as that of a sweep ({error!r}); take another --out") from error
            if scene != plan["scene"] or rows != self.rows[: len(rows)]:
                raise SceneError(
                    f"--out {self.folder}: holds another sweep, of {scene} with {len(rows)} rows; take another one (to go on, "
                    "give the command that began it; rows may be added at the end of its table)"
                )
        self.folder.mkdir(parents=True, exist_ok=True)
        with replaced(path) as part:
            part.write_text(json.dumps(plan, indent=1) + "\n", encoding="utf-8")

    def write_table(self, outcomes: Sequence[Outcome]) -> None:
        """Write sweep.csv: the rows, their status and results."""
        keys = list(dict.fromkeys(key for row in self.rows for key in row))
        names = [quantity.text for quantity in self.quantities]
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["row", *keys, *names, "status", "why", "wall_time [s]", "state_hash"])
        for one in outcomes:
            values = ["" if math.isnan(one.results[name]) else repr(one.results[name]) for name in names]
            wall = "" if math.isnan(one.wall_seconds) else f"{one.wall_seconds:.3f}"
            given = [one.row.get(key, "") for key in keys]
            writer.writerow([one.number, *given, *values, one.status, one.why, wall, one.state_hash])
        with replaced(self.folder / TABLE) as part:
            part.write_text(text.getvalue(), encoding="utf-8")


def run_sweep(
    sweep: Sweep,
    *,
    on: str | Factory = "local",
    workers: int = 1,
    threads: int = 1,
    device: str | None = None,
    precision: str | None = None,
    skip_wrong: bool = False,
    watch: Callable[[Sequence[Outcome]], None] = lambda outcomes: None,
) -> list[Outcome]:
    """Run the rows that are not done, and write the table after each.

    Args:
        sweep: what to run.
        on: "local", "mpi", "dask", "slurm", or an executor of your own.
        workers: rows at once.
        threads: CPU threads of each.
        device: as ``Simulation``; "cuda" gives each local worker a GPU, one after the other.
        precision: of the contact law instead of the scene's.
        skip_wrong: run the other rows where some are wrong.
        watch: called with all outcomes at the start and after each row.

    Returns:
        What came out of each row.

    Raises:
        SceneError: before anything is run: rows, quantities or the folder are wrong, or the executor is not there.
        KeyboardInterrupt: after the rows that ran have written their checkpoints.
    """
    require(on)
    if workers < 1 or threads < 1:
        raise SceneError(f"--workers {workers} and --threads {threads}: must be 1 or more")
    reasons = sweep.check(skip_wrong)
    gpus = _gpus() if device == "cuda" and on == "local" else 0
    with locked(sweep.folder):
        sweep.claim()
        numbers = range(1, len(sweep.rows) + 1)
        outcomes = [sweep.outcome(number, reasons[number - 1]) for number in numbers]
        sweep.write_table(outcomes)
        watch(outcomes)
        waiting = [_task(sweep, one, threads, device, precision) for one in outcomes if one.status not in FINAL]
        with executor(on, workers, threads, sweep.folder, gpus) as submit:
            running: dict[Future[int], Task] = {}
            while waiting or running:
                # the first one compiles the kernels that the others share
                alone = len(running) == 1 and len(waiting) > 0 and not _kernels_are_there(running)
                while waiting and len(running) < workers and not alone:
                    task = waiting.pop(0)
                    running[submit(task)] = task
                    alone = len(running) == 1 and not _kernels_are_there(running)
                done, _ = wait(running, timeout=LOOK if alone else None, return_when=FIRST_COMPLETED)
                for future in done:
                    task = running.pop(future)
                    _refuse_lost(future, task)
                    outcomes[task.number - 1] = sweep.outcome(task.number, reasons[task.number - 1])
                    sweep.write_table(outcomes)
                    watch(outcomes)
    return outcomes


def _task(sweep: Sweep, one: Outcome, threads: int, device: str | None, precision: str | None) -> Task:
    folder = folder_of(sweep.folder, one.number).absolute()
    # absolute: a worker may stand in another folder
    arguments = [str(sweep.scene.absolute()), "--out", str(folder), "--quiet", "--no-picture", "--threads", str(threads)]
    arguments += ["--precision", precision] if precision else []
    for name, paths in (("--plugin", sweep.plugins), ("--allow-path", sweep.allow_paths)):
        arguments += [word for path in paths for word in (name, str(path.absolute()))]
    changes = overrides(one.row)
    arguments += ["--set", *changes] if changes else []
    return Task(one.number, str(folder), tuple(arguments), device)


def _kernels_are_there(running: dict[Future[int], Task]) -> bool:
    """Whether the only row that runs has loaded its kernels, or has ended: its run.json is written then."""
    return any((Path(task.folder) / RECORD).exists() or future.done() for future, task in running.items())


def _refuse_lost(future: Future[int], task: Task) -> None:
    """Raise what kept a worker from running a row at all."""
    error = future.exception()
    if error is not None:
        raise WarpdemError(f"row {task.number}: no worker could run it ({error})") from error


def _gpus() -> int:
    """Number of GPUs of this machine.

    Raises:
        SceneError: there is none.
    """
    import warp as wp

    count: int = wp.get_cuda_device_count()
    if not count:
        raise SceneError("--device cuda: there is no GPU on this machine; give --device cpu")
    return count


def failed(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Rows that are not done."""
    return [one for one in outcomes if one.status != "done"]
