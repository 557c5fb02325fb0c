"""Friction never creates energy with ``mindlin``; ``mindlin_displacement`` does, by what is tabulated (exact_solutions 3).

Impacts without damping (e = 1) that stick (mu = 10) or slip now and then, over angles and spins: slip and load change
together in many ways. What a contact gives back beyond what came in can only be the tangential law's: the normal law returns
its energy to order 2.4 (test_hertz_impact), 1e-5 at 200 steps per contact.
"""

import numpy as np
import pytest

from chung_ooi import ANGLES, OXIDE, SPEED, wall_impacts
from warpdem import Simulation


def energies(sim):
    """Kinetic energy of each grain, spin included [J], shape (n,)."""
    p = sim.particles
    return 0.5 * p.mass * (p.velocity**2).sum(axis=1) + 0.5 * p.inertia * (p.spin**2).sum(axis=1)


def gains(device, law, normal_speed, tangential_speed, friction, spins=None, steps=200):
    """Energy after over energy before, less 1, shape (n,)."""
    scene, end = wall_impacts(
        OXIDE, normal_speed, tangential_speed, law, restitution=np.ones(len(normal_speed)), friction=friction, spins=spins,
        steps=steps,
    )  # fmt: skip
    sim = Simulation(scene, device=device, threads=1)
    before = energies(sim)
    sim.run(until=end)
    assert len(sim.contacts().i) == 0, "an impact is not over"
    return energies(sim) / before - 1.0


def over_the_angle(device, law, steps=200):
    a = np.radians(ANGLES)
    return gains(device, law, SPEED * np.cos(a), SPEED * np.sin(a), 10.0, steps=steps)


def test_mindlin_loses_energy_at_every_angle(device):
    gain = over_the_angle(device, "mindlin")
    assert gain.max() < -1e-3, "unloading costs a sheared contact its share"
    assert np.all(np.diff(gain[:-1]) < 0), "the more shear, the more"


def test_mindlin_displacement_gains_up_to_80_degrees_and_loses_where_it_slips(device):
    """+0.75 % at 80 degrees, -19 % at 85 (another code's audit); first order in the step: two steps lead to the limit."""
    coarse, fine = (over_the_angle(device, "mindlin_displacement", steps) for steps in (400, 800))
    limit = 2.0 * fine - coarse
    assert np.all(limit[:-1] > 0)
    assert limit[:-1].max() == pytest.approx(0.0075, abs=0.0010)
    assert limit[-1] == pytest.approx(-0.19, abs=0.005)


@pytest.mark.parametrize("friction", [0.1, 0.5, 10.0])
def test_mindlin_gives_no_impact_more_than_it_had(device, friction):
    """400 impacts with random speeds and spins about all axes; with the displacement law most of those that stick gain."""
    rng = np.random.default_rng(5)
    n = 400
    spins = rng.normal(size=(n, 3)) * 1000.0 * 10.0 ** rng.uniform(-1.0, 0.5, (n, 1))
    way = rng.uniform(0.3, 4.0, n), 3.0 * rng.normal(size=n)
    gain = gains(device, "mindlin", *way, friction, spins)
    assert gain.max() < 1e-5
    assert gain.mean() < -0.1
    if friction == 10.0:
        assert np.mean(gains(device, "mindlin_displacement", *way, friction, spins) > 1e-4) > 0.8


def test_mindlin_gives_no_collision_more_than_it_had(make_simulation):
    """200 collisions of two unequal spinning spheres, off centre."""
    rng, n, radius, speed = np.random.default_rng(6), 200, np.array([1e-3, 0.6e-3]), 0.4
    spin = rng.normal(size=(n, 2, 3)) * 300.0
    place, velocity = np.zeros((2, n, 2, 3))
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    apart = (radius.sum() * 1.0001 * direction)[:, None]
    place += 5e-3 * np.stack(np.meshgrid(*[np.arange(6)] * 3), axis=-1).reshape(-1, 1, 3)[:n]
    place += apart * [[0.5], [-0.5]]
    across = np.cross(direction, rng.normal(size=(n, 3)))
    velocity += (0.5 * (rng.uniform(0.0, 2.0, (n, 1)) * across - direction) * speed)[:, None] * [[1.0], [-1.0]]
    for friction in (0.2, 10.0):
        sim = make_simulation(
            place.reshape(-1, 3), velocities=velocity.reshape(-1, 3), spins=spin.reshape(-1, 3), radius=np.tile(radius, n),
            step=1e-6, young_modulus=5e7, restitution=1.0, friction=friction, tangential="mindlin", max_speed=speed,
        )  # fmt: skip
        before = energies(sim).reshape(-1, 2).sum(axis=1)
        sim.step(400)
        assert len(sim.contacts().i) == 0, "a collision is not over"
        gain = energies(sim).reshape(-1, 2).sum(axis=1) / before - 1.0
        assert np.mean(np.abs(gain) > 1e-4) > 0.95, "too few met"
        assert gain.max() < 1e-5
