"""What ``check`` tells of adhesion: strength beside weight and impacts, the law that suits, softer grains."""

import io
import math

import numpy as np
import pytest
from rich.console import Console
from warpdem.kernels.normal import luding
from warpdem.kernels.normal.jkr import binding, root

from adhesion import DENSITY, ENERGY, MASS, PULL, PULL_OFF, RADIUS, meeting
from law_scenes import ELASTIC
from warpdem import Scene, Simulation
from warpdem.app import check
from warpdem.model.adhesion import adhesions
from warpdem.model.impact import impact, own_of

WEIGHT = 2.0 * MASS * 9.81
FLOOR = {"name": "floor", "material": "g", "plane": {"point": [0, 0, -0.01], "normal": [0, 0, 1]}}


def simulation(**changes) -> Simulation:
    changes = {"gravity": [0, 0, -9.81], "walls": [FLOOR], **changes}
    return Simulation(meeting(0.02, 5e-6, **changes), device="cpu", threads=1)


def numbers(**changes):
    sim = simulation(**changes)
    return adhesions(sim.scene, sim.expected)


def printed(**changes) -> str:
    out = io.StringIO()
    check.print_description(check.describe(simulation(**changes), probe=False), Console(file=out, width=400))
    return out.getvalue()


def test_numbers_of_jkr_are_those_of_the_theory():
    grains, wall = numbers()
    assert grains.pull_off_force == pytest.approx(PULL, rel=1e-10)
    assert grains.bond_number == pytest.approx(PULL / WEIGHT, rel=1e-10) == pytest.approx(2.2935, rel=1e-4)
    assert grains.sticking_speed == pytest.approx(8.62468381638e-3, rel=1e-10)
    # (R* w^2/(E*^2 z^3))^(1/3) = d_c/(0.75 pi^(2/3) z)
    assert grains.tabor_number == pytest.approx(PULL_OFF / (0.75 * math.pi ** (2 / 3) * 0.3e-9), rel=1e-10)
    assert wall.wall and wall.materials == ("g", "g") and wall.radius == RADIUS
    assert wall.bond_number == pytest.approx(2.0 * grains.bond_number, rel=1e-10)
    assert wall.sticking_speed == pytest.approx(9.68088026256e-3, rel=1e-10)
    # a sphere on a wall: Thornton and Ning (1998), who give 1.84
    scale = (ENERGY**5 / (RADIUS**5 * DENSITY**3 * ELASTIC**2)) ** (1.0 / 6.0)
    assert wall.sticking_speed == pytest.approx(1.8401831808 * scale, rel=1e-10)
    assert wall.pull_off_force == pytest.approx(4.71238898038e-4, rel=1e-11)


def test_softer_grains_keep_the_pull_and_less_surface_energy_the_speed():
    soft = {"g": {"density": 2500, "young_modulus": 1e6, "poisson_ratio": 0.3}}
    hard, softer, weaker = numbers()[0], numbers(materials=soft)[0], numbers(materials=soft, energy=0.1 * 0.1**0.4)[0]
    assert softer.pull_off_force == pytest.approx(hard.pull_off_force, rel=1e-12)
    assert softer.sticking_speed == pytest.approx(hard.sticking_speed * 10 ** (1 / 3), rel=1e-12)
    assert weaker.sticking_speed == pytest.approx(hard.sticking_speed, rel=1e-12)


def test_other_laws_state_what_they_do():
    fixed, dmt = numbers(normal="jkr_fixed_load")[0], numbers(normal="dmt")[0]
    assert fixed.pull_off_force == pytest.approx(PULL, rel=1e-10)
    assert fixed.sticking_speed / numbers()[0].sticking_speed == pytest.approx(math.sqrt(0.462014 / 0.935503), rel=1e-5)
    assert dmt.pull_off_force == pytest.approx(4.0 / 3.0 * PULL, rel=1e-10)
    assert dmt.sticking_speed == 0.0
    assert dmt.tabor_number == pytest.approx(fixed.tabor_number, rel=1e-10)
    data = simulation().scene.model_dump(exclude_unset=True)
    del data["pairs"][0]["surface_energy"]
    hertz = Scene.model_validate({**data, "contact": {"normal": "hertz", "tangential": "none"}})
    assert adhesions(hertz, simulation().expected) == []


def of_pair(normal: str, **keys):
    """Adhesion of two grains and of a grain and the floor."""
    pair = {"materials": ["g", "g"], "restitution": 1.0, **keys}
    return numbers(normal=normal, pairs=[pair]), printed(normal=normal, pairs=[pair])


def test_sjkr_pulls_at_most_where_its_force_is_least():
    [grains, wall], text = of_pair("sjkr", cohesion_energy_density=1e5)
    d = np.linspace(0.0, 5e-6, 200_001)
    stiffness = 4.0 / 3.0 * ELASTIC * math.sqrt(RADIUS)
    least = (stiffness * d**1.5 - 1e5 * math.pi * (RADIUS**2 - (RADIUS - d) ** 2)).min()
    assert wall.pull_off_force == pytest.approx(-least, rel=1e-9)
    assert grains.pull_off_force == pytest.approx(1.70965808e-4, rel=5e-3)  # to d/R
    assert (grains.sticking_speed, grains.tabor_number, grains.pressed_by) == (0.0, None, 0.0)
    assert "1.66 of its weight (granular Bond number); a touch costs nothing" in text and "Tabor" not in text


def test_laws_that_yield_are_asked_for_the_pull_after_the_weight():
    keys = {"stiffness": 100, "unloading_stiffness": 500, "plasticity_depth": 0.016, "adhesion_stiffness": 100}
    [grains, wall], text = of_pair("luding", **keys)
    assert grains.pressed_by == wall.pressed_by == pytest.approx(WEIGHT, rel=1e-12)
    row = {"stiffness": 100.0, "radius": 0.5 * RADIUS, "limit": 500.0, "adhesion": 100.0, "yield_depth": 2e-5}
    assert grains.pull_off_force == pytest.approx(luding.pull_after(WEIGHT, **row), rel=1e-12)
    assert f"{grains.bond_number:.3g} of its weight (granular Bond number); after a load of 0.000103 N, its weight" in text
    # of an impact by pieces, exact: the least force after the largest
    for load, least in ((4.472135955e-4, 1.38196601125e-4), (1.11803398875e-3, 5.90169943749e-4)):
        assert luding.pull_after(load, **row) == pytest.approx(least, rel=1e-9)
    [grains, _], _ = of_pair("edinburgh", surface_energy=0.5, pull_off_force="50 uN")
    assert 5e-5 < grains.pull_off_force < 5e-4 and grains.tabor_number is None
    assert of_pair("edinburgh", surface_energy=0, pull_off_force="50 uN")[0][0].pull_off_force == pytest.approx(5e-5, rel=1e-12)


def test_check_tells_them():
    text = printed()
    assert "adhesion of g (radius 0.001 m) and g: pull-off force 0.000236 N, 2.29 of its weight (granular Bond number)" in text
    assert "and a wall of g: pull-off force 0.000471 N, 4.59 of its weight" in text
    assert "undamped impacts stick below 0.00862 m/s; Tabor number 1.83e+03 (at 0.3 nm)" in text
    assert "at a tenth of it 2.15 times; surface_energy x 0.398" in text
    without = printed(normal="dmt", gravity=[0, 0, 0])
    assert "a touch costs nothing" in without and "Bond" not in without and "softer" not in without
    [row, _] = check.describe(simulation(), probe=False)["adhesion"]
    assert row["materials"] == ["g", "g"] and row["bond_number"] == pytest.approx(PULL / WEIGHT)


def test_limits_know_the_pull_of_a_touch():
    """An impact is deeper by what the touch gives: at no speed to where the energy is that of the touch again."""
    sim = simulation()
    row, own = sim.model.coefficient_table[0], own_of("jkr", sim.model.coefficient_table[0])
    base = row[sim.plan.contact.coefficients.stiffness]
    still = impact("jkr", base, MASS, 0.5 * RADIUS, 1e-9, own)
    assert binding(root(still.overlap / PULL_OFF)) == pytest.approx(binding(root(0.0)), rel=1e-9)
    assert still.overlap > 2.0 * PULL_OFF
    fast = impact("jkr", base, MASS, 0.5 * RADIUS, 0.02, own)
    assert fast.overlap == pytest.approx(3.68333406693e-6, rel=1e-7)
    assert fast.time == pytest.approx(2.0 * 2.40293542146e-4, rel=1e-4)
