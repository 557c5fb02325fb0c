"""What is measured of the scenes of the gallery; lengths in [m], times in [s]."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import warpdem

SCENES = Path(__file__).parents[2] / "scenes"


def simulation(name: str, *overrides: str) -> warpdem.Simulation:
    """A scene of the gallery on one thread."""
    return warpdem.Simulation(warpdem.load_scene(SCENES / f"{name}.toml", overrides), device="cpu", threads=1)


def instants(sim: warpdem.Simulation, until: float, interval: float, start: float = 0.0) -> Iterator[warpdem.Simulation]:
    """The simulation itself, every ``interval`` after ``start``."""
    every, last = max(1, round(interval / sim.dt)), sim.steps_until(until)
    while sim.step_number < last:
        sim.step(min(every, last - sim.step_number))
        if sim.time > start:
            yield sim


def centre_angle(sim: warpdem.Simulation) -> float:
    """Angle [deg] by which the centre of mass stands behind the lowest point of a drum that turns about +y."""
    p = sim.particles
    x, _, z = p.mass @ p.position_lab
    return math.degrees(math.atan2(-x, -z))


def jacobi(sim: warpdem.Simulation) -> np.ndarray:
    """v^2/2 - w^2 r^2/2 + g z [m2/s2] of each grain, in a frame that turns about z."""
    q, v, rate = sim.particles.position, sim.particles.velocity, sim.scene.frame[0].rate
    return 0.5 * (v**2).sum(1) - 0.5 * rate**2 * (q[:, :2] ** 2).sum(1) - sim.scene.gravity[2] * q[:, 2]


def cone_angle(sim: warpdem.Simulation) -> float:
    """Angle [deg] of the cone whose mean height and mean distance from the axis are those of the grains."""
    p = sim.particles
    centre = np.average(p.position, axis=0, weights=p.mass)
    distance = np.hypot(*(p.position - centre)[:, :2].T)
    return math.degrees(math.atan(2.0 * centre[2] / np.average(distance, weights=p.mass)))


def surface_curvature(sim: warpdem.Simulation, column: float, radius: float) -> float:
    """Curvature k [1/m] of z = c + k r^2 fitted to the uppermost grain of each column of that width within ``radius``."""
    q = sim.particles.position
    highest = {}
    for i in np.argsort(q[:, 2]):
        highest[tuple(np.floor(q[i, :2] / column))] = i
    top = q[list(highest.values())]
    square = (top[:, :2] ** 2).sum(1)
    return np.polyfit(square[square < radius**2], top[square < radius**2, 2], 1)[0]


def mean_angular_velocity(sim: warpdem.Simulation) -> float:
    """Angular momentum over moment of inertia about z [rad/s], in the frame."""
    p = sim.particles
    q, v = p.position, p.velocity
    return (p.mass @ (q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0])) / (p.mass @ (q[:, :2] ** 2).sum(1))


def time_in_air(acceleration: float) -> float:
    """Share of the period for which a lump that does not bounce is off a plate shaken at ``acceleration`` times g.

    With the phase x since it left at sin(x0) = 1/acceleration: sin(x0) + cos(x0) x - x^2 / (2 acceleration) = sin(x0 + x).
    """
    x0 = math.asin(1.0 / acceleration)
    x = np.linspace(1e-3, 2.0 * math.pi, 100_000)
    above = math.sin(x0) + math.cos(x0) * x - x**2 / (2.0 * acceleration) - np.sin(x0 + x)
    return float(x[np.argmax(above < 0.0)] / (2.0 * math.pi))


def solid_fraction(sim: warpdem.Simulation, low: float, high: float, inner: float, outer: float, points: int = 20_000) -> float:
    """Share of the grains in the space between two heights and two distances from the z axis, by random points."""
    p = sim.particles
    random = np.random.default_rng(0).random((points, 3))
    r, phi = np.sqrt(inner**2 + random[:, 0] * (outer**2 - inner**2)), 2.0 * math.pi * random[:, 1]
    place = np.stack([r * np.cos(phi), r * np.sin(phi), low + random[:, 2] * (high - low)], axis=1)
    near = (p.position[:, 2] > low - p.radius.max()) & (p.position[:, 2] < high + p.radius.max())
    held = np.zeros(points, dtype=bool)
    for centre, radius in zip(p.position[near], p.radius[near], strict=True):
        held |= ((place - centre) ** 2).sum(1) < radius**2
    return float(held.mean())
