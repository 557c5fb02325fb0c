"""One grain on an inclined floor: sliding, rolling, held by rolling friction; spin about the normal (exact_solutions 5).

Gravity is tilted by th over a level floor. With the torque arm a = R - d:

    rolls   if tan(th) <= (1 + (5/2)(a/R)^2) mu:   acceleration g sin(th)/(1 + (2/5)(R/a)^2)      (7/2 and 5/7 for a = R)
    slides  otherwise:                              g (sin(th) - mu cos(th)),   w' = (5/2) mu g cos(th) a/R^2
"""

import math

import numpy as np
import pytest

G, MU = 9.81, 0.3
FLOOR = ({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},)
RHO, NU = 2500.0, 0.3


def on_incline(make_simulation, tangent, *, radius=5e-3, young_modulus=5e6, gravity=G, **keys):
    """A grain put down at its overlap on a floor of slope ``tangent``, and the torque's arm [m]."""
    angle = math.atan(tangent)
    mass = RHO * 4.0 / 3.0 * math.pi * radius**3
    stiffness = 4.0 / 3.0 * young_modulus / (2.0 * (1.0 - NU**2)) * math.sqrt(radius)
    rest = (mass * gravity * math.cos(angle) / stiffness) ** (2.0 / 3.0)
    keys = {"friction": MU, "tangential": "mindlin", "restitution": 0.3, "step": 2e-5} | keys
    keys["engine"] = {"skin": 1.0}  # one list for the whole run
    sim = make_simulation(
        [[0.0, 0.0, radius - rest]], radius=radius, young_modulus=young_modulus, density=RHO, poisson_ratio=NU, walls=FLOOR,
        gravity=[gravity * math.sin(angle), 0.0, -gravity * math.cos(angle)], **keys,
    )  # fmt: skip
    return sim, radius - rest


def accelerations(sim, first, last):
    """Mean acceleration down the slope [m/s2] and of the spin [rad/s2] between two times."""
    seen = []
    for time in (first, last):
        sim.run(until=time)
        seen.append((sim.time, sim.particles.velocity[0, 0], sim.particles.spin[0, 1]))
    (t1, v1, w1), (t2, v2, w2) = seen
    return (v2 - v1) / (t2 - t1), (w2 - w1) / (t2 - t1)


@pytest.mark.parametrize("law", ["mindlin", "mindlin_displacement"])
@pytest.mark.parametrize("share", [0.3, 0.97, 1.03, 2.0])
def test_a_grain_rolls_up_to_seven_halves_of_mu_and_slides_beyond(make_simulation, law, share):
    """After 0.1 s the spring's swing, exp(-350 t/s), is over, and a constant acceleration is integrated exactly."""
    radius = 5e-3
    sim, arm = on_incline(make_simulation, share * 3.5 * MU, tangential=law)
    angle = math.atan(share * 3.5 * MU)
    a, alpha = accelerations(sim, 0.1, 0.2)
    if share < 1.0:
        assert a == pytest.approx(G * math.sin(angle) / (1.0 + 0.4 * (radius / arm) ** 2), rel=1e-10)
        assert alpha * arm == pytest.approx(a, rel=1e-10)
        assert a == pytest.approx(5.0 / 7.0 * G * math.sin(angle), rel=2 * (radius - arm) / radius)
    else:
        assert a == pytest.approx(G * (math.sin(angle) - MU * math.cos(angle)), rel=1e-10)
        assert alpha == pytest.approx(2.5 * MU * G * math.cos(angle) * arm / radius**2, rel=1e-10)


def test_the_sliding_sphere_of_mercurydpm(make_simulation):
    """Weinhart et al. 2024, second self-test: R = 1 mm, body force (5, 0, -5) m/s2, mu = 0.2: v = 4 t, w = 2500 t.

    At 5 ms 0.0200 m/s and 12.5 rad/s, the latter with the arm 1 - d/R.
    """
    sim, arm = on_incline(
        make_simulation, 1.0, radius=1e-3, young_modulus=1e8, gravity=math.hypot(5, 5), friction=0.2, step=1e-6
    )
    sim.run(until=5e-3)
    assert 1.0 - arm / 1e-3 < 1e-3
    # the spring loads to its limit in mu F_n/k_t: 0.2 % of the time
    assert sim.particles.velocity[0, 0] == pytest.approx(0.0200, rel=5e-3)
    assert sim.particles.spin[0, 1] == pytest.approx(12.5, rel=5e-3)


MU_R = 0.1


@pytest.mark.parametrize("model", ["constant", "spring"])
def test_rolling_friction_holds_below_its_slope_and_slows_above(make_simulation, model):
    """Stays if tan(th) < mu_r, else a = (5/7) g (sin - mu_r cos) within 0.5 % (d/R < 1e-3)."""
    hard = {"young_modulus": 5e8, "step": 1e-5, "rolling": model, "rolling_friction": MU_R}
    sim, _ = on_incline(make_simulation, 0.9 * MU_R, **hard)
    sim.run(until=0.1)
    # one step of the constant torque would be 2.5 mu_r g dt/R of spin; the spring bends by less than its limit
    assert np.abs(sim.particles.velocity).max() < 1e-3 * MU_R * G * sim.dt
    assert sim.particles.position[0, 0] < (1e-6 if model == "constant" else 0.1 * 5e-3)
    for share in (1.5, 3.0):
        sim, _ = on_incline(make_simulation, share * MU_R, **hard)
        angle = math.atan(share * MU_R)
        a, alpha = accelerations(sim, 0.1, 0.2)
        assert a == pytest.approx(5.0 / 7.0 * G * (math.sin(angle) - MU_R * math.cos(angle)), rel=5e-3)
        assert alpha * 5e-3 == pytest.approx(a, rel=5e-3)


@pytest.mark.parametrize("model", ["constant", "spring"])
def test_a_spin_about_the_normal_goes_on_without_torsion(make_simulation, model):
    """Neither friction at a point nor rolling resistance without torsion touches it."""
    sim, _ = on_incline(make_simulation, 0.0, rolling=model, rolling_friction=MU_R, spins=[[0, 0, 100.0]])
    sim.step(2000)
    assert sim.particles.spin[0, 2] == pytest.approx(100.0, rel=1e-12)
    assert np.abs(sim.particles.spin[0, :2]).max() < 1e-9
    assert np.abs(sim.particles.velocity).max() < 1e-12
