"""What walls cost: analytic walls against their meshes, finer meshes against coarser ones, turning ones against resting ones.

    python tools/bench/walls.py [--launches N]

Times the three phases of a step (pairs, walls, motion) one by one: the least of many launches of one and the same instant, on
one thread, which other work on the machine hardly disturbs. Lists are not in these times; whole steps, lists included, are
timed over windows of 1000 that take turns.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # tools/

import numpy as np
import warp as wp
from scipy.spatial import cKDTree

from dev import meshes
from warpdem import Scene, Simulation, load_scene

SCENES = Path(__file__).resolve().parents[2] / "scenes"
AROUND, ALONG = 192, 24  # facets of a tessellated shape


def phases(sim: Simulation, launches: int, only: Sequence[str] = ("pairs", "walls", "motion")) -> dict[str, float]:
    """Least time of each phase of the present step [us]."""
    engine, loop, lists = sim.engine, sim.kernels.loop, sim.lists
    grains, contacts, rows = engine.structs.arguments()
    base, _ = engine.batch.row()
    b, last = engine.batch, len(sim.state)
    batches = lists.totals[0] // sim.plan.backend.lanes  # the arrays are longer
    shared = b.model, b.control, grains
    calls = {
        "pairs": (loop.pair_forces, [1, batches, base, 0, *shared, contacts, b.report]),
        "walls": (loop.wall_forces, [1, lists.row_count, base, 0, sim.step_number & 1, *shared, rows, b.report]),
        "motion": (loop.move, [last, base - 1, 0, *shared, rows, b.report, lists.share_that_holds]),
    }
    out = {}
    for name in only:
        kernel, inputs = calls[name]
        command = wp.launch(kernel, dim=1, inputs=inputs, device=sim.device, record_cmd=True)
        best = np.inf
        for _ in range(launches if name != "motion" else 300):  # the motion goes on with each launch
            begin = time.perf_counter()
            command.launch()
            best = min(best, time.perf_counter() - begin)
        out[name] = best * 1e6
    return out


def hourglass(mesh: Path, wall: dict, grains: dict | None) -> Simulation:
    """The hourglass scene in a resting frame with another mesh, filled or with ``grains`` as they lay."""
    data = load_scene(SCENES / "hourglass.toml").model_dump(mode="json")
    data["walls"][0] |= {"mesh": str(mesh), **wall}
    data |= {"frame": None, "grains": [grains] if grains else data["grains"]}
    return Simulation(Scene.model_validate(data), device="cpu", threads=1)


def hourglasses(launches: int, folder: Path) -> list[dict]:
    """A mesh of some 5 000 triangles at rest and turning (so slowly that the grains lie alike), and one of 90 000."""
    rows, grains, runs = [], None, []
    for fineness, wall, name in (
        (1.25, {}, "hourglass"),
        (1.25, {"motion": [{"axis": [0, 1, 0], "rate": 1e-9}]}, "hourglass, turning"),
        (5.7, {}, "hourglass, fine"),
    ):
        mesh = folder / f"hourglass{fineness}.stl"
        triangles = meshes.hourglass(**meshes.SMALL, segments=int(48 * fineness), rows=int(14 * fineness))
        meshes.write_stl(mesh, triangles)
        if grains is None:
            first = hourglass(mesh, wall, None)
            first.run(until=0.25)  # they lie by then
            grains = dict(material="grain", positions=first.particles.position, radii=first.particles.radius)
        sim = hourglass(mesh, wall, grains)
        sim.step(1000)
        listed = sim.view.contacts
        places = len(listed.point_slots(sim.step_number & 1, listed.wall_grains)[0])
        rows.append({"case": name, "triangles": len(triangles), "places": places, **phases(sim, launches)})
        runs.append(hourglass(mesh, wall, grains))
    for row, seconds in zip(rows, windows(runs), strict=True):
        row["step"] = seconds * 1e3
    return rows


def windows(runs: list[Simulation], count: int = 9) -> np.ndarray:
    """Median time of 1000 steps of each run [s], measured by turns."""
    for sim in runs:
        sim.step(500)
    times = np.zeros((count, len(runs)))
    for row in times:
        for k, sim in enumerate(runs):
            begin = time.perf_counter()
            sim.step(1000)
            row[k] = time.perf_counter() - begin
    return np.median(times, axis=0)


def tube(along: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Triangles of a surface of revolution about x through circles of ``radius`` at ``along`` [m]."""
    angle = np.arange(AROUND) * 2 * np.pi / AROUND
    points = np.stack(np.broadcast_arrays(along, radius * np.cos(angle)[:, None], radius * np.sin(angle)[:, None]), axis=-1)
    a, b, c, d = points[:, :-1], points[:, 1:], np.roll(points, -1, 0)[:, 1:], np.roll(points, -1, 0)[:, :-1]
    return np.concatenate([np.stack(t, axis=2).reshape(-1, 3, 3) for t in ((a, b, c), (a, c, d))])


def shapes() -> dict[str, tuple[dict, np.ndarray]]:
    """Each analytic wall with triangles on it."""
    long = np.linspace(-0.04, 0.04, ALONG + 1)
    up = np.linspace(0.01, 0.05, ALONG + 1)
    polar = np.linspace(0.15, np.pi - 0.15, ALONG * 4 + 1)
    floor = 0.05 * np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]], dtype=float)
    return {
        "plane": (dict(plane=dict(point=[0, 0, 0], normal=[0, 0, 1])), floor),
        "cylinder": (
            dict(cylinder=dict(point=[0, 0, 0], axis=[1, 0, 0], radius=0.02, inside=True)),
            tube(long, np.full(ALONG + 1, 0.02)),
        ),
        "cone": (
            dict(cone=dict(apex=[0, 0, 0], axis=[1, 0, 0], half_angle=float(np.arctan(0.7)), inside=True)),
            tube(up, 0.7 * up),
        ),
        "sphere": (
            dict(sphere=dict(centre=[0, 0, 0], radius=0.03, inside=True)),
            tube(-0.03 * np.cos(polar), 0.03 * np.sin(polar)),
        ),
    }


def resting(name: str, triangles: np.ndarray, radius: float) -> np.ndarray:
    """Centres of grains apart from each other that press on the surface by a thousandth of their radius."""
    rng = np.random.default_rng(0)
    k = rng.choice(len(triangles), 4000)
    x = (triangles[k] * rng.dirichlet([2, 2, 2], 4000)[:, :, None]).sum(axis=1)
    off = 0.999 * radius
    if name == "plane":
        x[:, 2] += off
    elif name == "sphere":
        x *= (0.03 - off) / np.linalg.norm(x, axis=1)[:, None]
    else:
        across = np.hypot(x[:, 1], x[:, 2])
        wanted = 0.02 - off if name == "cylinder" else 0.7 * x[:, 0] - off * np.hypot(1.0, 0.7)
        x[:, 1:] *= (wanted / across)[:, None]
    keep = np.ones(len(x), dtype=bool)
    for i, j in cKDTree(x).query_pairs(2.6 * radius):
        keep[j] &= not keep[i]
    inner = np.abs(x[:, 0]) < 0.038 if name == "cylinder" else x[:, 0] > 0.012 if name == "cone" else np.full(len(x), True)
    return x[keep & inner & (x[:, 0] < 0.048)]


def analytic(launches: int, folder: Path) -> list[dict]:
    """Time per touching place of each analytic wall and of its mesh."""
    rows, radius = [], 2e-4
    for name, (wall, triangles) in shapes().items():
        mesh = folder / f"{name}.stl"
        meshes.write_stl(mesh, triangles)
        grains = [dict(material="g", positions=resting(name, triangles, radius), radius=radius)]
        row = {"case": name, "triangles": len(triangles)}
        for kind, form in (("analytic", wall), ("mesh", dict(mesh=str(mesh), open=True))):
            sim = Simulation(Scene.model_validate(dict(
                gravity=[0, 0, 0], materials=dict(g=dict(density=2500.0, young_modulus=5e7, poisson_ratio=0.3)),
                contact=dict(rolling="none"), pairs=[dict(materials=["g", "g"], restitution=0.5, friction=0.5)],
                grains=grains, walls=[dict(name="wall", material="g", **form)],
                time=dict(end=1.0, step=1e-7, max_speed=0.1),
            )), device="cpu", threads=1)  # fmt: skip
            sim.step(3)
            places = int(sim.lists.wall_contacts.point_count.numpy()[sim.step_number & 1].sum())
            row[f"{kind}_places"], row[f"{kind}_ns"] = places, 1e3 * phases(sim, launches)["walls"] / places
        rows.append(row)
    return rows


def main() -> None:
    """Print both tables as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--launches", type=int, default=5000, help="launches of which the least counts")
    launches = parser.parse_args().launches
    with tempfile.TemporaryDirectory() as folder:
        found = {"analytic": analytic(launches, Path(folder)), "hourglass": hourglasses(launches, Path(folder))}
    json.dump(found, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
