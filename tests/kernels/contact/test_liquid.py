"""A contact with a bridge: birth, first and last force, rupture, viscous dashpots, what is lost; by the law of all contacts."""

import numpy as np
import pytest
from warpdem.kernels.contact import columns, liquid
from warpdem.kernels.liquid import bridge_rabinovich
from warpdem.kernels.normal import hertz, hertz_clamped, jkr

from law_probe import Contacts

RADIUS, MASS, PULL = 5e-4, 5e-6, 4e-4  # R* [m], m* [kg], 4 pi R* g [N]
WETTING = 0.8
TENSION = PULL / (4.0 * np.pi * RADIUS * WETTING)
VOLUME = 1e-12
SQUARE = VOLUME / (np.pi * RADIUS)
FAR = VOLUME ** (1 / 3)


def contacts(normal=hertz, viscous=(), own=()):
    made = liquid.joined(normal, bridge_rabinovich, bool(viscous))
    given = (7e6, 0.1, 0.8, 0.7, *own, TENSION, WETTING, *viscous, *([1.0] if viscous else []))
    return made, Contacts(made, given, RADIUS, MASS)


def bridge(late=0.0, count=100.0, before=()):
    return [*before, count, late, FAR, SQUARE]


def capillary(gap):
    return PULL * (1.0 - gap / np.sqrt(gap**2 + SQUARE))


def test_a_touch_asks_for_liquid_and_remembers_when_it_began():
    _, made = contacts()
    touch = made.force([3e-7, 3e-7, -1e-7], [-1e-7, 1e-7, -2e-7])
    np.testing.assert_allclose(touch["history"][:, :2], [[liquid.PENDING, 0.75 + 0.5], [liquid.PENDING, -1.0], [0.0, 0.0]])
    dry = made.force([1e-7, -1e-7], [2e-7, 1e-7], history=[liquid.DRY, 0, 0, 0])
    np.testing.assert_array_equal(dry["history"][:, 0], [liquid.DRY, 0.0])
    without = Contacts(jkr, (7e6, 0.1, 0.8, 0.7, 0.02), RADIUS, MASS)
    assert "liquid" not in without.force([1e-7], [2e-7])


def test_the_pull_goes_by_the_gap_and_the_first_force_makes_up_for_the_delay():
    _, made = contacts()
    gap = np.array([0.0, 0.1, 0.5, 0.999]) * FAR
    found = made.force(-gap, -gap, history=bridge())
    np.testing.assert_allclose(found["force"], -capillary(gap), rtol=1e-12)
    np.testing.assert_array_equal(found["load"], 0.0)
    np.testing.assert_array_equal(found["history"], np.tile(bridge(), (4, 1)))
    first = made.force([1e-6], [5e-7], history=bridge(late=1.25))
    pressed = Contacts(hertz, (7e6, 0.1, 0.8, 0.7), RADIUS, MASS).force([1e-6])
    assert first["force"][0] == pytest.approx(pressed["force"][0] - 2.25 * PULL, rel=1e-12)
    assert first["load"][0] == pressed["force"][0], "friction goes by what presses the surfaces together"
    assert first["history"][0, 1] == 0.0
    assert made.force([1e-6], [5e-7], history=bridge(late=-1.0))["force"][0] == pytest.approx(pressed["force"][0] - PULL)


def test_the_last_force_acts_for_the_part_of_the_step_before_the_rupture():
    _, made = contacts()
    end = made.force([-FAR - 3e-7], [-FAR + 1e-7], history=bridge())
    assert end["force"][0] == pytest.approx((0.75 - 0.5) * capillary(FAR), rel=1e-6)
    np.testing.assert_array_equal(end["history"], 0.0)
    gone = made.force([-1e3], [-0.5 * FAR], history=bridge())
    assert gone["force"][0] == 0.0 and not gone["history"].any()


def test_what_a_bridge_holds_is_lost_as_it_forms():
    law, made = contacts()
    work = PULL * (FAR + np.sqrt(SQUARE) - np.sqrt(FAR**2 + SQUARE))
    lost = [made.force([2e-6], [1e-6], history=bridge(late))["liquid"][0] for late in (1.25, -1.0, 0.0)]
    np.testing.assert_allclose(lost, [work, work + 2e-6 * PULL, 0.0], rtol=1e-12)
    own = {"bridge_pull": PULL, "bridge_wetting": 1.0, "bridge": np.array([1.0, 1.0, 0.0, 1.0]), "bridge_late": 0.0,
           "bridge_rupture": FAR, "bridge_square": SQUARE}  # fmt: skip
    held = law.energy(np.array([2e-6, 0.0, -1e-6, -FAR]), 3e5, **own)
    np.testing.assert_allclose(held[[1, 2, 3]], [-work, 0.0, 0.0], rtol=1e-12, atol=1e-22)
    assert held[0] == pytest.approx(hertz.energy(2e-6, 3e5) - work - 2e-6 * PULL, rel=1e-12)


def test_stiffness_is_that_of_the_law_alone():
    law, _ = contacts()
    own = {"bridge_pull": PULL, "bridge_wetting": 1.0, "bridge": 1.0, "bridge_late": 0.0, "bridge_rupture": FAR,
           "bridge_square": SQUARE}  # fmt: skip
    d = np.array([1e-10, 1e-6])
    np.testing.assert_allclose(law.secant(d, 3e5, **own), 3e5 * np.sqrt(d), rtol=1e-6)
    np.testing.assert_allclose(law.slope(d, 3e5, **own), 4.5e5 * np.sqrt(d), rtol=1e-6)
    assert law.slope(np.array([-1e-6]), 3e5, **own)[0] == pytest.approx(0.0, abs=1e-12)


def test_viscous_dashpots_of_the_gap():
    eta, rough = 0.1, 1e-6
    _, made = contacts(viscous=(eta, rough))
    gap, speed = np.array([0.0, 5e-7, 5e-6]), 0.02
    near = np.maximum(gap, rough)
    open_part = (1.0 - near / np.sqrt(near**2 + SQUARE)) ** 2
    squeeze = 6.0 * np.pi * eta * RADIUS**2 / near * open_part
    found = made.force(-gap, -gap, speed, bridge())
    np.testing.assert_allclose(found["squeezed"], -squeeze * speed, rtol=1e-12)
    np.testing.assert_array_equal(found["dashpot"], 0.0)
    np.testing.assert_allclose(found["force"], -capillary(gap) - squeeze * speed, rtol=1e-12)
    drag = 6.0 * np.pi * eta * RADIUS * (8.0 / 15.0 * np.log(RADIUS / near) + 0.9588)
    np.testing.assert_allclose(found["drag"], drag, rtol=1e-12)
    dry = made.force([-5e-6], [-5e-6], speed)
    assert dry["force"][0] == dry["drag"][0] == 0.0


def test_joined_to_a_law_that_never_attracts_and_to_one_with_memory():
    law, made = contacts(hertz_clamped)
    assert made.force([-1e-7], [-1e-7], history=bridge())["force"][0] == pytest.approx(-capillary(1e-7))
    law, made = contacts(jkr, own=jkr.coefficients(*[Glass] * 2, Pair)[4:])
    assert law.LOSSES == ("adhesion", "liquid")
    kept = [1.0] * columns.own_history(jkr).width
    both = made.force([-1e-8], [-1e-8], history=bridge(before=kept))
    alone = Contacts(jkr, (7e6, 0.1, 0.8, 0.7, *jkr.coefficients(*[Glass] * 2, Pair)[4:]), RADIUS, MASS)
    dry = alone.force([-1e-8], [-1e-8], history=kept)
    assert dry["force"][0] < 0.0
    assert both["force"][0] == pytest.approx(dry["force"][0] - capillary(1e-8), rel=1e-12)


class Glass:
    density, young_modulus, poisson_ratio = 2500.0, 1e7, 0.3


class Pair:
    restitution, surface_energy = 0.9, 0.1
