"""Everything that a GPU has to show, in one call of under ten minutes: `python tools/gpu_session.py --out gpu_session.json`.

Each part runs in a process of its own with a limit of time, so that one that fails or hangs leaves the others standing; the
JSON file is written anew after each. `--device cpu --small` is a trial: the captured graph on a CPU, on tiny beds.

    part        what it shows                                                               wanted on an H200
    agreement   one contact, 1 000 steps of a bed and 8 perturbed twins, GPU against CPU;   1e-12, 1e-9, 2.5;
                bits of two GPU runs                                                        equal
    speed       ns per grain and step, share of each launch, bytes moved over a copy's      1.0 (mixed 0.3) at 1e6
    step        microseconds of a step at 10 000 grains, by steps between two looks at      15
                the clock (`engine.resident.BODY`)
    hourglass   the paper's hourglass, a short stretch; half a turn is 1e6 steps            60 s to 600 s for 160 000
    large       10 million grains: they run, memory per grain                               700 B
    peer        DEME on the same bed
    tests       the tests that take a device
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Literal

import bench_speed
import numpy as np
import warp as wp
from cyclopts import App, Parameter
from rich.console import Console

from warpdem import Scene, Simulation, load_scene
from warpdem.engine import resident

ROOT = Path(__file__).resolve().parents[1]
Part = Literal["agreement", "speed", "step", "hourglass", "large", "peer", "tests"]
LIMITS: dict[Part, float] = {
    "agreement": 110.0, "speed": 150.0, "step": 60.0, "hourglass": 60.0, "large": 80.0, "peer": 60.0, "tests": 60.0,
}  # fmt: skip
"""Seconds that each part may take; 580 in all."""
TWINS = 8
QUIET = Console(quiet=True)


def simulation(scene: Scene, device: str) -> Simulation:
    """The captured graph on ``device``."""
    return Simulation(scene, device=device, threads=1, resident=True)


# --- agreement --------------------------------------------------------------------------------------------------------


def contact(device: str | None) -> np.ndarray:
    """Path of two grains that hit each other obliquely, spinning; the CPU's own loop without a device. Shape (k, 12)."""
    scene = Scene.model_validate(
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
    sim = Simulation(scene, device="cpu", threads=1) if device is None else simulation(scene, device)
    path = []
    for _ in range(20):
        sim.step(20)
        p = sim.particles
        path.append(np.concatenate([p.velocity.ravel(), p.spin.ravel()]))
    return np.array(path)


def bed_scene(start: bench_speed.Start, nudge: int = 0) -> Scene:
    """A settled bed in a turning box; each twin with grains moved by 1e-12 m."""
    data = bench_speed.scene_of(start, "full", bench_speed.Settings()).model_dump(mode="json")
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
    start = bench_speed.own_bed(200 if small else 2000, folder, bench_speed.Settings(), 200 if small else 10_000)
    own, two, again = Simulation(bed_scene(start), device="cpu"), *(simulation(bed_scene(start), device) for _ in range(2))
    for sim in (own, two, again):
        sim.step(100 if small else 1000)
    error = np.abs(own.particles.position - two.particles.position).max() / start.state["r"].min()
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
        "twins_standardised": dict(zip(("height", "kinetic", "contacts"), difference.tolist(), strict=True)),
    }


# --- speed ------------------------------------------------------------------------------------------------------------


def speed(device: str, small: bool, folder: Path) -> dict:
    """``bench_speed`` over sizes, and mixed precision at the largest."""
    if small:
        return {"cpu": "device_share is tested by itself; bench_speed takes a graph only on a GPU"}
    out = {}
    for precision, sizes in (("double", (1000, 10_000, 100_000, 1_000_000)), ("mixed", (1_000_000,))):
        settings = bench_speed.Settings(device=device, precision=precision, warm=100, steps=1000)
        report = bench_speed.bench(grains=sizes, models=["full"], settings=settings, work=folder, console=QUIET)
        out[precision] = report["cases"]
    return out


def step(device: str, small: bool, folder: Path) -> dict:
    """Microseconds of a step by BODY."""
    start = bench_speed.own_bed(200 if small else 10_000, folder, bench_speed.Settings(), 20 if small else 10_000)
    steps, out = (20 if small else 2000), {}
    for body in (1, 2, 4, 8, 16):
        resident.BODY = body
        sim = simulation(bench_speed.scene_of(start, "full", bench_speed.Settings()), device)
        sim.step(steps)
        begin, lists, refreshes = time.perf_counter(), sim.lists.rebuilds, sim.lists.refreshes
        sim.step(steps)
        out[str(body)] = {
            "us": 1e6 * (time.perf_counter() - begin) / steps,
            "rebuilds": sim.lists.rebuilds - lists,
            "refreshes": sim.lists.refreshes - refreshes,
            "captures": sim.stepper.resident.captures,
        }
    return out


def hourglass(device: str, small: bool, folder: Path) -> dict:
    """Seconds of the paper's hourglass for half a turn at 30 rpm (1e6 steps of 1e-6 s), from a short stretch."""
    scene = load_scene(ROOT / "scenes" / ("hourglass.toml" if small else "hourglass_paper.toml"))
    sim = simulation(scene, device)
    steps = 20 if small else 2000
    sim.step(steps)
    begin = time.perf_counter()
    sim.step(steps)
    seconds = (time.perf_counter() - begin) / steps
    return {"grains": len(sim.state), "step_us": 1e6 * seconds, "half_turn_s": 1e6 * seconds, "stages_s": sim.seconds}


def large(device: str, small: bool, folder: Path) -> dict:
    """Ten million grains."""
    tile = bench_speed.own_bed(200 if small else bench_speed.TILE, folder, bench_speed.Settings(), 20 if small else 20_000)
    start = bench_speed.tiled(tile, 2 if small else 22, folder)
    where = wp.get_device(device)
    before = wp.get_mempool_used_mem_current(where) if where.is_cuda else 0
    sim = simulation(bench_speed.scene_of(start, "full", bench_speed.Settings()), device)
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
    if small or bench_speed.deme_peer.version() is None:
        return {"skipped": "deme is not installed, or this is a CPU"}
    settings = bench_speed.Settings(device=device, steps=1000, repeats=1)
    report = bench_speed.bench(grains=[20_000], models=["full"], settings=settings, peer="deme", work=folder, console=QUIET)
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
    *, device: str = "cuda:0", small: bool = False, parts: list[Part] = list(LIMITS), work: Path = Path("gpu_session"),  # noqa: B006
    out: Path = Path("gpu_session.json"),
) -> None:  # fmt: skip
    """Run all parts and write one JSON file.

    Args:
        device: The GPU; cpu for a trial.
        small: Tiny beds, for a trial.
        parts: Which parts, in this order.
        work: Folder that keeps beds.
        out: JSON file, written anew after each part.
    """
    if device not in (there := [d.alias for d in wp.get_devices()]):
        raise SystemExit(f"--device {device}: not on this machine; there is {', '.join(there)}")
    work.mkdir(parents=True, exist_ok=True)
    name = wp.get_device(device).name
    report = {"device": name, "machine": bench_speed.machine(), "commit": bench_speed.commit(), "warp": wp.config.version}
    for one in parts:
        begin = time.perf_counter()
        command = [sys.executable, __file__, "part", one, device, str(work.resolve()), *(["--small"] if small else [])]
        try:
            done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=LIMITS[one])
            report[one] = json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else {"failed": done.stderr[-3000:]}
        except subprocess.TimeoutExpired:
            report[one] = {"failed": f"longer than {LIMITS[one]:g} s"}
        report[one]["seconds"] = time.perf_counter() - begin
        out.write_text(json.dumps(report, indent=2) + "\n")
        print(one, json.dumps(report[one])[:300], flush=True)


if __name__ == "__main__":
    sys.exit(app())
