import math
from types import SimpleNamespace

import numpy as np
import pytest
from warpdem.kernels.normal import dmt, hertz

from law_probe import Contacts
from law_scenes import ELASTIC, HERTZ, MASS, POISSON, RADIUS, YOUNG, contact_time, impacts, parting_speeds
from model_probes import RTOL
from warpdem import Simulation

BED = {"surface_energy": 0.02, "tail_length": "2 um"}
"""Keys of the pair of materials in the bed of ``test_laws_anywhere``."""
GRAIN = SimpleNamespace(young_modulus=YOUNG, poisson_ratio=POISSON)
W, TAIL, REDUCED = 0.1, 0.4e-6, 0.5 * RADIUS
PULL = 2.0 * math.pi * W * REDUCED
PHASES = 16


def pair(tail=0.0, restitution=1.0):
    return SimpleNamespace(restitution=restitution, surface_energy=W, tail_length=tail)


def contacts(tail=0.0, real=None, restitution=1.0):
    given = dmt.coefficients(GRAIN, GRAIN, pair(tail, restitution))
    return Contacts(dmt, given, REDUCED, 0.5 * MASS, **({"real": real} if real else {}))


@pytest.mark.parametrize("tail", [0.0, TAIL])
def test_force_in_contact_is_that_of_hertz_less_the_pull(real, tail):
    d = np.array([1e-9, 1e-7, 1e-6, 1e-5])
    made = contacts(tail, real).force(d)
    np.testing.assert_allclose(made["force"], HERTZ * d**1.5 - PULL, rtol=3 * RTOL[real], atol=PULL * RTOL[real])
    np.testing.assert_allclose(made["load"], HERTZ * d**1.5, rtol=3 * RTOL[real])
    np.testing.assert_allclose(made["k_n"], HERTZ * d**0.5, rtol=3 * RTOL[real])
    assert (made["depth"] == made["depth_before"]).all()


def test_the_tail_is_van_der_waals_force_and_ends_where_a_thousandth_is_left(real):
    gap = np.array([0.0, 0.1, 1.0, 10.0, 30.6]) * TAIL
    hamaker = 12.0 * math.pi * W * TAIL**2
    made = contacts(TAIL, real).force(-gap)
    np.testing.assert_allclose(made["force"], -hamaker * REDUCED / (6.0 * (gap + TAIL) ** 2), rtol=4 * RTOL[real])
    assert not made["load"].any() and not made["k_n"].any()
    end = (math.sqrt(1000.0) - 1.0) * TAIL
    inside, outside = contacts(TAIL, real).force([-end * 0.99999, -end * 1.00001])["force"]
    assert inside == pytest.approx(-1e-3 * PULL, rel=1e-4, abs=0)
    assert outside == 0.0
    assert dmt.gap(GRAIN, GRAIN, pair(TAIL), REDUCED) == pytest.approx(end, rel=1e-12, abs=0)


def test_nothing_acts_beyond_contact_without_a_tail_but_in_the_step_of_the_jump(real):
    made = contacts(0.0, real)
    assert not made.force([-1e-12, -1e-7])["force"].any()
    share = np.array([0.1, 0.5, 0.9])
    d = 1e-9 * share  # so small that the spring is nothing: the touch, then the end, share of the step inside
    begun = made.force(d, d - 1e-9)["force"]
    np.testing.assert_allclose(begun, -PULL * (0.5 + share), rtol=2e-3)
    ended = made.force(-1e-9 * (1.0 - share), 1e-9 * share)["force"]
    np.testing.assert_allclose(ended, -PULL * (share - 0.5), rtol=3e-5, atol=1e-20)
    reach = math.sqrt(REDUCED * 2.0 * math.pi * W / (4.0 / 3.0 * ELASTIC))
    near, far = made.force([-0.9999 * reach, -1.0001 * reach], 1e-6)["force"]
    assert near != 0.0 and far == 0.0
    assert dmt.gap(GRAIN, GRAIN, pair(), REDUCED) == pytest.approx(reach, rel=1e-12, abs=0)


def test_grains_at_rest_at_no_overlap_have_finite_forces(real):
    for tail in (0.0, TAIL):
        assert np.isfinite(contacts(tail, real).force([0.0, 1e-7], [0.0, 1e-7])["force"]).all()


@pytest.mark.parametrize("tail", [0.0, TAIL])
def test_force_is_minus_the_gradient_of_the_energy_and_the_readers_know_the_constants(tail):
    made = contacts(tail)
    own = dmt.own_constants(REDUCED, *dmt.coefficients(GRAIN, GRAIN, pair(tail))[4:])
    np.testing.assert_allclose([float(x) for x in own.values()], made.constants[3:], rtol=1e-14)
    h = 1e-11
    for d in (-20 * TAIL, -1e-7, 1e-7, 3e-6):
        slope = (dmt.energy(d + h, HERTZ, **own) - dmt.energy(d - h, HERTZ, **own)) / (2 * h)
        assert slope == pytest.approx(made.force([d])["force"][0], rel=1e-5, abs=1e-12)
    assert dmt.energy(-1.0, HERTZ, **own) == 0.0
    assert dmt.secant(4e-6, HERTZ, **own) == pytest.approx(HERTZ * 2e-3, rel=1e-14)
    assert dmt.secant(-1e-7, HERTZ, **own) == 0.0


def test_coefficients_are_those_of_hertz_and_three_more():
    made = dmt.coefficients(GRAIN, GRAIN, pair(TAIL, 0.5))
    assert made[:4] == hertz.coefficients(GRAIN, GRAIN, pair(TAIL, 0.5))
    np.testing.assert_allclose(made[4:], [2 * math.pi * W, TAIL, 2 * math.pi * W / (4 / 3 * ELASTIC)], rtol=1e-14)


@pytest.mark.parametrize("tail", [0.0, 4e-6])
def test_an_impact_gives_back_all_of_its_energy_at_order_one_and_a_half(tail):
    """Even at 20 mm/s, where the grains come to rest at an overlap that is mostly the pull's doing."""
    speed = 0.02
    whole = 0.5 * contact_time(speed)
    worst = {}
    for steps in (40, 160):
        scene = impacts("dmt", {"surface_energy": W, "tail_length": tail}, speed, contact_time(speed) / steps, phases=PHASES,
                        measures={"energy": True})  # fmt: skip
        sim = Simulation(scene, device="cpu", threads=1)
        start = 0.5 * MASS * speed**2 * 1.5 * PHASES
        sim.run(until=6.0 * whole)
        apart = np.array(parting_speeds(sim, PHASES))
        assert (apart > 0.0).all(), "they must have parted"
        if tail:  # on the way: what the tail still takes or gives counts
            total = sum(sim.energy().values())
            worst[steps] = abs(total - sum(Simulation(scene, device="cpu", threads=1).energy().values())) / start
        else:
            worst[steps] = np.abs(apart / speed - 1.0).max()
        assert abs(sim.budget.energy()["integration_error"]) < 1e-3 * start
    assert worst[40] < 1e-3
    assert worst[160] < worst[40] / 4.0


def test_a_dashpot_makes_grains_stick_which_come_to_rest_where_the_spring_holds_the_pull():
    speed = 5e-3
    scene = impacts("dmt", {"surface_energy": W, "restitution": 0.3}, speed, contact_time(speed) / 100, phases=2)
    sim = Simulation(scene, device="cpu", threads=1)
    sim.run(until=20.0 * contact_time(speed))
    overlap = sim.contacts().overlap
    assert len(overlap) == 4
    rest = [(PULL / HERTZ) ** (2 / 3), (2 * PULL / (HERTZ * math.sqrt(2.0))) ** (2 / 3)]
    np.testing.assert_allclose(overlap, np.repeat(rest, 2), rtol=1e-6)
