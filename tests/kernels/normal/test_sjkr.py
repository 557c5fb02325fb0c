import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from warpdem.kernels.normal import hertz, sjkr

from law_probe import Contacts
from law_scenes import HERTZ, MASS, POISSON, RADIUS, YOUNG, contact_time, impacts, parting_speeds
from model_probes import RTOL
from warpdem import Simulation
from warpdem.model.impact import rebound

BED = {"cohesion_energy_density": 2e4}
"""Keys of the pair of materials in the bed of ``test_laws_anywhere``."""
GRAIN = SimpleNamespace(young_modulus=YOUNG, poisson_ratio=POISSON)
COHESION = 1.0e5  # [J/m3]
PAIR = SimpleNamespace(restitution=1.0, cohesion_energy_density=COHESION)
MADE = sjkr.coefficients(GRAIN, GRAIN, PAIR)


def contacts(a=RADIUS, b=RADIUS, **keywords):
    """Of two spheres; ``b`` infinite: of a sphere and a wall."""
    if math.isinf(b):
        return Contacts(sjkr, MADE, a, MASS, 0.0, **keywords)
    return Contacts(sjkr, MADE, a * b / (a + b), 0.5 * MASS, 1.0 / (a + b), **keywords)


def lens(a, b, d):
    """Area of the disc in which spheres cut each other, from Heron's formula for the radii and the distance [m2]."""
    if math.isinf(b):
        return math.pi * (a**2 - (a - d) ** 2)
    r = a + b - d
    return math.pi / 4.0 * (a + b - r) * (r + a - b) * (r - a + b) * (r + a + b) / r**2


@pytest.mark.parametrize(("a", "b"), [(1e-3, 1e-3), (1e-3, 0.3e-3), (1e-3, math.inf)])
def test_force_is_that_of_hertz_less_the_pull_of_the_lens(real, a, b):
    made, depth = contacts(a, b, real=real), np.array([1e-7, 2e-5, 1e-4])
    reduced = a if math.isinf(b) else a * b / (a + b)
    spring = HERTZ * math.sqrt(reduced / (0.5 * RADIUS)) * depth**1.5
    pull = COHESION * np.array([lens(a, b, d) for d in depth])
    found = made.force(depth)
    # Heron's formula loses the digits of d/R
    close = {"rtol": max(1e-11, 20 * RTOL[real]), "atol": 2 * RTOL[real] * spring.max()}
    np.testing.assert_allclose(found["force"] - spring, -pull, **close)
    np.testing.assert_allclose(found["load"], spring, rtol=5 * RTOL[real])
    assert not made.force([0.0, -1e-7])["force"].any()


def test_the_number_that_liggghts_gives():
    """LIGGGHTS 3.8, ``cohesion sjkr``, reference pair at an overlap of 20 um [N]."""
    assert contacts().force([2e-5])["force"][0] == pytest.approx(0.008400245271371, rel=3e-13, abs=0)


def test_force_is_minus_the_gradient_of_the_energy():
    for a, b in ((1e-3, 1e-3), (1e-3, 0.3e-3), (1e-3, math.inf)):
        made = contacts(a, b)
        own = dict(zip(sjkr.COEFFICIENTS, made.constants[3:], strict=True))
        for d in (2e-5, 1e-4):
            work = quad(lambda x, made=made: made.force([x])["force"][0], 0.0, d, epsabs=0, epsrel=1e-9)[0]
            assert sjkr.energy(d, made.constants[0], **own) == pytest.approx(work, rel=1e-8, abs=0)
        assert sjkr.energy(-1e-5, made.constants[0], **own) == 0.0
        assert sjkr.secant(1e-4, made.constants[0], **own) == pytest.approx(made.constants[0] * 1e-2, rel=1e-14)
    at_wall = sjkr.own_constants(1e-3, *MADE[4:])
    np.testing.assert_allclose([float(x) for x in at_wall.values()], contacts(1e-3, math.inf).constants[3:], rtol=1e-15)


def test_coefficients_are_those_of_hertz_and_the_cohesion():
    assert MADE[:4] == hertz.coefficients(GRAIN, GRAIN, PAIR)
    assert MADE[4] == pytest.approx(math.pi / 4 * COHESION, rel=1e-15)


def test_overlap_at_rest_and_least_force_of_the_reference_pair():
    """Equal spheres cut each other in a disc of area pi (R d - d^2/4): with x = sqrt(d), K x = pi k_c (R - x^2/4) at rest."""
    pull = math.pi * COHESION
    rest = (2.0 * pull * RADIUS / (HERTZ + math.sqrt(HERTZ**2 + pull**2 * RADIUS))) ** 2
    assert rest == pytest.approx(3.67111091629316e-6, rel=1e-14, abs=0)
    made = contacts()
    force = made.force([(1.0 - 1e-9) * rest, rest, (1.0 + 1e-9) * rest])["force"]
    assert abs(force[1]) < 1e-14 * HERTZ * rest**1.5 and force[0] < force[1] < force[2]
    assert made.force(np.linspace(1e-7, 3.6e-6, 200_001))["force"].min() == pytest.approx(-1.70965808e-4, rel=4e-9, abs=0)


def test_an_impact_of_the_reference_pair_is_that_of_its_energy():
    """Deepest overlap and contact time: of the equation of motion, against quadratures of the energy by another program."""
    made, mass = contacts(), 0.5 * MASS

    def stops(_, y):
        return y[1]

    stops.terminal, stops.direction = True, -1
    out = solve_ivp(lambda _, y: [y[1], -made.force([y[0]])["force"][0] / mass], (0, 1e-3), [0.0, 0.1], events=stops,
                    method="DOP853", rtol=1e-13, atol=1e-18, max_step=2e-6)  # fmt: skip
    assert out.y[0, -1] == pytest.approx(1.5850146873039e-5, rel=1e-10, abs=0)
    assert 2.0 * out.t[-1] == pytest.approx(4.30903822831e-4, rel=1e-10, abs=0)


def test_an_impact_gives_back_all_of_its_energy_and_lasts_as_long_as_it_should():
    errors, deepest, lasted = {}, {}, {}
    for steps in (100, 200, 400):
        dt = contact_time(0.1) / steps
        sim = Simulation(impacts("sjkr", {"cohesion_energy_density": COHESION}, 0.1, dt, phases=4), device="cpu", threads=1)
        deepest[steps], touching = 0.0, 0
        for _ in range(2 * steps):
            sim.step(1)
            of_pairs = sim.contacts().overlap[sim.contacts().j >= 0]
            deepest[steps], touching = max(deepest[steps], of_pairs.max(initial=0.0)), touching + (of_pairs > 0).sum()
        errors[steps] = np.abs(np.array(parting_speeds(sim, 4)) / 0.1 - 1.0).max()
        lasted[steps] = touching / 4 * dt
    assert errors[400] < 1e-4 and errors[100] / errors[400] > 8.0
    assert deepest[400] == pytest.approx(1.585014687e-5, rel=1e-4, abs=0)
    assert lasted[400] == pytest.approx(4.309038228e-4, rel=2e-3, abs=0)


def test_contacts_of_a_run_know_both_radii():
    """A pair of unequal grains and one grain on a plane, at rest, as they are read."""
    small, depth = 0.4e-3, 3e-5
    scene = impacts("sjkr", {"cohesion_energy_density": COHESION}, 0.1, 1e-6, phases=1)
    group = scene.grains[0].model_copy(update={
        "radius": None, "radii": np.array([RADIUS, small, RADIUS]), "velocities": np.zeros((3, 3)),
        "positions": np.array([[0, 0, 0.1], [RADIUS + small - depth, 0, 0.1], [0, 0.1, RADIUS - depth]]),
    })  # fmt: skip
    sim = Simulation(scene.model_copy(update={"grains": [group]}), device="cpu", threads=1)
    c = sim.contacts()
    made = [contacts(RADIUS, small), contacts(RADIUS, math.inf)]
    force = np.einsum("ij,ij->i", c.force, c.normal)
    np.testing.assert_allclose(force, [m.force([depth])["force"][0] for m in made], rtol=1e-10)
    energies = [
        sjkr.energy(depth, m.constants[0], **dict(zip(sjkr.COEFFICIENTS, m.constants[3:], strict=True))) for m in made
    ]
    assert sim.energy()["elastic"] == pytest.approx(sum(energies), rel=1e-10, abs=0)


def test_the_estimate_of_check_gives_back_what_a_run_does():
    speed, phases = 0.05, 32
    step = contact_time(speed) / 15.0
    pair = {"restitution": 0.8, "cohesion_energy_density": COHESION}
    sim = Simulation(impacts("sjkr", pair, speed, step, phases=phases), device="cpu", threads=1)
    sim.run(until=60.0 * step)
    met = parting_speeds(sim, phases)[1] / speed
    made = sjkr.coefficients(GRAIN, GRAIN, SimpleNamespace(**pair))
    own = dict(zip(sjkr.COEFFICIENTS, made[4:], strict=True))
    told = rebound("sjkr", made[0], made[1], MASS, RADIUS, speed, step, own)
    np.testing.assert_allclose(told, met, rtol=0, atol=1e-6)
    assert abs(met.mean() - 0.8) > 0.02, "the pull shows"
