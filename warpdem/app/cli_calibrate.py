"""The command that fits parameters to measurements. Arguments to calls; no physics."""

from pathlib import Path
from typing import Literal

from rich.console import Console

from warpdem.app.cli_options import AllowPaths, Plugins


def calibrate(
    file: Path,
    /,
    *,
    out: Path | None = None,
    on: Literal["local", "mpi", "dask", "slurm"] = "local",
    workers: int | None = None,
    threads: int | None = None,
    device: str | None = None,
    precision: Literal["double", "mixed"] | None = None,
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
    quiet: bool = False,
) -> None:
    """Find the parameters with which scenes give what was measured; the same command goes on after any end.

    OUT has a folder for the runs of each experiment, calibration.csv with all of them, calibration.json and calibration.html
    with values and errors, and the scenes with the best values in best/.

    Args:
        file: Calibration file (.toml): parameters with ranges, experiments with their scenes, targets with uncertainties.
        out: Folder of the calibration; out/NAME in the present folder if not given.
        on: What runs the scenes, as in sweep.
        workers: Runs at once; as many as cores if not given.
        threads: CPU threads of each run; the cores over the workers if not given.
        device: As in run; cuda gives each worker a GPU, one after the other.
        precision: As in run.
        quiet: Print errors only.
    """
    from warpdem.app.calibrate import calibrate as search
    from warpdem.core.file_names import require_usable

    for name, path in (("--out", out), ("FILE", file)):
        require_usable(name, path)
    folder = out or Path("out") / file.stem
    console = Console(highlight=False)
    try:
        search(file, folder, on=on, workers=workers, threads=threads, device=device, precision=precision, plugins=plugin,
               allow_paths=allow_path, console=console, quiet=quiet)  # fmt: skip
    except KeyboardInterrupt:
        raise KeyboardInterrupt("with runs that were under way saved; the same command goes on") from None
