"""Commands that take a scene. Arguments to calls; no physics."""

import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter
from rich.console import Console

from warpdem.app.cli_options import AccuracyOptions, AllowPaths, At, Picture, Plugins, Settings
from warpdem.app.cli_results import write_report
from warpdem.errors import SceneError

if TYPE_CHECKING:
    from warpdem.app.accuracy import Trial
    from warpdem.ranks.world import World


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
    ranks: int | None = None,
    held: Annotated[AccuracyOptions, Parameter(name="*")] = AccuracyOptions(),  # noqa: B008
) -> None:
    """Run a scene and write its results.

    Args:
        scene: Scene file: .toml, .usda, .usdc, .usd or .usdz.
        out: Folder of the results; out/NAME in the present folder if not given, NAME that of the scene file, or of its folder
            for a result stage.
        device: cpu or cuda:0; a GPU if there is one. Of several ranks also cuda, a GPU for each of them; else the CPU.
        threads: CPU threads, of each rank; as many as pay for the number of grains if not given, up to all cores.
        precision: Precision of the contact law instead of the scene's.
        until: End at this time [s] instead of the scene's.
        report: Write report.html at the end, as warpdem report does.
        resume: Continue from the checkpoint in the folder.
        overwrite: Allow a folder that holds results.
        quiet: Print errors only.
        ranks: Share the grains among so many MPI processes; mpirun -n N warpdem run does the same.
        held: Choose step and precision by runs for a measure, and hold the run to its accuracy with another one.
    """
    from warpdem.app.phases import run as run_all
    from warpdem.app.run_folder import default_folder, named_folder
    from warpdem.core.file_names import require_usable
    from warpdem.core.run_lock import FolderLocked
    from warpdem.ranks.front import leading
    from warpdem.scene.file import load_scene

    world = _ranks(ranks)
    with leading(world):
        require_usable("--out", out)
        console = Console(highlight=False, quiet=quiet)
        trial = _held(held, scene, [*([f"engine.precision={precision}"] if precision else []), *set_], at, console,
                      device=device, threads=threads, plugins=plugin, allow_paths=allow_path)  # fmt: skip
        if trial is not None:
            set_ = [*set_, *trial.choice.settings]
        loaded = load_scene(scene, [*([f"engine.precision={precision}"] if precision else []), *set_],
                            allow_paths=allow_path, plugins=plugin, at=at)  # fmt: skip
        try:
            while True:
                folder = out or (named_folder(scene) if resume else default_folder(scene))
                try:
                    run_all(loaded, folder, device=device, threads=threads, until=until, resume=resume, overwrite=overwrite,
                            quiet=quiet, picture=picture)  # fmt: skip
                    if trial is not None:
                        trial.verify(folder, until, console)
                    if report:
                        write_report(folder, None, picture is not False, quiet)
                    break
                except FolderLocked as taken:
                    if out or resume or taken.folder != folder:
                        raise  # else another run has just taken the folder that was free: the next one
        except KeyboardInterrupt as stop:
            if not stop.args:  # nothing was run yet
                raise
            given = {"device": device, "threads": threads, "precision": precision, "until": until, "at": at, "ranks": ranks}
            options = [f"--{name}={value}" for name, value in given.items() if value is not None]
            options += [word for name, paths in (("plugin", plugin), ("allow-path", allow_path)) for path in paths
                        for word in (f"--{name}", str(path))]  # fmt: skip
            options += ["--report"] if report else []
            options += [] if picture is None else ["--picture" if picture else "--no-picture"]
            options += ["--set", *set_] if set_ else []
            command = shlex.join(["warpdem", "run", str(scene), "--out", str(folder), "--resume", *options])
            raise KeyboardInterrupt(*stop.args, f"go on with: {command}") from None


def _held(
    held: AccuracyOptions, scene: Path, changes: list[str], at: float | None, console: Console, **how: Any
) -> "Trial | None":
    """Step and precision for the accuracy asked; None where none is asked."""
    if held.accuracy is None:
        for name, given in (("--measure", held.measure), ("--diagram", held.diagram)):
            if given is not None:
                raise SceneError(f"{name}: belongs to --accuracy")
        return None
    from warpdem.app.accuracy import Source, Trial, Wish
    from warpdem.core.file_names import require_usable

    wish = Wish.of(held.accuracy, held.measure)
    if at is not None:
        raise SceneError("--accuracy: not with --at: a scene that starts from a frame of results has no scene file to repeat")
    source = Source(scene, changes, until=held.short, **how)
    require_usable("--diagram", held.diagram)
    folder = held.trials or Path("out") / f"{scene.stem}-accuracy"
    return Trial.of(source, wish, folder, console, held.twins, held.steps, held.diagram)


def _ranks(asked: int | None) -> "World | None":
    """The ranks that this process leads, started as ``--ranks`` asks for if they are not here; None where it runs alone.

    On a rank other than 0 it does not return: that ends with rank 0.
    """
    from warpdem.ranks import launcher
    from warpdem.ranks.follower import serve

    if asked is not None and asked < 1:
        raise SceneError(f"--ranks {asked}: must be 1 or more")
    there = launcher.launched()
    if asked is not None and there == 1 < asked:
        launcher.start(asked, sys.argv[1:])
    if asked is not None and asked != there:
        raise SceneError(f"--ranks {asked}: but a launcher of MPI started {there}: leave the option out")
    world = launcher.join()
    if world is not None and world.rank:
        sys.exit(serve(world))
    return world


def check(
    scene: Path,
    *,
    json_: Annotated[bool, Parameter(name="--json")] = False,
    device: str | None = None,
    threads: int | None = None,
    probe: bool = True,
    ranks: int | None = None,
    at: At = None,
    set_: Settings = [],  # noqa: B006
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
    held: Annotated[AccuracyOptions, Parameter(name="*")] = AccuracyOptions(),  # noqa: B008
) -> None:
    """Validate a scene; print the plan, the time step and its limits, memory and an estimate of the run time.

    Args:
        scene: Scene file, as in run.
        json_: Print JSON.
        device: As in run.
        threads: As in run.
        probe: Measure a few steps for the estimate.
        ranks: Also tell what a run over so many ranks exchanges.
        held: Choose step and precision by runs, and say how accurate a measure then is.
    """
    from warpdem.app.check import describe, print_description
    from warpdem.app.run import SETTING_UP
    from warpdem.core.progress import report_if_long
    from warpdem.model import needs
    from warpdem.ranks import estimate
    from warpdem.ranks.devices import device_name
    from warpdem.scene.file import load_scene
    from warpdem.simulation import Simulation

    if ranks is not None and ranks < 1:
        raise SceneError(f"--ranks {ranks}: must be 1 or more")
    console = Console(highlight=False)
    trial = _held(held, scene, set_, at, Console(highlight=False, quiet=json_), device=device, threads=threads, plugins=plugin,
                  allow_paths=allow_path)  # fmt: skip
    if trial is not None:
        if json_:
            sys.stdout.write(json.dumps(trial.choice.as_data(), indent=2) + "\n")
        return
    loaded = load_scene(scene, set_, allow_paths=allow_path, plugins=plugin, at=at)
    if ranks is not None and ranks > 1:
        device = device_name(device, 0)
    for k in range(len(loaded.phases)):
        needs.check_grid(loaded.phase(k))
    first = loaded.phase(0) if loaded.phases else loaded  # the others begin with what it leaves
    later = [phase.name for phase in loaded.phases[1:]]
    with report_if_long(SETTING_UP, console, quiet=json_):
        sim = Simulation(first, device=device, threads=threads)
    there = sim.particles.position, sim.particles.radius, sim.lists.skin  # before the probe moves the grains
    data = describe(sim, probe, later, None if json_ else console)
    if ranks is not None:
        data["ranks"] = estimate.estimate(sim.model, *there, ranks)
    if json_:
        sys.stdout.write(json.dumps(data, indent=2) + "\n")
    else:
        print_description(data, console)
        if ranks is not None:
            console.print(estimate.text(data["ranks"]), markup=False)


def convert(
    source: Path,
    target: Path,
    *,
    at: At = None,
    plugin: Plugins = [],  # noqa: B006
    allow_path: AllowPaths = [],  # noqa: B006
    overwrite: bool = False,
) -> None:
    """Write a scene file in another format: TOML from USD, USD from TOML, TOML from a script of LIGGGHTS.

    A script is converted with its meshes, materials, contact law, walls, motions and insertions; what is other or missing is
    said, and written at the head of the scene file.

    Args:
        source: Scene file, as in run; a file of another suffix is a script of LIGGGHTS.
        target: File to write: .toml, .usda, .usdc or .usd; .toml of a script.
        overwrite: Allow a target that exists.
    """
    from warpdem.core.file_names import require_usable
    from warpdem.exchange.liggghts.convert import convert_script
    from warpdem.scene.convert import SUFFIXES
    from warpdem.scene.convert import convert as write

    require_usable("TARGET", target)
    if source.suffix.lower() not in (*SUFFIXES, ".usdz"):
        notes = convert_script(source, target, overwrite=overwrite)
    else:
        notes = write(source, target, at=at, overwrite=overwrite, allow_paths=allow_path, plugins=plugin)
    console = Console(highlight=False)
    for note in notes:
        console.print(f"note: {note}", markup=False)
    console.print(f"wrote {target}", markup=False)


def schema(*, plugin: Plugins = []) -> None:  # noqa: B006
    """Print the JSON schema of a scene file, for editors; with --plugin, with the keys of your own contact laws."""
    from warpdem.scene.schema import scene_schema

    sys.stdout.write(json.dumps(scene_schema(plugin), indent=2) + "\n")


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
    held: Annotated[AccuracyOptions, Parameter(name="*")] = AccuracyOptions(),  # noqa: B008
) -> None:
    """List the scenes that come with warpdem, or copy one to a folder of its own and run it there.

    The copy and its results stay together, in NAME/NAME.toml and NAME/results; run puts its results in out/NAME. With
    --accuracy the copy is not run as it is: runs with several steps make its work-precision diagram, in NAME.

    Args:
        name: Scene to copy and run; lists them all if not given.
        about: Only tell what the scene shows, what must come out, and how long it takes.
        out: Folder to make for the scene, its meshes and, in results, what comes out; NAME if not given.
        device: As in run.
        threads: As in run.
        precision: As in run.
        until: As in run.
        quiet: As in run.
        held: As in check; --measure is what the scene's own Measure says (--about), --diagram NAME/work_precision.png, and
            the folder of the runs NAME/accuracy, if not given.
    """
    from warpdem.app.demo import RESULTS, copy, print_about, print_gallery, print_outcome, scene_named
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
    if held.accuracy is not None:
        held = replace(held, measure=held.measure or scene_named(name).measure, trials=held.trials or folder / "accuracy",
                       diagram=held.diagram or folder / "work_precision.png")  # fmt: skip
    changes = [*([f"engine.precision={precision}"] if precision else []), *set_]
    if _held(held, scene, changes, None, Console(highlight=False, quiet=quiet), device=device, threads=threads) is not None:
        return
    run(scene, out=folder / RESULTS, device=device, threads=threads, precision=precision, until=until, set_=set_,
        picture=picture, quiet=quiet)  # fmt: skip
    if not quiet:
        print_outcome(scene, bool(set_ or until or precision), console)
