"""Figures 2 to 8 of the paper: one grain, every integrator; energy, orders, paths, and the volume of phase space.

Errors are |q - exact| at t = 1 s [m] of a grain that starts 1 m from the centre, so they are shares of the path's size too.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from paper.common import SCHEMES, STYLES, save, seen_every, simulation

OMEGA = 40.0  # of the oscillators and of the frame [rad/s]
LAMBDA = 2.0  # damping of the damped oscillator [1/s]
END = 1.0  # [s]
STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5)  # [s], all parts of END
DECADES = (1e-2, 1e-3, 1e-4, 1e-5)
FIT = (1e-5, 1e-4)  # steps between which slopes are fitted [s]
FIT_RK4 = (1e-4, 1e-2)  # its error is round-off below
ROUND_OFF = 1e-11  # errors below it have no slope


@dataclass(frozen=True)
class Problem:
    """A grain with a known path.

    Attributes:
        name: Scene file.
        figure: Figure of its orders in the paper.
        dimensions: Of its motion: 1 along x, 2 in the plane z = 0.
        exact: Position at a time [s] -> [m], shape (3,).
        volume: Share of phase space that is left after a time [s] [-].
        orders: Orders that the schemes must show.
    """

    name: str
    figure: int
    dimensions: int
    exact: Callable[[float], np.ndarray]
    volume: Callable[[float], float]
    orders: dict[str, int]


def _damped(t: float) -> np.ndarray:
    w = math.sqrt(OMEGA**2 - LAMBDA**2)
    return math.exp(-LAMBDA * t) * np.array([math.cos(w * t) + LAMBDA / w * math.sin(w * t), 0.0, 0.0])


RUNGE_KUTTA = {"explicit_euler": 1, "rk2": 2, "rk4": 4}
PROBLEMS = (
    Problem(
        "harmonic", 4, 1, lambda t: np.array([math.cos(OMEGA * t), 0.0, 0.0]), lambda t: 1.0,
        RUNGE_KUTTA | dict.fromkeys(("velocity_verlet", "modified_verlet", "scovel", "lobatto", "exact_drift"), 2),
    ),
    Problem(
        "damped", 5, 1, _damped, lambda t: math.exp(-2.0 * LAMBDA * t),
        RUNGE_KUTTA | dict.fromkeys(("velocity_verlet", "modified_verlet", "scovel", "lobatto"), 1) | {"exact_drift": 2},
    ),
    Problem(
        "rotating", 8, 2, lambda t: np.array([math.cos(OMEGA * t), -math.sin(OMEGA * t), 0.0]), lambda t: 1.0,
        RUNGE_KUTTA | {"velocity_verlet": 1, "modified_verlet": 1, "scovel": 2, "lobatto": 2},
    ),
)  # fmt: skip

REFERENCE = {
    "explicit_euler": (1.67e3, 1.2245, 8.3287e-2, 8.0321e-3),
    "velocity_verlet": (7.0e13, 778.0, 3.691, 0.32354),
    "modified_verlet": (1.0e9, 60.06, 1.7023, 0.16087),
    "rk2": (1.198, 1.0668e-2, 1.06667e-4, 1.06667e-6),
    "rk4": (8.508e-3, 8.533e-7, 8.54e-11, 4e-13),
    "scovel": (1.118, 1.0477e-1, 1.0665e-3, 1.0667e-5),
}
"""Errors of the rotating grain at the steps of ``DECADES`` [m], from an independent NumPy program."""


# --- orders ----------------------------------------------------------------------------------------------------------


def error(problem: Problem, scheme: str, step: float) -> float:
    """|q - exact| at ``END`` [m]."""
    sim = simulation(problem.name, step, scheme)
    sim.run(until=END)
    return float(np.linalg.norm(sim.particles.position[0] - problem.exact(END)))


def slope(steps: Sequence[float], errors: Sequence[float], scheme: str) -> float | None:
    """Order of the errors, fitted between the steps of ``FIT``; None where they are round-off."""
    steps, errors = np.array(steps), np.array(errors)
    least, largest = FIT_RK4 if scheme == "rk4" else FIT
    inside = (steps > 0.99 * least) & (steps < 1.01 * largest)
    if errors[inside].max() < ROUND_OFF:
        return None
    return float(np.polyfit(np.log(steps[inside]), np.log(errors[inside]), 1)[0])


def orders(problem: Problem, steps: Sequence[float]) -> dict[str, Any]:
    """Errors and slopes of all schemes."""
    found = {}
    for scheme in SCHEMES:
        errors = [error(problem, scheme, step) for step in steps]
        found[scheme] = {"errors_m": errors, "slope": slope(steps, errors, scheme), "order": problem.orders.get(scheme)}
    return {"steps_s": list(steps), "schemes": found}


def compared(numbers: dict[str, Any]) -> dict[str, Any]:
    """Errors of the rotating grain beside those of ``REFERENCE``, by scheme and step."""
    rows: dict[str, Any] = {}
    for scheme, reference in REFERENCE.items():
        errors = dict(zip(numbers["steps_s"], numbers["schemes"][scheme]["errors_m"], strict=True))
        rows[scheme] = {
            f"{step:g}": {"error_m": errors[step], "reference_m": there, "relative": errors[step] / there - 1.0}
            for step, there in zip(DECADES, reference, strict=True)
            if step in errors
        }
    return rows


def draw_orders(problem: Problem, numbers: dict[str, Any], path: Path) -> None:
    """Figures 4, 5 and 8: error against time step."""
    figure, axes = plt.subplots(figsize=(8.5, 5), layout="constrained")
    for scheme, found in numbers["schemes"].items():
        slope = "round-off" if found["slope"] is None else f"s = {found['slope']:.2f}"
        errors = np.maximum(found["errors_m"], 1e-17)
        axes.loglog(
            numbers["steps_s"], errors, label=f"{SCHEMES[scheme]}, {slope}", markersize=4, lw=1, **STYLES[scheme]
        )
    axes.set(xlabel="time step [s]", ylabel="error of the position at 1 s [m]", ylim=(None, 1e4))
    axes.set_title(f"figure {problem.figure}: {problem.name}")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right upper", fontsize=8)
    save(figure, path)


def make_orders(problem: Problem, quick: bool, out: Path) -> dict[str, Any]:
    """Figure of the orders of one problem."""
    numbers = orders(problem, DECADES if quick else STEPS)
    draw_orders(problem, numbers, out)
    return numbers | ({"table": compared(numbers)} if problem.name == "rotating" else {})


# --- figure 3 --------------------------------------------------------------------------------------------------------

ENERGY_STEP, ENERGY_OMEGA = 0.1, 0.5  # of figure 3 [s], [rad/s]


def energies(scheme: str, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and energies over the energy at the start [-] of the oscillator of figure 3."""
    stiffness = f"fields.0.parameters.stiffness={ENERGY_OMEGA**2}"
    sim = simulation("harmonic", ENERGY_STEP, scheme, [stiffness, f"time.end={end}"])
    time, energy = [], []
    for step in seen_every(sim, 250, end):
        sim.step(step - sim.step_number)
        parts = sim.energy()
        time.append(sim.time)
        energy.append(parts["kinetic"] + parts["fields"])
    return np.array(time), np.array(energy) / energy[0]


def make_energy(quick: bool, out: Path) -> dict[str, Any]:
    """Figure 3: energy of the harmonic oscillator against time."""
    end = 50.0 if quick else 200.0
    shown = ("explicit_euler", "rk2", "rk4", "velocity_verlet", "exact_drift")
    figure, grid = plt.subplots(1, 5, figsize=(13, 3), layout="constrained")
    numbers = {"step_s": ENERGY_STEP, "omega_rad_s": ENERGY_OMEGA, "end_s": end, "schemes": {}}
    for axes, scheme in zip(grid, shown, strict=True):
        time, energy = energies(scheme, end)
        axes.plot(time, 1.0 - energy, color=STYLES[scheme]["color"])
        axes.set(title=SCHEMES[scheme], xlabel="time [s]")
        axes.ticklabel_format(axis="y", scilimits=(-2, 2))
        least, largest = float(energy.min()), float(energy.max())
        numbers["schemes"][scheme] = {"least": least, "largest": largest, "last": float(energy[-1])}
    grid[0].set_ylabel("lack of energy / energy")
    save(figure, out)
    x = (ENERGY_OMEGA * ENERGY_STEP) ** 2
    euler = (1.0 + x) ** round(end / ENERGY_STEP)
    return numbers | {"exact": {"explicit_euler last": euler, "velocity_verlet least": 1.0 - x / 4.0}}


# --- figures 6 and 7 -------------------------------------------------------------------------------------------------


def path_and_energy(scheme: str, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], positions in the frame [m], shape (k, 3), and H / (Omega^2 r^2 / 2) [-] of the rotating grain."""
    sim = simulation("rotating", step, scheme)
    time, places, energy = [], [], []
    for number in seen_every(sim, 400, END):
        sim.step(number - sim.step_number)
        q, v = sim.particles.position[0], sim.particles.velocity[0]
        time.append(sim.time)
        places.append(q)
        energy.append((v @ v - OMEGA**2 * (q[:2] @ q[:2])) / OMEGA**2)
    return np.array(time), np.array(places), np.array(energy)


def make_paths(scheme: str, out: Path) -> dict[str, Any]:
    """Figures 6 (velocity Verlet) and 7 (Scovel): paths and energies at four time steps, with those of exact drift."""
    figure, grid = plt.subplots(2, 4, figsize=(13, 6), layout="constrained")
    around = np.linspace(0.0, 2.0 * np.pi, 200)
    numbers: dict[str, Any] = {scheme: {}, "exact_drift": {}}
    for (top, bottom), step in zip(grid.T, DECADES, strict=True):
        for name, line in ((scheme, "-"), ("exact_drift", ".")):
            time, places, energy = path_and_energy(name, step)
            colour = STYLES[name]["color"]
            thin = 1 if name == scheme else 5
            top.plot(places[::thin, 0], places[::thin, 1], line, ms=3, lw=0.8, color=colour, label=SCHEMES[name])
            bottom.plot(time[::thin], energy[::thin], line, ms=3, lw=0.8, color=colour)
            radius = float(np.linalg.norm(places[-1]))
            largest = float(np.abs(energy).max())
            numbers[name][f"{step:g}"] = {
                "radius_m": radius,
                "energy_last": float(energy[-1]),
                "energy_largest": largest,
            }
        top.plot(np.cos(around), np.sin(around), "k--", lw=0.8, label="exact")
        top.set(title=f"dt = {step:g} s, r(1 s) = {numbers[scheme][f'{step:g}']['radius_m']:.4g} m", aspect="equal")
        top.set_adjustable("datalim")
        bottom.set_xlabel("time [s]")
        bottom.ticklabel_format(axis="y", scilimits=(-2, 2))
    grid[0, 0].legend(fontsize=7)
    grid[0, 0].set_ylabel("y [m]")
    grid[1, 0].set_ylabel(r"$H / (\Omega^2 r^2 / 2)$")
    save(figure, out)
    return {"frame_rate_rad_s": OMEGA, "schemes": numbers}


# --- figure 2: volume of phase space ---------------------------------------------------------------------------------

PARASITES_GONE = 6  # steps after which what a scheme keeps besides position and velocity has no say


def flow_map(problem: Problem, scheme: str, step: float, count: int) -> np.ndarray:
    """Derivative of (q, v) after ``count`` steps by (q, v) at the start, by central differences; shape (2 d, 2 d).

    The problems are linear, so that differences over +-1/2 (m, m/s) are exact to round-off.
    """
    d = problem.dimensions
    columns = []
    for k in range(2 * d):
        ends = []
        for sign in (0.5, -0.5):
            q, v = np.array([1.0, 0.0, 0.0]), np.zeros(3)
            (q if k < d else v)[k % d] += sign
            start = [f"positions=[{q.tolist()}]", f"velocities=[{v.tolist()}]", "velocities_in=frame"]
            sim = simulation(problem.name, step, scheme, [f"grains.0.{change}" for change in start])
            sim.step(count)
            ends.append(np.concatenate([sim.particles.position[0, :d], sim.particles.velocity[0, :d]]))
        columns.append(ends[0] - ends[1])
    return np.column_stack(columns)


def volumes(problem: Problem, scheme: str, step: float) -> tuple[float, float]:
    """Factors by which the first step of a run, and every later one, change the volume of phase space [-].

    A scheme whose force sees the velocity of half a step before maps (q, v^(k-1/2)) and not (q, v), but its first step has only
    v: for velocity Verlet that is A_3 A_2 A_1 of eqs. 92-94. The later steps all have the same determinant on their own
    state, which is the quotient of two maps that begin at the start, since start and reading drop out.
    """
    first, before, after = (
        float(np.linalg.det(flow_map(problem, scheme, step, count)))
        for count in (1, PARASITES_GONE, PARASITES_GONE + 1)
    )
    return first, after / before


def make_volumes(quick: bool, out: Path) -> dict[str, Any]:
    """Figure 2 and eqs. 52, 92-94: how far each scheme is from keeping the volume of phase space."""
    steps = DECADES[:2] if quick else (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
    figure, grid = plt.subplots(1, 3, figsize=(12, 4.6), layout="constrained", sharey=True)
    numbers: dict[str, Any] = {"steps_s": list(steps)}
    for axes, problem in zip(grid, PROBLEMS, strict=True):
        exact = [problem.volume(step) for step in steps]
        found = numbers[problem.name] = {"exact": exact, "schemes": {}}
        for scheme in SCHEMES:
            first, later = (
                np.array(column) for column in zip(*(volumes(problem, scheme, s) for s in steps), strict=True)
            )
            found["schemes"][scheme] = {"first_step": first.tolist(), "per_step": later.tolist()}
            off = np.maximum(np.abs(later - exact), 1e-16)
            axes.loglog(steps, off, label=SCHEMES[scheme], markersize=4, lw=1, **STYLES[scheme])
        axes.set(title=problem.name, xlabel="time step [s]")
        axes.grid(alpha=0.3)
    grid[0].set_ylabel("|determinant of one step - exact|")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    save(figure, out)
    return numbers
