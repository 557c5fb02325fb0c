"""Speed of warpdem, alone or side by side with a peer: `python tools/bench/speed.py --help`; how to read it: README.md.

A case is a state (a settled bed, an hourglass in mid-discharge), a contact model and a number of threads. Each window
starts anew from the state with an empty contact history: a new Simulation, warm-up steps, then the timed steps. Windows
of warpdem and of the peer alternate. The time holds stepping, list rebuilds and walls; nothing is written.
"""
import json
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from statistics import median
from typing import Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
import warp as wp
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench import deme, liggghts, size_picture
from bench.states import MATERIAL, OWN_GLASS, Law, Model, Precision, Settings, Start, bed, given_bed, mid_discharge
from bench.window import OtherLoad, commit, machine, spread, window
from warpdem.core.threads import available_threads

Peer = Literal["liggghts", "deme"]
PEERS = {"liggghts": liggghts, "deme": deme}


# --- windows ---------------------------------------------------------------------------------------------------------


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
        return deme.run(start.state, start.width, MATERIAL, settings.step, settings.warm, settings.steps)
    text = liggghts.deck(
        peer_data(start, folder), MATERIAL, model, step=settings.step, skin=settings.skin, warm=settings.warm,
        steps=settings.steps, width=start.width, mesh=start.mesh,
    )  # fmt: skip
    return liggghts.run(text, folder, ranks, settings.steps)


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
    precision: Precision = "double",
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
    picture: Path | None = None,
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
        picture: PNG to write: time per grain and step of the beds against their size.
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
    if picture is not None:
        size_picture.draw(report, picture)
        console.print(f"wrote {picture}")


if __name__ == "__main__":
    sys.exit(app())
