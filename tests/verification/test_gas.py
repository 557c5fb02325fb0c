"""A frictionless gas in a box: energy is kept when elastic and only lost when not (exact_solutions 9)."""

import math

import numpy as np

RADIUS, E, NU, RHO, SPEED = 1e-3, 5e7, 0.3, 2500.0, 0.5
FASTEST = 1.6  # [m/s], approach speed of any impact in these runs
SIDE = 12 * RADIUS


def box():
    """The six faces of [0, SIDE]^3."""
    faces = []
    for normal in np.concatenate([np.eye(3), -np.eye(3)]):
        point = np.where(normal < 0, SIDE, 0.0)
        faces.append({"name": f"face{len(faces)}", "plane": {"point": point.tolist(), "normal": normal.tolist()}})
    return faces


def gas(make_simulation, restitution):
    """27 grains at random speeds; 50 steps per contact of the quickest impact, at ``FASTEST``."""
    grid = (np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3) + 0.5) * SIDE / 3
    velocity = np.random.default_rng(3).normal(size=grid.shape)
    velocity *= SPEED / np.sqrt(np.mean(np.sum(velocity**2, axis=1)))
    mass = 0.5 * RHO * 4.0 / 3.0 * math.pi * RADIUS**3
    depth = (15.0 * mass * FASTEST**2 / (16.0 * E / (2.0 * (1.0 - NU**2)) * math.sqrt(0.5 * RADIUS))) ** 0.4
    return make_simulation(
        grid, velocities=velocity, radius=RADIUS, young_modulus=E, poisson_ratio=NU, density=RHO, walls=box(),
        restitution=restitution, step=2.943275184 * depth / FASTEST / 50,
    )  # fmt: skip


def total(sim):
    return sum(sim.energy().values())


def test_an_elastic_gas_keeps_its_energy(make_simulation):
    sim = gas(make_simulation, 1.0)
    start = total(sim)
    drift = []
    for _ in range(40):
        sim.step(500)
        drift.append(total(sim) / start - 1.0)
    assert SPEED < sim.extremes["pair_approach_speed"] < FASTEST
    assert np.abs(drift).max() < 1e-4  # criterion of exact_solutions 9 at t_c/50
    assert abs(np.mean(drift[20:]) - np.mean(drift[:20])) < 5e-5, "the energy has a trend"


def test_an_inelastic_gas_only_loses_energy(make_simulation):
    sim = gas(make_simulation, 0.8)
    energy = [total(sim)]
    for _ in range(400):
        sim.step(10)
        energy.append(total(sim))
    # within a contact the scheme's energy swings like that of the elastic gas
    assert np.diff(energy).max() < 1e-4 * energy[0]
    assert energy[-1] < 0.8 * energy[0]
