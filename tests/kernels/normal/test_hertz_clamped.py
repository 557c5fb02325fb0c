import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from warpdem.kernels.normal import hertz, hertz_clamped

from law_scenes import MASS, contact_time, impacts, parting_speeds
from warpdem import Simulation

BED = {"restitution": 0.3}
"""Keys of the pair of materials in the bed of ``test_laws_anywhere``."""
GLASS = SimpleNamespace(young_modulus=5e6, poisson_ratio=0.3)
RESTITUTIONS = (0.05, 0.1, 0.3, 0.5, 0.9, 0.99)
PHASES = 16


def run(normal: str, restitution: float, steps: int, speed: float = 0.2, **keywords) -> Simulation:
    """Impacts followed until all have parted."""
    scene = impacts(normal, {"restitution": restitution}, speed, contact_time(speed) / steps, phases=PHASES, **keywords)
    sim = Simulation(scene, device="cpu", threads=1)
    sim.run(until=2.0 * hertz_clamped.damped_time(restitution) * contact_time(speed))
    assert not (sim.contacts().overlap > 0.0).any(), "a contact has not ended"
    return sim


@pytest.mark.parametrize("restitution", RESTITUTIONS)
def test_restitution_and_time_of_the_equation_of_motion_are_those_of_the_closed_form(restitution):
    damping = math.sqrt(5.0) * hertz_clamped.damping_ratio(restitution)

    def rate(_, y):
        depth = max(y[0], 0.0)
        return [y[1], -max(depth**1.5 + damping * depth**0.25 * y[1], 0.0)]

    def opens(_, y):
        return y[0]

    opens.terminal, opens.direction = True, -1
    early = 1e-9
    out = solve_ivp(rate, (0.0, 100.0), [early, 1.0], events=opens, rtol=1e-10, atol=1e-13)
    assert -out.y[1, -1] == pytest.approx(restitution, abs=1e-8)
    undamped = 2.943275184 * 1.25**0.4
    assert (out.t[-1] + early) / undamped == pytest.approx(hertz_clamped.damped_time(restitution), rel=5e-6)


@pytest.mark.parametrize("ratio", [1e-3, 0.3, 1.0 / math.sqrt(2.0), 0.999, 1.001, 5.0])
def test_given_back_is_the_closed_form_of_linear_springs(ratio):
    """Schwager and Poeschel 2007, equations 12 and 21, written with the angle of their arctangent."""
    if ratio < 1.0:
        root = math.sqrt(1.0 - ratio**2)
        exponent = ratio / root * (math.pi - math.atan2(2.0 * ratio * root, 1.0 - 2.0 * ratio**2))
    else:
        root = math.sqrt(ratio**2 - 1.0)
        exponent = ratio / root * math.log((ratio + root) / (ratio - root))
    assert hertz_clamped.given_back(ratio) == pytest.approx(math.exp(-exponent), rel=1e-12)


def test_only_the_dashpot_is_another_one_than_in_hertz():
    pair = SimpleNamespace(restitution=0.5)
    theirs, ours = hertz.coefficients(GLASS, GLASS, pair), hertz_clamped.coefficients(GLASS, GLASS, pair)
    assert (ours[0], ours[2:]) == (theirs[0], theirs[2:])
    assert ours[1] == pytest.approx(math.sqrt(5.0) * hertz_clamped.damping_ratio(0.5), rel=1e-14)
    assert ours[1] > 1.1 * theirs[1]
    assert hertz_clamped.coefficients(GLASS, GLASS, SimpleNamespace(restitution=1.0))[1] == 0.0
    assert hertz_clamped.damped_time(1.0) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("restitution", [0.1, 0.5, 0.9])
def test_the_restitution_asked_for_is_obtained_in_pairs_and_at_a_wall_and_better_with_smaller_steps(restitution):
    worst = {}
    for steps in (40, 160):
        errors = np.array(parting_speeds(run("hertz_clamped", restitution, steps), PHASES)) / 0.2 - restitution
        worst[steps] = np.abs(errors).max()
    assert worst[40] < 0.006
    assert worst[160] < worst[40] / 4.0


def test_friction_takes_its_limit_from_the_impulse_of_the_impact_and_from_more_with_hertz():
    """Grains that slide all along at a plane lose mu (1 + e) v_n across; with an attraction at the end 3.3 % more."""
    mu, e = 0.1, 0.5
    change = {"contact": {"tangential": "mindlin"}, "across": 1.0}
    lost = {}
    for normal in ("hertz_clamped", "hertz"):
        scene = impacts(normal, {"restitution": e, "friction": mu}, 0.2, contact_time(0.2) / 400, phases=PHASES, **change)
        sim = Simulation(scene, device="cpu", threads=1)
        sim.run(until=2.5 * contact_time(0.2))
        v = sim.particles.velocity[2 * PHASES :]
        lost[normal] = (1.0 - v[:, 1]) / (mu * (0.2 + v[:, 2]))
    np.testing.assert_allclose(lost["hertz_clamped"], 1.0, rtol=1e-12)
    # (1 + e at the end of the push)/(1 + e): the speed there is that of a clamped contact with Tsuji's damping
    ratio = hertz.coefficients(GLASS, GLASS, SimpleNamespace(restitution=e))[1] / math.sqrt(5.0)
    expected = (1.0 + hertz_clamped.given_back(ratio)) / (1.0 + e)
    assert expected == pytest.approx(1.0335, abs=5e-5)
    np.testing.assert_allclose(lost["hertz"], expected, rtol=1e-3)


def test_no_force_attracts_and_the_energy_that_is_lost_is_that_of_the_damping():
    e, steps = 0.3, 400
    scene = impacts("hertz_clamped", {"restitution": e}, 0.2, contact_time(0.2) / steps, phases=4, measures={"energy": True})
    sim = Simulation(scene, device="cpu", threads=1)
    least, seen = 0.0, 0
    while sim.time < 2.0 * contact_time(0.2):
        sim.step(7)
        c = sim.contacts()
        force = np.einsum("ij,ij->i", c.force, c.normal)
        least, seen = min(least, force.min(initial=0.0)), seen + len(force)
    assert least == 0.0
    assert seen > 400
    lost = (1.0 - e**2) * 0.5 * 0.2**2 * MASS * (0.5 + 1.0) * 4
    budget = sim.budget.energy()
    assert budget["dissipated_normal_damping"] == pytest.approx(lost, rel=2e-3)
    assert abs(budget["integration_error"]) < 1e-3 * lost
