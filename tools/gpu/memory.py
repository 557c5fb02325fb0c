"""Device memory per grain, array by array: `python tools/gpu/memory.py [--grains 20000] [--device cuda:0]`.

A settled bed in a box is stepped as on a GPU (the captured graph; on a CPU too), its lists are made anew once more, and what is
held is listed by the name of the array. `peak` holds also what lives only while lists are made. Warp's own count of its
allocations gives live and peak sums, hash grids included, so that nothing can be left out of the table.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import warp as wp
from cyclopts import App
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from bench import states
from warpdem import Simulation

UNITS = {"B": 1, "KB": 1 << 10, "MB": 1 << 20, "GB": 1 << 30}


def arrays(sim: Simulation) -> dict[str, int]:
    """Bytes of each array that ``sim`` holds on its device, by its name, the largest first; views of others do not count."""
    found: dict[str, int] = {}
    seen: set[int] = set()

    def visit(thing: Any, name: str) -> None:
        if id(thing) in seen:
            return
        seen.add(id(thing))
        if isinstance(thing, wp.array):
            if thing.deleter is not None and thing.device == sim.device and thing.capacity:
                found[name] = found.get(name, 0) + thing.capacity
        elif hasattr(thing, "_cls"):  # a struct of Warp
            for key in thing._cls.vars:
                visit(getattr(thing, key), f"{name}.{key}")
        elif isinstance(thing, dict):
            for number, (key, value) in enumerate(thing.items()):
                visit(value, f"{name}.{key if isinstance(key, str) else number}")
        elif isinstance(thing, (list, tuple)):
            for number, value in enumerate(thing):
                visit(value, f"{name}.{number}")
        elif type(thing).__module__.startswith("warpdem."):
            attributes = getattr(thing, "__dict__", {})
            for key in sorted(attributes, key=lambda key: key.startswith("_")):  # public names first: an array has one
                visit(attributes[key], key if thing is sim else f"{name}.{key}")

    visit(sim, "")
    return dict(sorted(found.items(), key=lambda entry: -entry[1]))


def allocated(report: str, title: str, alias: str) -> int:
    """Bytes that Warp's report of its allocations gives for a device under ``title``.

    Raises:
        ValueError: the report has no such line.
    """
    line = re.search(rf"{title}:\n(?:    .*\n)*?    {re.escape(alias)} .*?([\d.]+) (B|KB|MB|GB)\b", report)
    if line is None:
        raise ValueError(f"no {title!r} of {alias} in Warp's report of allocations")
    return round(float(line[1]) * UNITS[line[2]])


def held(scene, device: str, steps: int) -> dict[str, Any]:
    """Bytes per grain by array, all that is live, and the peak, after ``steps`` steps and one more making of all lists."""
    with wp.ScopedMemoryTracker("simulation", print=False) as tracker:
        tracker.clear()
        sim = Simulation(scene, device=device, threads=1, resident=True)
        sim.step(steps)
        sim.lists.update(force_rebuild=True)
        texts: list[str] = []
        tracker.report_func = texts.append
        tracker.report(max_items=0)
    alias, n, by_name = sim.device.alias, len(sim.state), arrays(sim)
    return {
        "grains": n,
        "contacts_listed": sim.lists.contact_count / n,
        "bytes_per_grain": {
            "live": allocated(texts[0], "Live allocations", alias) / n,
            "peak": allocated(texts[0], "Peak usage", alias) / n,
            "named": sum(by_name.values()) / n,
            "by_plan": sim.plan.bytes_per_grain,
        },
        "arrays": {name: size / n for name, size in by_name.items()},
    }


def print_table(found: dict[str, Any], console: Console) -> None:
    """The arrays of at least 1 B per grain, and the sums."""
    table = Table(box=SIMPLE, title=f"{found['grains']} grains, {found['contacts_listed']:.2f} listed contacts per grain")
    table.add_column("array")
    table.add_column("B per grain", justify="right")
    for name, size in found["arrays"].items():
        if size >= 1.0:
            table.add_row(name, f"{size:.1f}")
    table.add_section()
    for name, size in found["bytes_per_grain"].items():
        table.add_row(name, f"{size:.1f}")
    console.print(table)


app = App(help=__doc__, version_flags=())


@app.default
def main(
    *, grains: int = 20_000, device: str = "cpu", precision: states.Precision = "double", steps: int = 50,
    settle: int = 20_000, work: Path = Path("bench"), out: Path | None = None,
) -> None:  # fmt: skip
    """Measure, print the table and write JSON.

    Args:
        grains: Number of grains.
        device: cpu, or a GPU such as cuda:0.
        precision: Of the contact law.
        steps: Steps before the lists are made once more.
        settle: Steps that the bed settles.
        work: Folder that keeps the bed.
        out: JSON file to write.
    """
    work.mkdir(parents=True, exist_ok=True)
    settings = states.Settings(precision=precision)
    start = states.bed(grains, work, settings, settle)
    found = held(states.scene_of(start, "full", settings), device, steps)
    print_table(found, Console(highlight=False, width=100))
    if out is not None:
        out.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(app())
