"""precision = "mixed": the contact law and its results in single precision, motion and geometry in double."""

import math

import numpy as np
import pytest


def bounce(make_simulation, precision):
    """Oblique collision of two grains with friction and rolling resistance, from touch to parting."""
    sim = make_simulation(
        [[0, 0, 0], [1.9999e-3, 0, 0]], velocities=[[0.2, 0.1, 0], [-0.2, 0, 0.05]], radius=1e-3, step=1e-6, restitution=0.6,
        friction=0.3, tangential="mindlin", rolling="spring", rolling_friction=0.05, engine={"precision": precision},
    )  # fmt: skip
    sim.step(1)
    force = np.linalg.norm(sim.contacts().force[0])
    sim.step(600)
    assert len(sim.contacts().i) == 0
    return sim, force


def test_a_collision_is_that_of_double_to_single_precision(make_simulation):
    (double, first), (mixed, same) = (bounce(make_simulation, p) for p in ("double", "mixed"))
    assert mixed.lists.history.numpy().dtype == np.float32
    assert same == pytest.approx(first, rel=1e-6)
    a, b = double.particles, mixed.particles
    difference = np.abs(a.velocity - b.velocity).max()
    assert 1e-12 < difference < 1e-6 * 0.2, "neither double nor mixed"
    assert np.abs(a.spin - b.spin).max() < 1e-5 * np.abs(a.spin).max()
    np.testing.assert_allclose(b.mass @ b.velocity, a.mass @ a.velocity, rtol=0, atol=1e-7 * a.mass.sum())


SPEEDS = np.array([0.01, 0.1, 1.0])  # [m/s]


def impacts(make_simulation, precision, restitution):
    """Oblique impacts of pairs far apart: forces [N] in the midst of the first two, shape (c, 3); restitution of each."""
    position, velocity = np.zeros((2, len(SPEEDS), 2, 3))
    position[:, :, 1] = 0.1 * np.arange(len(SPEEDS))[:, None]
    position[:, :, 0] = [0.0, 2e-3]
    velocity[:, 0] = SPEEDS[:, None] * [1.0, 0.3, 0.0]
    sim = make_simulation(
        position.reshape(-1, 3), velocities=velocity.reshape(-1, 3), radius=1e-3, step=1e-6, restitution=restitution,
        friction=0.3, tangential="mindlin", rolling="spring", rolling_friction=0.05,
        engine={"precision": precision, "max_overlap": 0.5},
    )  # fmt: skip
    sim.step(60)
    contacts = sim.contacts()
    forces = contacts.force[np.argsort(contacts.i)]
    assert len(forces) == len(SPEEDS)
    sim.step(3000)
    assert len(sim.contacts().i) == 0
    u = sim.particles.velocity[:, 0].reshape(-1, 2)
    return forces, (u[:, 1] - u[:, 0]) / SPEEDS


@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.9])
def test_forces_and_restitution_are_those_of_double(make_simulation, restitution):
    """Forces within 1e-4 and restitution within 1e-3 of double's at speeds over a factor 100; single precision leaves 1e-6."""
    (forces, e), (same, found) = (impacts(make_simulation, p, restitution) for p in ("double", "mixed"))
    size = np.linalg.norm(forces, axis=1, keepdims=True)
    assert (np.abs(same - forces) < 1e-4 * size).all()
    assert (same != forces).any(), "mixed is double"
    np.testing.assert_allclose(found, e, atol=1e-3, rtol=0)


def test_free_flight_and_gravity_are_those_of_double(make_simulation):
    """A velocity in single precision would lose 0.4 % of gravity at a step of 1e-6 s and 1 m/s."""
    sim = make_simulation(
        [[0, 0, 0]], velocities=[[1.0, 0, 0]], gravity=[0, 0, -9.81], frame={"axis": [0, 1, 0], "rate": 3.0},
        velocities_in="laboratory", step=1e-6, engine={"precision": "mixed"},
    )  # fmt: skip
    sim.step(20_000)
    t = sim.time
    np.testing.assert_allclose(sim.particles.position_lab[0], [t, 0, -0.5 * 9.81 * t**2], rtol=0, atol=1e-14)


def test_a_grain_at_rest_on_a_floor_in_mixed_precision(make_simulation):
    """Walls stay in double: the rest overlap of the linear law to 1e-9, as in double."""
    g, radius, stiffness = 9.81, 1e-3, 1000.0
    rest = 2500.0 * 4.0 / 3.0 * math.pi * radius**3 * g / stiffness
    sim = make_simulation(
        [[0, 0, radius - rest]], radius=radius, normal="hooke", stiffness=stiffness, gravity=[0, 0, -g], step=1e-5,
        walls=({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},), engine={"precision": "mixed"},
    )  # fmt: skip
    sim.step(2000)
    assert sim.particles.position[0, 2] == pytest.approx(radius - rest, rel=1e-12)
