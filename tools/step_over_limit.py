"""Run settled beds with time steps up to and beyond the stability limit of their contacts, until they fail.

    python tools/step_over_limit.py [--out FOLDER]      step_over_limit.json and a table, to tests/results; some minutes

A bed of 400 grains (paper's Table 2: 0.3 to 0.6 mm, 50 MPa, friction 0.52, rolling friction 0.3; periodic across, floor
below) settles at a small step. The limit is the one that the guard measures there (``warpdem.guards.stability``). Then the
same state goes on for ``STEPS`` steps at each multiple of the limit, with guards that only record. Told of each run: mean
kinetic energy over m g d, deviation of the floor's load from the weight, largest overlap, and what the guards noticed first.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from warpdem import Scene, Simulation, StabilityError
from warpdem.guards import stability

MULTIPLES = (0.5, 0.9, 1.1, 1.3, 1.5, 1.7, 2.0, 2.5, 3.0)
CASES = ((0.05, 1.0), (0.1, 1.0), (0.3, 1.0), (0.5, 1.0), (0.7, 1.0), (0.9, 1.0), (0.3, 100.0), (0.9, 100.0))
"""Restitution, and gravity over that of the Earth."""
GRAINS, EDGE, G, DENSITY = 400, 4e-3, 9.81, 2653.0
STEPS, WINDOWS = 20_000, 20


def scene(restitution: float, gravity: float, step: float, **grains) -> Scene:
    """A bed in a domain that is periodic across; ``gravity`` over that of the Earth, ``grains`` or ``start`` as in a scene."""
    pair = {"materials": ["g", "g"], "restitution": restitution, "friction": 0.52, "rolling_friction": 0.3}
    floor = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    return Scene.model_validate({
        "gravity": [0, 0, -G * gravity],
        "materials": {"g": {"density": DENSITY, "young_modulus": 5e7, "poisson_ratio": 0.3}},
        "contact": {"rolling": "constant"},
        "pairs": [pair],
        "walls": [floor],
        "borders": {axis: {"min": 0.0, "max": EDGE, "kind": "periodic"} for axis in "xy"},
        **grains,
        "engine": {"guards": "record", "max_overlap": 0.5},
        "time": {"end": 10.0, "step": step, "max_speed": 0.02},
    })  # fmt: skip


def settled(restitution: float, gravity: float, folder: Path) -> tuple[Path, float]:
    """Checkpoint of a bed at rest, and the stability limit of its contacts [s]."""
    rng = np.random.default_rng(7)
    across = 6
    layers = np.arange(GRAINS) // across**2
    grid = np.stack([np.arange(GRAINS) % across, np.arange(GRAINS) // across % across, layers], axis=1)
    radius = rng.uniform(0.15e-3, 0.3e-3, GRAINS)
    position = (grid + np.array([0.5, 0.5, 0.6])) * EDGE / across + rng.uniform(-0.02e-3, 0.02e-3, (GRAINS, 3))
    step = 1e-6 if gravity < 10.0 else 5e-7
    grains = [{"material": "g", "positions": position.tolist(), "radii": radius.tolist()}]
    sim = Simulation(scene(0.1, gravity, step, grains=grains), device="cpu", threads=1)
    sim.run(0.4 if gravity < 10.0 else 0.05)
    path = folder / "rest.h5"
    sim.save_checkpoint(path)
    again = Simulation(scene(restitution, gravity, step, start={"checkpoint": str(path)}), device="cpu", threads=1)
    again.run(0.05 / np.sqrt(gravity))
    again.save_checkpoint(path)
    p = again.particles
    return path, stability.stable_step(stability.springs(again, again.contacts()), p.mass, p.inertia)[0]


def pushed(restitution: float, gravity: float, start: Path, step: float) -> dict:
    """What becomes of the bed in ``STEPS`` steps of ``step`` [s]."""
    sim = Simulation(scene(restitution, gravity, step, start={"checkpoint": str(start)}), device="cpu", threads=1)
    weight = sim.particles.mass.sum() * G * gravity
    kinetic, load, failed = [], [], None
    for _ in range(WINDOWS):
        try:
            sim.step(STEPS // WINDOWS)
        except StabilityError as error:
            failed = f"{error}"
            break
        energy, p = sim.energy(), sim.particles
        scale = float(np.sum(p.mass * 2.0 * p.radius) * G * gravity)
        kinetic.append((energy["kinetic"] + energy["rotational"]) / scale)
        load.append(abs(-sim.wall_loads()["floor"].force[2] / weight - 1.0))
        if kinetic[-1] > 1e3:
            break
    met = sim.extremes
    return {
        "kinetic": max(kinetic, default=np.inf), "kinetic_last": kinetic[-1] if kinetic else np.inf,
        "load": float(np.mean(load)) if load else np.inf, "steps": sim.step_number,
        "overlap": max(met["pair_overlap_share"], met["wall_overlap_share"]), "noticed": {**sim.noticed}, "failed": failed,
    }  # fmt: skip


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description="Push settled beds over the stability limit of their contacts.")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent.parent / "tests" / "results")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    found = []
    for restitution, gravity in CASES:
        with tempfile.TemporaryDirectory() as folder:
            start, limit = settled(restitution, gravity, Path(folder))
            print(f"\ne = {restitution}, {gravity:g} g: limit {limit:.3g} s", flush=True)
            print("| step / limit | kinetic energy / m g d | floor load off by | overlap | noticed |")
            print("| --- " * 5 + "|")
            for multiple in MULTIPLES:
                one = pushed(restitution, gravity, start, multiple * limit)
                found.append({"restitution": restitution, "gravity": gravity, "limit": limit, "multiple": multiple, **one})
                said = ", ".join(one["noticed"]) or "-"
                print(f"| {multiple:g} | {one['kinetic']:.1e} | {one['load']:.1e} | {one['overlap']:.3f} | {said}"
                      f"{', failed' if one['failed'] else ''} ({one['steps']} steps) |", flush=True)  # fmt: skip
    (options.out / "step_over_limit.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
