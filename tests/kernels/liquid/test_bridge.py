import numpy as np
import pytest
import warp as wp
from warpdem.kernels.liquid import bridge

from bridges import WORK, YOUNG_LAPLACE
from lane_probes import assert_same_bits

FULL_FIT = {
    (0.001, 0): (0.91878, 0.62119),
    (0.001, 30): (0.77316, 0.53450, 0.11855, 0.04408),
    (0.01, 0): (0.87149, 0.80726, 0.47099, 0.25316, 0.09642),
    (0.01, 30): (0.72331, 0.40932, 0.22941, 0.10004),
    (0.05, 0): (0.81464, 0.66197, 0.50576, 0.29965),
}
"""Willett's fit, computed by another program."""
RUPTURE = {(0.001, 0): 0.101, (0.001, 30): 0.127442, (0.01, 0): 0.220085, (0.01, 30): 0.277703, (0.05, 0): 0.381975}
TENSION, RADIUS = 0.07, 0.5  # R* of two spheres of radius 1
LANES = 8


def made(volume, angle, real=wp.float64):
    """Functions of the law, and the numbers that a bridge keeps."""
    of, cosine = bridge.build(real), np.cos(np.radians(angle))
    formed = of.formed(wp.float64(volume), wp.float64(RADIUS), wp.float64(TENSION), wp.float64(cosine))
    return of, real(4.0 * np.pi * RADIUS * TENSION * cosine), formed


def pulls(cases, real):
    """Pulls [N] of (volume, angle [deg], gap), one by one, which must have the bits of those in lanes."""
    numbers = [made(volume, angle, real)[1:] for volume, angle, _ in cases]
    rows = [(gap, float(pull), [float(x) for x in formed]) for (_, _, gap), (pull, formed) in zip(cases, numbers, strict=True)]
    rows += rows[-1:] * (-len(rows) % LANES)
    gap, pull, kept = (np.array(column) for column in zip(*rows, strict=True))
    types = {"gap": (real, gap), "pull": (real, pull), "bridge": (bridge.BRIDGE.vector(real), kept)}
    (found,) = assert_same_bits(bridge.build(real).force, types, (real,), LANES)
    return found[: len(cases), 0]


def test_force_is_that_of_the_fit_in_lanes_too():
    cases = [(volume, angle, gap) for volume, angle, gaps, *_ in YOUNG_LAPLACE for gap in gaps]
    wanted = [bridge.force(gap, volume, RADIUS, TENSION, np.cos(np.radians(angle))) for volume, angle, gap in cases]
    np.testing.assert_allclose(pulls(cases, wp.float64), wanted, rtol=1e-14)
    np.testing.assert_allclose(pulls(cases, wp.float32), wanted, rtol=4e-6)


@pytest.mark.parametrize(("volume", "angle", "gaps", "exact", "rupture"), YOUNG_LAPLACE)
def test_force_and_rupture_are_those_of_the_fit_and_near_young_laplace(volume, angle, gaps, exact, rupture):
    cosine = np.cos(np.radians(angle))
    force = bridge.force(np.array(gaps), volume, RADIUS, TENSION, cosine) / (2.0 * np.pi * TENSION)
    np.testing.assert_allclose(force, FULL_FIT[volume, angle], rtol=0, atol=6e-6)
    np.testing.assert_allclose(force, exact, rtol=0.045)
    assert bridge.rupture(volume, RADIUS, cosine) == pytest.approx(RUPTURE[volume, angle], rel=3e-6)
    assert bridge.rupture(volume, RADIUS, cosine) == pytest.approx(rupture, rel=0.025)
    _, _, formed = made(volume, angle)
    assert float(formed[0]) == pytest.approx(RUPTURE[volume, angle], rel=3e-6)


@pytest.mark.parametrize(("volume", "angle"), WORK)
def test_the_work_is_that_of_the_force_and_near_young_laplace(volume, angle):
    of, pull, formed = made(volume, angle)
    numbers = [float(x) for x in formed]
    work = float(of.work(pull, formed))
    assert work / (2.0 * np.pi * TENSION) == pytest.approx(WORK[volume, angle], rel=0.025)
    gap = np.linspace(0.0, numbers[0], 20_001) ** 2 / numbers[0]
    whole = np.trapezoid(bridge.force(gap, volume, RADIUS, TENSION, np.cos(np.radians(angle))), gap)
    assert work == pytest.approx(whole, rel=1e-6)
    held = bridge.energy(np.array([0.0, 0.5, 1.0]) * numbers[0], float(pull), numbers[1], numbers[0], *numbers[2:])
    assert held[0] == pytest.approx(-work, rel=1e-12) and held[2] == 0.0
    step, far = 1e-5 * numbers[0], 0.4 * numbers[0]
    rise = bridge.energy(np.array([far + step, far - step]), float(pull), numbers[1], numbers[0], *numbers[2:])
    slope = (rise[0] - rise[1]) / (2.0 * step)
    assert slope == pytest.approx(bridge.force(far, volume, RADIUS, TENSION, np.cos(np.radians(angle))), rel=1e-5)


def test_volumes_outside_of_the_fit():
    least, below = (bridge.exponents(volume, RADIUS, 1.0) for volume in (1e-5, 1e-9))
    assert least == below
    assert 0.0 < bridge.force(1e-6, 1e-9, RADIUS, TENSION, 1.0) < 2.0 * np.pi * TENSION
