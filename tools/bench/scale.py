"""A bed over ranks, measured here, and what follows from that for more of them: `python tools/bench/scale.py --help`.

Measured, on one machine: share of ghosts and of contacts that two ranks evaluate, bytes and time of an exchange, memory,
time of a row of the history, of a look of the guards, and of gathering all grains.
The time of an exchange is that of many in a row while no rank does anything else: no waiting for slower ranks is in it.

What it prints as a projection is arithmetic with these numbers and with a network that was not measured.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from warpdem.kernels import grain

import warpdem
from bench.readings import resident_bytes
from bench.states import DIAMETER, Settings, Start, bed, given_bed, scene_of
from bench.window import OtherLoad, commit, machine
from warpdem.measure.column import Readings
from warpdem.output.history import history_columns, history_row
from warpdem.ranks import launcher
from warpdem.ranks.follower import serve
from warpdem.ranks.front import Front, leading
from warpdem.ranks.rank import Rank

app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))
DENSITY = 10.75e9  # grains of the bed per volume [1/m3]
CLUSTERS = (
    # name, ranks, grains, cores of a rank, network of a rank [B/s]
    ("16 nodes of 64 cores, a rank per 16", 64, 1.6e7, 16, 6.25e9),
    ("100 nodes of 64 cores, a rank per 16", 400, 1e8, 16, 6.25e9),
    ("100 nodes of 64 cores, a rank per core", 6400, 1e8, 1, 0.39e9),
)
"""Nodes of 25 GB/s. Nothing of this was measured."""
TIMED = ("row", "look", "gather")
"""What is timed besides exchanges."""
HOP = 1.5e-6  # latency of a message, and of each of the stages of an Allreduce [s]; not measured


def looked(rank: Rank, repeats: int) -> list[dict[str, Any]]:
    """What each rank holds, and what an exchange takes; a method of ``Rank`` that all ranks call together."""
    exchange, state, world, last = rank.exchange, rank.state, rank.world, rank.engine.batch.stages - 1
    calls, flags = [], []
    one, out = np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32)
    def exchanged() -> None:
        exchange.call(1, last, 0)
        exchange.finish()

    for times, job in ((calls, exchanged), (flags, lambda: world.comm.Allreduce(one, out))):
        for _ in range(repeats):
            begin = time.perf_counter()
            job()
            times.append(time.perf_counter() - begin)
    contacts = rank.lists.view()
    pairs = shared = 0
    if state.slots and contacts.contact_count:
        lane = contacts.real_lanes()
        owner, partner = (side.numpy().ravel()[lane] for side in (contacts.owner, contacts.partner))
        pairs, shared = len(lane), int(((owner >= state.owned) | (partner >= state.owned)).sum())
    found: list[dict[str, Any]] = world.gathered({
        "inside": rank.share_inside,
        "grains": state.owned, "ghosts": state.ghosts, "pairs": pairs, "shared_pairs": shared,
        "bytes": exchange.bytes_per_call, "call": median(calls), "least_call": min(calls), "least_flag": min(flags),
        "memory": resident_bytes(), "peak": resident_bytes(peak=True),
    })  # fmt: skip
    return found


def after_a_step(sim: warpdem.Simulation, job: Callable[[], object], repeats: int = 5) -> float:
    """Least wall time of a job [s], each time after a step, as what it reads is kept until then."""
    times = []
    for _ in range(repeats):
        sim.step(1)
        sim.evaluate()
        begin = time.perf_counter()
        job()
        times.append(time.perf_counter() - begin)
    return min(times)


def width() -> int:
    """Size of what is sent of a grain [B]."""
    return 8 * grain.WIDTH[True]


@app.command(name="window", show=False)
def window(state: Path, side: float, steps: int, repeats: int, out: Path) -> None:
    """One rank of a measurement: started by MPI; rank 0 writes JSON to ``out``."""
    setattr(Rank, looked.__name__, looked)
    world = launcher.join()
    if world is not None and world.rank:
        sys.exit(serve(world))
    with leading(world):
        scene = scene_of(Start(state.stem, state, width=side), "full", Settings())
        sim = warpdem.Simulation(scene, device="cpu", threads=1, world=world)
        sim.step(Settings().warm)
        used = time.process_time()
        sim.step(steps)
        found: dict[str, Any] = {"processor": time.process_time() - used, "skin": sim.lists.skin}
        if isinstance(sim.loop, Front):
            found |= {"ranks": sim.loop.on_all(looked.__name__, repeats), "report": sim.loop.report()}
        else:
            found |= {"memory": resident_bytes(), "peak": resident_bytes(peak=True)}
        columns = history_columns(sim.scene)  # last: gathering takes memory
        jobs = {"row": lambda: history_row(columns, Readings(sim.evaluated)), "look": sim.guards.judge, "gather": sim.prepare}
        found |= {name: after_a_step(sim, job) for name, job in jobs.items()}
        out.write_text(json.dumps(found))


def run(start: Start, ranks: int, steps: int, repeats: int, folder: Path) -> dict[str, Any]:
    """A measurement in processes of its own, over ``ranks`` if that is above 1."""
    begin, environment = launcher.command(ranks) if ranks > 1 else ([], dict(os.environ))
    out = folder / f"scale_{start.name}_{ranks}.json"
    given = [str(start.file), repr(start.width), str(steps), str(repeats), str(out)]
    load = OtherLoad()
    subprocess.run([*begin, sys.executable, str(Path(__file__)), "window", *given], env=environment, check=True)
    return {"grains": len(start.state["r"]), "size": ranks, "other_load": load.cores(), **json.loads(out.read_text())}


def shown(one: dict[str, Any]) -> list[str]:
    """A line of the table of what was measured over several ranks."""
    each, n = one["ranks"], one["grains"]
    ghosts, shared, pairs = (sum(rank[name] for rank in each) for name in ("ghosts", "shared_pairs", "pairs"))
    first, others = each[0]["memory"] / n, max(rank["memory"] for rank in each[1:]) * len(each) / n
    return [
        f"{n}", f"{len(each)}", f"{ghosts / n:.1%}", f"{0.5 * shared / max(pairs - 0.5 * shared, 1):.1%}",
        f"{min(rank['inside'] for rank in each):.0%}", f"{max(rank['bytes'] for rank in each) / 1e3:.0f}",
        f"{1e6 * max(rank['call'] for rank in each):.0f}",
        f"{1e6 * max(rank['least_call'] for rank in each):.0f}", f"{1e6 * max(rank['least_flag'] for rank in each):.1f}",
        f"{first:.0f}", f"{others:.0f}", *(f"{1e3 * one[name]:.1f}" for name in TIMED),
    ]  # fmt: skip


def ghosts_of_a_cube(grains: float, halo: float) -> float:
    """Ghosts of a cube of a large bed, in a layer of thickness ``halo`` [m] all around."""
    side = (grains / DENSITY) ** (1.0 / 3.0)
    return DENSITY * ((side + 2.0 * halo) ** 3 - side**3)


def projection(step: float, halo: float, per_byte: float) -> list[list[str]]:
    """Lines of the projection.

    Args:
        step: processor time per grain and step [s].
        halo: thickness of the layer of ghosts [m].
        per_byte: of an exchange in memory, copies included [s/B].
    """
    lines = []
    for name, ranks, grains, cores, network in CLUSTERS:
        own = grains / ranks
        ghosts = ghosts_of_a_cube(own, halo)
        sent = width() * ghosts
        work = step * own / cores
        double = 0.5 * ghosts / own * 0.5 * work  # every second contact of a ghost, and pairs are half of the work
        moved = sent * max(per_byte, 1.0 / network) + 6.0 * HOP
        flag = 2.0 * HOP * np.log2(ranks)
        whole = work + double + moved + flag
        # only forces without ghosts go on meanwhile: half of the work, less 1.2 ghosts per grain (76 to 98 % measured)
        hidden = min(moved, 0.5 * max(1.0 - 1.2 * ghosts / own, 0.0) * work)
        lines.append([
            name, f"{own:.3g}", f"{ghosts / own:.0%}", f"{sent / 1e6:.2f}", f"{1e3 * work:.3g}",
            f"{1e3 * (double + moved):.2g}", f"{1e3 * flag:.2g}", f"{1e3 * whole:.3g}", f"{work / whole:.0%}",
            f"{work / (whole - hidden):.0%}",
        ])  # fmt: skip
    return lines


def table(title: str, columns: Sequence[str], lines: Sequence[Sequence[str]]) -> Table:
    """A table with numbers to the right."""
    out = Table(*columns, box=SIMPLE, title=title, title_justify="left")
    for column in out.columns:
        column.justify = "right"
    for line in lines:
        out.add_row(*line)
    return out


@app.default
def main(
    *,
    states: Path | None = None,
    grains: Sequence[int] = (20_000,),
    ranks: Sequence[int] = (2, 4),
    steps: int = 100,
    repeats: int = 300,
    settle: int = 20_000,
    work: Path = Path("bench_scale"),
    out: Path = Path("bench_scale.json"),
) -> None:
    """Measure, print tables and a projection, and write JSON.

    ``inside``: contact batches without ghosts, which are evaluated while those are under way. The projection takes the exchange
    of the fewest ranks: the others share cores if there are fewer of these.

    Args:
        states: Folder of states bed_N.npz; states are made if not given.
        grains: Numbers of grains; above 40 000 a bed is settled ones side by side, 1 000 000 are 980 000.
        ranks: Numbers of ranks.
        steps: Steps before the looks.
        repeats: Exchanges in a row, of which the median and the least count.
        settle: Steps that a bed made here settles.
        work: Folder for states.
        out: JSON file to write.
    """
    console, results = Console(highlight=False, width=150), []
    work.mkdir(parents=True, exist_ok=True)
    for count in grains:
        start = given_bed(count, states) if states else bed(count, work, Settings(), settle)
        results.append(run(start, 1, steps, repeats, work))
        for many in ranks:
            results.append(run(start, many, steps, repeats, work))
    alone, shared = ([one for one in results if ("ranks" in one) == several] for several in (False, True))
    out.write_text(json.dumps({"machine": machine(), "commit": commit(), "results": results}, indent=1))
    console.print(table(
        "one process: processor time per grain and step (ns), memory per grain (B)",
        ("grains", "step", "memory", "peak", *(f"{name} ms" for name in TIMED)),
        [[f"{one['grains']}", f"{1e9 * one['processor'] / steps / one['grains']:.0f}", f"{one['memory'] / one['grains']:.0f}",
          f"{one['peak'] / one['grains']:.0f}", *(f"{1e3 * one[name]:.1f}" for name in TIMED)] for one in alone],
    ))  # fmt: skip
    console.print(table(
        "several ranks, measured on this machine; memory per grain of the whole run (B): of rank 0, of a part like the others",
        ("grains", "ranks", "ghosts", "double", "inside", "kB sent", "exchange us", "least us", "flag us", "rank 0", "others",
         *(f"{name} ms" for name in TIMED)),
        [shown(one) for one in shared],
    ))  # fmt: skip
    one = alone[-1]
    last = min((many for many in shared if many["grains"] == one["grains"]), key=lambda many: int(many["size"]))
    busiest = max(last["ranks"], key=lambda rank: rank["bytes"])
    per_byte = max(busiest["least_call"] - busiest["least_flag"], 0.0) / max(busiest["bytes"], 1)
    step, halo = one["processor"] / steps / one["grains"], 0.5 * (np.mean(DIAMETER) + DIAMETER[1]) + last["skin"]
    console.print(table(
        f"PROJECTION, not measured; from {last['size']} ranks: {1e9 * step:.0f} ns per grain and step on a core, "
        f"ghosts within {1e3 * halo:.2f} mm, {1e9 * per_byte:.3g} ns a byte, messages of {1e6 * HOP:g} us, all ranks alike",
        ("cluster", "grains a rank", "ghosts", "MB sent", "work ms", "exchange ms", "flag ms", "step ms", "one by one",
         "overlapped"),
        projection(step, float(halo), per_byte),
    ))  # fmt: skip


if __name__ == "__main__":
    app()
