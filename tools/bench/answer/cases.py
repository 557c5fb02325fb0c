"""The cases, each defined once for all codes: grains, walls, motion, what is read at which times, what the answer is.

Grains, walls and friction are those of Table 2 of the paper. Everything turns about the axis y through the origin, from rest in
the laboratory at time 0; gravity points along -z. What is read of any code are the mass that has passed z = 0 of the walls'
own axes, and the centre of mass: the answers follow from them, so no code's own output can flatter it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.states import DIAMETER, MATERIAL, MEAN_VOLUME
from dev.meshes import hourglass, revolve

GRAVITY = 9.81
PACKED = 0.58  # solid fraction by which walls are sized [-]
NECK = 4.5  # radius of the neck over the mean diameter [-]
LARGER = 10.0  # factor on lengths and steps of the peer in a short look
QUARTERS = (0.25, 0.5, 0.75)

Answers = dict[str, float]


@dataclass(frozen=True)
class Rows:
    """What was read of a run at its sample times.

    Attributes:
        time: Times [s], shape (k,).
        passed: Share of the mass above z = 0 in the axes of the walls [-], shape (k,).
        x: Centre of mass in the laboratory [m], shape (k,).
        z: Its height [m], shape (k,).
    """

    time: np.ndarray
    passed: np.ndarray
    x: np.ndarray
    z: np.ndarray


@dataclass(frozen=True)
class Run:
    """What one run gave, apart from its costs."""

    rows: Rows
    step: float
    """Time step [s]."""
    steps: int
    loop: float
    """Wall time of the steps alone [s]."""
    lost: int = 0
    """Grains that left the domain."""


@dataclass(frozen=True)
class Case:
    """One question and how it is asked.

    Attributes:
        name: Of the case.
        title: What is drawn, with its unit.
        count: Grains.
        scale: Factor on the lengths of Table 2 [-]; 1 but for a short look.
        shell: Triangles of the closed mesh that turns [m], shape (t, 3, 3); this or ``width``.
        width: Width of the square box of five planes: floor z = 0, sides x, y = 0 and this [m].
        fill: Box in which the grains are placed at random [m].
        settle: Time that they are given to come to rest before the start [s].
        rate: Angular velocity about y [rad/s].
        turn: Time for which it turns [s].
        end: Time at which it ends [s].
        sample: Time between two readings [s].
        curve: The curve that answers the question, of the rows.
        answers: Its numbers, of times and curve.
    """

    name: str
    title: str
    count: int
    scale: float
    shell: np.ndarray | None
    width: float | None
    fill: dict[str, list[float]]
    settle: float
    rate: float
    turn: float
    end: float
    sample: float
    curve: Callable[[Rows], np.ndarray]
    answers: Callable[["Case", Rows], Answers]

    @property
    def diameter(self) -> tuple[float, float]:
        """Smallest and largest diameter [m], uniform by number."""
        return DIAMETER[0] * self.scale, DIAMETER[1] * self.scale

    @property
    def mass(self) -> float:
        """Mean mass of all grains [kg]."""
        return self.count * MATERIAL.density * MEAN_VOLUME * self.scale**3


def rayleigh_step(scale: float = 1.0) -> float:
    """Rayleigh time of the smallest grain [s]: pi R sqrt(rho / G) / (0.1631 nu + 0.8766)."""
    nu = MATERIAL.poisson_ratio
    shear = MATERIAL.young_modulus / (2.0 * (1.0 + nu))
    wave = math.sqrt(MATERIAL.density / shear)
    return math.pi * 0.5 * DIAMETER[0] * scale * wave / (0.1631 * nu + 0.8766)


def first_time(share: float, time: np.ndarray, curve: np.ndarray) -> float:
    """When a curve has reached ``share`` first [s], interpolated; nan if it never has."""
    k = int(np.argmax(curve >= share))
    if curve[k] < share or k == 0:
        return math.nan
    return float(np.interp(share, curve[k - 1 : k + 1], time[k - 1 : k + 1]))


# --- the hourglass ---------------------------------------------------------------------------------------------------


def _discharge(case: Case, rows: Rows) -> Answers:
    """Times at which a quarter, half and three quarters of the mass have passed the neck [s]."""
    return {f"{share:.0%} passed [s]": first_time(share, rows.time, rows.passed) for share in QUARTERS}


def hourglass_case(count: int, scale: float = 1.0, rpm: float = 30.0, segments: int = 48) -> Case:
    """Half a turn and the discharge: an hourglass whose lower bulb is 65 % full, as in `tools/dev/meshes.py`."""
    size = scale * sum(DIAMETER) / 2.0
    neck, slope = NECK * size, math.tan(math.radians(30.0))
    volume = count * MEAN_VOLUME * scale**3 / PACKED / 0.65
    rim = (3.0 * volume * slope / math.pi + neck**3) ** (1.0 / 3.0)
    shell = hourglass(neck, 2.2 * size, 30.0, rim, segments, max(4, segments * 14 // 48))
    turn = 30.0 / rpm
    flow = 0.58 * PACKED * math.sqrt(GRAVITY) * (2.0 * neck - 1.4 * size) ** 2.5  # Beverloo [m3/s of grains]
    end = turn + 1.2 * count * MEAN_VOLUME * scale**3 / flow
    low, high = shell.reshape(-1, 3).min(axis=0), shell.reshape(-1, 3).max(axis=0)
    return Case(
        name="hourglass", title="mass that has passed the neck [-]", count=count, scale=scale, shell=shell, width=None,
        fill={"min": low.tolist(), "max": [*high[:2].tolist(), 0.0]}, settle=0.05 * math.sqrt(scale),
        rate=math.pi / turn, turn=turn, end=end, sample=end / 300.0, curve=lambda rows: rows.passed, answers=_discharge,
    )  # fmt: skip


# --- the bed ---------------------------------------------------------------------------------------------------------


def _settling(case: Case, rows: Rows) -> Answers:
    """Times at which the centre of mass has come down by a half and nine tenths [s], and where it stays [mm]."""
    last = float(rows.z[-len(rows.z) // 10 :].mean())
    fallen = (rows.z[0] - rows.z) / (rows.z[0] - last)
    times = {f"{share:.0%} fallen [s]": first_time(share, rows.time, fallen) for share in (0.5, 0.9)}
    return {**times, "height at rest [mm]": 1e3 * last}


def bed_case(count: int, scale: float = 1.0) -> Case:
    """A loose cloud of grains in a square box falls and settles to a bed as high as wide."""
    width = (count * MEAN_VOLUME * scale**3 / PACKED) ** (1.0 / 3.0)
    top = 2.0 * width  # solid fraction 0.29
    end = 3.0 * math.sqrt(2.0 * (top - width) / GRAVITY)
    return Case(
        name="bed", title="height of the centre of mass [mm]", count=count, scale=scale, shell=None, width=width,
        fill={"min": [0.0, 0.0, 0.0], "max": [width, width, top]}, settle=0.0, rate=0.0, turn=0.0, end=end,
        sample=end / 300.0, curve=lambda rows: 1e3 * rows.z, answers=_settling,
    )  # fmt: skip


# --- the drum --------------------------------------------------------------------------------------------------------


def _leaning(rows: Rows) -> np.ndarray:
    """Angle of the centre of mass from the vertical [deg]: that of the surface, where it is plane."""
    return np.degrees(np.arctan2(np.abs(rows.x), -rows.z))


def _turning(case: Case, rows: Rows) -> Answers:
    """Mean angle [deg] and mean torque of the weight about the axis [uN m], over the second half of the run."""
    half = rows.time > 0.5 * case.end
    torque = case.mass * GRAVITY * np.abs(rows.x)  # in the mean it is what turns the drum
    return {"angle [deg]": float(_leaning(rows)[half].mean()), "torque [uN m]": 1e6 * float(torque[half].mean())}


def drum_case(count: int, scale: float = 1.0, rpm: float = 30.0, segments: int = 48) -> Case:
    """A closed drum, 40 % full, whose bed is taken up and then rolls down its surface."""
    volume = count * MEAN_VOLUME * scale**3 / PACKED / 0.4
    radius = (volume / (math.pi * 1.2)) ** (1.0 / 3.0)
    length = 1.2 * radius
    rows = max(2, round(length * segments / (2.0 * math.pi * radius)))
    lid, side = radius * np.array([0.0, 1.0, 2.0]) / 3.0, np.linspace(-0.5 * length, 0.5 * length, rows + 1)
    profile = np.concatenate([lid, np.full(rows + 1, radius), lid[::-1]])
    along = np.concatenate([np.full(3, side[0]), side, np.full(3, side[-1])])
    about_z = revolve(profile, along, segments)
    shell = about_z[..., [1, 2, 0]]  # z becomes y: a turn of the axes, so the winding stays
    end = 30.0 / rpm
    return Case(
        name="drum", title="angle of the bed [deg]", count=count, scale=scale, shell=shell, width=None,
        fill={"min": [-radius, -0.5 * length, -radius], "max": [radius, 0.5 * length, 0.15 * radius]},
        settle=0.08 * math.sqrt(scale), rate=math.pi / end, turn=end, end=end, sample=end / 300.0, curve=_leaning,
        answers=_turning,
    )  # fmt: skip


def cases(count: int, short: bool) -> dict[str, Case]:
    """All cases by name: of ``count`` grains, or a short look with larger grains and coarse walls."""
    if short:
        return {
            case.name: case
            for case in (
                hourglass_case(count, LARGER, 60.0, 16), bed_case(count, LARGER), drum_case(count, LARGER, 60.0, 16),
            )
        }  # fmt: skip
    return {case.name: case for case in (hourglass_case(count), bed_case(count), drum_case(count))}


def scene_tables(case: Case, shell: str | None, grains: dict[str, Any], step: float | str) -> dict[str, Any]:
    """Tables of the scene of a case.

    Args:
        case: What is run.
        shell: File of the mesh; None for a box of planes.
        grains: The table of its grains, but for the material.
        step: Time step [s], or "auto".
    """
    if shell is not None:
        walls = [{"name": "shell", "material": "grain", "mesh": shell}]
    else:
        assert case.width is not None
        w = case.width
        planes = {"floor": ([0, 0, 0], [0, 0, 1]), "west": ([0, 0, 0], [1, 0, 0]), "east": ([w, 0, 0], [-1, 0, 0]),
                  "south": ([0, 0, 0], [0, 1, 0]), "north": ([0, w, 0], [0, -1, 0])}  # fmt: skip
        walls = [
            {"name": name, "material": "grain", "plane": {"point": point, "normal": normal}}
            for name, (point, normal) in planes.items()
        ]
    pair = {key: getattr(MATERIAL, key) for key in ("restitution", "friction", "rolling_friction")}
    scene: dict[str, Any] = {
        "gravity": [0.0, 0.0, -GRAVITY],
        "materials": {"grain": {key: getattr(MATERIAL, key) for key in ("density", "young_modulus", "poisson_ratio")}},
        "contact": {"tangential": "mindlin_displacement", "rolling": "constant"},
        "pairs": [{"materials": ["grain", "grain"], **pair}],
        "grains": [{"material": "grain", **grains}],
        "walls": walls,
        "time": {"end": case.end, "step": step},
        "source": case.name,
    }
    if case.rate:
        scene["frame"] = {"axis": [0, 1, 0], "schedule": [{"until": case.turn, "rate": case.rate}, {"rate": 0.0}]}
    return scene
