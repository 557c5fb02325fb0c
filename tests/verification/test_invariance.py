"""The laws of nature do not know where one stands (exact_solutions 9): one cloud of colliding grains, told in other words.

The cloud falls together, spins, slides and sticks for 800 steps. Told in turned, mirrored, shifted or flying, in other
units or with other numbers on the grains, it must go the same way up to the growth of round-off, 1e-9 of its size and speeds.
A sign that is wrong for one direction only, a constant of some unit hidden in a formula, or a law that treats i and j
differently shows here.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

STEPS, STEP, RADIUS = 800, 2e-6, 1e-3
TOLERANCE = 1e-9
GRAVITY = np.array([3.0, -5.0, -60.0])
FLOOR = {"point": np.array([0.0, 0.0, -3.5e-3]), "normal": np.array([0.1, -0.05, 1.0])}


def cloud():
    """Places [m], velocities [m/s], spins [rad/s] and radii [m] of 27 grains that fly to their middle and down."""
    rng = np.random.default_rng(4)
    place = (np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3) - 1.0) * 2.15 * RADIUS
    place += rng.uniform(-0.05, 0.05, place.shape) * RADIUS
    velocity = [0.1, 0.0, -0.5] - 120.0 * place + rng.normal(0.0, 0.03, place.shape)
    return place, velocity, rng.normal(0.0, 100.0, place.shape), rng.uniform(0.8, 1.0, 27) * RADIUS


LAWS = {
    "young_modulus": 2e7, "density": 2500.0, "restitution": 0.7, "friction": 0.4, "tangential": "mindlin", "rolling": "spring",
    "rolling_friction": 0.1,
}  # fmt: skip


def run(make_simulation, place, velocity, spin, radius, floor=FLOOR, gravity=GRAVITY, step=STEP, **keys):
    walls = ({"name": "floor", "plane": {k: v.tolist() for k, v in floor.items()}},)
    sim = make_simulation(
        place.tolist(), velocities=velocity.tolist(), spins=spin.tolist(), radius=radius, gravity=gravity.tolist(), walls=walls,
        step=step, **{**LAWS, **keys},
    )  # fmt: skip
    sim.step(STEPS)
    return sim


def same(sim, place, velocity, spin, length=RADIUS, time=1.0):
    p = sim.particles
    np.testing.assert_allclose(p.position, place, rtol=0, atol=TOLERANCE * length)
    np.testing.assert_allclose(p.velocity, velocity, rtol=0, atol=TOLERANCE * 0.5 * length / RADIUS / time)
    np.testing.assert_allclose(p.spin, spin, rtol=0, atol=TOLERANCE * 200.0 / time)


@pytest.fixture
def reference(make_simulation):
    sim = run(make_simulation, *cloud())
    contacts = sim.contacts()
    assert (contacts.j >= 0).sum() > 10
    assert (contacts.j < 0).sum() > 2
    assert np.abs(sim.particles.spin - cloud()[2]).max() > 100.0
    slides = np.linalg.norm(np.cross(contacts.force, contacts.normal), axis=1) > 0.39 * np.sum(
        contacts.force * contacts.normal, axis=1
    )
    assert 0 < slides.sum() < len(slides)
    return sim.particles


def test_turned(reference, make_simulation):
    turn = Rotation.random(random_state=11).apply
    place, velocity, spin, radius = cloud()
    floor = {k: turn(v) for k, v in FLOOR.items()}
    sim = run(make_simulation, turn(place), turn(velocity), turn(spin), radius, floor, turn(GRAVITY))
    same(sim, turn(reference.position), turn(reference.velocity), turn(reference.spin))


def test_mirrored(reference, make_simulation):
    """A mirror keeps lengths and turns spins, which are pseudovectors, the other way."""
    mirror = np.array([-1.0, 1.0, 1.0])
    place, velocity, spin, radius = cloud()
    floor = {k: mirror * v for k, v in FLOOR.items()}
    sim = run(make_simulation, mirror * place, mirror * velocity, -mirror * spin, radius, floor, mirror * GRAVITY)
    same(sim, mirror * reference.position, mirror * reference.velocity, -mirror * reference.spin)


def test_shifted(reference, make_simulation):
    """A shift of 40 radii costs 40 roundings of the places."""
    way = np.array([0.04, -0.02, 0.03])
    place, velocity, spin, radius = cloud()
    floor = FLOOR | {"point": FLOOR["point"] + way}
    sim = run(make_simulation, place + way, velocity, spin, radius, floor)
    same(sim, reference.position + way, reference.velocity, reference.spin)


def test_numbered_otherwise(reference, make_simulation):
    """Other ids and other order: each contact is evaluated from its other side."""
    other = np.random.default_rng(1).permutation(27)
    sim = run(make_simulation, *(x[other] for x in cloud()))
    same(sim, reference.position[other], reference.velocity[other], reference.spin[other])


def test_in_other_units(reference, make_simulation):
    """Lengths 3.7 times, times 0.23 times, masses 1900 times as large: no law has a scale of its own."""
    length, time, mass = 3.7, 0.23, 1900.0
    place, velocity, spin, radius = cloud()
    sim = run(
        make_simulation, place * length, velocity * length / time, spin / time, radius * length,
        FLOOR | {"point": FLOOR["point"] * length}, GRAVITY * length / time**2, STEP * time,
        density=LAWS["density"] * mass / length**3, young_modulus=LAWS["young_modulus"] * mass / (length * time**2),
        max_speed=1e-3 * length / time,
    )  # fmt: skip
    same(sim, reference.position * length, reference.velocity * length / time, reference.spin / time, RADIUS * length, time)


def test_flying_by(make_simulation):
    """Galilean shift: without gravity and far from the floor, the same collisions at 2 m/s more."""
    drift, nothing, far = np.array([2.0, -1.0, 0.5]), np.zeros(3), {"point": 30 * FLOOR["point"], "normal": FLOOR["normal"]}
    place, velocity, spin, radius = cloud()
    rest = run(make_simulation, place, velocity, spin, radius, far, nothing)
    assert len(rest.contacts().i) > 5
    assert np.abs(rest.particles.spin - spin).max() > 100.0
    sim = run(make_simulation, place, velocity + drift, spin, radius, far, nothing)
    p = rest.particles
    same(sim, p.position + drift * sim.time, p.velocity + drift, p.spin)


@pytest.mark.parametrize("skin", [0.05 * RADIUS, 3.0 * RADIUS])
def test_with_other_lists(reference, make_simulation, skin):
    """Lists made often and short, or once and long: bit for bit (test_bits goes further)."""
    sim = run(make_simulation, *cloud(), engine={"skin": skin})
    for name in ("position", "velocity", "spin"):
        np.testing.assert_array_equal(getattr(sim.particles, name), getattr(reference, name))
