"""Everything that a GPU has to show, in calls of under ten minutes: `python tools/gpu/session.py --out gpu_session.json`.

Each part runs in a process of its own with a limit of time, so that one that fails or hangs leaves the others standing; the
JSON file is written anew after each, and keeps the parts of earlier calls. `--device cpu --small` is a trial: the captured
graph on a CPU, on tiny beds.

    part        what it shows                                                               wanted on an H200
    compile     all kernels of the parts, in parallel; the others find them in Warp's cache
    agreement   one contact, 1 000 steps of a bed and 8 perturbed twins, GPU against CPU;   1e-12, 1e-9, 2.5;
                bits of two GPU runs; frames written beside the steps                       equal
    speed       ns per grain and step, time of each launch, bytes moved over a copy's       1.0 (mixed 0.3) at 1e6
    step        microseconds of a step at 10 000 grains, by steps between two looks at      15
                the clock (`engine.graph.BODY`)
    hourglass   the paper's hourglass, a stretch; half a turn is 1e6 steps                  60 s to 600 s for 160 000
    memory      bytes per grain of each array, 100 000 grains
    large       10 million grains: they run, memory per grain                               700 B
    peer        DEME on the same bed

in calls of their own, `--parts paper` and `--parts tests`:

    paper       figures 10 to 13: the paper's hourglass in both frames at 30 and 120 rpm, 0.25 s to settle, half a turn and
                0.55 s after it; runs that are done stay in `--work`, so that another call goes on
    tests       the tests that take a device
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Literal, get_args

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
import warp as wp
from cyclopts import App, Parameter
from rich.console import Console
from warpdem.kernels import KernelSet
from warpdem.kernels.lists import cells, numbering

import bench.speed
import bench.states
import bench.window
from gpu import memory as device_memory
from paper import hourglass as paper_hourglass
from paper.common import SCENES
from warpdem import Scene, Simulation
from warpdem.engine import graph
from warpdem.measure.snapshot import take_snapshot
from warpdem.output.staged_state import StagedState, StagingBuffer

ROOT = Path(__file__).resolve().parents[2]
Part = Literal["compile", "agreement", "speed", "step", "hourglass", "memory", "large", "peer", "paper", "tests"]
LIMITS: dict[Part, float] = {
    "compile": 90.0, "agreement": 75.0, "speed": 110.0, "step": 35.0, "hourglass": 90.0, "memory": 25.0, "large": 130.0,
    "peer": 35.0, "paper": 580.0, "tests": 580.0,
}  # fmt: skip
"""Seconds that each part may take; those of one call under 600 in all."""
TOGETHER = [name for name in get_args(Part) if name not in ("paper", "tests")]
TWINS = 8
QUIET = Console(quiet=True)


def simulation(scene: Scene, device: str) -> Simulation:
    """The captured graph on ``device``."""
    return Simulation(scene, device=device, threads=1, resident=True)


def compile(device: str, small: bool, folder: Path) -> dict:
    """Kernels of all parts, for the GPU and for the CPU that is compared with it."""
    bed = bench.states.own_bed(200, folder, bench.states.Settings(), 2)
    mixed = bench.states.scene_of(bed, "full", bench.states.Settings(precision="mixed"))
    scenes = [contact_scene(), bed_scene(bed), bench.states.scene_of(bed, "full", bench.states.Settings()), mixed]
    scenes += [paper_hourglass.scene_of(paper_hourglass.glass(paper_hourglass.Size(count=200)), SCENES, "hourglass.toml")]
    out = {}
    ways = {"graph": (device, lambda scene: simulation(scene, device)), "loop": ("cpu", lambda scene: Simulation(scene, "cpu"))}
    for name, (where, make) in ways.items():
        begin, modules = time.perf_counter(), {}
        for scene in scenes[: 1 if small else None]:
            built = make(scene).kernels
            groups = [numbering, cells, *(group for group in vars(built).values() if isinstance(group, KernelSet))]
            kernels = [thing for group in groups for thing in vars(group).values() if isinstance(thing, wp.Kernel)]
            # the CPU's loop waits at barriers between threads: nothing for a GPU
            modules |= {id(k.module): k.module for k in kernels if not (built.graph and k is built.loop.run)}
        wp.force_load(where, [*modules.values()], max_workers=len(os.sched_getaffinity(0)))
        out[name] = {"modules": len(modules), "s": time.perf_counter() - begin}
    return out


# --- agreement --------------------------------------------------------------------------------------------------------


def contact_scene() -> Scene:
    """Two grains that hit each other obliquely, spinning."""
    return Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
            "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "constant"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": 0.4, "rolling_friction": 0.1}],
            "grains": [{"material": "g", "positions": [[-1e-3, 0, 0], [1.0001e-3, 3e-4, 0]], "radius": 1e-3,
                        "velocities": [[0.3, 0, 0.1], [-0.3, 0, 0]], "spins": [[0, 0, 40], [10, 0, 0]]}],
            "frame": {"axis": [0, 0, 1], "rate": 20.0},
            "time": {"end": 1.0, "step": 1e-6, "max_speed": 1.0},
        }
    )  # fmt: skip


def contact(device: str | None) -> np.ndarray:
    """Velocities and spins of the two grains on their way; by the CPU's own loop without a device. Shape (k, 12)."""
    scene = contact_scene()
    sim = Simulation(scene, device="cpu", threads=1) if device is None else simulation(scene, device)
    path = []
    for _ in range(20):
        sim.step(20)
        p = sim.particles
        path.append(np.concatenate([p.velocity.ravel(), p.spin.ravel()]))
    return np.array(path)


def bed_scene(start: bench.states.Start, nudge: int = 0) -> Scene:
    """A settled bed in a turning box; each twin with grains moved by 1e-12 m."""
    data = bench.states.scene_of(start, "full", bench.states.Settings()).model_dump(mode="json")
    state = start.state
    shift = 1e-12 * np.random.default_rng(nudge).normal(size=state["x"].shape) if nudge else 0.0
    grains = {"material": "grain", "positions": state["x"] + shift, "radii": state["r"]}
    return Scene.model_validate(data | {"grains": [grains], "frame": {"axis": [0, 1, 0], "rate": 20.0}})


def figures(sim: Simulation) -> np.ndarray:
    """Mean height [m], kinetic energy [J] and contacts of a bed."""
    energy = sim.energy()
    return np.array([sim.particles.position[:, 2].mean(), energy["kinetic"] + energy["rotational"], len(sim.contacts().i)])


def agreement(device: str, small: bool, folder: Path) -> dict:
    """GPU against CPU; errors of positions are over the radius."""
    one, other = contact(None), contact(device)
    start = bench.states.own_bed(200 if small else 2000, folder, bench.states.Settings(), 200 if small else 10_000)
    own, two, again = Simulation(bed_scene(start), device="cpu"), *(simulation(bed_scene(start), device) for _ in range(2))
    for sim in (own, two, again):
        sim.step(100 if small else 1000)
    error = np.abs(own.particles.position - two.particles.position).max() / start.state["r"].min()
    there, staged = again.snapshot(), StagedState(again.view, StagingBuffer(again.device))
    again.step(100)
    aside = take_snapshot(staged.view())
    same = all(np.array_equal(getattr(there, name), getattr(aside, name)) for name in ("position", "velocity", "spin", "force"))
    two.step(100)
    steps, twins = (50, 2) if small else (20_000, TWINS)
    values: dict[str, list] = {"cpu": [], "device": []}
    for twin in range(1, twins + 1):
        for name, sim in (("cpu", Simulation(bed_scene(start, twin), device="cpu")),
                          ("device", simulation(bed_scene(start, twin), device))):  # fmt: skip
            sim.step(steps)
            values[name].append(figures(sim))
    a, b = np.array(values["cpu"]), np.array(values["device"])
    spread = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / twins)
    difference = np.abs(a.mean(axis=0) - b.mean(axis=0)) / np.maximum(spread, 1e-300)
    return {
        "contact_relative": float(np.abs(one - other).max() / np.abs(one).max()),
        "bed_over_radius": float(error),
        "equal_bits_on_device": two.state_hash() == again.state_hash(),
        "frame_beside_the_steps_is_that_at_rest": same,
        "twins_standardised": dict(zip(("height", "kinetic", "contacts"), difference.tolist(), strict=True)),
    }


# --- speed ------------------------------------------------------------------------------------------------------------


def speed(device: str, small: bool, folder: Path) -> dict:
    """``bench/speed.py`` over sizes, and mixed precision at the largest."""
    out = {}
    cases = {"double": (1000, 10_000, 100_000, 1_000_000), "mixed": (1_000_000,)}
    for precision, sizes in ({"double": (200,)} if small else cases).items():
        keys = {"warm": 5, "steps": 5, "repeats": 1} if small else {"warm": 100, "steps": 1000, "repeats": 2}
        settings = bench.states.Settings(device=device, precision=precision, resident=True, **keys)
        settle = 20 if small else 20_000
        report = bench.speed.bench(
            grains=sizes, models=["full"], threads=[1], settings=settings, work=folder, settle=settle, console=QUIET
        )
        out[precision] = report["cases"]
    return out


def step(device: str, small: bool, folder: Path) -> dict:
    """Microseconds of a step by BODY."""
    start = bench.states.own_bed(200 if small else 10_000, folder, bench.states.Settings(), 20 if small else 10_000)
    steps, out = (20 if small else 2000), {}
    for body in (1, 2, 4, 8, 16):
        graph.BODY = body
        sim = simulation(bench.states.scene_of(start, "full", bench.states.Settings()), device)
        sim.step(steps)
        begin, lists, refreshes = time.perf_counter(), sim.lists.rebuilds, sim.lists.inner_rebuilds
        sim.step(steps)
        out[str(body)] = {
            "us": 1e6 * (time.perf_counter() - begin) / steps,
            "rebuilds": sim.lists.rebuilds - lists,
            "refreshes": sim.lists.inner_rebuilds - refreshes,
            "captures": sim.engine.executor.captures,
        }
    return out


def paper_size(device: str, small: bool) -> paper_hourglass.Size:
    """The paper's own grains and glass; few and coarse ones for a trial."""
    if small:
        return paper_hourglass.Size(twins=1, count=100, settle=0.002, rest=0.05, device=device)
    return paper_hourglass.Size(twins=1, paper=True, device=device)


def paper_start(size: paper_hourglass.Size, folder: Path) -> dict[str, np.ndarray]:
    """The settled grains, or those of an earlier part."""
    file = folder / f"hourglass_settled_{size.paper}.npz"
    if not file.exists():
        np.savez(file, **paper_hourglass.settled(paper_hourglass.glass(size), SCENES, size.settle, size.device))
    with np.load(file) as data:
        return dict(data)


def hourglass(device: str, small: bool, folder: Path) -> dict:
    """Seconds of the paper's hourglass for half a turn at 30 rpm (1e6 steps of 1e-6 s), from a stretch at its start."""
    size = paper_size(device, small)
    begin = time.perf_counter()
    start = paper_start(size, folder)
    made = time.perf_counter() - begin
    sim = paper_hourglass.simulation(size, 30.0, "frame", start, 0)
    steps = 20 if small else 10_000
    sim.step(steps)
    begin = time.perf_counter()
    sim.step(steps)
    seconds = (time.perf_counter() - begin) / steps
    grains = len(sim.state)
    return {"grains": grains, "start_s": made, "step_us": 1e6 * seconds, "half_turn_s": 1e6 * seconds, "stages_s": sim.seconds}


def paper_run(size: paper_hourglass.Size, rpm: float, setting: str, folder: Path) -> paper_hourglass.Run:
    """One run of the figures, or the one of an earlier call."""
    file = folder / f"hourglass_{size.paper}_{rpm:g}_{setting}.npz"
    if not file.exists():
        np.savez(file, **vars(paper_hourglass.run(size, rpm, setting, paper_start(size, folder), 0)))
    with np.load(file) as data:
        return paper_hourglass.Run(**{name: value if value.ndim else float(value) for name, value in data.items()})


def paper(device: str, small: bool, folder: Path) -> dict:
    """Figures 10 to 13 of the paper, one run of each setting."""
    size, out = paper_size(device, small), {}
    for rpm, pictures, curves in ((120.0, 11, 13),) if small else ((30.0, 10, 12), (120.0, 11, 13)):
        found = {setting: [paper_run(size, rpm, setting, folder)] for setting in paper_hourglass.SETTINGS}
        numbers = paper_hourglass.summary(size, rpm, found)
        paper_hourglass.draw_grains(size, rpm, found, paper_start(size, folder), folder / f"figure_{pictures}.png")
        paper_hourglass.draw_mass(rpm, found, numbers, folder / f"figure_{curves}.png")
        turn = paper_hourglass.half_turn(rpm)
        half = {key: seconds * turn / (turn + size.rest) for key, seconds in numbers["seconds_per_run"].items()}
        out[f"{rpm:g} rpm"] = {**numbers, "half_turn_s": half}
    return out


def memory(device: str, small: bool, folder: Path) -> dict:
    """Bytes per grain of each array of a settled bed."""
    settings = bench.states.Settings(device=device)
    start = bench.states.bed(200 if small else 100_000, folder, settings, 20 if small else 20_000)
    return device_memory.held(bench.states.scene_of(start, "full", settings), device, 50)


def large(device: str, small: bool, folder: Path) -> dict:
    """Ten million grains."""
    tile = bench.states.own_bed(200 if small else bench.states.TILE, folder, bench.states.Settings(), 20 if small else 20_000)
    start = bench.states.tiled(tile, 2 if small else 22, folder)
    where = wp.get_device(device)
    before = wp.get_mempool_used_mem_current(where) if where.is_cuda else 0
    sim = simulation(bench.states.scene_of(start, "full", bench.states.Settings()), device)
    sim.step(20)
    begin, steps, n = time.perf_counter(), 20 if small else 200, len(sim.state)
    sim.step(steps)
    seconds = time.perf_counter() - begin
    held = (wp.get_mempool_used_mem_current(where) - before) / n if where.is_cuda else None
    finite = bool(np.isfinite(sim.particles.position).all())
    return {"grains": n, "ns_per_grain_step": 1e9 * seconds / steps / n, "bytes_per_grain": held,
            "bytes_per_grain_by_plan": sim.plan.bytes_per_grain, "finite": finite}  # fmt: skip


def peer(device: str, small: bool, folder: Path) -> dict:
    """DEME beside warpdem."""
    if wp.get_device(device).is_cpu or bench.speed.deme.version() is None:
        return {"skipped": "deme is not installed, or this is a CPU"}
    settings = bench.states.Settings(device=device, steps=1000, repeats=1)
    report = bench.speed.bench(grains=[20_000], models=["full"], settings=settings, peer="deme", work=folder, console=QUIET)
    return {"cases": report["cases"], "versions": report["versions"]}


def tests(device: str, small: bool, folder: Path) -> dict:
    """The tests that take a device, on it."""
    words = ["tests/test_resident.py"] if small else ["tests", "-k", "cuda and not compile or resident"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True)
    return {"code": done.returncode, "end": done.stdout.splitlines()[-15:]}


# --- all of it --------------------------------------------------------------------------------------------------------

app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.command
def part(name: Part, device: str, folder: Path, *, small: bool = False) -> None:
    """Run one part in this process and print its JSON in the last line."""
    out = globals()[name](device, small, folder)
    print("\n" + json.dumps(out))


@app.default
def main(
    *, device: str = "cuda:0", small: bool = False, parts: list[Part] = TOGETHER, limit: float | None = None,
    work: Path = Path("gpu_session"), out: Path = Path("gpu_session.json"),
) -> None:  # fmt: skip
    """Run parts and write one JSON file.

    Args:
        device: The GPU; cpu for a trial.
        small: Tiny beds, for a trial.
        parts: Which parts, in this order.
        limit: Seconds for each part instead of its own.
        work: Folder that keeps beds, runs and figures.
        out: JSON file, written anew after each part.
    """
    if device not in (there := [d.alias for d in wp.get_devices()]):
        raise SystemExit(f"--device {device}: not on this machine; there is {', '.join(there)}")
    work.mkdir(parents=True, exist_ok=True)
    name = wp.get_device(device).name
    report: dict[str, Any] = json.loads(out.read_text()) if out.exists() else {}
    report |= {"device": name, "machine": bench.window.machine(), "commit": bench.window.commit(), "warp": wp.config.version}
    for one in parts:
        begin = time.perf_counter()
        command = [sys.executable, __file__, "part", one, device, str(work.resolve()), *(["--small"] if small else [])]
        try:
            done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=limit or LIMITS[one])
            report[one] = json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else {"failed": done.stderr[-3000:]}
        except subprocess.TimeoutExpired:
            report[one] = {"failed": f"longer than {limit or LIMITS[one]:g} s"}
        report[one]["seconds"] = time.perf_counter() - begin
        out.write_text(json.dumps(report, indent=2) + "\n")
        print(one, json.dumps(report[one])[:300], flush=True)


if __name__ == "__main__":
    sys.exit(app())
