"""A run with its outputs: advances a simulation from frame to frame, writes, shows progress, and sums up."""

import time
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.text import Text

from warpdem.app import scene_warnings, summary
from warpdem.app.compile_ahead import compiling_ahead
from warpdem.app.final_picture import draw_picture, wants_picture
from warpdem.app.outputs import Outputs, output_schedule
from warpdem.app.run_folder import CHECKPOINT, check_request, refuse_results
from warpdem.app.run_record import record
from warpdem.core.interrupts import held_back
from warpdem.core.log import log
from warpdem.core.progress import progress_bar, report_if_long
from warpdem.core.run_lock import RunLock, locked
from warpdem.core.timers import speed_text
from warpdem.errors import OutputError, StabilityError
from warpdem.model.prepare import require_scene
from warpdem.output.write_tables import write_run_record
from warpdem.ranks.front import led
from warpdem.scene.messages import visible
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import largest_rates
from warpdem.simulation import Simulation
from warpdem.state import checkpoint, checkpoint_file

SETTING_UP = "setting up: meshes, grains, and kernels to place them (compiled once) ..."
COMPILING = "compiling kernels (once per kind of scene) ..."
SECONDS_PER_CHUNK = 0.3  # of wall time between two looks at progress and interrupts


def run_scene(
    scene: Scene,
    folder: Path | str,
    *,
    device: str | None = None,
    threads: int | None = None,
    until: float | None = None,
    resume: bool = False,
    overwrite: bool = False,
    quiet: bool = False,
    picture: bool | None = None,
    console: Console | None = None,
    reported: set[str] | None = None,
) -> Simulation:
    """Run ``scene`` to its end, write its results into ``folder`` and print a summary.

    Args:
        scene: validated scene.
        folder: where the results go; made if it is not there.
        device: as ``Simulation``.
        threads: as ``Simulation``.
        until: end [s] instead of the scene's.
        resume: continue from the checkpoint in the folder.
        overwrite: allow a folder that holds the results of a run.
        quiet: print errors only.
        picture: draw picture.png at the end, or not; None as the scene says.
        console: where to print.
        reported: notes and warnings that were printed already and need not be again; those printed now are added.

    Raises:
        SceneError: before anything is computed, if the scene or the checkpoint to continue from is wrong, or the folder holds
            the results of a run and neither ``resume`` nor ``overwrite`` is given, or another run is writing there.
        StabilityError: if the run stops itself; results and the last good checkpoint stay.
        OutputError: if a result cannot be written; results so far and the last good checkpoint stay.
        KeyboardInterrupt: on Ctrl-C, SIGTERM and SIGHUP, with a checkpoint of the present step.
    """
    require_scene(scene)
    folder, console = Path(folder), console or Console()
    check_request(folder, until, overwrite or resume)
    with locked(folder) as claim:
        refuse_results(folder, overwrite or resume)  # of a run that has ended meanwhile
        return _run(scene, claim, device, threads, until, resume, quiet, picture, console, reported)


def _run(
    scene: Scene, claim: RunLock, device: str | None, threads: int | None, until: float | None, resume: bool, quiet: bool,
    picture: bool | None, console: Console, reported: set[str] | None,
) -> Simulation:  # fmt: skip
    """``run_scene`` in a folder that no other run writes into."""
    folder = claim.folder
    begin = time.perf_counter()
    end = scene.time.end if until is None else until
    opened: AbstractContextManager[checkpoint_file.Contents | None] = nullcontext()
    if resume:
        opened = checkpoint_file.opened(folder / CHECKPOINT)
    with opened as saved, compiling_ahead(scene, device) if led() is None else nullcontext():
        with report_if_long(SETTING_UP, console, quiet):
            sim = Simulation(scene, device=device, threads=threads, world=led())
        if saved is not None:
            checkpoint.restore(sim, saved)
        warned, reported = scene_warnings.warnings(sim), set() if reported is None else reported
        for message in warned:
            if message not in reported:
                log.warning("%s: %s", scene.source, message)
        if not quiet:
            _announce(sim, warned, end, folder, console, reported)
        reported |= {*sim.notes, *warned}
        with sim.clock("compile"), report_if_long(COMPILING, console, quiet):
            sim.load_kernels()
    claim.check()
    outputs = Outputs(sim, folder, resume, claim)
    if not resume:
        (folder / CHECKPOINT).unlink(missing_ok=True)  # one of a run before would not fit what is written now
    write_run_record(folder / "run.json", {"status": "running", "scene": scene.source})
    status = "failed"
    try:
        _advance(sim, outputs, end, resume, console, quiet)
        status = "done"
    except StabilityError:
        status = "stopped itself"
        raise
    except OutputError as error:
        status = "output cannot be written"
        raise OutputError(f"stopped at t = {sim.time:.6g} s: {error}; the last good checkpoint is kept") from error
    except KeyboardInterrupt:
        status = "interrupted"
        raise
    finally:
        log.info("%s at t = %.6g s, results in %s", status, sim.time, folder)
        with suppress(OutputError) if status != "done" else nullcontext():
            written = record(sim, status, time.perf_counter() - begin, outputs.turning.result())
            write_run_record(folder / "run.json", written)
    if wants_picture(scene, picture):
        with sim.clock("picture"):
            draw_picture(folder, folder)
        write_run_record(
            folder / "run.json", record(sim, status, time.perf_counter() - begin, outputs.turning.result())
        )
    if not quiet:
        summary.print_summary(sim, console, time.perf_counter() - begin, folder, outputs.turning.result())
    return sim


def _announce(
    sim: Simulation, warned: list[str], end: float, folder: Path, console: Console, reported: set[str]
) -> None:
    """What is about to be run, to ``end`` [s]: notes and the warnings ``warned`` that were not ``reported`` already."""
    resumed_at = f"goes on at t = {sim.time:.6g} s, " if sim.step_number else ""
    steps = max(0, sim.steps_until(end) - sim.step_number)
    title = escape(visible(sim.scene.title or sim.scene.source))
    console.print(f"[bold]{title}[/]: {resumed_at}{len(sim.state)} grains, {steps} steps of "
                  f"{sim.dt:.3g} s on {sim.device} with {sim.threads.count} threads -> {escape(str(folder))}")  # fmt: skip
    if rates := largest_rates(sim.scene):
        console.print(summary.rates_line(rates), markup=False)
    for message in [*sim.notes, *warned]:
        if message not in reported:
            console.print(summary.warning_text(message) if message in warned else Text(f"note: {message}"))


def _advance(sim: Simulation, outputs: Outputs, end: float, resumed: bool, console: Console, quiet: bool) -> None:
    """Bring ``sim`` to ``end`` [s] with all outputs and checkpoints, the last one where it ends or is interrupted.

    A checkpoint comes after all rows and frames up to its time: a resumed run writes those after it, and no others.
    """
    last = sim.steps_until(end)
    due = output_schedule(sim, sim.scene.time.end)  # the same for a run that is cut short and its rest
    interval = sim.scene.output.checkpoint_interval
    save_every = max(1, round(interval / sim.dt)) if interval is not None else last + 1
    path = outputs.folder / CHECKPOINT
    try:
        with progress_bar(console, quiet, max(last, 1)) as tell, held_back() as interrupted:
            if not resumed:
                outputs.write(row=True, frame=True)
                outputs.settle()
                checkpoint.save(sim, path)
            saved = began = time.perf_counter()
            first, chunk = sim.step_number, 16
            while sim.step_number < last and not interrupted():
                step = sim.step_number
                sim.step(min(due.next(step), _next(step, save_every), last, step + chunk) - step)
                step = sim.step_number
                ends = step == last
                outputs.write(row=ends or due.is_row(step), frame=ends or due.is_frame(step))
                now = time.perf_counter()
                if step % save_every == 0 or now - saved > sim.scene.output.checkpoint_wall_time:
                    if sim.guards.is_sound():  # else the last checkpoint stays, and the next look decides
                        outputs.settle()
                        checkpoint.save(sim, path)
                    saved = now
                n, rate = sim.count, (step - first) / max(now - began, 1e-9)
                chunk = max(1, int(SECONDS_PER_CHUNK * rate))
                tell(step, f"t = {sim.time:.4g} of {end:g} s  {speed_text(1.0 / rate, n)}  {n} grains")
            if sim.step_number == last:
                sim.guards.judge()
            outputs.close()
            if sim.guards.is_sound():
                checkpoint.save(sim, path)
    except BaseException:
        with suppress(OutputError):
            outputs.close()
        raise
    if sim.step_number < last:
        raise KeyboardInterrupt(f"at t = {sim.time:.6g} s of {end:g} s")


def _next(step: int, every: int) -> int:
    return (step // every + 1) * every
