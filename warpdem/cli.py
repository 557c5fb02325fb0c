"""The command ``warpdem``: run, check, render. Arguments to calls; no physics."""

import json
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter
from rich.console import Console

from warpdem.errors import WarpdemError

app = App(
    name="warpdem",
    help="Discrete element method for granular flow in rotating and moving equipment.",
    suppress_keyboard_interrupt=False,  # main() tells how to go on
)


@app.command
def run(
    scene: Path,
    *,
    out: Path | None = None,
    device: str | None = None,
    threads: int | None = None,
    precision: Literal["double", "mixed"] | None = None,
    until: float | None = None,
    set_: Annotated[list[str], Parameter(name="--set", consume_multiple=True)] = [],  # noqa: B006
    resume: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
) -> None:
    """Run a scene and write its results.

    Args:
        scene: Scene file (.toml).
        out: Folder of the results; out/NAME if not given.
        device: cpu or cuda:0; a GPU if there is one.
        threads: CPU threads; all cores if not given.
        precision: Precision of the contact law instead of the scene's.
        until: End at this time [s] instead of the scene's.
        set_: Change keys of the scene, as in --set time.end=0.5 engine.skin='"0.1 mm"'.
        resume: Go on from the checkpoint in the folder.
        overwrite: Allow a folder that holds results.
        quiet: Print errors only.
    """
    from warpdem.runner import check_folder, default_folder, run_scene
    from warpdem.scene_file import load_scene

    loaded = load_scene(scene, [*([f"engine.precision={precision}"] if precision else []), *set_])
    folder = out or (Path("out") / scene.stem if resume else default_folder(scene))
    check_folder(folder, overwrite or resume)
    run_scene(loaded, folder, device=device, threads=threads, until=until, resume=resume, quiet=quiet)


@app.command
def check(
    scene: Path,
    *,
    json_: Annotated[bool, Parameter(name="--json")] = False,
    device: str | None = None,
    threads: int | None = None,
    probe: bool = True,
    set_: Annotated[list[str], Parameter(name="--set", consume_multiple=True)] = [],  # noqa: B006
) -> None:
    """Validate a scene; print the plan, the time step and its limits, memory and an estimate of the run time.

    Args:
        scene: Scene file (.toml).
        json_: Print JSON.
        device: As in run.
        threads: As in run.
        probe: Measure a few steps for the estimate.
        set_: As in run.
    """
    from warpdem.scene_file import load_scene
    from warpdem.simulation import Simulation
    from warpdem.summary import describe, print_description

    data = describe(Simulation(load_scene(scene, set_), device=device, threads=threads), probe)
    if json_:
        sys.stdout.write(json.dumps(data, indent=2) + "\n")
    else:
        print_description(data, Console(highlight=False))


@app.command
def render(
    folder: Path,
    *,
    out: Path | None = None,
    view: Literal["frame", "laboratory"] = "laboratory",
    colour: str = "speed",
    time: float | None = None,
) -> None:
    """Draw the results of a run: a picture (.png) or a film (.mp4).

    Args:
        folder: Folder of the results.
        out: File to write; FOLDER/picture.png if not given.
        view: Axes that stand still in the picture.
        colour: Field that colours the grains: speed, radius, id, type.
        time: Instant of a picture [s]; the last one if not given.
    """
    from warpdem.render import render as draw

    target = out or folder / "picture.png"
    extra = {} if time is None else {"time": time}
    draw(folder, target, view=view, colour=colour, **extra)
    Console(highlight=False).print(f"wrote {target}")


def main() -> None:
    """Entry point: exit codes 0 done, 2 wrong scene, 3 run stopped itself, 130 interrupted."""
    try:
        app()
    except WarpdemError as error:
        Console(stderr=True, highlight=False, markup=False, soft_wrap=True).print(f"error: {error}")
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        Console(stderr=True).print("interrupted; --resume continues")
        sys.exit(130)


if __name__ == "__main__":
    main()
