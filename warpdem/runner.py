"""A run with its outputs: advances a simulation from frame to frame, writes, shows progress, and sums up."""

import json
import platform
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

from warpdem import checkpoint, summary
from warpdem.dimensionless import Turning, TurningNumbers
from warpdem.errors import SceneError, StabilityError
from warpdem.scene import Scene
from warpdem.simulation import Simulation
from warpdem.write_tables import HistoryWriter, write_run_record

HISTORY_COLUMNS = (
    "time [s]", "frame_angle [rad]", "grains [-]", "kinetic [J]", "rotational [J]", "elastic [J]", "potential [J]",
    "centre_x [m]", "centre_y [m]", "centre_z [m]", "largest_overlap [-]", "largest_approach_speed [m/s]",
)  # fmt: skip
CHECKPOINT = "checkpoint.h5"
SECONDS_PER_CHUNK = 0.3  # of wall time between two looks at progress and interrupts
CHECKPOINT_SECONDS = 60.0  # of wall time between two checkpoints


def default_folder(scene_path: Path) -> Path:
    """``out/NAME``, or ``out/NAME-2``, ``out/NAME-3``... when there are results already."""
    base = Path("out") / scene_path.stem
    folder, number = base, 1
    while (folder / "run.json").exists():
        number += 1
        folder = base.with_name(f"{base.name}-{number}")
    return folder


def check_folder(folder: Path, overwrite: bool) -> None:
    """Refuse to write over the results of another run.

    Raises:
        SceneError: if ``folder`` holds a run and ``overwrite`` is false, or cannot be written.
    """
    if (folder / "run.json").exists() and not overwrite:
        raise SceneError(f"--out {folder}: holds the results of a run; take another folder, or say --overwrite")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-test"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise SceneError(f"--out {folder}: cannot be written ({error.strerror})") from error


def history_columns(scene: Scene) -> list[str]:
    """Header of history.csv: loads on each wall come last, in laboratory axes."""
    vectors = [f"{name} {axis} {unit}" for name, unit in (("force", "[N]"), ("torque", "[N m]")) for axis in "xyz"]
    return [*HISTORY_COLUMNS, *(f"{wall.name} {column}" for wall in scene.walls for column in (*vectors, "power [W]"))]


def history_row(sim: Simulation) -> list[float]:
    """One row of history.csv."""
    loads = sim.wall_loads(lab=True).values()
    energy, particles, met = sim.energy(), sim.particles, sim.extremes
    mass, position = particles.mass, particles.position_lab
    centre = mass @ position / mass.sum() if len(mass) else np.full(3, np.nan)
    return [
        sim.time, sim.schedule.pose(sim.time).angle, len(mass), energy["kinetic"], energy["rotational"],
        energy["elastic"], energy["potential"], *centre,
        max(met["pair_overlap_share"], met["wall_overlap_share"]),
        max(met["pair_approach_speed"], met["wall_approach_speed"]),
        *(number for load in loads for number in (*load.force, *load.torque, load.power)),
    ]  # fmt: skip


class Outputs:
    """All files of a run but the pictures."""

    def __init__(self, sim: Simulation, folder: Path, resume: bool = False) -> None:
        self.sim, self.folder = sim, folder
        walls = sim.wall_meshes()
        self.writers = []
        if "vtk" in sim.scene.output.formats:
            from warpdem.write_vtk import VtkWriter

            self.writers.append(VtkWriter(folder, walls, resume=resume))
        if "usd" in sim.scene.output.formats:
            from warpdem.write_usd import UsdWriter

            self.writers.append(UsdWriter(folder, walls, resume=resume))
        self.history = HistoryWriter(folder / "history.csv", history_columns(sim.scene), resume=resume)
        self.turning = TurningNumbers(sim)

    def frame(self) -> None:
        """Write a frame of the present instant."""
        with self.sim.clock("output"):
            snapshot = self.sim.snapshot()
            for writer in self.writers:
                writer.write(snapshot)

    def row(self) -> None:
        """Write a row of the history."""
        with self.sim.clock("output"):
            self.history.write(history_row(self.sim))
            self.turning.add()

    def close(self) -> None:
        """Close all files."""
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
        "scene_hash": summary.scene_hash(sim.scene),
        "state_hash": sim.state_hash(),
        "versions": {"warpdem": __version__, "warp": wp.config.version, "numpy": np.__version__,
                     "python": platform.python_version()},
        "device": str(sim.device),
        "threads": sim.threads.count,
        "plan": sim.plan.explain(),
        "notes": sim.notes,
        "grains": len(sim.state),
        "time": sim.time,
        "steps": sim.step_number,
        "time_step": {"used": sim.dt, "candidates": sim.limits.candidates, "binding": sim.limits.binding,
                      "stability_limit": sim.limits.stable, "max_speed": sim.limits.max_speed},
        "extremes": {**sim.extremes, "steps_per_contact": summary.steps_per_contact(sim)},
        "noticed": sim.noticed,
        "left": {name: {"grains": count, "mass": mass} for name, (count, mass) in sim.left.items()},
        "came": [{"grains": feeder.count, "mass": feeder.mass} for feeder in sim.feeders],
        "turning": asdict(turning) if turning is not None else None,
        "packings": [asdict(packing) for packing in sim.expected.packings],
        "lists": {"rebuilds": sim.lists.rebuilds, "refreshes": sim.lists.refreshes, "skin": sim.lists.skin},
        "seconds": {**sim.seconds, "total": wall_seconds},
        "scene_data": scene if len(json.dumps(scene)) < 100_000 else "left out: explicit arrays; see scene_hash",
    }  # fmt: skip


@contextmanager
def _interrupts() -> Iterator[Callable[[], None]]:
    """Hold Ctrl-C and SIGTERM back; the function given raises KeyboardInterrupt where the state is whole."""
    came: list[int] = []

    def ask() -> None:
        if came:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield ask
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(s, lambda number, _: came.append(number)) for s in signals]
    try:
        yield ask
    finally:
        for s, handler in zip(signals, before, strict=True):
            signal.signal(s, handler)


@contextmanager
def _progress(console: Console, quiet: bool, total: float) -> Iterator[Progress]:
    columns = (
        SpinnerColumn(), TextColumn("[bold]{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"),
        TextColumn("ETA"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=quiet or not console.is_terminal, transient=True) as progress:
        progress.add_task("run", total=total, state="")
        yield progress


def run_scene(
    scene: Scene,
    folder: Path,
    *,
    device: str | None = None,
    threads: int | None = None,
    until: float | None = None,
    resume: bool = False,
    quiet: bool = False,
    console: Console | None = None,
) -> Simulation:
    """Run ``scene`` to its end, write its results into ``folder`` and print a summary.

    Raises:
        SceneError: before anything is computed, if the scene is wrong.
        StabilityError: if the run stops itself; results and the last good checkpoint stay.
    """
    console = console or Console()
    begin = time.perf_counter()
    sim = Simulation(scene, device=device, threads=threads)
    if resume:
        checkpoint.restore(sim, folder / CHECKPOINT)
    end = scene.time.end if until is None else until
    last = sim.steps_until(end)
    interval = scene.output.interval or end / 50.0
    frame_every = max(1, round(interval / sim.dt))
    row_every = max(1, round((scene.output.history_interval or interval / 4.0) / sim.dt))
    if not quiet:
        console.print(f"[bold]{scene.title or scene.source}[/]: {len(sim.state)} grains, {last} steps of {sim.dt:.3g} s "
                      f"on {sim.device} with {sim.threads.count} threads -> {folder}")  # fmt: skip
        for note in sim.notes:
            console.print(f"note: {note}", markup=False)
    outputs = Outputs(sim, folder, resume)
    write_run_record(folder / "run.json", {"status": "running", "scene": scene.source})
    saved = time.perf_counter()
    status = "done"
    try:
        with _progress(console, quiet, max(last, 1)) as progress, _interrupts() as ask:
            if not resume:
                outputs.frame()
                outputs.row()
            first, began, chunk = sim.step_number, time.perf_counter(), 16
            while sim.step_number < last:
                stops = (_next(sim.step_number, frame_every), _next(sim.step_number, row_every), last)
                sim.step(min(*stops, sim.step_number + chunk) - sim.step_number)
                if sim.step_number % row_every == 0 or sim.step_number == last:
                    outputs.row()
                if sim.step_number % frame_every == 0 or sim.step_number == last:
                    outputs.frame()
                now = time.perf_counter()
                if now - saved > CHECKPOINT_SECONDS:
                    checkpoint.save(sim, folder / CHECKPOINT)
                    saved = now
                rate = (sim.step_number - first) / max(now - began, 1e-9)
                chunk = max(1, int(SECONDS_PER_CHUNK * rate))
                progress.update(
                    progress.task_ids[0], completed=sim.step_number,
                    state=f"t = {sim.time:.4g} of {end:g} s  {rate:.0f} steps/s  {len(sim.state)} grains",
                )  # fmt: skip
                ask()
    except StabilityError:
        status = "stopped itself"
        raise
    except KeyboardInterrupt:
        status = "interrupted"
        raise
    finally:
        outputs.close()
        if status != "stopped itself":
            checkpoint.save(sim, folder / CHECKPOINT)
        write_run_record(folder / "run.json", record(sim, status, time.perf_counter() - begin, outputs.turning.result()))
    if scene.output.picture and "vtk" in scene.output.formats:
        with sim.clock("picture"):
            from warpdem.render import render

            render(folder, folder / "picture.png", view="laboratory")
        write_run_record(folder / "run.json", record(sim, status, time.perf_counter() - begin, outputs.turning.result()))
    if not quiet:
        summary.print_summary(sim, console, time.perf_counter() - begin, folder, outputs.turning.result())
    return sim


def _next(step: int, every: int) -> int:
    return (step // every + 1) * every


