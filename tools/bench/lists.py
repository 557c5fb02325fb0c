"""What grains that fly off, leave or come in cost the others: `python tools/bench/lists.py --help`; how to read it: README.md.

Each case is a settled bed beside the same with something that happens to few of its grains. Windows of the two alternate,
processor time counts (of all threads), and the least of each: on a busy machine too the ratio says something.
"""

import gc
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench.states import Settings, Start, bed, scene_of
from bench.window import OtherLoad

FALL = 1.0  # speed at which the bed of the discharge comes through its border, and that all time steps are made for [m/s]
STREAM = {"material": "grain", "diameter": {"uniform": [3e-4, 6e-4]}, "velocity": [0, 0, 3.0], "count_rate": 1e5}


def written(start: Start, folder: Path, name: str, **changes: np.ndarray) -> Path:
    """A state file beside that of ``start``, with other positions, radii, velocities or spins."""
    path = folder / f"{start.file.stem}_{name}.npz"
    np.savez(path, **{**start.state, **changes})
    return path


def settled(start: Start, settings: Settings) -> dict:
    """The bed as it is; the time step is not that of a grain that flies away, which hits nothing."""
    scene = json.loads(scene_of(start, "full", settings).model_dump_json(exclude_unset=True))
    return scene | {"time": {**scene["time"], "max_speed": FALL}}


def with_flyer(start: Start, folder: Path, settings: Settings, speed: float) -> dict:
    """The bed, and one more grain, 5 mm above it, that flies away upwards."""
    state, scene = start.state, settled(start, settings)
    above = [0.5 * start.width, 0.5 * start.width, state["x"][:, 2].max() + 5e-3]
    flyer = {"material": "grain", "radius": 2e-4, "positions": [above], "velocities": [[0, 0, speed]]}
    return scene | {"grains": [*scene["grains"], flyer]}


def falling(start: Start, folder: Path, settings: Settings, border: bool) -> dict:
    """The bed without its floor, falling as one; with ``border`` it leaves at its lower end."""
    rest = start.state["x"]
    scene = settled(start, settings)
    file = written(start, folder, "falling", v=np.zeros_like(rest) - [0, 0, FALL])
    scene |= {"grains": [{"material": "grain", "file": str(file.resolve())}], "walls": scene["walls"][1:]}
    lowest = float(np.sort(rest[:, 2])[0])
    return scene | ({"borders": {"z": {"min": lowest - 1e-6, "kind": "open"}}} if border else {})


def with_stream(start: Start, folder: Path, settings: Settings) -> dict:
    """The bed, and a stream of grains that come in above it, 10 at a time."""
    top, scene = start.state["x"][:, 2].max() + 5e-3, settled(start, settings)
    w = start.width
    box = {"min": [0.0, 0.0, top], "max": [w, w, top + 4e-3]}
    return scene | {"streams": [{**STREAM, "box": box}]}


def cases(start: Start, folder: Path, settings: Settings) -> dict[str, tuple[dict, dict]]:
    """Scenes of each case: without and with what happens."""
    plain = settled(start, settings)
    return {
        "one grain at 20 m/s": (plain, with_flyer(start, folder, settings, 20.0)),
        "one grain at 300 m/s": (plain, with_flyer(start, folder, settings, 300.0)),
        "discharge through a border": (
            falling(start, folder, settings, border=False), falling(start, folder, settings, border=True),
        ),
        "stream": (plain, with_stream(start, folder, settings)),
    }  # fmt: skip


def window(scene: dict, threads: int, settings: Settings) -> dict:
    """Processor time per step [s], and how often lists were made."""
    gc.collect()
    sim = warpdem.Simulation(warpdem.Scene.model_validate(scene), device="cpu", threads=threads, resident=settings.resident)
    sim.step(settings.warm)
    there, rebuilds, refreshes = len(sim.state), sim.lists.rebuilds, sim.lists.inner_rebuilds
    begin = time.process_time()
    sim.step(settings.steps)
    seconds = time.process_time() - begin
    out = {
        "seconds_per_step": seconds / settings.steps, "rebuilds": sim.lists.rebuilds - rebuilds,
        "refreshes": sim.lists.inner_rebuilds - refreshes, "came_or_left": abs(len(sim.state) - there),
        "state_hash": sim.state_hash(),
    }  # fmt: skip
    sim.threads.close()
    return out


def bench(
    grains: Sequence[int], threads: int, settings: Settings, settle: int, work: Path, only: Sequence[str] = ()
) -> dict:
    """All cases, as the JSON report has them."""
    work.mkdir(parents=True, exist_ok=True)
    load, rows = OtherLoad(), []
    for count in grains:
        start = bed(count, work, settings, settle)
        for name, scenes in cases(start, work, settings).items():
            if only and not any(word in name for word in only):
                continue
            windows: tuple[list[dict], list[dict]] = ([], [])
            for _ in range(settings.repeats):
                for found, scene in zip(windows, scenes, strict=True):
                    found.append(window(scene, threads, settings))
            without, with_ = (min(found, key=lambda one: one["seconds_per_step"]) for found in windows)
            ratio = with_["seconds_per_step"] / without["seconds_per_step"]
            rows.append({"case": name, "grains": len(start.state["r"]), "ratio": ratio, "without": without, "with": with_})
    return {"threads": threads, "steps": settings.steps, "cases": rows, "other_load_cores": load.cores()}


def print_report(report: dict, console: Console) -> None:
    """One line per case."""
    table = Table(box=SIMPLE, title=f"{report['threads']} threads, windows of {report['steps']} steps, processor time")
    for column in ("case", "grains", "us/step without", "with", "ratio", "lists without", "with", "came or left"):
        table.add_column(column, justify="left" if column == "case" else "right")
    for row in report["cases"]:
        pair = row["without"], row["with"]
        times = [f"{1e6 * one['seconds_per_step']:.0f}" for one in pair]
        lists = [f"{one['rebuilds']} + {one['refreshes']}" for one in pair]
        table.add_row(row["case"], str(row["grains"]), *times, f"{row['ratio']:.2f}", *lists, str(row["with"]["came_or_left"]))
    console.print(table)


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    grains: Sequence[int] = (2000, 13_000, 40_000),
    cases: Sequence[str] = (),
    threads: int = 1,
    steps: int = 400,
    warm: int = 100,
    repeats: int = 3,
    settle: int = 20_000,
    resident: bool = False,
    work: Path = Path("bench"),
    out: Path | None = None,
) -> None:
    """Time a bed with a grain that flies away, with grains that leave, and with a stream, beside the bed alone.

    Args:
        grains: Grains of the beds.
        cases: Words that the name of a case must hold one of; default all cases.
        threads: CPU threads.
        steps: Timed steps of a window.
        warm: Steps before them.
        repeats: Windows of each scene.
        settle: Steps that a bed settles for; beds are kept in ``work``.
        resident: Steps as the graph that a GPU runs.
        work: Folder of the states.
        out: File of the report, JSON.
    """
    settings = Settings(skin="auto", warm=warm, steps=steps, repeats=repeats, resident=resident or None)
    report = bench(grains, threads, settings, settle, work, cases)
    print_report(report, Console(highlight=False, width=None if sys.stdout.isatty() else 120))
    if out is not None:
        out.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(app())
