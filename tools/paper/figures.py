"""Makes the figures of the paper again with warpdem: `python tools/paper/figures.py [--figure N ...] [--quick]`.

Delacroix et al. 2020, "Simulation of granular flow in a rotating frame of reference using the discrete element method",
Powder Technology 369, 146-161, doi:10.1016/j.powtec.2020.05.006.

    2        volume of phase space: determinant of one step of each integrator (eqs. 52, 92-94)
    3        energy of the harmonic oscillator
    4, 5, 8  order of each integrator: harmonic oscillator, damped oscillator, grain seen from a turning frame
    6, 7     that grain's path and energy by velocity Verlet and by Scovel's scheme, at four time steps
    9        grain on a turning disk, in both frames
    10, 12   hourglass at 30 rpm in both frames: pictures, mass below the neck against time
    11, 13   the same at 120 rpm
    15       run time in the turning frame over run time in the laboratory, against threads: on an idle machine only

Figures 1 and 14 show no results. Each figure becomes `figure_NN.png`, its numbers an entry of `figures.json` (those of other
figures stay); both in the folder of the scenes, `scenes/paper`, or in `--out`. What they say: scenes/README.md.
"""

import argparse
import importlib.metadata
import json
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

from paper import disk, hourglass, one_grain, threads
from paper.common import SCENES

Make = Callable[[argparse.Namespace, Callable[[int], Path]], dict[str, Any]]


def _hourglass(rpm: float, pictures: int, curves: int) -> Make:
    def make(options: argparse.Namespace, out: Callable[[int], Path]) -> dict[str, Any]:
        size = hourglass.Size(paper=options.device != "cpu", device=options.device, twins=options.twins)
        if options.quick:
            size = hourglass.Size(twins=2, count=200, settle=0.1, rest=0.3)
        return hourglass.make(rpm, size, out(pictures), out(curves))

    return make


def _orders(figure: int) -> Make:
    [problem] = [p for p in one_grain.PROBLEMS if p.figure == figure]
    return lambda options, out: one_grain.make_orders(problem, options.quick, out(figure))


def _threads(options: argparse.Namespace, out: Callable[[int], Path]) -> dict[str, Any]:
    short = threads.Windows(warm=20, steps=100, repeats=1, count=500, settle=0.1)
    return threads.make(short if options.quick else threads.Windows(), out(15))


MAKERS: dict[tuple[int, ...], Make] = {
    (2,): lambda options, out: one_grain.make_volumes(options.quick, out(2)),
    (3,): lambda options, out: one_grain.make_energy(options.quick, out(3)),
    (4,): _orders(4),
    (5,): _orders(5),
    (6,): lambda options, out: one_grain.make_paths("velocity_verlet", out(6)),
    (7,): lambda options, out: one_grain.make_paths("scovel", out(7)),
    (8,): _orders(8),
    (9,): lambda options, out: disk.make(options.quick, out(9)),
    (10, 12): _hourglass(30.0, 10, 12),
    (11, 13): _hourglass(120.0, 11, 13),
    (15,): _threads,
}
"""What makes which figures: figures made from the same runs are made together."""

FIGURES = sorted(number for numbers in MAKERS for number in numbers)


def rounded(value: Any) -> Any:
    """The value with 6 digits to each number, and None for what is not finite: JSON has no word for it."""
    if isinstance(value, dict):
        return {str(key): rounded(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(entry) for entry in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def record(path: Path, numbers: tuple[int, ...], found: dict[str, Any], quick: bool, seconds: float) -> None:
    """Put the numbers of some figures into the JSON file."""
    entries = json.loads(path.read_text()) if path.exists() else {}
    about = {name: importlib.metadata.version(name) for name in ("warpdem", "warp-lang")}
    entry = {"made_with": about, "quick": quick, "seconds": seconds, **found}
    entries[f"figure {', '.join(map(str, numbers))}"] = rounded(entry)
    ordered = dict(sorted(entries.items(), key=lambda entry: int(entry[0].split()[1].rstrip(","))))
    path.write_text(json.dumps(ordered, indent=1, allow_nan=False) + "\n")


def main(arguments: list[str] | None = None) -> None:
    """Make the figures asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--figure", type=int, nargs="+", choices=FIGURES, default=FIGURES, metavar="N", help="default: all"
    )
    parser.add_argument("--quick", action="store_true", help="fewer and shorter runs, to see that it works")
    parser.add_argument("--out", type=Path, default=SCENES, help="folder for pictures and figures.json")
    parser.add_argument("--device", default="cpu", help="cuda:0: the hourglass with the paper's 160 000 grains")
    parser.add_argument(
        "--twins", type=int, default=8, help="runs of each setting of the hourglass, default 8, at least 2"
    )
    options = parser.parse_args(arguments)
    if options.twins < 2:
        parser.error(f"--twins {options.twins}: at least 2 are needed to tell chance from difference")
    options.out.mkdir(parents=True, exist_ok=True)
    for numbers, make in MAKERS.items():
        if not set(numbers) & set(options.figure):
            continue
        begin = time.perf_counter()
        found = make(options, lambda number: options.out / f"figure_{number:02}.png")
        seconds = time.perf_counter() - begin
        record(options.out / "figures.json", numbers, found, options.quick, seconds)
        print(f"figure {', '.join(map(str, numbers))}: {seconds:.0f} s", flush=True)


if __name__ == "__main__":
    main()
