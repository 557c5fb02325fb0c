"""Figure 15 of the paper: run time in the turning frame over run time in the laboratory, against threads.

The main job of ``scenes/hourglass.toml`` is settled, turned to each angle in both settings, and saved there. Each window starts
anew from that checkpoint; windows of the two settings alternate.
"""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

import warpdem
from paper.common import SCENES, save, scene_of, tables
from paper.hourglass import SETTINGS, settled, started
from warpdem.core.threads import available_threads

ANGLES = (0.0, 45.0, 90.0)  # of the turn [deg]


@dataclass(frozen=True)
class Windows:
    """What is timed: ``steps`` steps after ``warm`` ones, ``repeats`` times for each setting, with ``count`` grains."""

    warm: int = 200
    steps: int = 2000
    repeats: int = 5
    count: int = 4600
    settle: float = 0.6  # [s]


def checkpoints(windows: Windows, folder: Path, angles: Sequence[float] = ANGLES) -> dict[tuple[float, str], Path]:
    """Save the job at each angle [deg] in both settings."""
    scene = tables(SCENES.parent / "hourglass.toml")
    scene["grains"][0]["fill"]["count"] = windows.count
    threads = available_threads()
    start = settled(scene, SCENES.parent, windows.settle, threads=threads)
    saved = {}
    for setting in SETTINGS:
        job = scene_of(started(scene, start, setting), SCENES.parent, "hourglass.toml")
        sim = warpdem.Simulation(job, device="cpu", threads=threads)
        [motion] = sim.scene.frame or sim.scene.walls[0].motion
        instants = np.linspace(0.0, sim.scene.time.end, 10_001)
        for angle in angles:
            sim.run(until=float(np.interp(np.radians(angle), motion.angle(instants), instants)))
            path = saved[angle, setting] = folder / f"{setting}_{angle:g}.h5"
            sim.save_checkpoint(path)
    return saved


def window(path: Path, threads: int, windows: Windows) -> tuple[float, int]:
    """Seconds per step of one window, and contacts at its end."""
    sim = warpdem.Simulation.from_checkpoint(path, device="cpu", threads=threads)
    sim.step(windows.warm)
    begin = time.perf_counter()
    sim.step(windows.steps)
    return (time.perf_counter() - begin) / windows.steps, len(sim.contacts().i)


def measure(windows: Windows) -> dict[str, Any]:
    """Medians of all windows, by angle and threads."""
    counts = sorted({2**k for k in range(8) if 2**k <= available_threads()} | {available_threads()})
    numbers: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        saved = checkpoints(windows, Path(folder))
        for angle in ANGLES:
            rows = numbers[f"{angle:g} deg"] = {}
            for threads in counts:
                taken: dict[str, list[tuple[float, int]]] = {setting: [] for setting in SETTINGS}
                for _ in range(windows.repeats):
                    for setting in SETTINGS:
                        taken[setting].append(window(saved[angle, setting], threads, windows))
                seconds = {setting: median(s for s, _ in pairs) for setting, pairs in taken.items()}
                rows[threads] = {
                    "frame_over_laboratory": seconds["frame"] / seconds["laboratory"],
                    "seconds_per_step": seconds,
                    "all_seconds_per_step": {setting: [s for s, _ in pairs] for setting, pairs in taken.items()},
                    "contacts": {setting: pairs[-1][1] for setting, pairs in taken.items()},
                }
                print(f"{angle:g} deg, {threads} threads: {rows[threads]['frame_over_laboratory']:.3f}", flush=True)
    return numbers


def make(windows: Windows, out: Path) -> dict[str, Any]:
    """Measure, and draw the ratio against threads for each angle."""
    numbers = measure(windows)
    figure, axes = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
    for marker, (angle, rows) in zip("o^s", numbers.items(), strict=True):
        axes.plot(list(rows), [row["frame_over_laboratory"] for row in rows.values()], marker + "-", label=angle)
    axes.axhline(1.0, color="0.5", lw=0.8)
    axes.set(xlabel="threads", ylabel="time in the turning frame / time in the laboratory", ylim=(0.5, 1.2))
    axes.set_xticks(list(rows))
    axes.legend(title="angle of the turn")
    save(figure, out)
    return {"grains": windows.count, "steps": windows.steps, "repeats": windows.repeats, "angles": numbers}
