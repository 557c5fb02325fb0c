"""The factor of stiffness that brings overlaps down: obeyed, it does so, and little less would not."""

import re

import pytest

from adhesion import YOUNG, meeting
from warpdem import Simulation
from warpdem.app import scene_warnings
from warpdem.model.stiffer import deepest_overlap, least_factor, stiffened

WEIGHT = {"gravity": [0, 0, -9.81]}


def simulation(speed, energy, young=YOUNG, **changes):
    material = {"density": 2500, "young_modulus": young, "poisson_ratio": 0.3}
    given = meeting(speed, 1e-8, energy=energy, materials={"g": material}, **WEIGHT | changes)
    return Simulation(given, device="cpu", threads=1)


def warned(*given, **changes) -> str:
    return next(line for line in scene_warnings.warnings(simulation(*given, **changes)) if "overlap" in line)


@pytest.mark.parametrize(
    ("speed", "energy", "changes"),
    [(0.1, 50.0, {}), (2.0, 50.0, {}), (3.0, 0.0, {}), (1.7, 0.0, {}), (0.1, 50.0, {"engine": {"max_overlap": 0.05}}),
     (1.8, 10.0, {"normal": "dmt"})],
)  # fmt: skip
def test_obeyed_it_brings_the_overlap_down(speed, energy, changes):
    line = warned(speed, energy, **changes)
    factor = float(re.search(r"([\d.e+]+) times the young_modulus", line)[1])
    sound = changes.get("engine", {}).get("max_overlap", 0.1)
    assert factor > 1.0
    assert simulation(speed, energy, factor * YOUNG, **changes).limits.overlap <= sound
    assert simulation(speed, energy, 0.89 * factor * YOUNG, **changes).limits.overlap > sound  # two digits: rounded up by 10 %


def test_it_is_that_of_hertz_without_adhesion():
    """At one speed d ~ E^(-2/5)."""
    sim = simulation(4.0, 0.0)
    found = least_factor(sim.scene, sim.expected, 4.0, 0.1, "young_modulus")
    assert found == pytest.approx((sim.limits.overlap / 0.1) ** 2.5, rel=3e-3)
    assert deepest_overlap(sim.scene, sim.expected, 4.0) == sim.limits.overlap
    assert stiffened(sim.scene, "young_modulus", 3.0).materials["g"].young_modulus == pytest.approx(3.0 * YOUNG)


def test_a_key_without_effect_has_no_factor():
    sim = simulation(4.0, 0.0)
    assert least_factor(sim.scene, sim.expected, 4.0, 0.1, "pairs[].stiffness") is None


def test_the_stiffness_of_a_pair_is_scaled_where_the_law_has_one():
    pairs = [{"materials": ["g", "g"], "restitution": 0.9, "stiffness": 100.0}]
    sim = simulation(2.0, 0.0, normal="hooke", pairs=pairs)
    factor = least_factor(sim.scene, sim.expected, 2.0, 0.1, "pairs[].stiffness")
    assert factor == pytest.approx((sim.limits.overlap / 0.1) ** 2, rel=3e-3)


def test_a_surface_energy_that_alone_overlaps_grains_is_named():
    line = warned(0.1, 50.0)
    assert "pairs[].surface_energy" in line and "J/m2: was mJ/m2 meant?" in line and "1.15e+03 times their weight" in line
    assert "surface_energy" in warned(0.1, 50.0, gravity=[0, 0, 0])
    assert "surface_energy" not in warned(4.0, 0.05)
    assert "surface_energy" not in warned(4.0, 0.0)
