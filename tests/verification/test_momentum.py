"""Grains collide off centre, spinning, with friction: no momentum is lost (exact_solutions 3 and 9)."""

import numpy as np
import pytest


def test_linear_and_angular_momentum_are_conserved_to_round_off_at_every_instant(make_simulation):
    # torque arms add up to the distance of the centres, so the angular momentum about any fixed point is constant
    velocity = np.array([[0.3, 0.1, -0.05], [-0.4, 0.0, 0.02]])
    sim = make_simulation(
        [[-1.01e-3, 0.2e-3, 0.0], [1.3e-3, -0.3e-3, 0.4e-3]],
        radius=[1.0e-3, 1.25e-3],
        velocities=velocity,
        spins=[[300.0, -200.0, 500.0], [-100.0, 400.0, 250.0]],
        young_modulus=5e7,
        restitution=0.7,
        tangential="mindlin",
        friction=0.4,
        step=2e-7,
    )
    p = sim.particles
    mass, inertia, radius = p.mass, p.inertia, p.radius
    point = np.array([0.01, -0.02, 0.005])

    def momenta():
        p = sim.particles
        linear = mass @ p.velocity
        moment = np.cross(p.position - point, p.velocity)
        return linear, mass @ moment + inertia @ p.spin

    speed = np.linalg.norm(velocity, axis=1)
    linear_scale = mass @ speed
    arm = np.linalg.norm(p.position - point, axis=1)
    angular_scale = (mass * arm) @ speed + inertia @ np.linalg.norm(p.spin, axis=1)
    linear, angular = momenta()
    spin_before, touched, slid = p.spin, False, 0.0
    for _ in range(60):
        sim.step(60)
        now = momenta()
        np.testing.assert_allclose(now[0], linear, rtol=0, atol=1e-12 * linear_scale)
        np.testing.assert_allclose(now[1], angular, rtol=0, atol=1e-12 * angular_scale)
        contacts = sim.contacts()
        if len(contacts.i):
            touched = True
            slid = max(slid, float(np.linalg.norm(np.cross(contacts.force[0], contacts.normal[0]))))
    assert touched
    assert len(sim.contacts().i) == 0, "the collision has not ended"
    assert slid > 0
    assert np.all(np.linalg.norm(sim.particles.spin - spin_before, axis=1) > 10.0), "friction turned nothing"
    assert radius[0] != radius[1]


# float32 forces act on both grains alike: linear momentum is as in double; their torques have rounded arms
@pytest.mark.parametrize(("precision", "of_moment"), [("double", 1e-12), ("mixed", 1e-6)])
def test_a_cloud_keeps_its_momenta(make_simulation, precision, of_moment):
    """64 unequal grains that fly together and bounce on: drift over 1e4 steps against sum m|v| and its moment."""
    rng, n = np.random.default_rng(9), 64
    place = (np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3) - 1.5) * 2.2e-3
    sim = make_simulation(
        place, velocities=-40.0 * place + rng.normal(0, 0.02, place.shape), spins=rng.normal(0, 100.0, (n, 3)),
        radius=rng.uniform(0.5e-3, 1e-3, n), young_modulus=1e7, restitution=0.8, tangential="mindlin", friction=0.4, step=4e-6,
        engine={"precision": precision},
    )  # fmt: skip
    p = sim.particles
    mass, inertia, velocity = p.mass, p.inertia, p.velocity

    def momenta():
        return mass @ p.velocity, mass @ np.cross(p.position, p.velocity) + inertia @ p.spin

    speed, distance, spin = (np.linalg.norm(x, axis=1) for x in (velocity, place, p.spin))
    scales = 1e-12 * mass @ speed, of_moment * ((mass * distance) @ speed + inertia @ spin)
    start, touched = momenta(), 0
    for _ in range(20):
        sim.step(500)
        touched += len(sim.contacts().i)
        for now, then, tolerance in zip(momenta(), start, scales, strict=True):
            np.testing.assert_allclose(now, then, rtol=0, atol=tolerance)
    assert touched > 20
    assert np.mean(np.linalg.norm(p.velocity - velocity, axis=1) > 0.01) > 0.9, "most have met another"
