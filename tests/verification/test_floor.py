"""One grain on a floor: at rest, sliding, rolling (exact_solutions 4 and 5)."""

import math

import numpy as np
import pytest

G = 9.81
FLOOR = ({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},)
RHO, NU = 2500.0, 0.3


def grain(radius, young_modulus):
    """Mass [kg] and overlap at rest [m] of a grain on a floor: m g = K_w d^(3/2)."""
    mass = RHO * 4.0 / 3.0 * math.pi * radius**3
    stiffness = 4.0 / 3.0 * young_modulus / (2.0 * (1.0 - NU**2)) * math.sqrt(radius)
    return mass, (mass * G / stiffness) ** (2.0 / 3.0)


R, E = 5e-3, 5e6  # the sphere of exact_solutions 4
MASS, REST = grain(R, E)


def on_floor(make_simulation, radius, young_modulus, height, **keys):
    keys = {"friction": 0.3, "tangential": "mindlin", "restitution": 0.3} | keys
    return make_simulation(
        [[0.0, 0.0, height]],
        radius=radius,
        young_modulus=young_modulus,
        density=RHO,
        poisson_ratio=NU,
        gravity=[0, 0, -G],
        walls=FLOOR,
        **keys,
    )


def test_the_static_overlap_is_the_tabulated_one():
    # the table's floor is rigid; this one is as soft as the grain, which halves E*
    assert REST / 2 ** (2 / 3) == pytest.approx(8.501655937e-6, rel=1e-9, abs=0)


def test_a_grain_put_down_at_its_static_overlap_stays_there(make_simulation):
    sim = on_floor(make_simulation, R, E, R - REST, step=2e-5)
    sim.step(5000)
    # z carries d to eps R/d = 1.3e-13; kick and gravity cancel to a rounding per step, held by the damped spring
    assert sim.contacts().overlap[0] == pytest.approx(REST, rel=1e-9, abs=0)
    assert np.abs(sim.particles.velocity).max() < 1e-13
    assert np.all(sim.particles.spin == 0.0)


def test_a_dropped_grain_settles_at_the_static_overlap(make_simulation):
    sim = on_floor(make_simulation, R, E, R + 1e-5, step=2e-5)
    # rate of decay |beta| sqrt(1.5 g/d) sqrt(5/6)... at least 0.3 * 1300 / s: exp(-0.3 * 1300 * 0.1) = 1e-17
    sim.step(5000)
    assert sim.contacts().overlap[0] == pytest.approx(REST, rel=1e-9, abs=0)


MU, V0 = 0.3, 0.2


@pytest.fixture(params=["mindlin", "mindlin_displacement"])
def sliding(request, make_simulation):
    return on_floor(
        make_simulation, R, E, R - REST, step=2e-5, velocities=[[V0, 0, 0]], tangential=request.param, friction=MU
    )


def test_a_sliding_grain_is_slowed_by_mu_g_and_ends_rolling_at_five_sevenths(sliding):
    """Slip ends at t = 2 v0/(7 mu g); then v = (5/7) v0 (exact_solutions 5), with the arm a = R - d of the torque."""
    sim, arm, end = sliding, R - REST, 2.0 * V0 / (7.0 * MU * G)
    seen = []
    for share in (0.3, 0.9):
        sim.run(until=share * end)
        seen.append((sim.time, sim.particles.velocity[0], sim.particles.spin[0]))
    (t1, v1, w1), (t2, v2, w2) = seen
    # gross sliding: constant acceleration, which the scheme integrates exactly
    np.testing.assert_allclose((v2 - v1) / (t2 - t1), [-MU * G, 0, 0], rtol=0, atol=1e-9 * MU * G)
    np.testing.assert_allclose((w2 - w1) / (t2 - t1), [0, 2.5 * MU * G * arm / R**2, 0], rtol=0, atol=1e-9 * MU * G / R)
    assert sim.contacts().force[0] @ [1, 0, 0] == pytest.approx(-MU * MASS * G, rel=1e-9)
    sim.run(until=4.0 * end)  # the tangential spring swings out as exp(-350 t/s): 1e-9 of its last stretch is left
    v, w = sim.particles.velocity[0], sim.particles.spin[0]
    # friction acts in the floor's plane, so m a v + I w is conserved: v = v0 q/(1 + q), q = (5/2)(a/R)^2, 5/7 for a = R
    q = 2.5 * (arm / R) ** 2
    assert v[0] == pytest.approx(V0 * q / (1.0 + q), rel=1e-9)
    assert v[0] == pytest.approx(5.0 / 7.0 * V0, rel=REST / R)
    assert w[1] * arm == pytest.approx(v[0], rel=1e-9)
    # it began to roll when it should: what was left to lose at 0.9 t goes at mu g
    rolled_from = t2 + (v2[0] - v[0]) / (MU * G)
    assert rolled_from == pytest.approx(end, rel=5e-3)


MU_R, STIFF = 0.05, 5e8


def rolling(make_simulation, model):
    """A grain that rolls on a hard floor (d/R < 1e-3), its speed and the exact stopping time and way."""
    speed = 0.05
    _, rest = grain(R, STIFF)
    assert rest / R < 1e-3
    sim = on_floor(
        make_simulation, R, STIFF, R - rest, step=1e-5, velocities=[[speed, 0, 0]], rolling=model,
        spins=[[0, speed / (R - rest), 0]], friction=MU, rolling_friction=MU_R,
    )  # fmt: skip
    return sim, speed, 7.0 * speed / (5.0 * MU_R * G), 7.0 * speed**2 / (10.0 * MU_R * G)


@pytest.mark.parametrize("model", ["constant", "spring"])
def test_rolling_friction_stops_a_grain_where_it_should_and_it_stays(make_simulation, model):
    """Deceleration (5/7) mu_r g: t = 7 v0/(5 mu_r g), way 7 v0^2/(10 mu_r g), 0.5 % (exact_solutions 5)."""
    sim, speed, time, way = rolling(make_simulation, model)
    if model == "spring":
        # while the spring loads, its dashpot acts beyond the limit: the law holds from when the spring slides
        sim.run(until=0.1 * time)
    x1, v1, t1 = sim.particles.position[0, 0], sim.particles.velocity[0, 0], sim.time
    share = v1 / speed
    sim.run(until=t1 + 0.75 * share * time)
    v2, t2 = sim.particles.velocity[0, 0], sim.time
    slowing = (v1 - v2) / (t2 - t1)
    assert slowing == pytest.approx(5.0 / 7.0 * MU_R * G, rel=5e-3)
    assert t2 + v2 / slowing == pytest.approx(t1 + share * time, rel=5e-3)
    sim.run(until=6.0 * time)  # the rolling spring swings out as exp(-0.3 * 250 t/s)
    place = sim.particles.position[0, 0]
    assert place - x1 == pytest.approx(share**2 * way, rel=5e-3)
    # then it stays: not even by what one step of the torque makes of the spin, 2.5 mu_r g dt/R
    jitter = []
    for _ in range(10):
        sim.step(500)
        jitter.append(max(np.abs(sim.particles.spin[0] * R).max(), np.abs(sim.particles.velocity[0]).max()))
        assert abs(sim.particles.position[0, 0] - place) < 1e-6 * way
    assert max(jitter[5:]) <= 1.01 * max(jitter[:5]) + 1e-15
    assert jitter[-1] < 1e-12 * speed
