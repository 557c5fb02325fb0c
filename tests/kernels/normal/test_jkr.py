import math
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from scipy.integrate import solve_ivp
from warpdem.kernels.normal import hertz, jkr

from adhesion import ENERGY, MASS, POISSON, PULL, PULL_OFF, REDUCED, YOUNG, contacts
from law_probe import Contacts
from law_scenes import HERTZ

BED = {"surface_energy": 0.02}
"""Keys of the pair of materials in the bed of ``test_laws_anywhere``."""
SOFT = SimpleNamespace(young_modulus=YOUNG, poisson_ratio=POISSON)
UNIT = {"stiffness": 1.0 / math.sqrt(3.0), "pull_off": 1.0}  # F_c = d_c = 1
TOLERANCE = {wp.float64: 1e-14, wp.float32: 3e-6}


def pair(energy=ENERGY, restitution=1.0):
    return SimpleNamespace(surface_energy=energy, restitution=restitution)


def holding(real, overlap, **values):
    """Contacts in units of F_c and d_c that hold, at rest."""
    return contacts(jkr, real, overlap, overlap, 0.5, **UNIT, **values)


def test_force_is_that_of_the_theory(real):
    # D, F/F_c: the end, the largest pull, the touch, and on; (40-digit roots of the quartic)
    ratio = [-1.0, -0.480749856769, 0.0, 1.0, 10.0, 100.0]
    force = [-5 / 9, -1.0, -8 / 9, -0.2011948610308353, 17.55982515113425, 576.6775634271045]
    np.testing.assert_allclose(holding(real, ratio)["force"], force, rtol=TOLERANCE[real], atol=TOLERANCE[real])


def test_contact_radius_is_that_of_the_theory(real):
    # D, s: of the touch, and on (40-digit roots)
    ratio, s = [0.0, 1.0, 10.0], [4.0 ** (1.0 / 3.0), 1.784357981032617, 2.515863640163121]
    np.testing.assert_allclose((3.0 * holding(real, ratio)["depth"]) ** 0.25, s, rtol=TOLERANCE[real])
    np.testing.assert_allclose(jkr.root(ratio), s, rtol=1e-14)


@pytest.mark.parametrize("real", [wp.float64])
def test_force_is_that_of_the_closed_form_over_ten_decades(real):
    ratio = np.concatenate([np.linspace(-0.9, 3.0, 400), 10.0 ** np.linspace(0.0, 9.0, 400)])
    s = jkr.root(ratio)
    np.testing.assert_allclose(s**4 - 4.0 * s, 3.0 * ratio, rtol=3e-15, atol=1e-14)
    found, force = holding(real, ratio), (s**6 - 6.0 * s**3) / 9.0
    np.testing.assert_allclose(found["force"], force, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(found["depth"], s**4 / 3.0, rtol=1e-14)
    np.testing.assert_allclose(found["k_n"], s**2 / 3.0, rtol=1e-14)  # in units of F_c/d_c
    np.testing.assert_allclose(found["load"], force + 2.0, rtol=1e-14)
    # towards Hertz: F + F_c (8/3 s^3 ... ) vanishes beside K d^(3/2)
    assert found["force"][-1] == pytest.approx(UNIT["stiffness"] * ratio[-1] ** 1.5, rel=1e-3)


def test_force_is_the_slope_of_the_energy_and_stiffness_that_of_the_force():
    ratio, h = np.array([-0.9, -0.3, 0.0, 0.7, 1.21141372855476, 20.0]), 1e-5
    def e(d): return jkr.energy(d, UNIT["stiffness"], 1.0, np.ones(len(ratio)))  # fmt: skip
    force = holding(wp.float64, ratio)["force"]
    np.testing.assert_allclose((e(ratio + h) - e(ratio - h)) / (2 * h), force, rtol=1e-6, atol=1e-8)
    above, below = (holding(wp.float64, ratio + side * h)["force"] for side in (1, -1))
    slope = jkr.slope(ratio, UNIT["stiffness"], 1.0, np.ones(len(ratio)))
    np.testing.assert_allclose(slope, np.maximum((above - below) / (2 * h), 0.0), rtol=1e-6, atol=1e-9)
    # a grain at rest: no force, the energy that holds it, its stiffness
    assert abs(force[4]) < 1e-13
    assert e(ratio)[4] == pytest.approx(-1.5426, rel=1e-4)
    assert slope[4] == pytest.approx(0.990578, rel=1e-6)


def test_readers_have_the_stiffness_of_the_law():
    ratio = np.array([-0.95, -0.3, 0.0, 2.0])
    found = holding(wp.float64, ratio)
    k = UNIT["stiffness"]
    # readers of springs give no negative overlap: what is remembered tells
    np.testing.assert_allclose(jkr.secant(np.maximum(ratio, 1e-100), k, 1.0, found["history"]), found["k_n"], rtol=1e-14)
    np.testing.assert_allclose(jkr.secant(ratio[-1:], k, 1.0, 0.0), found["k_n"][-1:], rtol=1e-14)
    assert jkr.secant(-0.3, k, 1.0, 0.0) == 0.0
    np.testing.assert_allclose(jkr.stored(ratio, k, 1.0, found["history"]), jkr.energy(ratio, k, 1.0, 0.0), rtol=1e-14)
    assert (jkr.stored(ratio[:3], k, 1.0, np.zeros(3)) == 0.0).all()


def test_a_contact_begins_at_touch_holds_on_and_ends_at_the_pull_off_distance(real):
    near = 1e-3
    # before the touch, at it, pulled, beyond the end, further, and beyond all reach
    overlap = [-0.5, near, -0.5, -1.0 + near, -1.0 - near, -2.9, -3.1]
    before = [-0.4, -near, -0.4, -0.9, -1.0 + 2 * near, -0.5, -0.9]
    history = [0.0, 0.0, 0.7, 0.4, 0.34, 0.4, 0.4]
    found = contacts(jkr, real, overlap, before, history, **UNIT)
    assert (found["history"] > 0.0).tolist() == [False, True, True, True, False, False, False]
    assert (found["force"] != 0.0).tolist() == [False, True, True, True, True, True, False]
    assert (found["load"] > 0.0).tolist() == [False, True, True, True, False, False, False]
    assert (found["adhesion"] > 0.0).tolist() == [False, True, False, False, False, False, False]
    assert (found["k_n"] > 0.0).tolist() == [False, True, True, True, True, True, False]
    assert all(value[0] == value[-1] == 0.0 for name, value in found.items() if not name.startswith("depth"))
    assert found["depth_before"][2] == pytest.approx(0.7, rel=1e-6)
    assert found["adhesion"][1] == pytest.approx(0.935502783271928609, rel=TOLERANCE[real])


def test_a_touch_loses_the_energy_of_thornton_and_ning():
    reduced_young = 0.5 * YOUNG / (1.0 - POISSON**2)
    loss = 7.09219597186396 * (ENERGY**5 * REDUCED**4 / reduced_young**2) ** (1.0 / 3.0)
    made = Contacts(jkr, jkr.coefficients(SOFT, SOFT, pair()), REDUCED, MASS)
    k, _, _, d_c = made.constants
    assert made.force([1e-9], [-1e-9])["adhesion"][0] == pytest.approx(loss, rel=1e-14, abs=0)
    assert jkr.adhesion(k, REDUCED, d_c)[1] == pytest.approx(loss, rel=1e-14, abs=0)


@pytest.mark.parametrize("tau", [0.0, 0.2, 0.9, 1.0])
def test_the_first_and_the_last_force_count_for_the_part_of_the_step_that_they_act_in(tau, real):
    step, damping = 0.01, 0.3
    arguments = {**UNIT, "speed": -0.2, "damping": damping}
    inside, outside = tau * step + 1e-6, (1.0 - tau) * step
    begun = contacts(jkr, real, inside, -outside, 0.0, **arguments)
    full = contacts(jkr, real, inside, -outside, 1.0, **arguments)
    share = inside / (inside + outside) + 0.5
    for name in ("load", "dashpot"):
        assert begun[name][0] == pytest.approx(full[name][0] * share, rel=20 * TOLERANCE[real])
    # of the force only what jumps, that of the touch
    lacking = (share - 1.0) * (-8.0 / 9.0 + full["dashpot"][0])
    assert begun["force"][0] == pytest.approx(full["force"][0] + lacking, rel=20 * TOLERANCE[real], abs=20 * TOLERANCE[real])
    for name in ("k_n", "depth", "history"):
        assert begun[name][0] == full[name][0]
    ended = contacts(jkr, real, -1.0 - inside, -1.0 + outside, 1.0, **arguments)
    tears = contacts(jkr, real, -1.0, -1.0, 1.0, **arguments)
    share = 0.5 - inside / (inside + outside)
    tolerance = {"rel": 1e-9, "abs": 1e-12} if real is wp.float64 else {"rel": 1e-3, "abs": 1e-4}
    assert ended["force"][0] == pytest.approx(tears["force"][0] * share, **tolerance)
    assert ended["dashpot"][0] == pytest.approx(tears["dashpot"][0] * share, **tolerance)
    assert ended["history"][0] == ended["load"][0] == 0.0


def test_a_contact_that_is_found_at_the_start_counts_in_full_and_loses_nothing(real):
    found = contacts(jkr, real, [0.5, 0.5], [0.5, 0.4], 0.0, **UNIT)
    full = contacts(jkr, real, [0.5, 0.5], [0.5, 0.4], 1.0, **UNIT)
    assert (found["force"] == full["force"]).all()
    assert (found["adhesion"] == 0.0).all()
    assert (found["depth_before"] == found["depth"]).all()  # springs that it was given are kept
    at_rest = contacts(jkr, real, [0.0, -0.3], [0.0, -0.3], 0.0, **UNIT)
    assert all(np.isfinite(value).all() for value in at_rest.values())
    assert (at_rest["force"] == 0.0).all()


def equation(speed, restitution=1.0, wall=False):
    """Equation of motion of D and of the speed of approach over ``speed`` [m/s]; d_c [m], and the unit of time [s]."""
    stiffness, pull, pull_off, mass = HERTZ, 1.5 * math.pi * ENERGY * REDUCED, PULL_OFF, MASS
    if wall:  # R* and m* are twice those of two grains
        stiffness, pull, pull_off, mass = stiffness * 2**0.5, 2.0 * pull, pull_off * 2 ** (1 / 3), 2.0 * mass
    damping = -math.sqrt(5.0) * math.log(restitution) / math.hypot(math.log(restitution), math.pi) * math.sqrt(mass * stiffness)
    unit = pull_off / speed

    def rate(_, y):
        s = float(jkr.root(y[0]))
        dashpot = damping * (pull_off * s**4 / 3.0) ** 0.25 * y[1] * speed
        return [y[1], -(pull * (s**6 - 6.0 * s**3) / 9.0 + dashpot) * unit / (mass * speed)]

    return rate, pull_off, unit


def impact(speed, restitution=1.0, wall=False):
    """Restitution, time of contact [s], largest overlap [m] and when [s], by the equation of motion."""
    rate, pull_off, unit = equation(speed, restitution, wall)
    def parts(_, y): return y[0] + 1.0  # fmt: skip
    def turns(_, y): return y[1]  # fmt: skip
    parts.terminal, parts.direction, turns.direction = True, -1, -1
    out = solve_ivp(rate, (0, 1e4), [0.0, 1.0], events=[parts, turns], method="DOP853", rtol=1e-13, atol=1e-14)
    [[_, left]], [deepest, *_] = out.y_events
    return -left, out.t_events[0][0] * unit, deepest[0] * pull_off, out.t_events[1][0] * unit


def sticking_speed(restitution):
    """Speed [m/s] of the impact that just comes to rest where the contact tears: from there back in time to the touch."""
    rate, _, _ = equation(0.01, restitution)
    def touches(_, y): return y[0]  # fmt: skip
    touches.terminal, touches.direction = True, -1
    out = solve_ivp(rate, (0, -1e4), [-1.0, 0.0], events=[touches], method="DOP853", rtol=1e-13, atol=1e-14)
    [[_, met]] = out.y_events[0]
    return 0.01 * met


def test_impacts_integrated_are_those_of_the_reference():
    for given, wanted in (
        ((0.02,), (0.902240030518, 5.27090413841e-4, 3.68333406693e-6, 2.40293542146e-4)),
        ((0.1,), (0.996273799167, 3.36083069259e-4, 1.12957476594e-5)),
        ((0.1, 1.0, True), (0.995302996948, 3.87734256579e-4)),
    ):
        np.testing.assert_allclose(impact(*given)[: len(wanted)], wanted, rtol=1e-10)
    speeds = [0.02, 0.05, 0.1, 0.5, 2.0]
    wanted = [0.671223462, 0.8400285197, 0.8716659854, 0.8921415229, 0.8968231238]
    np.testing.assert_allclose([impact(v, 0.9)[0] for v in speeds], wanted, rtol=2e-10)
    assert sticking_speed(1.0) == pytest.approx(8.62468381638e-3, rel=1e-10)
    assert sticking_speed(0.9) == pytest.approx(0.01200539, rel=5e-7)


def test_dashpot_goes_by_the_effective_overlap(real):
    ratio, damping = np.array([-0.7, 0.0, 2.0, 50.0]), 0.3
    found = holding(real, ratio, speed=0.2, damping=damping)
    expected = damping * (jkr.root(ratio) ** 4 / 3.0) ** 0.25
    np.testing.assert_allclose(found["dashpot"], -0.2 * expected, rtol=10 * TOLERANCE[real])
    difference = found["force"] - holding(real, ratio)["force"]
    np.testing.assert_allclose(difference, -0.2 * expected, rtol=100 * TOLERANCE[real], atol=10 * TOLERANCE[real])


def test_constants_are_pull_off_force_and_distance():
    base, damping, *rest, pull_off = jkr.coefficients(SOFT, SOFT, pair(restitution=0.9))
    assert (base, damping, *rest) == hertz.coefficients(SOFT, SOFT, pair(restitution=0.9))
    k, c, _, d_c = Contacts(jkr, [base, damping, *rest, pull_off], REDUCED, MASS).constants
    assert d_c == pytest.approx(PULL_OFF, rel=1e-11)
    assert math.sqrt(3.0) * k * d_c**1.5 == pytest.approx(PULL, rel=1e-11) == 1.5 * math.pi * ENERGY * REDUCED
    assert c == pytest.approx(damping * math.sqrt(MASS * k) * (d_c / 3.0) ** 0.25, rel=1e-14)
    assert float(jkr.own_constants(REDUCED, pull_off)["pull_off"]) == pytest.approx(d_c, rel=1e-14)
    assert jkr.gap(SOFT, SOFT, pair(), REDUCED) == pytest.approx(3.0 * d_c, rel=1e-13)


def test_cube_root_holds_from_powder_to_boulders(real):
    radius = 10.0 ** np.linspace(-9.0, 1.0, 101)
    found = [Contacts(jkr, [1e7, 0.0, 0.0, 0.0, 1.0], r, real=real).constants[3] for r in radius]
    np.testing.assert_allclose(found, np.cbrt(radius), rtol=2e-15 if real is wp.float64 else 1e-6)


def test_without_surface_energy_it_is_hertz(real):
    k, _, _, d_c = Contacts(jkr, jkr.coefficients(SOFT, SOFT, pair(energy=0.0)), REDUCED, MASS, real=real).constants
    overlap = np.array([1e-8, 1e-6, 1e-5])
    found = contacts(jkr, real, overlap, overlap, overlap, stiffness=k, pull_off=d_c)
    np.testing.assert_allclose(found["force"], k * overlap**1.5, rtol=1e-5)
    assert np.isfinite(found["force"]).all()
