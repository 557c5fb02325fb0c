"""A run with its outputs: advances a simulation from frame to frame, writes, shows progress, and sums up."""

import json
import math
import os
import platform
import time
from contextlib import nullcontext, suppress
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.text import Text

from warpdem.app import advice, summary
from warpdem.core.interrupts import held_back
from warpdem.core.output_schedule import OutputSchedule
from warpdem.core.progress import progress_bar, told_if_long
from warpdem.core.run_lock import FolderLocked, RunLock, is_locked, locked, require_unlocked
from warpdem.core.snapshot import WallMesh
from warpdem.errors import OutputError, SceneError, StabilityError
from warpdem.measure import observation
from warpdem.measure.column import Readings
from warpdem.measure.dimensionless import Turning, TurningNumbers
from warpdem.measure.snapshot import take_snapshot
from warpdem.model import digests
from warpdem.output.background import Background
from warpdem.output.history import history_columns, history_row
from warpdem.output.instant import Instant, Room
from warpdem.output.write_grid import GridWriter
from warpdem.output.write_tables import HistoryWriter, write_run_record
from warpdem.scene.messages import visible
from warpdem.scene.model import Scene
from warpdem.scene.motion_chain import largest_rates
from warpdem.simulation import Simulation
from warpdem.state import checkpoint
from warpdem.usd.stage import USD_SUFFIXES

CHECKPOINT = "checkpoint.h5"
SETTING_UP = "setting up: meshes, grains, and kernels to place them (compiled once) ..."
COMPILING = "compiling kernels (once per kind of scene) ..."
SECONDS_PER_CHUNK = 0.3  # of wall time between two looks at progress and interrupts


def named_folder(scene_path: Path) -> Path:
    """``out/NAME``: the name of the scene's file, or of its folder if it is the result stage of a run."""
    is_result = scene_path.stem == "result" and scene_path.suffix.lower() in USD_SUFFIXES
    return Path("out") / (scene_path.resolve().parent.name if is_result else scene_path.stem)


def default_folder(scene_path: Path) -> Path:
    """``out/NAME``, or ``out/NAME-2``, ``out/NAME-3``... when there are results already, or another run is writing there."""
    base = named_folder(scene_path)
    folder, number = base, 1
    while (folder / "run.json").exists() or is_locked(folder):
        number += 1
        folder = base.with_name(f"{base.name}-{number}")
    return folder


def check_request(folder: Path, until: float | None, overwrite: bool) -> None:
    """Refuse to write over the results of another run, and an end that is none; nothing is written.

    Raises:
        SceneError: if ``folder`` holds a run and ``overwrite`` is false, or cannot be written; if ``until`` [s] is not above 0.
        FolderLocked: a SceneError: another run is writing into ``folder``, or has left its results there.
    """
    if until is not None and not 0.0 < until < math.inf:
        raise SceneError(f"--until {until:g}: the time at which the run ends must be above 0 [s]")
    require_unlocked(folder)
    refuse_results(folder, overwrite)
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise SceneError(f"--out {folder}: cannot be written ({there} is no folder to write in)")


def refuse_results(folder: Path, overwrite: bool) -> None:
    """Refuse to write over the results of another run.

    Raises:
        FolderLocked: if ``folder`` holds a run and ``overwrite`` is false.
    """
    if (folder / "run.json").exists() and not overwrite:
        said = f"--out {folder}: holds the results of a run; take another one, or say --overwrite (overwrite=True)"
        raise FolderLocked(folder, said)


def cadence(sim: Simulation, end: float) -> OutputSchedule:
    """When frames and rows of the history are due in a run to ``end`` [s]."""
    output = sim.scene.output
    return OutputSchedule.of(output.interval or end / 50.0, output.history_interval, sim.dt)


def writer_of(name: str, folder: Path, walls: list[WallMesh], scene: Scene, resume: bool = False):
    """Writer of a format of ``output.formats``; its libraries are loaded now, not before.

    Args:
        name: the format.
        folder: where the files go.
        walls: the walls to draw, each in its body axes.
        scene: the scene that is run.
        resume: keep the frames of an earlier run that come before the first new one.
    """
    if name == "usd":
        from warpdem.output.write_usd import UsdWriter

        return UsdWriter(folder, walls, scene=scene, resume=resume)
    if name == "vtkhdf":
        from warpdem.output.write_vtkhdf import VtkhdfWriter

        return VtkhdfWriter(folder, walls, contacts=scene.output.contacts, resume=resume)
    from warpdem.output.write_vtk import VtkWriter

    return VtkWriter(folder, walls, contacts=scene.output.contacts, resume=resume)


class Outputs:
    """All files of a run but the pictures."""

    def __init__(self, sim: Simulation, folder: Path, resume: bool = False, claim: RunLock | None = None) -> None:
        self.sim, self.folder, self.claim = sim, folder, claim
        walls = sim.wall_meshes()
        self.writers = [writer_of(name, folder, walls, sim.scene, resume=resume) for name in sim.scene.output.formats]
        grid = sim.scene.measures.grid
        self.writers += [GridWriter(folder, grid, sim.domain.period, resume=resume)] if grid is not None else []
        self.background = Background()
        self.rooms = Room(sim.device), Room(sim.device)  # of the instant that is written, and of the next one
        self.columns = history_columns(sim.scene)
        header = [column.header for column in self.columns]
        self.history = HistoryWriter(folder / "history.csv", header, resume=resume)
        self.turning = TurningNumbers(sim.scene)

    def write(self, *, row: bool = False, frame: bool = False) -> None:
        """Write a row of the history and a frame of the present instant, while the run goes on.

        Raises:
            OutputError: what came before could not be written, or the folder is no longer that of this run.
        """
        if not (row or frame):
            return
        if self.claim is not None:
            self.claim.check()
        with self.sim.clock("output"):
            output, self.rooms = self.sim.scene.output, self.rooms[::-1]
            network = frame and (output.contacts or self.sim.scene.measures.grid is not None)
            instant = Instant(self.sim.view, self.rooms[0], contacts=row or network)
            observed = observation.observed(self.sim.view) if row else {}  # by kernels, which no other thread may launch
            self.background.start(lambda: self._write(instant, observed, row, frame))

    def _write(self, instant: Instant, observed: dict[str, np.ndarray], row: bool, frame: bool) -> None:
        with self.sim.clock("output, beside the steps"):
            view = instant.view()
            if row:
                self.history.write(history_row(self.columns, Readings(view, observed)))
                self.turning.add(view)
            if frame:
                snapshot = take_snapshot(view)
                for writer in self.writers:
                    writer.write(snapshot)

    def settle(self) -> None:
        """Wait until all rows and frames are written: what is saved next counts on them.

        Raises:
            OutputError: one could not be written, or the folder is no longer that of this run.
        """
        if self.claim is not None:
            self.claim.check()
        with self.sim.clock("output"):
            self.background.settle()

    def close(self) -> None:
        """Close all files, after the last row and frame are written.

        Raises:
            OutputError: it could not be written.
        """
        try:
            self.background.close()
        finally:
            for writer in (*self.writers, self.history):
                writer.close()


def record(sim: Simulation, status: str, wall_seconds: float, turning: Turning | None) -> dict:
    """What run.json holds."""
    import warp as wp

    from warpdem import __version__

    scene = sim.scene.model_dump(mode="json")
    return {
        "status": status,
        "scene": sim.scene.source,
        "title": sim.scene.title,
        "scene_hash": digests.scene_hash(sim.scene),
        "state_hash": sim.state_hash(),
        "versions": {"warpdem": __version__, "warp": wp.config.version, "numpy": np.__version__,
                     "python": platform.python_version()},
        "device": str(sim.device),
        "threads": sim.threads.count,
        "groups": sim.scene.groups,
        "plan": sim.plan.explain(),
        "notes": sim.notes,
        "warnings": [*advice.warnings(sim), *summary.shortfalls(sim)],
        "grains": len(sim.state),
        "time": sim.time,
        "steps": sim.step_number,
        "time_step": {"used": sim.dt, "candidates": sim.limits.candidates, "binding": sim.limits.binding,
                      "stability_limit": sim.limits.stable, "max_speed": sim.limits.max_speed},
        "extremes": {**sim.extremes, "steps_per_contact": summary.steps_per_contact(sim),
                     "step_over_stability_limit": sim.guards.stability.seen.largest},
        "noticed": sim.noticed,
        "left": {name: {"grains": count, "mass": mass} for name, (count, mass) in sim.left.items()},
        "came": [{"grains": f.count, "mass": f.mass, "due": f.due(sim.step_number)[0]} for f in sim.feeders],
        "turning": asdict(turning) if turning is not None else None,
        "packings": [asdict(packing) for packing in sim.expected.packings],
        "lists": {"rebuilds": sim.lists.rebuilds, "refreshes": sim.lists.refreshes, "skin": sim.lists.skin},
        "seconds": {**sim.seconds, "total": wall_seconds},
        "scene_data": scene if len(json.dumps(scene)) < 100_000 else "left out: explicit arrays; see scene_hash",
    }  # fmt: skip


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
    told: set[str] | None = None,
) -> Simulation:
    """Run ``scene`` to its end, write its results into ``folder`` and print a summary.

    Args:
        scene: validated scene.
        folder: where the results go; made if it is not there.
        device: as ``Simulation``.
        threads: as ``Simulation``.
        until: end [s] instead of the scene's.
        resume: go on from the checkpoint in the folder.
        overwrite: allow a folder that holds the results of a run.
        quiet: print errors only.
        picture: draw picture.png at the end, or not; None as the scene says.
        console: where to print.
        told: notes and warnings that were printed already and need not be again; those printed now are added.

    Raises:
        SceneError: before anything is computed, if the scene or the checkpoint to go on from is wrong, or the folder holds
            the results of a run and neither ``resume`` nor ``overwrite`` is said, or another run is writing there.
        StabilityError: if the run stops itself; results and the last good checkpoint stay.
        OutputError: if a result cannot be written; results so far and the last good checkpoint stay.
        KeyboardInterrupt: on Ctrl-C, SIGTERM and SIGHUP, with a checkpoint of the present step.
    """
    folder, console = Path(folder), console or Console()
    check_request(folder, until, overwrite or resume)
    with locked(folder) as claim:
        refuse_results(folder, overwrite or resume)  # of a run that has ended meanwhile
        return _run(scene, claim, device, threads, until, resume, quiet, picture, console, told)


def _run(
    scene: Scene, claim: RunLock, device: str | None, threads: int | None, until: float | None, resume: bool, quiet: bool,
    picture: bool | None, console: Console, told: set[str] | None,
) -> Simulation:  # fmt: skip
    """``run_scene`` in a folder that no other run writes into."""
    folder = claim.folder
    begin = time.perf_counter()
    saved = checkpoint.read(folder / CHECKPOINT) if resume else None
    with told_if_long(SETTING_UP, console, quiet):
        sim = Simulation(scene, device=device, threads=threads)
    if saved is not None:
        checkpoint.restore(sim, saved)
    end = scene.time.end if until is None else until
    if not quiet:
        _announce(sim, end, folder, console, set() if told is None else told)
    with sim.clock("compile"), told_if_long(COMPILING, console, quiet):
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
        with suppress(OutputError) if status != "done" else nullcontext():
            written = record(sim, status, time.perf_counter() - begin, outputs.turning.result())
            write_run_record(folder / "run.json", written)
    if wants_picture(scene, picture):
        with sim.clock("picture"):
            draw_picture(folder, folder)
        write_run_record(folder / "run.json", record(sim, status, time.perf_counter() - begin, outputs.turning.result()))
    if not quiet:
        summary.print_summary(sim, console, time.perf_counter() - begin, folder, outputs.turning.result())
    return sim


def wants_picture(scene: Scene, asked: bool | None) -> bool:
    """Whether a run of ``scene`` ends with a picture: as ``asked``, or None as the scene says; not without frames to draw."""
    return (scene.output.picture if asked is None else asked) and bool({"vtk", "vtkhdf"} & set(scene.output.formats))


def draw_picture(results: Path, folder: Path) -> None:
    """Draw the last frame of the ``results`` in a folder as picture.png in ``folder``.

    Raises:
        WarpdemError: as ``warpdem.render``.
        KeyboardInterrupt: on Ctrl-C, which says that nothing else is lost.
    """
    from warpdem.drawing.rendering import render

    try:
        render(results, folder / "picture.png")
    except KeyboardInterrupt:
        raise KeyboardInterrupt("while the picture was drawn, with all other results written") from None


def _announce(sim: Simulation, end: float, folder: Path, console: Console, told: set[str]) -> None:
    """What is about to be run, to ``end`` [s]."""
    goes_on = f"goes on at t = {sim.time:.6g} s, " if sim.step_number else ""
    steps = max(0, sim.steps_until(end) - sim.step_number)
    title = escape(visible(sim.scene.title or sim.scene.source))
    console.print(f"[bold]{title}[/]: {goes_on}{len(sim.state)} grains, {steps} steps of "
                  f"{sim.dt:.3g} s on {sim.device} with {sim.threads.count} threads -> {escape(str(folder))}")  # fmt: skip
    if rates := largest_rates(sim.scene):
        console.print(summary.rates_line(rates), markup=False)
    warned = advice.warnings(sim)
    for words in [*sim.notes, *warned]:
        if words not in told:
            console.print(summary.warning_text(words) if words in warned else Text(f"note: {words}"))
    told |= {*sim.notes, *warned}


def _advance(sim: Simulation, outputs: Outputs, end: float, resumed: bool, console: Console, quiet: bool) -> None:
    """Bring ``sim`` to ``end`` [s] with all outputs and checkpoints on the way, the last one where it ends or is interrupted.

    A checkpoint comes after all rows and frames up to its instant: a resumed run writes those after it, and no others.
    """
    last = sim.steps_until(end)
    due = cadence(sim, sim.scene.time.end)  # the same for a run that is cut short and its rest
    asked = sim.scene.output.checkpoint_interval
    save_every = max(1, round(asked / sim.dt)) if asked is not None else last + 1
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
                n, rate = len(sim.state), (step - first) / max(now - began, 1e-9)
                chunk = max(1, int(SECONDS_PER_CHUNK * rate))
                tell(step, f"t = {sim.time:.4g} of {end:g} s  {summary.speed_text(1.0 / rate, n)}  {n} grains")
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


