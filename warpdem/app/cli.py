"""The command ``warpdem``: run, check, convert, schema, render, plot, report, demo. Arguments to calls; no physics."""

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter
from rich.console import Console

from warpdem.core.command import run_command
from warpdem.drawing.style import PictureStyle

app = App(
    name="warpdem",
    help="Discrete element method for granular flow in rotating and moving equipment.",
    suppress_keyboard_interrupt=False,  # run_command() reports how to continue
    default_parameter=Parameter(negative_iterable=()),  # no --empty-set, which an option left out says as well
)

Settings = Annotated[
    list[str],
    Parameter("--set", consume_multiple=True, help="""Change keys: --set time.end=0.5 engine.skin='"0.1 mm"'."""),
]
Plugins = Annotated[
    list[Path], Parameter("--plugin", consume_multiple=True, help="Load these .py files, which the scene names; after SCENE.")
]
AllowPaths = Annotated[
    list[Path], Parameter("--allow-path", consume_multiple=True, help="Let the scene read in these folders too; after SCENE.")
]
Picture = Annotated[
    bool | None, Parameter(help="Draw picture.png at the end, or not (it takes seconds), whatever the scene says.")
]
At = Annotated[
    float | None, Parameter("--at", help="With the result stage of a run: start from its frame at this time [s].")
]


@app.command
def run(
    scene: Path,
    *,
    out: Path | None = None,
    device: str | None = None,
    threads: int | None = None,
    precision: Literal["double", "mixed"] | None = None,
    until: float | None = None,
    at: At = None,
    set_: Settings = [],  # noqa: B006
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
    picture: Picture = None,
    report: bool = False,
    resume: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
) -> None:
    """Run a scene and write its results.

    Args:
        scene: Scene file: .toml, .usda, .usdc, .usd or .usdz.
        out: Folder of the results; out/NAME in the present folder if not given, NAME that of the scene file, or of its folder
            for a result stage.
        device: cpu or cuda:0; a GPU if there is one.
        threads: CPU threads; as many as pay for the number of grains if not given, up to all cores.
        precision: Precision of the contact law instead of the scene's.
        until: End at this time [s] instead of the scene's.
        report: Write report.html at the end, as warpdem report does.
        resume: Continue from the checkpoint in the folder.
        overwrite: Allow a folder that holds results.
        quiet: Print errors only.
    """
    from warpdem.app.phases import run as run_all
    from warpdem.app.run_folder import default_folder, named_folder
    from warpdem.core.file_names import require_usable
    from warpdem.core.run_lock import FolderLocked
    from warpdem.scene.file import load_scene

    require_usable("--out", out)
    loaded = load_scene(scene, [*([f"engine.precision={precision}"] if precision else []), *set_],
                        allow_paths=allow_path, plugins=plugin, at=at)  # fmt: skip
    try:
        while True:
            folder = out or (named_folder(scene) if resume else default_folder(scene))
            try:
                run_all(loaded, folder, device=device, threads=threads, until=until, resume=resume, overwrite=overwrite,
                        quiet=quiet, picture=picture)  # fmt: skip
                if report:
                    write_report(folder, None, picture is not False, quiet)
                break
            except FolderLocked as taken:
                if out or resume or taken.folder != folder:
                    raise  # else another run has just taken the folder that was free: the next one
    except KeyboardInterrupt as stop:
        if not stop.args:  # nothing was run yet
            raise
        given = {"device": device, "threads": threads, "precision": precision, "until": until, "at": at}
        options = [f"--{name}={value}" for name, value in given.items() if value is not None]
        options += [word for name, paths in (("plugin", plugin), ("allow-path", allow_path)) for path in paths
                    for word in (f"--{name}", str(path))]  # fmt: skip
        options += ["--report"] if report else []
        options += [] if picture is None else ["--picture" if picture else "--no-picture"]
        options += ["--set", *set_] if set_ else []
        command = shlex.join(["warpdem", "run", str(scene), "--out", str(folder), "--resume", *options])
        raise KeyboardInterrupt(*stop.args, f"go on with: {command}") from None


@app.command
def check(
    scene: Path,
    *,
    json_: Annotated[bool, Parameter(name="--json")] = False,
    device: str | None = None,
    threads: int | None = None,
    probe: bool = True,
    at: At = None,
    set_: Settings = [],  # noqa: B006
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
) -> None:
    """Validate a scene; print the plan, the time step and its limits, memory and an estimate of the run time.

    Args:
        scene: Scene file, as in run.
        json_: Print JSON.
        device: As in run.
        threads: As in run.
        probe: Measure a few steps for the estimate.
    """
    from warpdem.app.check import describe, print_description
    from warpdem.app.run import SETTING_UP
    from warpdem.core.progress import report_if_long
    from warpdem.model import needs
    from warpdem.scene.file import load_scene
    from warpdem.simulation import Simulation

    loaded = load_scene(scene, set_, allow_paths=allow_path, plugins=plugin, at=at)
    for k in range(len(loaded.phases)):
        needs.check_grid(loaded.phase(k))
    first = loaded.phase(0) if loaded.phases else loaded  # the others begin with what it leaves
    later = [phase.name for phase in loaded.phases[1:]]
    console = Console(highlight=False)
    with report_if_long(SETTING_UP, console, quiet=json_):
        sim = Simulation(first, device=device, threads=threads)
    data = describe(sim, probe, later, None if json_ else console)
    if json_:
        sys.stdout.write(json.dumps(data, indent=2) + "\n")
    else:
        print_description(data, console)


@app.command
def convert(
    source: Path,
    target: Path,
    *,
    at: At = None,
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
    overwrite: bool = False,
) -> None:
    """Write a scene file in another format: TOML from USD, USD from TOML.

    Args:
        source: Scene file, as in run.
        target: File to write: .toml, .usda, .usdc or .usd.
        overwrite: Allow a target that exists.
    """
    from warpdem.core.file_names import require_usable
    from warpdem.scene.convert import convert as write

    require_usable("TARGET", target)
    notes = write(source, target, at=at, overwrite=overwrite, allow_paths=allow_path, plugins=plugin)
    console = Console(highlight=False)
    for note in notes:
        console.print(f"note: {note}", markup=False)
    console.print(f"wrote {target}", markup=False)


@app.command
def schema(*, plugin: Plugins = []) -> None:  # noqa: B006
    """Print the JSON schema of a scene file, for editors; with --plugin, with the keys of your own contact laws."""
    from warpdem.scene.schema import scene_schema

    sys.stdout.write(json.dumps(scene_schema(plugin), indent=2) + "\n")


@app.command
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


@app.command(name="report")
def report_(folder: Path, /, *, out: Path | None = None, pictures: bool = True, quiet: bool = False) -> None:
    """Write the report of a run: an HTML page with pictures, curves, loads, time step, warnings and a section on methods.

    The page needs no network and no file beside it. A film (.mp4) in the folder becomes part of it.

    Args:
        folder: Folder of the results.
        out: File to write; FOLDER/report.html if not given.
        pictures: Draw the first, the middle and the last frame, which takes seconds each.
        quiet: Print errors only.
    """
    from warpdem.core.file_names import require_usable

    for name, path in (("--out", out), ("FOLDER", folder)):
        require_usable(name, path)
    write_report(folder, out, pictures, quiet)


def write_report(folder: Path, out: Path | None, pictures: bool, quiet: bool) -> None:
    """Write a report, and say what takes time."""
    from warpdem.reports.write_report import report as write

    console = Console(highlight=False, quiet=quiet)
    target = write(folder, out, draw=pictures, watch=lambda message: console.print(message, markup=False))
    console.print(f"wrote {target}", markup=False)


@app.command
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
        list_: Print the columns with their least and greatest values, and draw nothing.
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


@app.command
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

    Grains are chaotic: equal runs go different ways in detail. Twins, whose grains begin 1e-9 of a radius apart, tell by how
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


@app.command
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
    with progress_bar(console, not console.is_terminal, 1000) as tell:
        count = write(folder, out, time=time, start=start, end=end, view=view, overwrite=overwrite,
                      watch=lambda done, total: tell(1000 * done // total, f"{done} of {total} frames"))  # fmt: skip
    console.print(f"wrote {out}: {count} frame{'s' if count != 1 else ''}", markup=False)


@app.command
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
        format_: Format of the source; told by its name or first lines if not given.
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


@app.command(name="sweep")
def sweep_(
    scene: Path,
    table: Path | None = None,
    /,
    *,
    out: Path | None = None,
    grid: Annotated[list[str], Parameter(consume_multiple=True)] = [],  # noqa: B006
    sample: Annotated[list[str], Parameter(consume_multiple=True)] = [],  # noqa: B006
    count: int | None = None,
    seed: int = 0,
    results: Annotated[list[str], Parameter(consume_multiple=True)] = [],  # noqa: B006
    on: Literal["local", "mpi", "dask", "slurm"] = "local",
    workers: int | None = None,
    threads: int | None = None,
    device: str | None = None,
    precision: Literal["double", "mixed"] | None = None,
    skip_wrong: bool = False,
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
    quiet: bool = False,
) -> None:
    """Run a scene with the changes of each row of a table, several rows at once; the same command goes on after any end.

    Each row has a folder of its own, OUT/0001 ..., with the results of its run. sweep.csv has all rows with their results, and
    sweep.html draws them.

    Args:
        scene: Scene file, as in run.
        table: CSV file whose columns are keys of the scene, as in --set (pairs.0.friction), or begin with note.
        out: Folder of the sweep; out/NAME-sweep in the present folder if not given.
        grid: Instead of TABLE, all combinations: --grid pairs.0.friction=0.1,0.3 frame.rate='10 rpm,20 rpm'.
        sample: Instead of TABLE, random values: --sample pairs.0.friction=0.1:0.9 materials.g.young_modulus='1:50 MPa:log'.
        count: Number of rows of --sample.
        seed: Seed of --sample.
        results: What sweep.csv has of each row: COLUMN:HOW or COLUMN:HOW@START:END of history.csv (HOW first, last, min, max,
            mean, std, rate), or run.KEY of run.json.
        on: What runs the rows: processes here, or mpi, dask, slurm.
        workers: Rows at once; as many as cores if not given.
        threads: CPU threads of each row; the cores over the workers if not given.
        device: As in run; cuda gives each worker a GPU, one after the other.
        precision: As in run.
        skip_wrong: Run the other rows where some are wrong; else nothing is run.
        quiet: Print errors only.
    """
    from warpdem.app.sweep import rows_of, sweep
    from warpdem.core.file_names import require_usable

    require_usable("--out", out)
    rows = rows_of(table, grid, sample, count, seed)
    folder = out or Path("out") / f"{scene.stem}-sweep"
    console = Console(highlight=False)
    try:
        sweep(scene, rows, folder, results=results, on=on, workers=workers, threads=threads, device=device, precision=precision,
              skip_wrong=skip_wrong, plugins=plugin, allow_paths=allow_path, console=console, quiet=quiet)  # fmt: skip
    except KeyboardInterrupt:
        raise KeyboardInterrupt("with rows that were running saved; the same command goes on") from None


@app.command
def demo(
    name: str | None = None,
    *,
    about: bool = False,
    out: Path | None = None,
    device: str | None = None,
    threads: int | None = None,
    precision: Literal["double", "mixed"] | None = None,
    until: float | None = None,
    set_: Settings = [],  # noqa: B006
    picture: Picture = None,
    quiet: bool = False,
) -> None:
    """List the scenes that come with warpdem, or copy one to a folder of its own and run it there.

    The copy and its results stay together, in NAME/NAME.toml and NAME/results; run puts its results in out/NAME.

    Args:
        name: Scene to copy and run; lists them all if not given.
        about: Only tell what the scene shows, what must come out, and how long it takes.
        out: Folder to make for the scene, its meshes and, in results, what comes out; NAME if not given.
        device: As in run.
        threads: As in run.
        precision: As in run.
        until: As in run.
        quiet: As in run.
    """
    from warpdem.app.demo import RESULTS, copy, print_about, print_gallery, print_outcome
    from warpdem.core.file_names import require_usable
    from warpdem.core.start_warp import start_warp

    require_usable("--out", out)
    console = Console(highlight=False)
    if name is None:
        print_gallery(console)
        return
    if about:
        print_about(name, console)
        return
    folder = out or Path(name)
    start_warp()  # what cannot run at all leaves no copy
    scene = copy(name, folder)
    run(scene, out=folder / RESULTS, device=device, threads=threads, precision=precision, until=until, set_=set_,
        picture=picture, quiet=quiet)  # fmt: skip
    if not quiet:
        print_outcome(scene, bool(set_ or until or precision), console)


def main() -> None:
    """The command, for programs that have imported this; exit codes as ``warpdem.core.command.run_command``."""
    run_command(lambda: app)


if __name__ == "__main__":
    main()
