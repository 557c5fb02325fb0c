import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq
from warpdem.kernels.normal import edinburgh, hertz

from law_probe import Contacts
from law_scenes import HERTZ, MASS, POISSON, RADIUS, YOUNG, contact_time, impacts, parting_speeds
from model_probes import RTOL
from warpdem import SceneError, Simulation

BED = {"surface_energy": 0.5, "pull_off_force": "50 uN", "tensile_exponent": 2}
"""Keys of the pair of materials in the bed of ``test_laws_anywhere``."""
GRAIN = SimpleNamespace(young_modulus=YOUNG, poisson_ratio=POISSON)
REDUCED, PHASES = 0.5 * RADIUS, 8
K1, RATIO, M, SPEED = 2e5, 0.8, 5e-6, 0.05  # of the reference impacts: k1 [N/m^1.5], 1 - k1/k2, m* [kg], [m/s]
TOP = 5.71631314909e-6  # their largest overlap without a constant pull [m]
REST = RATIO ** (2 / 3) * TOP


def pair(w=0.0, f0=0.0, ratio=RATIO, exponent=1.5, restitution=1.0):
    return SimpleNamespace(
        restitution=restitution, surface_energy=w, pull_off_force=f0, plasticity_ratio=ratio, tensile_exponent=exponent,
        tangential_stiffness_ratio=0.7,
        slope_exponent=1.5,
    )  # fmt: skip


def contacts(k1=K1, real=None, **keywords):
    base, *others = edinburgh.coefficients(GRAIN, GRAIN, pair(**keywords))
    base = k1 / math.sqrt(REDUCED)
    return Contacts(edinburgh, (base, *others), REDUCED, M, **({"real": real} if real else {}))


def energy_of(pull):
    """The surface energy that pulls with ``pull`` [N] a contact which has been at TOP."""
    return pull / (1.5 * math.pi * math.sqrt(2.0 * REDUCED * REST))


def work(made, high, history, stop=0.0, n=4001):
    """Work that the law gives back on the way out from an overlap [J]: Simpson's rule in the root of it, piece by piece."""
    d = np.linspace(math.sqrt(high), math.sqrt(stop), n) ** 2
    f = made.force(d, high, history=history)["force"] * 2.0 * np.sqrt(d)
    x = np.sqrt(d)
    return float(-np.sum((x[2::2] - x[:-2:2]) / 6.0 * (f[:-2:2] + 4.0 * f[1::2] + f[2::2])))


def branch_start(made, history):
    """Overlap at which h is first forgotten [m]."""
    low, high = 0.0, TOP
    for _ in range(70):
        middle = 0.5 * (low + high)
        kept = made.force([middle], TOP, history=history)["history"][0, 0]
        low, high = (middle, high) if kept < history[0, 0] * (1 - 1e-15) else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.parametrize(("pull", "least", "where", "e"), [
    (0.0, 0.0, 4.926169339e-6, 0.413089888616), (5.2064860664e-4, -5.2064860664e-4, 4.76851482782e-6, 0.0718660650129),
])  # fmt: skip
def test_impacts_of_the_reference_give_back_what_they_should(pull, least, where, e):
    made = contacts(w=energy_of(pull))
    assert 0.4 * K1 * TOP**2.5 == pytest.approx(0.5 * M * SPEED**2, rel=1e-11, abs=0)
    history = made.force([TOP], 0.0)["history"]
    begun = branch_start(made, history)
    assert begun == pytest.approx(where, rel=1e-9, abs=0)
    assert made.force([begun], TOP, history=history)["force"][0] == pytest.approx(least, rel=1e-9, abs=1e-15)
    given = work(made, TOP, history, begun) + work(made, begun, history)
    assert math.sqrt(2.0 * given / M) / SPEED == pytest.approx(e, rel=1e-9)


@pytest.mark.parametrize("w", [energy_of(2e-4), 1e3])
def test_the_pull_after_a_load_is_the_least_force_on_the_way_out(w):
    made, load = contacts(w=w, f0=5e-5), 3e-4
    deepest = ((load + 5e-5) / K1) ** (2 / 3)
    pressed = made.force([deepest], 0.5 * deepest)
    assert pressed["force"][0] == pytest.approx(load, rel=1e-12)
    out = made.force(np.linspace(0.0, deepest, 40_001)[1:], deepest, history=pressed["history"])["force"]
    own = dict(zip(edinburgh.COEFFICIENTS, made.constants[3:], strict=True))
    assert edinburgh.pull_after(load, K1, REDUCED, **own) == pytest.approx(-out.min(), rel=1e-4)


def test_a_constant_pull_deepens_the_impact_and_takes_what_is_missing_to_part():
    """f0 = -1e-4 N beside a branch of the stiffness 5e4 N/m^1.5 [J]."""
    f0 = 1e-4
    top = brentq(lambda d: 0.4 * K1 * d**2.5 - f0 * d - 0.5 * M * SPEED**2, 1e-6, 1e-5, xtol=1e-22)
    assert top == pytest.approx(5.92728385353e-6, rel=1e-10, abs=0)
    rest, k2 = RATIO ** (2 / 3) * top, K1 / (1 - RATIO)
    end = brentq(lambda d: k2 * (d**1.5 - rest**1.5) + 5e4 * d**1.5, 1e-7, top, xtol=1e-22)
    made = contacts(w=5e4 * end**1.5 / (1.5 * math.pi * math.sqrt(2.0 * REDUCED * rest)), f0=f0)
    history = made.force([top], 0.0)["history"]
    given = work(made, top, history, end) + work(made, end, history)
    # at d = 0 exactly the pull is given for half of the step that it ends in: one point of the rule
    assert -given == pytest.approx(5.57387532e-10, rel=1e-5, abs=0)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.5, 5.0])
def test_the_branch_has_the_power_asked_for_and_goes_through_the_least_force(real, exponent):
    made = contacts(w=energy_of(4e-4), exponent=exponent, real=real)
    history = made.force([TOP], 0.0)["history"]
    end = (REST**1.5 - 4e-4 * (1 - RATIO) / K1) ** (2 / 3)
    d = end * np.array([0.9, 0.5, 0.1])
    found = made.force(d, TOP, history=history)
    np.testing.assert_allclose(found["force"], -4e-4 * (d / end) ** exponent, rtol=300 * RTOL[real])
    # pressing again starts from there, along the line of k2, and reaches first loading where that line meets it
    u = found["history"][:, 0]
    line = K1 / (1 - RATIO) * (d**1.5 - RATIO * u)
    np.testing.assert_allclose(line, found["force"], rtol=300 * RTOL[real], atol=K1 / (1 - RATIO) * REST**1.5 * RTOL[real])
    again = made.force(1.0001 * u ** (2 / 3), d, history=found["history"])["force"]
    np.testing.assert_allclose(again, K1 * 1.0001**1.5 * u, rtol=30 * RTOL[real])


def test_the_pull_is_at_most_half_of_what_the_line_could():
    made = contacts(w=1e3)
    history = made.force([TOP], 0.0)["history"]
    begun = branch_start(made, history)
    assert made.force([begun], TOP, history=history)["force"][0] == pytest.approx(-0.5 * K1 / (1 - RATIO) * REST**1.5, rel=1e-9)
    assert begun == pytest.approx(REST * 0.5 ** (2 / 3), rel=1e-9, abs=0)


def test_contacts_end_and_begin_with_the_constant_pull_for_the_share_of_the_step(real):
    f0 = 1e-4
    made = contacts(f0=f0, real=real)
    begun = made.force([0.3e-9], -0.7e-9)
    assert begun["force"][0] == pytest.approx(-f0 * 0.8, rel=1e-4)
    ended = made.force([-0.7e-9], 0.3e-9, history=begun["history"])
    assert ended["force"][0] == pytest.approx(f0 * 0.2, rel=1e-4)
    assert not ended["history"].any() and not ended["k_n"].any()
    far = made.force([-0.02001 * REDUCED, -1e-9], [1e-6, -1e-6], history=begun["history"])
    assert not far["force"].any()
    assert edinburgh.gap(GRAIN, GRAIN, pair(f0=f0), REDUCED) == pytest.approx(0.02 * REDUCED, abs=0)
    assert edinburgh.gap(GRAIN, GRAIN, pair(), REDUCED) == 0.0


def test_friction_goes_by_the_pressure_without_the_pull():
    made = contacts(w=energy_of(4e-4), f0=1e-4)
    history = made.force([TOP], 0.0)["history"]
    end = (REST**1.5 - 4e-4 * (1 - RATIO) / K1) ** (2 / 3)
    d = np.array([TOP, end, 0.5 * end])
    out = made.force(d, TOP, history=history)
    pull = 4e-4 * np.minimum(d / end, 1.0) ** 1.5
    np.testing.assert_allclose(out["load"], np.maximum(out["force"] + 1e-4 + pull, 0.0), rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(out["k_n"], K1 * d**0.5, rtol=1e-14)


def test_an_elastic_contact_is_hertz_and_coefficients_are_those_given():
    made = contacts(w=0.1, ratio=0.0)
    history = made.force([TOP], 0.0)["history"]
    d = np.array([TOP, 0.5 * TOP, 0.01 * TOP])
    np.testing.assert_allclose(made.force(d, TOP, history=history)["force"], K1 * d**1.5, rtol=2e-6)
    found = edinburgh.coefficients(GRAIN, GRAIN, pair(w=0.1, restitution=0.5))
    of_hertz = hertz.coefficients(GRAIN, GRAIN, pair(restitution=0.5))
    assert found[:2] == of_hertz[:2]
    assert found[2:4] == (0.7, math.sqrt(0.7 / 1.5))


def test_energies_for_readers_are_the_work_of_the_force():
    made = contacts(w=energy_of(4e-4), f0=1e-4)
    own = dict(zip(edinburgh.COEFFICIENTS, made.constants[3:], strict=True))
    told = edinburgh.own_constants(REDUCED, *edinburgh.coefficients(GRAIN, GRAIN, pair(energy_of(4e-4), 1e-4))[4:])
    np.testing.assert_allclose([float(x) for x in told.values()], made.constants[3:], rtol=1e-14)
    history = made.force([TOP], 0.0)["history"]
    past = dict(zip(edinburgh.HISTORY, history[0], strict=True))
    h = 1e-11
    for d in (0.99 * TOP, 0.95 * TOP):
        force = made.force([d], TOP, history=history)["force"][0]
        at = [edinburgh.stored(d + s * h, K1, **own, **past) for s in (1, -1)]
        assert (at[0] - at[1]) / (2 * h) == pytest.approx(force, rel=1e-4)
        at = [edinburgh.energy(d + s * h, K1, **own, **past) for s in (1, -1)]
        assert (at[0] - at[1]) / (2 * h) == pytest.approx(made.force([d], 1e-9)["force"][0], rel=1e-4)
        slope = (made.force([d + h], TOP, history=history)["force"][0] - force) / h
        assert edinburgh.slope(d, K1, **own, **past) == pytest.approx(slope, rel=1e-3)
    assert edinburgh.stored(-1e-6, K1, **own, yielded=0.0, turned=0.0) == 0.0


@pytest.mark.parametrize(("w", "f0", "exponent"), [(0.0, 0.0, 1.5), (0.5, 0.0, 1.5), (1.0, 2e-5, 3.0)])
def test_a_run_loses_what_its_budget_tells(w, f0, exponent):
    given = {"surface_energy": w, "pull_off_force": f0, "plasticity_ratio": 0.6, "tensile_exponent": exponent}
    errors = {}
    for steps in (60, 240):
        scene = impacts("edinburgh", given, 0.1, contact_time(0.1) / steps, phases=PHASES, measures={"energy": True})
        sim = Simulation(scene, device="cpu", threads=1)
        sim.run(until=2.5 * contact_time(0.1))
        of_pairs, at_wall = parting_speeds(sim, PHASES)
        assert (of_pairs > 0.0).all() and (at_wall > 0.0).all()
        budget = sim.budget.energy()
        start = 0.5 * 0.1**2 * MASS * 1.5 * PHASES
        left = 0.5 * MASS * (0.5 * (of_pairs**2).sum() + (at_wall**2).sum())
        errors[steps] = abs(budget["dissipated_plasticity"] + budget["dissipated_adhesion"] - (start - left)) / start
        assert budget["dissipated_plasticity"] > 0.2 * start
        assert (budget["dissipated_adhesion"] > 0.005 * start) == (w > 0.0)
        assert abs(budget["integration_error"]) < 1e-5 * start
        if w == f0 == 0.0:  # e^2 = 1 - the share lost to yielding, at any speed
            share = 0.4 * HERTZ - float(edinburgh.stored(1.0, HERTZ, 0.6, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0))
            expected = math.sqrt(1.0 - share / (0.4 * HERTZ))
            np.testing.assert_allclose(of_pairs / 0.1, expected, rtol=0, atol=0.06 / steps)
    assert errors[240] < 2e-3


@pytest.mark.parametrize(
    ("given", "words"),
    [({"plasticity_ratio": 1.0}, "must be below 1"), ({"tensile_exponent": 1.7}, "must be one of 1, 1.5, 2"),
     ({"tensile_exponent": 6}, "must be one of 1, 1.5, 2"), ({"pull_off_force": -1e-6}, ">= 0"),
     ({"slope_exponent": 1}, "must be 1.5, [^$]*luding")],
)  # fmt: skip
def test_what_the_law_cannot_be_is_refused_by_key(given, words):
    [key] = given
    with pytest.raises(SceneError, match=rf"pairs\[0\]\.{key} = [^$]*{words}"):
        impacts("edinburgh", {"surface_energy": 0.1} | given, 0.1, 1e-6)
