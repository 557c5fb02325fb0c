"""The scenes of the gallery with clumps come out as their first lines say, beside spheres of equal volume."""

import math

import numpy as np
import pytest

import warpdem
from outcomes import centre_angle, instants, simulation


def as_spheres(name: str, diameter: float) -> warpdem.Simulation:
    """A scene of the gallery with spheres in place of its clumps, as many by volume."""
    scene = warpdem.load_demo(name)
    data = {**scene.model_dump(mode="json", exclude_unset=True), "base": scene.base}
    del data["clumps"]
    for group in data["grains"]:
        del group["clump"]
        group["fill"]["diameter"] = diameter
    return warpdem.Simulation(warpdem.Scene.model_validate(data), device="cpu", threads=1)


def gone(sim: warpdem.Simulation, until: float) -> tuple[float, float]:
    """Share of the mass that is gone at a time, and root mean square speed [m/s] of the rest."""
    held = sim.particles.mass.sum()
    sim.run(until=until)
    p = sim.particles
    return 1.0 - p.mass.sum() / held, float(np.sqrt(np.average((p.velocity**2).sum(1), weights=p.mass)))


def test_rods_fall_through_the_hole_whole():
    sim = simulation("rod_hopper", "grains.0.fill.region.max=[0.03,0.03,0.022]", "grains.0.fill.solid_fraction=0.2")
    start = sim.particles.mass.sum()
    sim.run(until=0.09)
    count, mass = sim.left["hole"]
    assert count > 3
    assert len(sim.particles.id) == 7 * len(sim.clumps.id)
    np.testing.assert_allclose(mass + sim.particles.mass.sum(), start, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_rods_arch_over_a_hole_through_which_spheres_run(seed):
    share, speed = gone(simulation("rod_hopper", f"grains.0.fill.seed={seed}"), 0.6)
    assert share < 0.1
    assert speed < 1e-3
    share, speed = gone(as_spheres("rod_hopper", 5.862e-3), 0.6)
    assert share > 0.15
    assert speed > 1e-2


@pytest.mark.slow
def test_rods_in_a_mill_are_as_fast_as_balls_and_scale_with_the_rate():
    assert abs(share_of_speed() - 0.43) < 0.04
    slow = ("gravity=[0,0,0]", "frame.0.rate='150 rpm'", "frame.1.rate='-300 rpm'")
    assert abs(share_of_speed(*slow, slowness=2.0) - share_of_speed("gravity=[0,0,0]")) < 0.03


def share_of_speed(*overrides: str, slowness: float = 1.0) -> float:
    """Root mean square speed of the centres of the rods in their jar, over that of the jar on the disk."""
    sim = simulation("rod_mill", *overrides)
    square = [(s.clumps.velocity**2).sum(1).mean() for s in instants(sim, 0.4 * slowness, 2e-3, 0.1 * slowness)]
    return math.sqrt(np.mean(square)) / (0.08 * sim.scene.frame[0].rate)


@pytest.mark.slow
def test_peanuts_stand_steeper_in_a_drum_than_spheres():
    angles = [
        np.mean([centre_angle(sim) for sim in instants(one, 2.0, 0.02, start=1.0)])
        for one in (simulation("peanut_drum"), as_spheres("peanut_drum", 5.234e-3))
    ]
    assert 35.0 < angles[0] < 44.0
    assert 21.0 < angles[1] < 30.0
