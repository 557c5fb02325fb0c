"""Beds at rest stay at rest; what the constant rolling torque leaves is bounded (it brakes, but holds nothing)."""


import numpy as np
import pytest

import stability_scenes as scenes

SETTLING = 45_000  # steps until nothing but round-off is left
QUIET, STILL = 1e-8, 1e-3  # of m g d per grain, of a diameter
LENGTHS = [pytest.param(20_000, id="20 000 steps"), pytest.param(1_000_000, id="1e6 steps", marks=pytest.mark.slow)]


def rested(sim, steps):
    """Kinetic energy of the grains over m g d in 20 looks, shape (20, n), and their way over their diameter, shape (n,)."""
    place, looks, way = sim.particles.position, [], 0.0
    for _ in range(20):
        sim.step(steps // 20)
        looks.append(scenes.kinetic_share(sim))
        way = np.maximum(way, np.linalg.norm(sim.particles.position - place, axis=1) / (2.0 * sim.particles.radius))
    return np.array(looks), way


@pytest.mark.parametrize("steps", LENGTHS)
@pytest.mark.parametrize("rolling", ["none", "spring"])
def test_a_bed_at_rest_neither_warms_nor_creeps(device, rolling, steps):
    sim = scenes.bed(rolling, device)
    sim.step(SETTLING)
    assert len(sim.contacts().i) > 2 * 36, "the grains do not lie on each other"
    kinetic, way = rested(sim, steps)
    assert kinetic.max() < QUIET
    assert kinetic[10:].max() <= max(kinetic[:10].max(), 1e-20), "the bed warms"
    assert way.max() < STILL


@pytest.mark.parametrize("steps", LENGTHS)
def test_a_bed_under_the_constant_torque_keeps_quiet(device, steps):
    sim = scenes.bed("constant", device)
    sim.step(SETTLING)
    kinetic, _ = rested(sim, steps)
    assert kinetic.mean(axis=1).max() < 1e-5


@pytest.mark.parametrize("rolling_friction", [0.1, 1.0])
def test_a_grain_on_an_incline_does_not_creep_under_the_constant_torque(device, rolling_friction):
    """Slopes of 0.2 and 0.95 of the limit tan(slope) = rolling friction; one step could leave 2.5 g sin(slope) dt."""
    for sim in scenes.incline(np.array([0.2, 0.95]), rolling_friction, 1e-5, device):
        sim.step(5000)
        start = sim.particles.position
        sim.step(5000)
        creep = np.linalg.norm(sim.particles.position - start) / (5000 * sim.dt)
        assert creep <= 1e-6 * scenes.G * sim.dt
        assert np.linalg.norm(sim.particles.velocity) <= 1e-6 * scenes.G * sim.dt
