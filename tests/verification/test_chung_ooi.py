"""Oblique impacts over the angle, and opposite spins: tests 4, 5 and 7 of Chung and Ooi, published and measured values.

Where a sphere slides throughout (friction mu, approach v_n = v cos a, v_t = v sin a; exact_solutions 3),

    v_t' = v_t - mu (1 + e) v_n,     R w' = -(5/2) mu (1 + e) v_n (1 - <d>/R),     v_c' = v_t' + R w',

the torque's arm being R - d: <d> = int F d dt / int F dt = 0.4 B(0.4, 1.5) d_max = 0.8176 d_max of an undamped Hertz impact.
It is left out in the published formulas, whose arm is R: d_max/R is 0.32 % in test 4 and 1.3 % in test 5. Sources of the
numbers: ``chung_ooi`` in tests/helpers. At 200 steps per contact the scheme adds 2.5e-3 to the ratio of speeds at 5 degrees
and under 1e-4 elsewhere, seen against 800; the law itself is what differs between codes below 15 degrees.
"""

import numpy as np
import pytest

import chung_ooi
from chung_ooi import ALUMINIUM, ANGLES, COPPER, OXIDE, SPEED, SPINNING_ALUMINIUM, STEEL, oblique, rebound, wall_impacts
from warpdem import Simulation

LAWS = ["mindlin", "mindlin_displacement"]
ARM = 3.2e-3
"""Largest overlap over radius in test 4 [-]."""


@pytest.fixture(params=LAWS)
def law(request):
    return request.param


def impacts(device, sphere, law):
    """Ratio of tangential speeds, spin [rad/s] and rebound angle [deg] by angle."""
    scene, end = oblique(sphere, law)
    sim = Simulation(scene, device=device, threads=1)
    sim.run(until=end)
    assert len(sim.contacts().i) == 0, "an impact is not over"
    assert sim.extremes["wall_overlap_share"] < 2.0 * ARM
    # nothing leaves the plane of the impact
    assert np.abs(sim.particles.velocity[:, 1]).max() < 1e-12 * SPEED
    assert np.abs(sim.particles.spin[:, ::2]).max() < 1e-9
    speed, spin, angle = rebound(sim)
    return np.stack([speed / (SPEED * np.sin(np.radians(ANGLES))), spin, angle], axis=1)


def arm_lost(sphere, speed):
    """Share <d>/R by which the torque's arm is shorter than R in an impact at ``speed`` [m/s]."""
    return 0.8176 * sphere.impact(speed, rigid_wall=True)[0] / sphere.radius


def at(found, angles):
    return found[np.searchsorted(ANGLES, angles)]


def test_gross_sliding_is_the_closed_form(device, law):
    for sphere in (OXIDE, ALUMINIUM):
        sliding = ANGLES >= 35.0
        a = np.radians(ANGLES[sliding])
        given = sphere.friction * (1.0 + sphere.restitution) * np.cos(a)
        spun = 2.5 * given * (1.0 - arm_lost(sphere, SPEED * np.cos(a)))
        found = impacts(device, sphere, law)[sliding]
        # e at 200 steps per contact and the attraction at the end of the damped contact: 5e-4 of the impulse
        np.testing.assert_allclose((1.0 - found[:, 0]) * np.sin(a), given, rtol=5e-4)
        np.testing.assert_allclose(sphere.radius * found[:, 1], -spun * SPEED, rtol=5e-4)
        after = np.degrees(np.arctan2(np.sin(a) - given - spun, sphere.restitution * np.cos(a)))
        np.testing.assert_allclose(found[:, 2], after, rtol=0, atol=0.05)


def test_angles_of_the_published_dem(device, law):
    """15 to 30 degrees within 3 % and 4 % of the paper, from 35 on within 0.5 % and 3 %: it has another tangential law."""
    found = impacts(device, OXIDE, law)
    paper = chung_ooi.PAPER_OXIDE[2:]
    here = at(found, paper[:, 0])
    late = paper[:, 0] >= 35
    np.testing.assert_array_less(np.abs(here[:, 0] / paper[:, 1] - 1), np.where(late, 5e-3, 0.03))
    np.testing.assert_array_less(np.abs(here[:, 1] / paper[:, 2] - 1), np.where(late, 0.03, 0.04))
    np.testing.assert_allclose(here[:, 2], paper[:, 3], rtol=0, atol=1.3)
    paper = chung_ooi.PAPER_ALUMINIUM[2:]
    here = at(impacts(device, ALUMINIUM, law), paper[:, 0])
    np.testing.assert_allclose(here[:, 0], paper[:, 1], rtol=0.03)
    np.testing.assert_allclose(here[:, 1], paper[:, 2], rtol=0.04)


def test_each_law_against_its_fine_integration(device, law):
    """All angles, also where a sphere sticks: two digits of another code's integration, whose torque arm is R."""
    fine = chung_ooi.FINE_OXIDE[law]
    found = at(impacts(device, OXIDE, law), fine[:, 0])
    np.testing.assert_allclose(found[:, 0], fine[:, 1], rtol=0, atol=ARM)
    np.testing.assert_allclose(found[:, 1], fine[:, 2], rtol=0, atol=ARM * 614.5)
    np.testing.assert_allclose(found[:, 2], fine[:, 3], rtol=0, atol=np.degrees(ARM * 3.5 * OXIDE.friction * 2) + 0.005)


def test_angles_of_the_experiment(device):
    """Kharaz, Gorham and Salman, from 20 degrees on: speeds within 6 %; spins 5 % in the mean, 10 % at most.

    The paper's own DEM misses the same readings by as much.
    """
    found = impacts(device, OXIDE, "mindlin")
    ratio, spin = (m[m[:, 0] >= 20.0] for m in (chung_ooi.MEASURED_RATIO, chung_ooi.MEASURED_SPIN))
    np.testing.assert_allclose(np.interp(ratio[:, 0], ANGLES, found[:, 0]), ratio[:, 1], rtol=0.06)
    here = np.interp(spin[:, 0], ANGLES, found[:, 1])
    np.testing.assert_allclose(here, spin[:, 1], rtol=0.10)
    assert np.mean(np.abs(here / spin[:, 1] - 1.0)) < 0.05
    paper = np.interp(spin[:, 0], chung_ooi.PAPER_OXIDE[:, 0], chung_ooi.PAPER_OXIDE[:, 2])
    assert np.abs(here - spin[:, 1]).mean() < 1.1 * np.abs(paper - spin[:, 1]).mean()


def grazing(device, law, x):
    """Test 5: contact point's speed and R spin, over mu v_n, at x = v_t/(mu v_n)."""
    scene, end = wall_impacts(STEEL, np.full(len(x), 5.0), 5.0 * STEEL.friction * x, law)
    sim = Simulation(scene, device=device, threads=1)
    sim.run(until=end)
    assert len(sim.contacts().i) == 0, "an impact is not over"
    p = sim.particles
    spin = -STEEL.radius * p.spin[:, 1]
    return np.stack([p.velocity[:, 0] + spin, spin], axis=1) / (STEEL.friction * 5.0)


def test_sliding_steel_of_test_5(device, law):
    """From x = 7 on the contact point goes on at x - 7, R w' = -5, within 1 % (for an arm of R); 1e-5 with R - d."""
    x = np.array([7.5, 8.0, 10.0, 13.0, 25.0])
    found = grazing(device, law, x)
    np.testing.assert_allclose(found[:, 1], -5.0, rtol=0.01)
    spun = 5.0 * (1.0 - arm_lost(STEEL, 5.0))
    np.testing.assert_allclose(found[:, 1], -spun, rtol=1e-5)
    np.testing.assert_allclose(found[:, 0], x - 2.0 - spun, rtol=0, atol=1e-5 * 7.0)


def test_sticking_steel_of_test_5(device):
    """Below x = 6 the displacement law against its fine integration, whose arm is R: overlap 1.3 % of R, times x up to 2.

    The paper's curve belongs to another tangential stiffness.
    """
    fine = chung_ooi.FINE_STEEL
    found = grazing(device, "mindlin_displacement", fine[:, 0])
    np.testing.assert_allclose(found[:, 0], fine[:, 1], rtol=0, atol=0.03)
    np.testing.assert_allclose(found[:, 1], fine[:, 2], rtol=0, atol=0.03)


@pytest.mark.parametrize("precision", ["double", "mixed"])
@pytest.mark.parametrize("sphere", [SPINNING_ALUMINIUM, COPPER], ids=["aluminium", "copper"])
def test_opposite_velocities_and_spins_never_slip(make_simulation, sphere, precision):
    """Test 7: both surfaces pass the contact at one velocity, so v_t' = 0 and w' = w exactly, and v_n' = e v_n."""
    speed, n = 0.2, len(ANGLES)
    _, _, duration = sphere.impact(2.0 * speed, rigid_wall=False)
    step = duration / 200
    place, velocity, spin = np.zeros((3, n, 2, 3))
    x = sphere.radius + 0.5 * speed * step
    place[:, :, 0] = [-x, x]
    place[:, :, 2] = 3.0 * sphere.radius * np.arange(n)[:, None]
    velocity[:, :, 0] = [speed, -speed]
    spin[:, :, 2] = speed * np.tan(np.radians(ANGLES))[:, None] / sphere.radius * [1.0, -1.0]
    sim = make_simulation(
        place.reshape(-1, 3), velocities=velocity.reshape(-1, 3), spins=spin.reshape(-1, 3), radius=sphere.radius, step=step,
        density=sphere.density, young_modulus=sphere.young_modulus, poisson_ratio=sphere.poisson_ratio,
        restitution=sphere.restitution, friction=sphere.friction, tangential="mindlin", max_speed=2 * speed,
        engine={"precision": precision},
    )  # fmt: skip
    sim.run(until=1.2 * duration)
    assert len(sim.contacts().i) == 0
    after, turned = sim.particles.velocity.reshape(-1, 2, 3), sim.particles.spin.reshape(-1, 2, 3)
    assert np.abs(after[:, :, 1:]).max() < 1e-10
    np.testing.assert_allclose(turned, spin, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(after[:, :, 0], speed * sphere.restitution * np.tile([-1.0, 1.0], (n, 1)), rtol=2e-3)
