"""The command that runs a scene with many sets of values. Arguments to calls; no physics."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from warpdem.app.cli_options import AllowPaths, Plugins


def sweep(
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
    from warpdem.app.sweep import rows_of
    from warpdem.app.sweep import sweep as run_rows
    from warpdem.core.file_names import require_usable

    require_usable("--out", out)
    rows = rows_of(table, grid, sample, count, seed)
    folder = out or Path("out") / f"{scene.stem}-sweep"
    console = Console(highlight=False)
    try:
        run_rows(
            scene, rows, folder, results=results, on=on, workers=workers, threads=threads, device=device,
            precision=precision, skip_wrong=skip_wrong, plugins=plugin, allow_paths=allow_path, console=console, quiet=quiet,
        )  # fmt: skip
    except KeyboardInterrupt:
        raise KeyboardInterrupt("with rows that were running saved; the same command goes on") from None
