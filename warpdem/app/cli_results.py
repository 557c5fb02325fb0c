"""Commands that take results. Arguments to calls; no physics."""

import json
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from warpdem.app.cli_options import Plugins
from warpdem.drawing.style import PictureStyle, Preset


def render(
    folder: Path,
    /,
    *others: Path,
    out: Path | None = None,
    time: float | None = None,
    start: float | None = None,
    end: float | None = None,
    speed: float | None = None,
    fps: float | None = None,
    style: Annotated[PictureStyle, Parameter(name="*", negative_iterable=())] = PictureStyle(),  # noqa: B008
) -> None:
    """Draw the results of a run: a picture (.png) or a film (.mp4).

    Args:
        folder: Folder of the results.
        others: Folders of more results, drawn beside it at the same times.
        out: File to write; FOLDER/picture.png if not given.
        time: Time of a picture [s]; the last one if not given.
        start: A film begins with the frame nearest to this time [s].
        end: A film ends with the frame nearest to this time [s].
        speed: Seconds of the run in a second of the film; each frame is shown once if not given.
        fps: Pictures in a second of the film; 25 if not given, fewer where so few frames are shown that it would last less
            than 2 seconds.
        style: Camera, colours, cuts and walls.
    """
    from rich.progress import Progress

    from warpdem.core.file_names import require_usable
    from warpdem.drawing.rendering import render as draw

    for name, path in (("--out", out), *(("FOLDER", path) for path in (folder, *others))):
        require_usable(name, path)
    target = out or folder / "picture.png"
    console = Console(highlight=False)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("film")

        def watch(done: int, total: int) -> None:
            if not done:
                console.print(f"drawing {total} pictures of {target}", markup=False)
            progress.update(task, completed=done, total=total)

        draw(
            [folder, *others], target, time=time, start=start, end=end, speed=speed, fps=fps, watch=watch, **vars(style)
        )  # fmt: skip
    console.print(f"wrote {target}", markup=False)


def report(
    folder: Path, /, *, out: Path | None = None, pictures: bool = True, camera: Preset = "auto", quiet: bool = False
) -> None:
    """Write the report of a run: an HTML page with pictures, curves, loads, time step, warnings and a section on methods.

    The page needs no network and no file beside it. A film (.mp4) in the folder becomes part of it.

    Args:
        folder: Folder of the results.
        out: File to write; FOLDER/report.html if not given.
        pictures: Draw the first, the middle and the last frame, which takes seconds each.
        camera: Side from which they are drawn, upright against gravity; "auto" is along the axis of a frame that rotates.
        quiet: Print errors only.
    """
    from warpdem.core.file_names import require_usable

    for name, path in (("--out", out), ("FOLDER", folder)):
        require_usable(name, path)
    write_report(folder, out, pictures, quiet, camera)


def write_report(folder: Path, out: Path | None, pictures: bool, quiet: bool, camera: Preset = "auto") -> None:
    """Write a report, and say what takes time."""
    from warpdem.reports.write_report import report as write

    console = Console(highlight=False, quiet=quiet)
    target = write(folder, out, draw=pictures, camera=camera, watch=lambda message: console.print(message, markup=False))
    console.print(f"wrote {target}", markup=False)


def plot(
    folder: Path,
    /,
    *others: Path,
    columns: Annotated[list[str], Parameter(consume_multiple=True)] = [],  # noqa: B006
    out: Path | None = None,
    x: str = "time",
    start: float | None = None,
    end: float | None = None,
    log: bool = False,
    dpi: float = 150.0,
    list_: Annotated[bool, Parameter(name="--list")] = False,
) -> None:
    """Draw columns of history.csv as curves, of one run or of several over each other.

    Args:
        folder: Folder of the results.
        others: Folders of more results.
        columns: Names of columns, as in "glass force z"; the unit may be left out, * and ? stand for any signs. The energies
            if none are given.
        out: File to write: .png, .svg or .pdf; FOLDER/history.png if not given.
        x: Column on the horizontal axis.
        start: Only rows from this value of X on.
        end: Only rows up to this value of X.
        log: Logarithmic vertical axes.
        dpi: Pixels in an inch of a .png.
        list_: Print the columns with their first, least, greatest, mean and last values, and draw nothing.
    """
    from warpdem.core.file_names import require_usable

    for name, path in (("--out", out), *(("FOLDER", path) for path in (folder, *others))):
        require_usable(name, path)
    console = Console(highlight=False)
    if list_:
        from warpdem.app.list_columns import print_columns

        print_columns([folder, *others], columns, console)
        return
    from warpdem.drawing.curves import plot as draw

    target = out or folder / "history.png"
    draw([folder, *others], target, columns=columns, x=x, start=start, end=end, log=log, dpi=dpi)
    console.print(f"wrote {target}", markup=False)


def compare(
    first: Path,
    second: Path,
    /,
    *,
    twins: int = 0,
    twin: Annotated[list[Path], Parameter(consume_multiple=True)] = [],  # noqa: B006
    columns: Annotated[list[str], Parameter(consume_multiple=True)] = [],  # noqa: B006
    start: float | None = None,
    end: float | None = None,
    out: Path | None = None,
    json_: Annotated[bool, Parameter(name="--json")] = False,
    device: str | None = None,
    threads: int | None = None,
    plugin: Plugins = [],  # noqa: B006
) -> None:
    """Compare two runs: how far their histories are apart, over the scatter of perturbed twins of the first.

    Grains are chaotic: equal runs go different ways in detail. Twins, whose grains begin 1e-9 of a radius apart, show by how
    much; each takes as long as the first run, and stays in its folder.

    Args:
        first: Folder of the results to compare with.
        second: Folder of the other results.
        twins: Number of twins of the first run to make; those that are there already are taken.
        twin: Folders of twins that you have run, as with other seeds.
        columns: Names of columns, as in plot; all that the runs share if none are given.
        start: Compare from this time [s].
        end: Compare up to this time [s].
        out: Write a page with the curves: .html.
        json_: Print JSON.
        device: As in run, for the twins.
        threads: As in run, for the twins.
    """
    from warpdem.app.compare import as_data, compared, print_comparison
    from warpdem.core.file_names import require_usable
    from warpdem.reports.comparison import write_comparison
    from warpdem.reports.document import page_file
    from warpdem.runs.names import run_names

    for name, path in (("--out", out), ("FIRST", first), ("SECOND", second), *(("--twin", path) for path in twin)):
        require_usable(name, path)
    if out is not None:
        page_file(out)
    console = Console(highlight=False)
    quiet = Console(highlight=False, quiet=json_)
    found, count = compared(first, second, twin=twin, twins=twins, columns=columns, start=start, end=end, device=device,
                            threads=threads, plugins=plugin, console=quiet)  # fmt: skip
    names = run_names([first, second])
    if json_:
        sys.stdout.write(json.dumps(as_data(found, count), indent=2, allow_nan=False) + "\n")
    else:
        print_comparison(found, count, (names[0], names[1]), console)
    if out is not None:
        quiet.print(f"wrote {write_comparison(found, (names[0], names[1]), count, out)}", markup=False)


def export(
    folder: Path,
    out: Path,
    /,
    *,
    time: float | None = None,
    start: float | None = None,
    end: float | None = None,
    view: Literal["laboratory", "frame"] = "laboratory",
    overwrite: bool = False,
) -> None:
    """Write the frames of a run for other programs: a LAMMPS dump (LAMMPS, LIGGGHTS, Ovito), or a table of grains.

    Args:
        folder: Folder of the results.
        out: File to write: .dump or .lammpstrj, packed with .gz; .csv; .parquet.
        time: Only the frame nearest to this time [s].
        start: Only frames from this time [s] on.
        end: Only frames up to this time [s].
        view: Absolute motion in laboratory axes, or motion relative to the frame in its axes.
        overwrite: Allow a file that exists.
    """
    from warpdem.core.file_names import require_usable
    from warpdem.core.progress import progress_bar
    from warpdem.exchange.export import export as write

    for name, path in (("FOLDER", folder), ("OUT", out)):
        require_usable(name, path)
    console = Console(highlight=False)
    notes: list[str] = []
    with progress_bar(console, not console.is_terminal, 1000) as tell:
        count = write(folder, out, time=time, start=start, end=end, view=view, overwrite=overwrite, tell=notes.append,
                      watch=lambda done, total: tell(1000 * done // total, f"{done} of {total} frames"))  # fmt: skip
    for note in notes:
        console.print(f"note: {note}", markup=False)
    console.print(f"wrote {out}: {count} frame{'s' if count != 1 else ''}", markup=False)


def grains(
    source: Path,
    target: Path,
    /,
    *,
    format_: Annotated[
        Literal["lammps-dump", "lammps-data", "yade", "mercury"] | None, Parameter(name="--format")
    ] = None,
    step: int | None = None,
    type_: Annotated[int | None, Parameter(name="--type")] = None,
    units: Literal["si", "cgs", "mm", "um"] = "si",
    overwrite: bool = False,
) -> None:
    """Make a state file for a scene (file = "grains.npz" in its grains) from grains that another program wrote.

    Args:
        source: LAMMPS or LIGGGHTS dump or data file, packed or not; text of YADE; .data file of MercuryDPM.
        target: State file to write: .npz or .csv.
        format_: Format of the source; recognised by its name or first lines if not given.
        step: TIMESTEP of a dump, or number of the time of MercuryDPM from 0; the last one if not given.
        type_: Only grains of this type.
        units: Units of the source: SI, or lengths in centimetres (cgs), millimetres or micrometres, all with seconds.
        overwrite: Allow a target that exists.
    """
    from warpdem.core.file_names import require_usable
    from warpdem.exchange.state_file import write_state_file

    for name, path in (("SOURCE", source), ("TARGET", target)):
        require_usable(name, path)
    notes = write_state_file(source, target, kind=format_, step=step, only_type=type_, unit=units, overwrite=overwrite)
    console = Console(highlight=False)
    for note in notes:
        console.print(f"note: {note}", markup=False)
    console.print(f"wrote {target}", markup=False)
