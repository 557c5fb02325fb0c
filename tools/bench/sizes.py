"""Cost of a broad size distribution: `python tools/bench/sizes.py --help`; how to read it: README.md.

Beds of the same number of grains, one of nearly equal sizes and others whose largest grain is some times as large as the
smallest, all sizes with equal shares of the volume. Windows of the beds alternate, so that what else loads the machine
meets all alike; the least time of each bed counts.
"""

import json
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
from cyclopts import App, Parameter
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

import warpdem
from bench.states import Settings, Start, save_state, scene_of
from bench.window import OtherLoad, Window, spread, window
from warpdem.filling.fill_region import closed_region
from warpdem.filling.fill_request import Filling
from warpdem.filling.packing import pack

SMALLEST = 0.3e-3  # diameter of the smallest grains [m]
UNIFORM = 2.0  # ratio of the bed that the others are compared with: Table 2 of the paper, uniform by number
FRACTION, BROAD_FRACTION = 0.57, 0.70  # solid fraction at which a bed is filled; small grains find room between large ones [-]


@dataclass(frozen=True)
class Bed:
    """A bed to measure.

    Attributes:
        ratio: largest over smallest diameter [-].
        start: where its windows start.
        fill_seconds: time that filling took [s]; None when the bed was kept from another call.
    """

    ratio: float
    start: Start
    fill_seconds: float | None


def diameters(count: int, ratio: float, sizes: int) -> np.ndarray:
    """Diameters [m], shape (count,), in random order.

    Up to `UNIFORM` uniform by number, beyond ``sizes`` diameters a constant factor apart with equal shares of the volume
    (at least one grain of each).
    """
    generator = np.random.default_rng(1)
    if ratio <= UNIFORM:
        return generator.uniform(SMALLEST, ratio * SMALLEST, count)
    size = SMALLEST * ratio ** np.linspace(1.0, 0.0, sizes)
    share = size**-3 / (size**-3).sum()
    number = np.maximum(1, np.rint(count * share[:-1]).astype(int))
    return generator.permutation(np.repeat(size, [*number, count - number.sum()]))


def bed(count: int, ratio: float, sizes: int, folder: Path, settle: int) -> Bed:
    """A bed filled at random and settled for ``settle`` steps, or the one made before."""
    diameter = diameters(count, ratio, sizes)
    volume = np.pi / 6.0 * (diameter**3).sum()
    fraction = FRACTION if ratio <= UNIFORM else BROAD_FRACTION
    # grains pack more loosely beside walls, the large ones do
    width = (volume / fraction) ** (1.0 / 3.0) + 0.3 * float(np.average(diameter, weights=diameter**2))
    name = f"bed_{count}_ratio_{ratio:g}"
    start = Start(name, folder / f"{name}_{sizes}_{settle}.npz", width=width)
    seconds = None
    if not start.file.exists():
        box = closed_region(None, ((0.0,) * 3, (width,) * 3), "fill")
        [position], [took] = pack([Filling(box, 0.5 * diameter, np.random.default_rng(2), "fill")])
        seconds = took.seconds
        rest = np.zeros_like(position)
        raw = Start(name, folder / f"{name}_{sizes}_raw.npz", width=width)
        np.savez(raw.file, x=position, r=0.5 * diameter, v=rest, w=rest)
        sim = warpdem.Simulation(scene_of(raw, "full", Settings(skin="auto")), device="cpu")
        sim.step(settle)
        save_state(start.file, sim, L=width)
    return Bed(ratio, start, seconds)


def measured(bed: Bed, windows: list[Window], steps: int) -> dict:
    """What the windows of a bed gave; ``rebuild_ns`` is the time of a near list per grain [ns]."""
    grains = len(bed.start.state["r"])
    rebuilds, refreshes = (sum(getattr(w, name) for w in windows) for name in ("rebuilds", "refreshes"))
    spent = {stage: sum(w.shares[stage] * w.seconds for w in windows) for stage in windows[0].shares}
    return {
        "ratio": bed.ratio,
        "grains": grains,
        "fill_seconds": bed.fill_seconds,
        "ns_per_grain_step": spread([w.seconds for w in windows], grains, steps),
        "contacts_per_grain": windows[-1].contacts_per_grain,
        "rebuilds_per_1000_steps": 1e3 * rebuilds / steps / len(windows),
        "refreshes_per_1000_steps": 1e3 * refreshes / steps / len(windows),
        "rebuild_ns": 1e9 * spent["lists"] / rebuilds / grains if rebuilds else None,
        "refresh_ns": 1e9 * spent["refresh"] / refreshes / grains if refreshes else None,
        "shares": windows[-1].shares,
    }


def bench(
    grains: int, ratios: list[float], sizes: int, threads: int, settings: Settings, settle: int, work: Path
) -> dict:
    """Windows of all beds, alternating."""
    work.mkdir(parents=True, exist_ok=True)
    beds = [bed(grains, ratio, sizes, work, settle) for ratio in ratios]
    load = OtherLoad()
    windows: list[list[Window]] = [[] for _ in beds]
    for _ in range(settings.repeats):
        for one, found in zip(beds, windows, strict=True):
            found.append(window(one.start, "full", threads, settings))
    cases = [measured(one, found, settings.steps) for one, found in zip(beds, windows, strict=True)]
    first = cases[0]["ns_per_grain_step"]["min"]
    for case in cases:
        case["over_first"] = case["ns_per_grain_step"]["min"] / first
    return {"threads": threads, "sizes": sizes, "settings": asdict(settings), "other_load_cores": load.cores(), "cases": cases}


def print_report(report: dict, console: Console) -> None:
    """Print a table of the cases."""
    table = Table(
        "ratio", "fill [s]", "ns", "over first", "contacts", "rebuilds", "ns each", "refreshes", "ns each", box=SIMPLE,
        title=f"{report['cases'][0]['grains']} grains, {report['threads']} threads, "
        f"other load {report['other_load_cores']:.2f} cores",
    )  # fmt: skip
    for case in report["cases"]:
        numbers = [case["rebuilds_per_1000_steps"], case["rebuild_ns"], case["refreshes_per_1000_steps"], case["refresh_ns"]]
        table.add_row(
            f"{case['ratio']:g}",
            "kept" if case["fill_seconds"] is None else f"{case['fill_seconds']:.1f}",
            f"{case['ns_per_grain_step']['min']:.0f}",
            f"{case['over_first']:.2f}",
            f"{case['contacts_per_grain']:.2f}",
            *("-" if number is None else f"{number:.0f}" for number in numbers),
        )
    console.print(table)


app = App(help=__doc__, version_flags=(), default_parameter=Parameter(consume_multiple=True, negative=()))


@app.default
def main(
    *,
    grains: int = 20_000,
    ratios: list[float] = [UNIFORM, 10.0],  # noqa: B006
    sizes: int = 3,
    threads: int = 1,
    step: float = 1e-6,
    warm: int = 50,
    steps: int = 400,
    repeats: int = 5,
    settle: int = 20_000,
    work: Path = Path("bench"),
    out: Path = Path("bench_sizes.json"),
) -> None:
    """Measure, print a table and write JSON.

    Args:
        grains: Number of grains of each bed.
        ratios: Largest over smallest diameter of each bed; up to 2 uniform by number. The others are compared with the first.
        sizes: Number of diameters beyond a ratio of 2, a constant factor apart, with equal shares of the volume.
        threads: Threads.
        step: Time step [s].
        warm: Steps before each window.
        steps: Steps of each window.
        repeats: Windows of each bed; the least time counts.
        settle: Steps that a bed settles.
        work: Folder that keeps the beds.
        out: JSON file to write.
    """
    settings = Settings(step=step, skin="auto", warm=warm, steps=steps, repeats=repeats)
    report = bench(grains, ratios, sizes, threads, settings, settle, work)
    print_report(report, Console(highlight=False, width=None if sys.stdout.isatty() else 110))
    out.write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(app())
