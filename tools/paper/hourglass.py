"""Figures 10 to 13 of the paper: an hourglass turned over, in the turning frame and in the laboratory.

Both settings start from one settled state. Each is run several times ("twins") with the centres moved by 1e-9 of a radius,
which the chaos of the flow makes as large as any other difference: only what differs by more than twins do tells the
settings apart.
"""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.collections import EllipseCollection

import warpdem
from paper.common import SCENES, in_laboratory, save, scene_of, tables
from warpdem.model.walls import load_meshes

SETTINGS = ("frame", "laboratory")
QUARTERS = (0.25, 0.5, 0.75)
NUDGE = 1e-9  # of a radius: how far the starts of twins lie apart
SAMPLE = 0.01  # s between two points of a curve
MANY = 20_000  # grains of a picture [-]
INK = ("#1f77b4", "#ff7f0e")

PAPER_SIZE = {"count": 160_000, "diameter": {"uniform": [0.3e-3, 0.6e-3]}, "modulus": 5e7, "step": 1e-6}
"""The paper's own grains, for a GPU [-], [m], [Pa], [s]."""


@dataclass(frozen=True)
class Size:
    """How much is run.

    Attributes:
        twins: Runs of each setting.
        count: Number of grains.
        settle: Time that the filling is given to come to rest [s].
        rest: Time that is run after the glass has stopped on its head [s].
        paper: Whether the grains and the glass are the paper's 160 000.
        device: Device; threads are one on a CPU.
        precision: Value of ``engine.precision``.
    """

    twins: int = 8
    count: int = 800
    settle: float = 0.25
    rest: float = 0.55
    paper: bool = False
    device: str = "cpu"
    precision: str = "double"


@dataclass(frozen=True)
class Run:
    """What one run leaves.

    Attributes:
        time: Instants [s], shape (k,).
        passed: Share of the mass that has passed the neck, shape (k,).
        places: Grains at the instants of the pictures, in the laboratory [m], shape (p, n, 3).
        overlap: Largest overlap over radius met [-].
        seconds: Wall time of stepping [s].
    """

    time: np.ndarray
    passed: np.ndarray
    places: np.ndarray
    overlap: float
    seconds: float


def glass(size: Size) -> dict[str, Any]:
    """Tables of the scene at that size."""
    scene = tables(SCENES / "hourglass.toml")
    fill = scene["grains"][0]["fill"] = {**scene["grains"][0]["fill"], "count": size.count}
    scene["engine"] = {"precision": size.precision}
    if size.paper:
        scene["walls"][0] |= {"mesh": "../meshes/hourglass_paper.stl", "scale": 0.001}
        fill |= {key: PAPER_SIZE[key] for key in ("count", "diameter")}
        scene["materials"]["grain"]["young_modulus"] = PAPER_SIZE["modulus"]
        scene["time"]["step"] = PAPER_SIZE["step"]
    return scene


def half_turn(rpm: float) -> float:
    """Time T of half a turn [s]."""
    return 30.0 / rpm


def settled(
    scene: dict[str, Any], folder: Path, time: float, device: str = "cpu", threads: int = 1
) -> dict[str, np.ndarray]:
    """Columns of the scene's grains after ``time`` [s] at rest: positions [m], radii [m], velocities [m/s], spins [rad/s]."""
    still = {key: value for key, value in scene.items() if key != "frame"}
    sim = warpdem.Simulation(scene_of(still, folder, "hourglass.toml"), device=device, threads=threads)
    sim.run(until=time)
    p = sim.particles
    return {"positions": p.position, "radii": p.radius, "velocities": p.velocity, "spins": p.spin}


def started(scene: dict[str, Any], start: dict[str, np.ndarray], setting: str) -> dict[str, Any]:
    """Tables of the scene in one setting, with grains that start from those columns."""
    grains = [{"material": "grain", "velocities_in": "laboratory", **start}]
    scene = {**scene, "grains": grains}
    return in_laboratory(scene) if setting == "laboratory" else scene


def simulation(size: Size, rpm: float, setting: str, start: dict[str, np.ndarray], twin: int) -> warpdem.Simulation:
    """One run at its start; ``twin`` chooses the nudge, another one in each setting."""
    rng = np.random.default_rng([twin, SETTINGS.index(setting)])
    nudge = NUDGE * start["radii"][:, None] * rng.standard_normal(start["positions"].shape)
    scene = glass(size)
    scene["frame"]["schedule"] = [{"until": half_turn(rpm), "rate": f"{rpm} rpm"}, {"rate": 0}]
    scene["time"]["end"] = half_turn(rpm) + size.rest
    scene = started(scene, {**start, "positions": start["positions"] + nudge}, setting)
    return warpdem.Simulation(scene_of(scene, SCENES, "hourglass.toml"), device=size.device, threads=1)


def share_passed(sim: warpdem.Simulation) -> float:
    """Share of the mass in the bulb that was empty at the start: z > 0 in the axes of the glass."""
    place = sim.schedule.wall_placements(sim.scene, sim.time)["glass"]
    p = sim.particles
    height = (p.position - place.translation) @ place.rotation[:, 2]
    return float(p.mass[height > 0.0].sum() / p.mass.sum())


def instants(size: Size, rpm: float) -> np.ndarray:
    """Times of the pictures [s]: three of the turn, two of the rest."""
    turn = half_turn(rpm)
    return np.concatenate([turn * np.array([0.25, 0.5, 1.0]), turn + size.rest * np.array([0.25, 0.75])])


def run(size: Size, rpm: float, setting: str, start: dict[str, np.ndarray], twin: int) -> Run:
    """One run from its start to its end."""
    sim = simulation(size, rpm, setting, start, twin)
    times = np.arange(0.0, sim.scene.time.end + 0.5 * SAMPLE, SAMPLE)
    shown = np.abs(instants(size, rpm)[:, None] - times).argmin(axis=1)
    passed, places = [], []
    for k, time in enumerate(times):
        sim.run(until=time)
        passed.append(share_passed(sim))
        if k in shown:
            places.append(sim.particles.position_lab)
    overlap = max(sim.extremes["pair_overlap_share"], sim.extremes["wall_overlap_share"])
    return Run(times, np.array(passed), np.array(places), overlap, sum(sim.seconds.values()) - sim.seconds["set-up"])


def finished(jobs: dict[tuple[str, int], tuple], device: str) -> dict[tuple[str, int], Run]:
    """Runs by name and twin, given the arguments of ``run``: one process per core; on a GPU one after the other."""
    for size, rpm, setting, start, _ in {name: job for (name, _), job in jobs.items()}.values():
        simulation(size, rpm, setting, start, 0).step(1)  # compiled once, before the processes start
    found = {}
    workers = len(os.sched_getaffinity(0)) if device == "cpu" else 1
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        waiting = {pool.submit(run, *job): key for key, job in jobs.items()}
        for done in as_completed(waiting):
            name, twin = waiting[done]
            found[name, twin] = done.result()
            print(f"hourglass, {jobs[name, twin][1]:g} rpm, {name}, twin {twin}: {found[name, twin].seconds:.0f} s", flush=True)
    return found


def runs(size: Size, rpm: float, start: dict[str, np.ndarray]) -> dict[str, list[Run]]:
    """All twins of both settings."""
    jobs = {(setting, twin): (size, rpm, setting, start, twin) for twin in range(size.twins) for setting in SETTINGS}
    found = finished(jobs, size.device)
    return {setting: [found[setting, twin] for twin in range(size.twins)] for setting in SETTINGS}


# --- statistics ------------------------------------------------------------------------------------------------------


def standard_error(curves: np.ndarray) -> np.ndarray:
    """Standard error of the mean over twins, shape of one curve; nan where there is only one twin."""
    if len(curves) < 2:
        return np.full(curves.shape[1:], np.nan)
    return curves.std(axis=0, ddof=1) / np.sqrt(len(curves))


def standardised_rms(first: np.ndarray, second: np.ndarray) -> float:
    """Root mean square over time of the difference of two mean curves over its standard error [-].

    Args:
        first: Curves of one setting, shape (twins, k).
        second: Curves of the other, shape (twins, k).

    Instants at which all curves are the same value tell nothing and do not count; where the means differ and no twin does,
    the result is inf; of single runs it is nan.
    """
    difference = first.mean(axis=0) - second.mean(axis=0)
    error = np.hypot(standard_error(first), standard_error(second))
    tells = (error > 0.0) | (difference != 0.0)
    if not tells.any():
        return 0.0
    with np.errstate(divide="ignore"):
        return float(np.sqrt(np.mean((difference[tells] / error[tells]) ** 2)))


def time_of(share: float, time: np.ndarray, passed: np.ndarray) -> float:
    """When that share of the mass has passed first [s], interpolated; nan if it never has."""
    k = int(np.argmax(passed >= share))
    if passed[k] < share or k == 0:
        return float("nan")
    return float(np.interp(share, passed[k - 1 : k + 1], time[k - 1 : k + 1]))


def quarters(found: dict[str, list[Run]]) -> dict[str, Any]:
    """Times at which 25, 50 and 75 % have passed: means and standard errors [s], and their difference over its error [-]."""
    out = {}
    for share in QUARTERS:
        columns = {key: np.array([time_of(share, r.time, r.passed) for r in found[key]]) for key in SETTINGS}
        mean = {key: float(column.mean()) for key, column in columns.items()}
        error = {key: float(standard_error(column)) for key, column in columns.items()}
        apart = (mean["frame"] - mean["laboratory"]) / np.hypot(*error.values())
        out[f"{share:.0%}"] = {"mean": mean, "standard_error": error, "difference_in_standard_errors": float(apart)}
    return out


def summary(size: Size, rpm: float, found: dict[str, list[Run]]) -> dict[str, Any]:
    """What figures 12 and 13 show, in numbers."""
    curves = {key: np.array([r.passed for r in found[key]]) for key in SETTINGS}
    every = [r for key in SETTINGS for r in found[key]]
    ends = {"mean": np.mean, "least": np.min, "largest": np.max}
    return {
        "rpm": rpm,
        "grains": int(every[0].places.shape[1]),
        "twins": size.twins,
        "standardised_rms": standardised_rms(*curves.values()),
        "times_passed_s": quarters(found),
        "largest_overlap_share": max(r.overlap for r in every),
        "seconds_per_run": {key: float(np.median([r.seconds for r in found[key]])) for key in SETTINGS},
        "time_s": np.round(every[0].time, 9).tolist(),
        "share_passed": {
            key: {name: np.round(f(curve, axis=0), 5).tolist() for name, f in ends.items()}
            for key, curve in curves.items()
        },
    }


# --- pictures --------------------------------------------------------------------------------------------------------


def draw_mass(rpm: float, found: dict[str, list[Run]], numbers: dict[str, Any], path: Path) -> None:
    """Figures 12 and 13: mass below the neck against time, mean and envelope of the twins of each setting."""
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(7, 6), sharex=True, height_ratios=(3, 1), layout="constrained")
    time = found["frame"][0].time
    curves = {key: 100.0 * np.array([r.passed for r in found[key]]) for key in SETTINGS}
    for key, colour, line in zip(SETTINGS, INK, ("-", "--"), strict=True):
        top.fill_between(time, curves[key].min(axis=0), curves[key].max(axis=0), color=colour, alpha=0.3, lw=0)
        top.plot(
            time, curves[key].mean(axis=0), line, color=colour, label=f"{key}: mean and envelope of {len(curves[key])}"
        )
    difference = curves["frame"].mean(axis=0) - curves["laboratory"].mean(axis=0)
    error = np.hypot(*(standard_error(curve) for curve in curves.values()))
    bottom.fill_between(time, -error, error, color="0.8", lw=0, label="standard error")
    bottom.plot(time, difference, "k", lw=1, label="difference of the means")
    for axes in (top, bottom):
        axes.axvline(half_turn(rpm), color="0.5", lw=1)
        axes.legend(fontsize=8)
    compared = f"standardised rms {numbers['standardised_rms']:.2f}" if len(curves["frame"]) > 1 else "one run of each"
    top.set_title(f"{rpm:g} rpm, {numbers['grains']} grains; {compared}")
    top.set_ylabel("mass below the neck [%]")
    bottom.set(xlabel="time [s] (line: the glass stops)", ylabel="frame - laboratory [%]")
    save(figure, path)


def draw_grains(size: Size, rpm: float, found: dict[str, list[Run]], start: dict[str, np.ndarray], path: Path) -> None:
    """Figures 10 and 11: the first twin of each setting, seen along the axis; colours are layers of the start.

    Of more than ``MANY`` grains only those near the middle plane are drawn.
    """
    times = instants(size, rpm)
    turned = np.pi * np.minimum(times / half_turn(rpm), 1.0)
    diameter = 2.0 * start["radii"]
    slab, edge = (2.0 * diameter.mean(), 0.0) if len(diameter) > MANY else (np.inf, 0.2)
    layer = np.argsort(np.argsort(start["positions"][:, 2])) * 4 // len(diameter)
    outline = _outline(size)
    views = (("frame", True), ("frame", False), ("laboratory", False))
    figure, grid = plt.subplots(3, len(times), figsize=(1.7 * len(times), 6.2), layout="constrained")
    for row, (key, frame_axes) in zip(grid, views, strict=True):
        for k, axes in enumerate(row):
            angle = 0.0 if frame_axes else turned[k]
            places = found[key][0].places[k] @ _about_y(turned[k] - angle)
            order = np.argsort(-places[:, 1])  # the far ones first
            order = order[np.abs(places[order, 1]) < slab]
            dots = {
                "widths": diameter[order],
                "heights": diameter[order],
                "angles": np.zeros(len(order)),
                "units": "xy",
            }
            axes.add_collection(
                EllipseCollection(
                    **dots, offsets=places[order][:, [0, 2]], offset_transform=axes.transData,
                    facecolors=plt.get_cmap("tab10")(layer[order]), edgecolors="k", linewidths=edge,
                )
            )  # fmt: skip
            axes.plot(*(outline @ _about_y(angle).T)[:, [0, 2]].T, color="0.4", lw=1)
            reach = 1.05 * np.linalg.norm(outline, axis=1).max()
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=[], yticks=[])
        row[0].set_ylabel(f"run in the {key}\nseen from the {'frame' if frame_axes else 'laboratory'}", fontsize=8)
    for axes, time in zip(grid[0], times, strict=True):
        axes.set_title(f"t = {time:.3g} s", fontsize=9)
    save(figure, path)


def _about_y(angle: float) -> np.ndarray:
    """Turn by ``angle`` [rad] about y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _outline(size: Size) -> np.ndarray:
    """Profile of the glass in the plane y = 0 [m], shape (k, 3)."""
    corners = load_meshes(scene_of(glass(size), SCENES, "hourglass.toml"))["glass"].vertices
    height = np.round(corners[:, 2], 9)
    levels = np.unique(height)
    radius = np.array([np.hypot(*corners[height == level, :2].T).max() for level in levels])
    right = np.column_stack([radius, np.zeros(len(levels)), levels])
    return np.concatenate([right, right[::-1] * [-1, 1, 1], right[:1]])


def make(rpm: float, size: Size, pictures: Path, curves: Path) -> dict[str, Any]:
    """Run both settings at one rate, draw their two figures, and return their numbers."""
    start = settled(glass(size), SCENES, size.settle, size.device)
    found = runs(size, rpm, start)
    numbers = summary(size, rpm, found)
    draw_grains(size, rpm, found, start, pictures)
    draw_mass(rpm, found, numbers, curves)
    return numbers
