"""Milliseconds per frame that each output format takes.

    python tools/bench/output.py                      100 000 grains, the formats vtk, vtkhdf and usd
    python tools/bench/output.py --grains 20000 --formats vtk --contacts --orientation

Frames as a run gives them: grains at random places, everything but ids, materials, radii and masses new in each of them. A
format's time is the least of the frames after the first two, which also make the files, beside the least of processor time,
which other work on the machine hardly changes, and the median; megabytes are those of a frame.
"""

import argparse
import shutil
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from warpdem import Scene
from warpdem.core.pose import FramePose
from warpdem.core.snapshot import ContactNetwork, Snapshot
from warpdem.output.formats import writer_of

TOUCHING = 1.9  # contacts per grain of a settled bed


def network(rng: np.random.Generator, count: int) -> ContactNetwork:
    """Contacts at random places."""
    ends, forces = rng.random((2, count, 3)), rng.random((2, count, 3))
    i, wall = np.arange(count), np.full(count, -1, np.int32)
    numbers, sliding = rng.random((2, count)), np.zeros(count, np.int8)
    return ContactNetwork(i, i + 1, wall, *ends, forces[0], numbers[0], forces[1], numbers[1], sliding, forces[0])


def frames(count: int, grains: int, contacts: bool, orientation: bool) -> list[Snapshot]:
    """Snapshots in which everything moves."""
    rng = np.random.default_rng(0)
    same = {
        "id": np.arange(grains),
        "type": np.zeros(grains, np.int32),
        "group": np.zeros(grains, np.int32),
        "radius": rng.uniform(1e-3, 2e-3, grains),
        "mass": rng.random(grains),
    }
    return [
        Snapshot(
            step=1000 * k,
            time=0.01 * k,
            frame=FramePose.rotated(np.array([0.0, 1.0, 0.0]), np.zeros(3), 0.1 * k, 10.0),
            **{name: values.copy() for name, values in same.items()},
            **{name: rng.random((grains, 3)) for name in ("position", "velocity", "spin", "force")},
            orientation=rng.random((grains, 4)) if orientation else None,
            contacts=network(rng, int(TOUCHING * grains)) if contacts else None,
        )
        for k in range(count)
    ]


def scene(contacts: bool) -> Scene:
    """A scene that the writers take what they need from: a grain in the air."""
    return Scene.model_validate(
        {
            "materials": {"glass": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["glass", "glass"], "restitution": 0.5}],
            "grains": [{"material": "glass", "positions": [[0.0, 0.0, 0.0]], "radius": 1e-3}],
            "time": {"end": 1.0},
            "output": {"formats": ["vtk"], "contacts": contacts},
        }
    )


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--grains", type=int, default=100_000)
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--formats", nargs="+", default=["vtk", "vtkhdf", "usd"], choices=["vtk", "vtkhdf", "usd"])
    parser.add_argument("--contacts", action="store_true", help="with the contact network")
    parser.add_argument("--orientation", action="store_true", help="with the grains' orientation")
    parser.add_argument("--folder", type=Path, help="where to write, default a folder for temporary files")
    options = parser.parse_args()
    snapshots = frames(options.frames, options.grains, options.contacts, options.orientation)
    print(f"{options.grains} grains, {options.frames} frames")
    print(f"{'format':8} {'best ms':>8} {'CPU ms':>7} {'median ms':>10} {'MB a frame':>11}")
    for name in options.formats:
        folder = Path(tempfile.mkdtemp(dir=options.folder))
        try:
            writer = writer_of(name, folder, [], scene(options.contacts))
            seconds, busy = [], []
            for snapshot in snapshots:
                begin, start = time.perf_counter(), time.process_time()
                writer.write(snapshot)
                seconds.append(time.perf_counter() - begin)
                busy.append(time.process_time() - start)
            writer.close()
            size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / len(snapshots)
        finally:
            shutil.rmtree(folder)
        best, cpu, median = min(seconds[2:]), min(busy[2:]), statistics.median(seconds[2:])
        print(f"{name:8} {1e3 * best:8.1f} {1e3 * cpu:7.1f} {1e3 * median:10.1f} {size / 1e6:11.1f}")


if __name__ == "__main__":
    main()
