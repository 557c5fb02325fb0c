"""Speed of warpdem, alone or side by side with a peer: `python tools/bench_speed.py --help`; how to read it: README.md.

A case is a state (a settled bed, an hourglass in mid-discharge), a contact model and a number of threads. Each window
starts anew from the state with an empty contact history: a new Simulation, warm-up steps, then the timed steps. Windows
of warpdem and of the peer alternate. The time holds stepping, list rebuilds and walls; nothing is written.
"""

import functools
import json
import platform
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Literal

import deme_peer
import device_share
import liggghts
import numpy as np
import psutil
import warp as wp
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from warpdem.filling.packing import fill
from warpdem.scene.sizes import DiameterDistribution
from warpdem.threads import available_threads

ROOT = Path(__file__).resolve().parent.parent
DIAMETER = (0.3e-3, 0.6e-3)  # [m], uniform by number (Table 2 of the paper)
SIZES = DiameterDistribution(uniform=DIAMETER)
MEAN_VOLUME = np.pi / 6.0 * sum(DIAMETER) * (DIAMETER[0] ** 2 + DIAMETER[1] ** 2) / 4.0  # [m3]
BED_FRACTION = 0.57  # solid fraction at which a bed of one's own is filled [-]
TILE = 20_000  # grains [-]: larger beds are settled ones of this size side by side
OWN_GLASS = (5000, 0.45e-3, "hourglass.stl")  # grains [-], scale [m] and mesh of the hourglass made without --states

Model = Literal["full", "no_rolling", "frictionless"]
Law = Literal["mindlin", "mindlin_displacement"]
Peer = Literal["liggghts", "deme"]
PEERS = {"liggghts": liggghts, "deme": deme_peer}


@dataclass(frozen=True)
class Material:
    """Table 2 of the paper; grains and walls alike."""

    density: float = 2653.0
    young_modulus: float = 5.0e7
    poisson_ratio: float = 0.3
    restitution: float = 0.3
    friction: float = 0.52
    rolling_friction: float = 0.3


MATERIAL = Material()


@dataclass(frozen=True)
class Start:
    """A state that windows start from.

    Attributes:
        name: such as bed_20000.
        file: .npz with x, r, v, w.
        width: Width of the square box around a bed [m]; this or mesh.
        mesh: Closed mesh around the grains [m].
    """

    name: str
    file: Path
    width: float | None = None
    mesh: Path | None = None

    @functools.cached_property
    def state(self) -> dict[str, np.ndarray]:
        """Positions x, radii r, velocities v and spins w in SI units."""
        with np.load(self.file) as data:
            return {key: data[key] for key in ("x", "r", "v", "w")}


@dataclass(frozen=True)
class Settings:
    """What all windows share."""

    law: Law = "mindlin_displacement"
    step: float = 1e-6
    skin: float = 1e-4
    warm: int = 50
    steps: int = 400
    repeats: int = 3
    device: str = "cpu"
    precision: Literal["double", "mixed"] = "double"


# --- states ----------------------------------------------------------------------------------------------------------


def scene_of(start: Start, model: Model, settings: Settings) -> warpdem.Scene:
    """The scene of a case."""
    rolls, rubs = model == "full", model != "frictionless"
    if start.mesh is not None:
        walls = [{"name": "glass", "material": "grain", "mesh": str(start.mesh.resolve())}]
    else:
        w = start.width
        planes = [([0, 0, 0], [0, 0, 1]), ([0, 0, 0], [1, 0, 0]), ([w, 0, 0], [-1, 0, 0]), ([0, 0, 0], [0, 1, 0]),
                  ([0, w, 0], [0, -1, 0])]  # fmt: skip
        names = ["floor", "west", "east", "south", "north"]
        walls = [
            {"name": name, "material": "grain", "plane": {"point": point, "normal": normal}}
            for name, (point, normal) in zip(names, planes, strict=True)
        ]
    pair = {
        "materials": ["grain", "grain"],
        "restitution": MATERIAL.restitution,
        "friction": MATERIAL.friction if rubs else 0.0,
        "rolling_friction": MATERIAL.rolling_friction if rolls else 0.0,
    }
    stuff = {key: getattr(MATERIAL, key) for key in ("density", "young_modulus", "poisson_ratio")}
    return warpdem.Scene.model_validate(
        {
            "materials": {"grain": stuff},
            "contact": {"tangential": settings.law if rubs else "none", "rolling": "constant" if rolls else "none"},
            "pairs": [pair],
            "grains": [{"material": "grain", "file": str(start.file.resolve())}],
            "walls": walls,
            "time": {"end": 1.0, "step": settings.step},
            "engine": {"skin": settings.skin, "precision": settings.precision},
            "source": start.name,
        }
    )


def save_state(path: Path, sim: warpdem.Simulation, **more: float) -> None:
    """Write the present state of ``sim`` as .npz."""
    p = sim.particles
    np.savez(path, x=p.position, r=p.radius, v=p.velocity, w=p.spin, **more)


def own_bed(count: int, folder: Path, settings: Settings, settle: int) -> Start:
    """A bed filled at random and settled for ``settle`` steps, or the one made before."""
    # grains pack more loosely beside walls: as if each wall stood 0.15 mean diameters further in
    width = (count * MEAN_VOLUME / BED_FRACTION) ** (1.0 / 3.0) + 0.15 * sum(DIAMETER)
    start = Start(f"bed_{count}", folder / f"bed_{count}_{settle}.npz", width=width)
    if not start.file.exists():
        position, radius = fill(None, ((0.0,) * 3, (width,) * 3), SIZES, seed=1, count=count)
        rest = np.zeros_like(position)
        raw = Start(start.name, folder / f"bed_{count}_raw.npz", width=width)
        np.savez(raw.file, x=position, r=radius, v=rest, w=rest)
        sim = warpdem.Simulation(scene_of(raw, "full", settings), device="cpu")
        sim.step(settle)
        save_state(start.file, sim, L=width)
    return start


def tiled(start: Start, times: int, folder: Path) -> Start:
    """``times`` by ``times`` copies of a bed side by side: faces that touched a wall now touch each other."""
    width, count = start.width * times, len(start.state["r"]) * times**2
    out = Start(f"bed_{count}", folder / f"{start.file.stem}_x{times}.npz", width=width)
    if not out.file.exists():
        shift = np.array([[i * start.width, j * start.width, 0.0] for i in range(times) for j in range(times)])
        state = {key: np.concatenate([value] * times**2) for key, value in start.state.items()}
        state["x"] = state["x"] + np.repeat(shift, len(start.state["r"]), axis=0)
        np.savez(out.file, **state, L=width)
    return out


def bed(count: int, folder: Path, settings: Settings, settle: int) -> Start:
    """About ``count`` grains: a settled bed of one's own, or several of them."""
    times = 1 if count <= 2 * TILE else max(1, round((count / TILE) ** 0.5))
    start = own_bed(count if times == 1 else TILE, folder, settings, settle)
    return start if times == 1 else tiled(start, times, folder)


def given_bed(count: int, states: Path) -> Start:
    """A bed of the folder ``states``."""
    file = find(states, f"bed_{count}.npz")
    with np.load(file) as data:
        return Start(file.stem, file, width=float(data["L"]))


def mid_discharge(
    count: int, states: Path | None, mesh: str | None, folder: Path, settings: Settings, flow: float
) -> Start:
    """An hourglass ``flow`` seconds after it was turned over, from a settled one or from one filled at random."""
    import trimesh

    count = count if states is not None else OWN_GLASS[0]
    if states is None:
        file, scale = ROOT / "scenes" / "meshes" / OWN_GLASS[2], OWN_GLASS[1]
    elif mesh is None:
        raise SystemExit("--mesh: give the mesh of the glasses of --states, such as meshes/hourglass_{n}.stl")
    else:
        path = Path(mesh.replace("{n}", str(count)))
        file, scale = find(path.parent, path.name), 1.0
    # turned about y with its grains; ASCII, the only form that the peer reads
    shell = trimesh.load(file, force="mesh")
    turned = shell.vertices * scale * [-1.0, 1.0, -1.0]
    turned_mesh = folder / f"hourglass_{count}.stl"
    write_ascii_stl(turned_mesh, turned[shell.faces])
    start = Start(f"hourglass_{count}", folder / f"hourglass_{count}_{flow:g}.npz", mesh=turned_mesh)
    if not start.file.exists():
        if states is None:
            from warpdem.mesh.geometry import load_mesh

            upper = ((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))
            position, radius = fill(load_mesh(turned_mesh), upper, SIZES, seed=1, count=count)
            state = {"x": position, "r": radius, "v": np.zeros_like(position), "w": np.zeros_like(position)}
        else:
            state = Start("", find(states, f"glass_{count}.npz")).state
            turn = np.array([-1.0, 1.0, -1.0])
            state = {key: value if key == "r" else value * turn for key, value in state.items()}
        raw = Start(start.name, folder / f"hourglass_{count}_raw.npz", mesh=turned_mesh)
        np.savez(raw.file, **state)
        sim = warpdem.Simulation(scene_of(raw, "full", settings), device="cpu")
        sim.run(until=flow)
        save_state(start.file, sim)
    return start


def find(folder: Path, name: str) -> Path:
    """The file ``name`` in ``folder``; ends the program with a list of what is there if it is missing."""
    if not (folder / name).is_file():
        there = sorted(p.name for p in folder.glob(f"*{Path(name).suffix}"))
        raise SystemExit(f"{folder / name}: no such file; there: {', '.join(there) or 'none'}")
    return folder / name


def write_ascii_stl(path: Path, triangles: np.ndarray) -> None:
    """Write triangles (t, 3, 3) [m] as ASCII STL; the normals are left to the reader."""
    facets = ("".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in corners) for corners in triangles)
    body = "".join(f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n" for corners in facets)
    path.write_text(f"solid mesh\n{body}endsolid mesh\n")


# --- windows ---------------------------------------------------------------------------------------------------------


class OtherLoad:
    """Cores that other processes kept busy since this was made: a timing is clean near 0."""

    def __init__(self) -> None:
        self._from = self._now()

    @staticmethod
    def _now() -> tuple[float, float, float]:
        cpu = psutil.cpu_times()
        own = sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        return time.perf_counter(), cpu.user + cpu.nice + cpu.system, own

    def cores(self) -> float:
        """Busy cores that are not ours [-]."""
        wall, busy, own = (now - then for now, then in zip(self._now(), self._from, strict=True))
        return max(0.0, busy - own) / wall


@dataclass(frozen=True)
class Window:
    """What one window of warpdem gave."""

    seconds: float
    contacts_per_grain: float
    wall_contacts: int
    rebuilds: int
    refreshes: int
    shares: dict[str, float]
    """Share of the time by stage: steps, lists (near list rebuilt), refresh (contact list), schedule."""
    bytes_per_grain: int
    """Device memory by the plan [B]; on a GPU as measured, with what Warp keeps for later."""
    device: dict
    """Share of each launch on a GPU, and what it moves; empty on a CPU."""


def window(start: Start, model: Model, threads: int, settings: Settings) -> Window:
    """One window of warpdem.

    Raises:
        RuntimeError: the state is not finite at the end.
    """
    device = wp.get_device(settings.device)
    taken = wp.get_mempool_used_mem_current(device) if device.is_cuda else 0
    sim = warpdem.Simulation(scene_of(start, model, settings), device=settings.device, threads=threads)
    sim.step(settings.warm)
    before, rebuilds, refreshes = dict(sim.seconds), sim.lists.rebuilds, sim.lists.refreshes
    begin = time.perf_counter()
    sim.step(settings.steps)
    seconds = time.perf_counter() - begin
    stages = {
        key: sim.seconds.get(key, 0.0) - before.get(key, 0.0) for key in ("steps", "lists", "refresh", "schedule")
    }
    rebuilds, refreshes = sim.lists.rebuilds - rebuilds, sim.lists.refreshes - refreshes
    particles, contacts = sim.particles, sim.contacts()
    if not all(np.isfinite(a).all() for a in (particles.position, particles.velocity, particles.spin)):
        raise RuntimeError(f"{start.name}, {model}: the state is not finite after {sim.step_number} steps")
    with_wall = int((contacts.j < 0).sum())
    grains = len(start.state["r"])
    held = (wp.get_mempool_used_mem_current(device) - taken) // grains if device.is_cuda else sim.plan.bytes_per_grain
    on_device = device_share.measured(sim) if sim.plan.resident else {}
    sim.threads.close()
    return Window(
        seconds=seconds,
        contacts_per_grain=2.0 * (len(contacts.j) - with_wall) / len(start.state["r"]),
        wall_contacts=with_wall,
        rebuilds=rebuilds,
        refreshes=refreshes,
        shares={key: value / seconds for key, value in stages.items()},
        bytes_per_grain=int(held),
        device=on_device,
    )


def peer_data(start: Start, folder: Path) -> Path:
    """Where the peer finds the grains of ``start``."""
    return folder / f"{start.name}.data"


def write_peer_data(start: Start, folder: Path) -> None:
    """Write the peer's data file."""
    shell = None
    if start.mesh is not None:
        import trimesh

        shell = np.array(trimesh.load(start.mesh, force="mesh").bounds)
    domain = liggghts.domain_of(start.state, start.width, shell)
    liggghts.write_data(peer_data(start, folder), start.state, MATERIAL.density, domain)


def peer_window(peer: Peer, start: Start, model: Model, ranks: int, settings: Settings, folder: Path) -> liggghts.Window:
    """One window of the peer."""
    if peer == "deme":
        return deme_peer.run(start.state, start.width, MATERIAL, settings.step, settings.warm, settings.steps)
    text = liggghts.deck(
        peer_data(start, folder), MATERIAL, model, step=settings.step, skin=settings.skin, warm=settings.warm,
        steps=settings.steps, width=start.width, mesh=start.mesh,
    )  # fmt: skip
    return liggghts.run(text, folder, ranks, settings.steps)


def spread(seconds: Sequence[float], grains: int, steps: int) -> dict[str, float | list[float]]:
    """Median, least and all values of the time per grain and step [ns]."""
    values = [1e9 * s / grains / steps for s in seconds]
    return {"median": median(values), "min": min(values), "all": values}


def run_case(start: Start, model: Model, threads: int, settings: Settings, folder: Path, peer: Peer | None) -> dict:
    """All windows of one case, alternating."""
    grains, steps = len(start.state["r"]), settings.steps
    load, own, other = OtherLoad(), [], []
    for _ in range(settings.repeats):
        own.append(window(start, model, threads, settings))
        if peer:
            other.append(peer_window(peer, start, model, threads, settings, folder))
    result = {
        "state": start.name,
        "grains": grains,
        "model": model,
        "threads": threads,
        "ns_per_grain_step": spread([w.seconds for w in own], grains, steps),
        "contacts_per_grain": own[-1].contacts_per_grain,
        "wall_contacts": own[-1].wall_contacts,
        "rebuilds": own[-1].rebuilds,
        "refreshes": own[-1].refreshes,
        "shares": {key: median(w.shares[key] for w in own) for key in own[-1].shares},
    }
    result["rebuild_share"] = result["shares"]["lists"] + result["shares"]["refresh"]
    result |= {"bytes_per_grain": own[-1].bytes_per_grain} | ({"device": own[-1].device} if own[-1].device else {})
    if peer:
        result["peer"] = {
            "ns_per_grain_step": spread([w.seconds for w in other], grains, steps),
            "contacts_per_grain": other[-1].contacts_per_grain,
            "rebuilds": other[-1].rebuilds,
            "pair_share": median(w.pair_share for w in other),
            "rebuild_share": median(w.neighbour_share for w in other),
            "grains_lost": grains - other[-1].grains,
        }
        result["ratio"] = result["peer"]["ns_per_grain_step"]["median"] / result["ns_per_grain_step"]["median"]
    result["other_load_cores"] = load.cores()
    return result


# --- report ----------------------------------------------------------------------------------------------------------


def machine() -> dict[str, str | int]:
    """Processor and cores."""
    info = Path("/proc/cpuinfo")
    names = (
        [line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line]
        if info.exists()
        else []
    )
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": available_threads(),
        "system": platform.platform(),
    }


def commit() -> str | None:
    """Commit of the working tree, with "+" when files differ from it; None outside a repository."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], check=False, capture_output=True, text=True)
        return done.stdout.strip()

    if shutil.which("git") is None or not (head := git("rev-parse", "HEAD")):
        return None
    return head + ("+" if git("status", "--porcelain", "--untracked-files=no") else "")


def comparisons(results: list[dict]) -> dict[str, list[dict]]:
    """Speed-up by threads, and the time of each model over the frictionless one, from the medians."""
    ns = {(r["state"], r["model"], r["threads"]): r["ns_per_grain_step"]["median"] for r in results}
    scaling = [
        {"state": s, "model": m, "threads": t, "speed_up": ns[s, m, 1] / v}
        for (s, m, t), v in ns.items()
        if t > 1 and (s, m, 1) in ns
    ]
    models = [
        {"state": s, "model": m, "threads": t, "over_frictionless": v / ns[s, "frictionless", t]}
        for (s, m, t), v in ns.items()
        if m != "frictionless" and (s, "frictionless", t) in ns
    ]
    return {"scaling": scaling, "models": models}


def bench(
    *,
    states: Path | None = None,
    mesh: str | None = None,
    cases: Sequence[Literal["bed", "hourglass"]] = ("bed",),
    grains: Sequence[int] = (20_000, 160_000),
    models: Sequence[Model] = ("full", "no_rolling", "frictionless"),
    threads: Sequence[int] = (),
    settings: Settings | None = None,
    peer: Peer | None = None,
    work: Path | None = None,
    settle: int = 20_000,
    flow: float = 0.12,
    console: Console | None = None,
) -> dict:
    """Run the cases and return what the JSON file holds.

    Args:
        states: Folder of states bed_N.npz (x, r, v, w, L) and glass_N.npz; states are made if not given.
        mesh: Mesh of glass_N.npz in metres; {n} stands for the number of grains.
        cases: Settled bed, or hourglass in mid-discharge.
        grains: Numbers of grains.
        models: Contact models.
        threads: Threads, and ranks of the peer; 1 and all if not given, 1 on a GPU.
        settings: What all windows share.
        peer: Simulator to run beside; gone without, with a word, if it is not installed.
        work: Folder that keeps states and decks; a temporary one if not given.
        settle: Steps that a bed made here settles.
        flow: Simulated time from turning the hourglass over to the windows [s].
        console: Where progress and table go.
    """
    settings, console = settings or Settings(), console or Console(highlight=False)
    if min(settings.warm, settings.steps, settings.repeats) < 1:
        raise SystemExit("warm, steps and repeats: at least 1 each (the first step compiles)")
    if settings.device not in (there := [device.alias for device in wp.get_devices()]):
        raise SystemExit(f"--device {settings.device}: not on this machine; there is {', '.join(there)}")
    on_gpu = wp.get_device(settings.device).is_cuda
    counts = (1,) if on_gpu else tuple(threads) or tuple(sorted({1, available_threads()}))
    if peer == "deme" and not (on_gpu and set(cases) == {"bed"} and set(models) == {"full"}):
        raise SystemExit("--peer deme: a GPU code, for --device cuda:0 --cases bed --models full")
    peer_version = PEERS[peer].version() if peer else None
    if peer and peer_version is None:
        console.print(f"{peer} is not installed: going on without it")
    results = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(work or temporary).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        for case in cases:
            for count in dict.fromkeys(grains if case == "bed" or states else (OWN_GLASS[0],)):
                console.print(f"{case} of {count} grains: state")
                if case == "hourglass":
                    start = mid_discharge(count, states, mesh, folder, settings, flow)
                else:
                    start = given_bed(count, states) if states else bed(count, folder, settings, settle)
                if peer_version is not None and peer == "liggghts":
                    write_peer_data(start, folder)
                for model in models:
                    for n in counts:
                        results.append(run_case(start, model, n, settings, folder, peer if peer_version is not None else None))
                        console.print(f"{start.name} {model} on {n}: {line(results[-1])}")
    return {
        "machine": machine(),
        "versions": {"warpdem": warpdem.__version__, "warp": wp.config.version, "python": platform.python_version(),
                     "numpy": np.__version__, "peer": f"{peer} {peer_version}" if peer_version else None},
        "commit": commit(),
        "time": time.strftime("%Y-%m-%d %H:%M:%S"),
        "settings": {**asdict(settings), "states": "given" if states else "made here", "settle": settle, "flow": flow},
        "cases": results,
        **comparisons(results),
    }  # fmt: skip


def line(result: dict) -> str:
    """One case in a line."""
    text = f"{result['ns_per_grain_step']['median']:.1f} ns per grain and step"
    if "ratio" in result:
        text += f", peer {result['peer']['ns_per_grain_step']['median']:.1f}, ratio {result['ratio']:.2f}"
    return text


def print_report(report: dict, console: Console) -> None:
    """The report as tables."""
    with_peer = any("ratio" in r for r in report["cases"])
    s = report["settings"]
    table = Table(
        box=SIMPLE,
        title=f"ns per grain and step, median of {s['repeats']} windows of {s['steps']} steps",
        title_justify="left",
    )
    columns = ["state", "model", "threads", "warpdem", "lists", "contacts", "load"]
    columns[4:4] = ["peer", "ratio"] if with_peer else []
    for name in columns:
        table.add_column(name, justify="left" if name in ("state", "model") else "right", no_wrap=True)

    def time_of(part: dict) -> str:
        return f"{part['ns_per_grain_step']['median']:.1f}"

    for r in report["cases"]:
        row = [r["state"], r["model"], str(r["threads"]), time_of(r)]
        contacts = f"{r['contacts_per_grain']:.3f}"
        if with_peer:
            row += [time_of(r["peer"]), f"{r['ratio']:.2f}"]
            contacts += f" / {r['peer']['contacts_per_grain']:.3f}"
        table.add_row(*row, f"{r['rebuild_share']:.1%}", contacts, f"{r['other_load_cores']:.2f}")
    console.print(table)
    for r in report["scaling"]:
        console.print(f"{r['state']} {r['model']}: {r['threads']} threads are {r['speed_up']:.2f} times as fast as 1")
    for r in report["models"]:
        over = r["over_frictionless"]
        console.print(f"{r['state']} on {r['threads']}: {r['model']} takes {over:.2f} times the time of frictionless")


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    states: Path | None = None,
    mesh: str | None = None,
    cases: list[Literal["bed", "hourglass"]] = ["bed"],  # noqa: B006
    grains: list[int] = [20_000, 160_000],  # noqa: B006
    models: list[Model] = ["full", "no_rolling", "frictionless"],  # noqa: B006
    threads: list[int] = [],  # noqa: B006
    device: str = "cpu",
    precision: Literal["double", "mixed"] = "double",
    law: Law = "mindlin_displacement",
    step: float = 1e-6,
    skin: float = 1e-4,
    warm: int = 50,
    steps: int = 400,
    repeats: int = 3,
    peer: Peer | None = None,
    work: Path | None = None,
    settle: int = 20_000,
    flow: float = 0.12,
    out: Path = Path("bench_speed.json"),
) -> None:
    """Measure, print a table and write JSON.

    Args:
        states: Folder of states bed_N.npz (x, r, v, w, L) and glass_N.npz; states are made if not given.
        mesh: Mesh of glass_N.npz in metres; {n} stands for the number of grains.
        cases: Settled bed, or hourglass in mid-discharge.
        grains: Numbers of grains.
        models: Contact models.
        threads: Threads, and ranks of the peer; 1 and all if not given, 1 on a GPU.
        device: cpu, or a GPU such as cuda:0; then with the share of each launch and the bytes it moves over those of a copy.
        precision: Of the contact law.
        law: Tangential law of warpdem; the peer has mindlin_displacement.
        step: Time step [s].
        skin: Skin of the neighbour lists of both [m].
        warm: Steps before each window.
        steps: Steps of each window; short ones keep the contacts of a frictionless bed.
        repeats: Windows of each code per case.
        peer: Simulator to run beside.
        work: Folder that keeps states and decks; a temporary one if not given.
        settle: Steps that a bed made here settles.
        flow: Simulated time from turning the hourglass over to the windows [s].
        out: JSON file to write.
    """
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=110)  # into a file or a pipe: room for all columns
    settings = Settings(law, step, skin, warm, steps, repeats, device, precision)
    report = bench(
        states=states, mesh=mesh, cases=cases, grains=grains, models=models, threads=threads, settings=settings,
        peer=peer, work=work, settle=settle, flow=flow, console=console,
    )  # fmt: skip
    print_report(report, console)
    out.write_text(json.dumps(report, indent=2) + "\n")
    console.print(f"wrote {out}")


if __name__ == "__main__":
    sys.exit(app())
