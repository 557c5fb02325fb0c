"""Figure 9 of the paper: a grain on a turning disk, in the frame of the disk and in the laboratory."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

import warpdem
from paper.common import SCENES, SCHEMES, in_laboratory, save, scene_of, seen_every, tables

RATE, RADIUS = 20.0, 2e-3  # as in scenes/paper/disk.toml [rad/s], [m]
CASES: dict[str, dict[str, Any]] = {
    "rolling": {},
    "sliding": {"friction": 0.02, "velocities": [[0.0, 0.0, 0.0]], "spins": [[0.0, 0.0, 0.0]]},
    "spinning with the disk": {"velocities": [[0.0, 1.0, 0.0]], "spins": [[0.0, 0.0, RATE]]},
}
"""What differs from the scene: friction [-], velocity [m/s] and spin [rad/s] in the laboratory."""
STEPS = (2e-5, 1e-5, 5e-6)  # [s]
SHOWN = ("exact_drift", "velocity_verlet")  # warpdem's own scheme, and the paper's


def simulation(case: str, scheme: str, step: float, laboratory: bool) -> warpdem.Simulation:
    """One run at its start."""
    scene = tables(SCENES / "disk.toml")
    changes = dict(CASES[case])
    scene["pairs"][0]["friction"] = changes.pop("friction", scene["pairs"][0]["friction"])
    scene["grains"][0] |= changes
    scene["time"]["step"] = step
    scene["engine"] |= {"integrator": scheme}
    if laboratory:
        scene = in_laboratory(scene)
    return warpdem.Simulation(scene_of(scene, SCENES, "disk.toml"), device="cpu", threads=1)


def path(case: str, scheme: str, step: float, laboratory: bool, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and places in the laboratory [m], shape (k, 3)."""
    sim = simulation(case, scheme, step, laboratory)
    time, places = [], []
    for number in seen_every(sim, 200, end):
        sim.step(number - sim.step_number)
        time.append(sim.time)
        places.append(sim.particles.position_lab[0])
    return np.array(time), np.array(places)


def in_frame(time: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Places seen from the frame: turned by -``RATE`` t about z."""
    c, s = np.cos(RATE * time), np.sin(RATE * time)
    x, y, z = places.T
    return np.stack([c * x + s * y, c * y - s * x, z], axis=1)


def make(quick: bool, out: Path) -> dict[str, Any]:
    """Run all cases, draw paths and differences, and return the largest differences over the grain's radius."""
    end, steps = (0.1, STEPS[:2]) if quick else (1.0, STEPS)
    figure, grid = plt.subplots(3, 3, figsize=(11, 10), layout="constrained")
    numbers: dict[str, Any] = {
        "frame_rate_rad_s": RATE,
        "grain_radius_m": RADIUS,
        "end_s": end,
        "difference_over_radius": {},
    }
    for row, case in zip(grid, CASES, strict=True):
        rows = numbers["difference_over_radius"][case] = {}
        for colour, scheme in zip(("C0", "C3"), SHOWN, strict=True):
            rows[scheme] = {}
            for line, step in zip(("-", "--", ":"), steps, strict=False):
                time, there = path(case, scheme, step, True, end)
                _, here = path(case, scheme, step, False, end)
                off = np.linalg.norm(here - there, axis=1) / RADIUS
                rows[scheme][f"{step:g}"] = float(off.max())
                row[2].semilogy(time[1:], np.maximum(off[1:], 1e-16), line, color=colour, lw=1,
                                label=f"{SCHEMES[scheme]}, {step:g} s")  # fmt: skip
                if step != steps[0]:
                    continue
                for axes, turn in ((row[0], False), (row[1], True)):
                    views = [(in_frame(time, q) if turn else q)[:, :2].T * 1e3 for q in (there, here)]
                    if scheme == SHOWN[0]:
                        axes.plot(*views[0], color="0.6", lw=3, label="run in the laboratory")
                    axes.plot(*views[1], "--", color=colour, lw=1, label=f"run in the frame, {SCHEMES[scheme]}")
        row[0].set(title=f"{case}: from the laboratory", xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
        row[1].set(title="from the frame", xlabel="x [mm]", aspect="equal")
        row[2].set(title="distance of both / grain's radius", xlabel="time [s]")
        row[2].axhline(1e-6, color="0.5", lw=0.8)
        for axes in row[:2]:
            axes.set_adjustable("datalim")
    grid[0, 0].legend(fontsize=7)
    grid[0, 2].legend(fontsize=7)
    save(figure, out)
    return numbers
