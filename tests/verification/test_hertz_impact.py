"""Head-on impacts: overlap, force and time of contact (exact_solutions 1 and 2, tests 1 to 3 of Chung and Ooi).

    F = K d^(3/2),   d_max = (5 m* v^2/(4 K))^(2/5),   t_c = 2.943275184 d_max/v,   K = (4/3) E* sqrt(R*)

At n steps per contact depth and time err by order 2, less than (pi/n)^2/8 of themselves: 3.1e-5 at n = 200. Where within a step
the contact begins costs the rebound of an elastic impact order 2.4 or better: 1.2e-6 of the speed at n = 200 at worst.
"""

import math

import numpy as np
import pytest

from chung_ooi import CAST_IRON, GLASS, LARGE_ALUMINIUM, LIMESTONE, MAGNESIUM, OXIDE, Sphere, wall_impacts
from warpdem import SceneError, Simulation

# by hand: m* [kg], K [N/m^1.5], d_max [m], F_max [N], t_c [s]; the forces 7108 N and 7233 N also stand in Kratos
WALL_CASES = {
    "aluminium": (LARGE_ALUMINIUM, 0.2, 11.3055448, 3.2433617e10, 4.97171752e-5, 11369.858, 7.31656641e-4),
    "magnesium": (MAGNESIUM, 0.2, 7.53982237, 1.92199212e10, 5.21232883e-5, 7232.681, 7.67065905e-4),
    "oxide": (OXIDE, 3.9, 2.61799388e-4, 2.67483194e10, 8.08880826e-6, 615.3516, 6.10450991e-6),
    "cast iron": (CAST_IRON, 3.9, 4.58148929e-4, 7.11111111e9, 1.71887136e-5, 506.7602, 1.29720806e-5),
}
PAIR_CASES = {
    "glass": (GLASS, 20.0, 5.86430629e-3, 2.3570226e9, 2.74112702e-4, 10696.889, 4.03394557e-5),
    "limestone": (LIMESTONE, 20.0, 5.23598776e-3, 1.00566298e9, 3.68304026e-4, 7108.241, 5.42010049e-5),
}

SECOND_ORDER = (math.pi / 200) ** 2 / 8.0


def on_wall(p):
    """Overlaps with the plane z = 0 [m], negative apart, shape (n,)."""
    return p.radius - p.position[:, 2]


def of_pair(p):
    """Overlap of the two grains on the x axis [m], negative apart, shape (1,)."""
    return p.radius.sum() - np.ptp(p.position[:, 0], keepdims=True)


def watched(sim, overlap, until):
    """Largest overlap [m] and time of contact [s] of each impact; overlap [m] and force [N] at every instant in contact.

    Three instants make the parabola of the largest overlap; begin and end lie on straight lines through two instants.
    """
    seen, curve = [overlap(sim.particles)], []
    while sim.time < until:
        sim.step(1)
        seen.append(overlap(sim.particles))
        contacts = sim.contacts()
        curve.append(np.stack([contacts.overlap, np.linalg.norm(contacts.force, axis=1)], axis=1))
    seen, n = np.array(seen), np.arange(len(seen[0]))
    k = np.argmax(seen, axis=0)
    a, b, c = seen[k - 1, n], seen[k, n], seen[k + 1, n]
    largest = b + (a - c) ** 2 / (16.0 * b - 8.0 * (a + c))
    inside = seen > 0.0
    first, last = inside.argmax(axis=0), len(seen) - 1 - inside[::-1].argmax(axis=0)
    begin = first - seen[first, n] / (seen[first, n] - seen[first - 1, n])
    end = last + seen[last, n] / (seen[last, n] - seen[last + 1, n])
    return largest, (end - begin) * sim.dt, np.concatenate(curve)


def check(case, rigid_wall, largest, time, curve, rounding):
    sphere, speed, mass, stiffness, depth, force, duration = case
    np.testing.assert_allclose(sphere.impact(speed, rigid_wall), (depth, force, duration), rtol=1e-7)
    assert sphere.mass * (1.0 if rigid_wall else 0.5) == pytest.approx(mass, rel=1e-8)
    np.testing.assert_allclose(largest, depth, rtol=SECOND_ORDER)
    np.testing.assert_allclose(time, duration, rtol=SECOND_ORDER)
    np.testing.assert_allclose(stiffness * largest**1.5, force, rtol=1.5 * SECOND_ORDER)
    np.testing.assert_allclose(curve[:, 1], stiffness * curve[:, 0] ** 1.5, rtol=rounding)
    assert len(curve) > 190


@pytest.mark.parametrize("name", WALL_CASES)
def test_impact_on_a_rigid_wall(device, name):
    case = WALL_CASES[name]
    sphere, speed, *_, duration = case
    scene, _ = wall_impacts(sphere, [speed], 0.0, "mindlin", restitution=[1.0], friction=0.1)
    sim = Simulation(scene, device=device, threads=1)
    largest, time, curve = watched(sim, on_wall, 1.1 * duration)
    # a wall of 1e6 times the modulus; the readings K d^(3/2) carry the rounding of d/R = 5e-4
    check(case, True, largest, time, curve, 2e-6)
    np.testing.assert_allclose(sim.particles.velocity, [[0, 0, speed]], rtol=0, atol=5e-6 * speed)
    assert np.all(sim.particles.spin == 0.0)


@pytest.mark.parametrize("precision", ["double", "mixed"])
@pytest.mark.parametrize("name", PAIR_CASES)
def test_impact_of_two_spheres(make_simulation, name, precision):
    case = PAIR_CASES[name]
    sphere, speed, *_, duration = case
    step = duration / 200
    x = sphere.radius + 0.25 * speed * step
    sim = make_simulation(
        [[-x, 0, 0], [x, 0, 0]], velocities=[[0.5 * speed, 0, 0], [-0.5 * speed, 0, 0]], radius=sphere.radius, step=step,
        density=sphere.density, young_modulus=sphere.young_modulus, poisson_ratio=sphere.poisson_ratio, restitution=1.0,
        friction=sphere.friction, tangential="mindlin", max_speed=speed, engine={"precision": precision},
    )  # fmt: skip
    largest, time, curve = watched(sim, of_pair, 1.1 * duration)
    check(case, False, largest, time, curve, 1e-8 if precision == "double" else 1e-6)
    np.testing.assert_allclose(sim.particles.velocity[:, 0], [-0.5 * speed, 0.5 * speed], rtol=5e-6)


# e asked: t_c/t_c0 and d_max/d_max0 of the damped contact, by scipy's integrator at 1e-11
DAMPED = {
    0.05: (1.778, 0.539), 0.1: (1.511, 0.577), 0.2: (1.296, 0.638), 0.3: (1.195, 0.691), 0.4: (1.134, 0.741),
    0.5: (1.093, 0.788), 0.6: (1.064, 0.833), 0.7: (1.042, 0.876), 0.8: (1.025, 0.918), 0.9: (1.011, 0.960),
    0.95: (1.005, 0.980),
}  # fmt: skip


def test_a_damped_impact_is_shallower_and_lasts_longer(device):
    """Tsuji's damping changes depth and time as tabulated to three digits, 1e-3; order 1 to 1.25 adds as much at 400 steps."""
    e, (longer, shallower) = np.array(list(DAMPED)), np.array(list(DAMPED.values())).T
    depth, _, duration = OXIDE.impact(3.9, rigid_wall=True)
    scene, _ = wall_impacts(OXIDE, np.full(len(e), 3.9), 0.0, "mindlin", restitution=e, steps=400)
    sim = Simulation(scene, device=device, threads=1)
    largest, time, _ = watched(sim, on_wall, 1.85 * duration)
    np.testing.assert_allclose(largest / depth, shallower, rtol=2e-3)
    np.testing.assert_allclose(time / duration, longer, rtol=2e-3)


def test_the_sphere_on_steel_of_mercurydpm(device):
    """Weinhart et al. 2024, first self-test: R = 1 mm, 1 m/s, e = 0.4; kinetic energy 5.235988e-6 to 8.377580e-7 J."""
    sphere = Sphere(1e-3, 2500.0, 1.0367299e9 * (1.0 - 0.3**2), 0.3, 0.2, 0.4)
    scene, end = wall_impacts(sphere, [1.0], 0.0, "mindlin", steps=400)
    sim = Simulation(scene, device=device, threads=1)
    assert sim.energy()["kinetic"] == pytest.approx(5.235988e-6, rel=1e-7)
    largest, time, _ = watched(sim, on_wall, end)
    assert largest[0] == pytest.approx(7.2462e-6, rel=2e-3)
    assert time[0] == pytest.approx(3.2663e-5, rel=2e-3)
    # |e_out - e| < 0.002 at 400 steps (test_restitution): twice that over e in the energy
    assert sim.energy()["kinetic"] == pytest.approx(8.377580e-7, rel=0.01)


def test_restitution_of_test_3_on_a_rigid_wall(device):
    """|e_out - e| < 0.005 at 100 steps per contact, for both materials; e = 0 has no logarithm and is refused."""
    e = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
    for sphere in (OXIDE, CAST_IRON):
        scene, end = wall_impacts(sphere, np.full(5, 3.9), 0.0, "mindlin", restitution=e, friction=0.1, steps=100)
        sim = Simulation(scene, device=device, threads=1)
        sim.run(until=end)
        assert len(sim.contacts().i) == 0
        np.testing.assert_allclose(sim.particles.velocity[:, 2] / 3.9, e, rtol=0, atol=0.005)
    with pytest.raises(SceneError, match=r"restitution"):
        wall_impacts(OXIDE, [3.9], 0.0, "mindlin", restitution=[0.0])


def test_an_elastic_impact_converges_in_rebound_and_depth(device):
    """Over 16 phases of the onset: rebound with order 2.4 or better, depth with order 2."""
    steps, speed, phases = (25, 50, 100, 200), 3.9, (np.arange(16) + 0.5) / 16
    depth, _, duration = OXIDE.impact(speed, rigid_wall=True)
    errors = []
    for n in steps:
        scene, _ = wall_impacts(
            OXIDE, np.full(16, speed), 0.0, "mindlin", restitution=np.ones(16), friction=0.1, steps=n, phase=phases
        )
        sim = Simulation(scene, device=device, threads=1)
        largest, _, _ = watched(sim, on_wall, (1.0 + 3.0 / n) * duration)
        errors.append((rms(sim.particles.velocity[:, 2] / speed - 1.0), rms(largest / depth - 1.0)))
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order[0] >= 2.4
    assert order[1] == pytest.approx(2.0, abs=0.2)


def rms(x):
    return math.sqrt(np.mean(x**2))


@pytest.mark.parametrize("e", [0.3, 0.7, 1.0])
def test_a_linear_impact_has_the_time_and_restitution_of_the_damped_oscillator(make_simulation, e):
    """t_c = pi/sqrt(k/m - (gamma/2m)^2), gamma = 2 |beta| sqrt(m k): e at every speed (exact_solutions 2).

    The dashpot's force jumps at onset and end, |beta| w dt of the speed each: that shows in the depth, and cancels in the
    rebound to 2e-4 over eight phases at 400 steps.
    """
    radius, density, stiffness, speed = 5e-3, 2500.0, 500.0, 0.1
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    beta = -math.log(e) / math.hypot(math.log(e), math.pi)
    duration = math.pi / math.sqrt(stiffness / mass * (1.0 - beta**2))
    step = duration / 400
    n = 8
    place = np.zeros((n, 3))
    place[:, 0] = 0.1 * np.arange(n)
    place[:, 2] = radius + speed * step * (np.arange(n) + 0.5) / n
    sim = make_simulation(
        place.tolist(), velocities=[[0, 0, -speed]] * n, radius=radius, density=density, normal="hooke", stiffness=stiffness,
        restitution=e, walls=({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},), step=step,
    )  # fmt: skip
    largest, time, _ = watched(sim, on_wall, 1.05 * duration)
    jump = beta * math.pi / 400
    np.testing.assert_allclose(time, duration, rtol=1e-4)
    np.testing.assert_allclose(sim.particles.velocity[:, 2] / speed, e, rtol=0, atol=2e-4)
    # v/w exp(-beta/sqrt(1-beta^2) atan(sqrt(1-beta^2)/beta)) is the first turning point of the oscillator
    damped = math.sqrt(1.0 - beta**2)
    turn = math.exp(-beta / damped * math.atan2(damped, beta)) * speed / math.sqrt(stiffness / mass)
    np.testing.assert_allclose(largest, turn, rtol=1e-4 + jump)
