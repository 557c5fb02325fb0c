"""What ``warpdem sweep`` does: makes the rows, runs them, says how far it is, and writes the page."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from warpdem.core.cpu_cores import available_cores
from warpdem.core.progress import duration_text, progress_bar
from warpdem.errors import SceneError
from warpdem.reports.sweep_page import write_sweep_page
from warpdem.sweep.quantities import DEFAULT, Quantity
from warpdem.sweep.row import OPEN
from warpdem.sweep.sweep import TABLE, Outcome, RowsFailed, Sweep, failed, run_sweep
from warpdem.sweep.table import Row, grid, read_table, samples

SHOWN = 5
"""Failed rows that the message names."""


def rows_of(table: Path | None, grids: Sequence[str], ranges: Sequence[str], count: int | None, seed: int) -> list[Row]:
    """The rows from exactly one of a table, a grid and samples.

    Raises:
        SceneError: none is given, or several, or one is wrong.
    """
    given = [name for name, there in (("TABLE", table is not None), ("--grid", grids), ("--sample", ranges)) if there]
    if len(given) != 1:
        raise SceneError(f"sweep: give exactly one of TABLE, --grid and --sample, not {' and '.join(given) or 'none'}")
    if ranges and count is None:
        raise SceneError("--sample: give --count, the number of rows")
    if not ranges and count is not None:
        raise SceneError("--count: belongs to --sample")
    if table is not None:
        return read_table(table)
    return grid(grids) if grids else samples(ranges, count or 0, seed)


def sweep(
    scene: Path,
    rows: list[Row],
    folder: Path,
    *,
    results: Sequence[str] = (),
    on: str = "local",
    workers: int | None = None,
    threads: int | None = None,
    device: str | None = None,
    precision: str | None = None,
    skip_wrong: bool = False,
    plugins: Sequence[Path] = (),
    allow_paths: Sequence[Path] = (),
    console: Console,
    quiet: bool = False,
) -> list[Outcome]:
    """Run a sweep to its end.

    Args:
        scene: scene file.
        rows: changes of each row.
        folder: of the sweep.
        results: quantities of each row, as ``warpdem.sweep.quantities.Quantity``.
        on: "local", "mpi", "dask" or "slurm".
        workers: rows at once; as many as there are cores if not given, but no more than rows.
        threads: CPU threads of each; the cores over the workers if not given.
        device: as ``Simulation``; "cuda" gives each worker a GPU of its own.
        precision: of the contact law instead of the scene's.
        skip_wrong: run the other rows where some are wrong.
        plugins: as ``load_scene``.
        allow_paths: as ``load_scene``.
        console: where to print.
        quiet: print errors only.

    Raises:
        SceneError: before anything is run.
        RowsFailed: rows have failed.
        KeyboardInterrupt: after the rows that ran have written their checkpoints.
    """
    cores = available_cores()
    workers = min(cores, len(rows)) if workers is None else workers
    threads = max(1, cores // max(workers, 1)) if threads is None else threads
    whole = Sweep(scene, folder, rows, [Quantity(text) for text in results or DEFAULT], plugins, allow_paths)
    begin = time.perf_counter()
    if not quiet:
        console.print(f"{len(rows)} rows of {scene}, {workers} at once with {threads} threads each -> {folder}", markup=False)
    with progress_bar(console, quiet, len(rows)) as tell:

        def watch(outcomes: Sequence[Outcome]) -> None:
            ended = [one for one in outcomes if one.status not in OPEN]
            tell(len(ended), f"{len(ended)} of {len(outcomes)} rows, {len(failed(ended))} failed")

        outcomes = run_sweep(whole, on=on, workers=workers, threads=threads, device=device, precision=precision,
                             skip_wrong=skip_wrong, watch=watch)  # fmt: skip
    states = [(one.status, one.why) for one in outcomes]
    page = write_sweep_page(folder, f"Sweep of {scene.name}", rows, [one.results for one in outcomes], states)
    if not quiet:
        seconds = duration_text(time.perf_counter() - begin)
        console.print(f"{len(rows)} rows in {seconds}: {folder / TABLE}, {page}", markup=False)
    if lost := failed(outcomes):
        named = "\n".join(f"row {one.number}: {one.status}: {one.why}" for one in lost[:SHOWN])
        more = f"\nand {len(lost) - SHOWN} more" if len(lost) > SHOWN else ""
        again = "the same command tries those again that were not refused and did not stop themselves"
        raise RowsFailed(f"{len(lost)} of {len(outcomes)} rows are not done; {again}:\n{named}{more}")
    return outcomes
