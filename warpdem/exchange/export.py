"""Frames of a run as files of other programs."""

from __future__ import annotations

import gzip
import io
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np

from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError, WarpdemError
from warpdem.exchange.grain_tables import CsvTable, ParquetTable, columns_of
from warpdem.exchange.lab import View, in_view
from warpdem.exchange.lammps_dump import write_frame
from warpdem.output.read_frames import AnyResults
from warpdem.runs import Run, read

DUMPS = (".dump", ".lammpstrj")
TABLES: dict[str, type[CsvTable] | type[ParquetTable]] = {".csv": CsvTable, ".parquet": ParquetTable}
ENDINGS = (*DUMPS, *(f"{name}.gz" for name in DUMPS), *TABLES)


def export(
    folder: Path | str,
    out: Path | str,
    *,
    time: float | None = None,
    start: float | None = None,
    end: float | None = None,
    view: View = "laboratory",
    overwrite: bool = False,
    watch: Callable[[int, int], None] = lambda done, total: None,
    tell: Callable[[str], None] = lambda note: None,
) -> int:
    """Write frames of a run as a LAMMPS dump, or as a table with a row per grain and frame.

    Args:
        folder: Folder of the results, with frames in VTK or VTKHDF.
        out: File to write: .dump or .lammpstrj, with .gz packed; .csv; .parquet.
        time: Only the frame nearest to this time [s].
        start: Only frames from this time [s] on.
        end: Only frames up to this time [s].
        view: "laboratory": absolute motion in laboratory axes; "frame": relative to the frame, in its axes.
        overwrite: Allow a file that exists.
        watch: Called with the number of frames done and of all.
        tell: Called with a note if the nearest frame to ``time`` stands at another time.

    Returns:
        Number of frames written.

    Raises:
        WarpdemError: The run cannot be read, has no frame at these times, or the file cannot be written.
    """
    run, out = read(folder), Path(out)
    ending = next((ending for ending in ENDINGS if out.name.lower().endswith(ending)), None)
    if ending is None:
        raise SceneError(f"{out}: its suffix is no known format; allowed are {', '.join(ENDINGS)}")
    if view not in get_args(View):
        raise SceneError(f"view {view!r} is unknown; allowed are {', '.join(get_args(View))}")
    if out.exists() and not overwrite:
        raise SceneError(f"{out}: is there already; take another name, or give --overwrite (overwrite=True)")
    numbers = _chosen(run.frames, time, start, end)
    if time is not None and (note := _elsewhere(run.frames.times, numbers[0], time)):
        tell(note)
    out.parent.mkdir(parents=True, exist_ok=True)
    with replaced(out) as part:
        if ending in TABLES:
            with TABLES[ending](part) as table:
                for done, k in enumerate(numbers, 1):
                    table.write(columns_of(run.frames.frame(k), view))
                    watch(done, len(numbers))
        else:
            _write_dump(run, numbers, part, ending.endswith(".gz"), view, watch)
    return len(numbers)


def _chosen(frames: AnyResults, time: float | None, start: float | None, end: float | None) -> list[int]:
    """Numbers of the frames at the times asked for."""
    times = frames.times
    if time is not None:
        if start is not None or end is not None:
            raise WarpdemError("time is that of one frame; start and end those of several: give one or the others")
        return [int(np.argmin(np.abs(times - time)))]
    low, high = (-np.inf if start is None else start), (np.inf if end is None else end)
    slack = 1e-9 * float(times[-1])  # frames stand at whole steps
    found = np.flatnonzero((times >= low - slack) & (times <= high + slack)).tolist()
    if not found:
        there = f"they go from {times[0]:g} to {times[-1]:g} s"
        raise WarpdemError(f"{frames.folder}: no frame from {low:g} to {high:g} s; {there}")
    return [int(k) for k in found]


def _elsewhere(times: np.ndarray, taken: int, time: float) -> str:
    """Note that the frame taken is not of the time asked for; empty if it is."""
    at = float(times[taken])
    if abs(at - time) <= 1e-9 * max(abs(time), float(times[-1])):  # frames stand at whole steps
        return ""
    return f"no frame at {time:g} s; took the nearest, at {at:g} s of {times[0]:g} to {times[-1]:g} s"


def _write_dump(run: Run, numbers: list[int], part: Path, packed: bool, view: View, watch: Callable[[int, int], None]) -> None:
    bounds, borders = _box(run, numbers, view)
    with gzip.open(part, "wb") if packed else part.open("wb") as raw, io.TextIOWrapper(raw, encoding="utf-8") as file:
        for done, k in enumerate(numbers, 1):
            write_frame(file, run.frames.frame(k), view, bounds, borders, first=done == 1)
            watch(done, len(numbers))


def _box(run: Run, numbers: list[int], view: View) -> tuple[np.ndarray, list[str]]:
    """Corners of a box that holds the grains of all frames [m], and the kind of its borders."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    moves = False
    for k in numbers:
        grains = run.frames.frame(k)
        moves = moves or bool(grains.frame.parts)
        if len(grains.id):
            position = in_view(grains, view).position
            low = np.minimum(low, (position - grains.radius[:, None]).min(axis=0))
            high = np.maximum(high, (position + grains.radius[:, None]).max(axis=0))
    low, high = np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, 1.0)
    kinds = ["ff"] * 3
    scene = run.last.get("scene_data")
    given = scene.get("borders") if isinstance(scene, dict) else None
    if view == "frame" or not moves:  # else the borders turn
        for axis, name in enumerate("xyz"):
            border = (given or {}).get(name)
            if border and border.get("kind") == "periodic":
                low[axis], high[axis], kinds[axis] = border["min"], border["max"], "pp"
    return np.array([low, high]), kinds
