"""Balls that fall and bounce (exact_solutions 4)."""

import math

import numpy as np
import pytest

G = 9.81
FLOOR = ({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},)
ONE_LIST = {"skin": 1.0}  # for the whole run
RADIUS, DENSITY = 5e-3, 2500.0
MASS = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3


def test_heights_fall_by_the_square_of_the_restitution(make_simulation):
    """h_k = h_0 e^(2k); the last of all bounces would be at sqrt(2 h_0/g) (1 + e)/(1 - e).

    Each bounce may err by the 0.0025 of e at 100 steps per contact and by t_c g/v of the speed, 0.15 % here, which gravity
    takes and gives during a contact: 1 % of a height per bounce; and it lasts t_c, 0.2 % of the time.
    """
    e, heights = 0.7, np.array([0.07, 0.073, 0.077, 0.08])
    elastic = 5e7 / (2.0 * (1.0 - 0.3**2))
    speed = math.sqrt(2.0 * G * heights.max())
    depth = (15.0 * MASS * speed**2 / (16.0 * elastic * math.sqrt(RADIUS))) ** 0.4
    duration = 2.943275184 * depth / speed
    place = np.zeros((4, 3))
    place[:, 0] = 0.1 * np.arange(4)
    place[:, 2] = RADIUS + heights
    sim = make_simulation(
        place.tolist(), radius=RADIUS, density=DENSITY, young_modulus=5e7, gravity=[0, 0, -G], walls=FLOOR, restitution=e,
        tangential="mindlin", friction=0.3, step=duration / 100, max_speed=speed, engine=ONE_LIST,
    )  # fmt: skip
    fall = np.sqrt(2.0 * heights / G)
    for k in range(4):
        bounced = fall * (1.0 + 2.0 * sum(e**j for j in range(1, k))) if k else 0.0 * fall
        next_one = fall * (1.0 + 2.0 * sum(e**j for j in range(1, k + 1)))
        assert bounced.max() < next_one.min()
        sim.run(until=0.5 * (bounced.max() + next_one.min()))  # all four fly between the same two bounces
        p = sim.particles
        height = p.position[:, 2] - RADIUS + p.velocity[:, 2] ** 2 / (2.0 * G)
        np.testing.assert_allclose(height, heights * e ** (2 * k), rtol=1e-12 + 0.01 * k)
        # when it will have come down for the last time
        left = (p.velocity[:, 2] + np.sqrt(2.0 * G * height)) / G
        end = sim.time + left + 2.0 * np.sqrt(2.0 * height / G) * e / (1.0 - e)
        np.testing.assert_allclose(end, fall * (1.0 + e) / (1.0 - e), rtol=1e-12 + 0.005 * k)


def test_a_linear_bounce_under_gravity_lasts_as_long_as_it_should(make_simulation):
    """t_c = 2 (pi - atan(v sqrt(k m)/(m g)))/sqrt(k/m) at e = 1, energy kept: 1e-4 at t_c/200."""
    stiffness, speeds = 500.0, np.array([0.005, 0.02, 0.05, 0.2])
    w = math.sqrt(stiffness / MASS)
    duration = 2.0 * (math.pi - np.arctan(speeds * w / G)) / w
    step = duration.min() / 200
    place, velocity = np.zeros((2, 4, 3))
    place[:, 0] = 0.1 * np.arange(4)
    place[:, 2] = RADIUS
    velocity[:, 2] = -speeds
    sim = make_simulation(
        place.tolist(), velocities=velocity.tolist(), radius=RADIUS, density=DENSITY, normal="hooke", stiffness=stiffness,
        restitution=1.0, walls=FLOOR, gravity=[0, 0, -G], step=step, engine=ONE_LIST,
    )  # fmt: skip
    total, seen = [sum(sim.energy().values())], [place[:, 2]]
    while sim.time < duration.max() + 2 * step:
        sim.step(1)
        seen.append(sim.particles.position[:, 2])
        total.append(sum(sim.energy().values()))
    gap = np.array(seen) - RADIUS
    for ball in range(4):
        last = np.argmax(gap[2:, ball] > 0) + 1
        end = sim.dt * (last - gap[last, ball] / (gap[last + 1, ball] - gap[last, ball]))
        assert end == pytest.approx(duration[ball], rel=1e-4)
    swing = np.abs(np.array(total) / total[0] - 1.0)
    # velocity Verlet's energy swings by (w dt)^2/4 of what swings
    assert swing.max() < 0.3 * (w * step) ** 2
