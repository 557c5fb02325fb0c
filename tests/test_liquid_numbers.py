"""What ``check`` tells of liquid: strength beside weight and impacts, rupture, the step of a thin gap; against closed forms."""

import io
import math

import numpy as np
import pytest
from rich.console import Console
from warpdem.kernels.liquid import bridge, bridge_rabinovich

from warpdem import Scene, Simulation
from warpdem.app import check
from warpdem.model.liquid_numbers import bridges

R, TENSION, CONTENT = 1e-3, 0.072, 0.02
MASS = 2500.0 * 4.0 / 3.0 * math.pi * R**3
VOLUME = CONTENT * 4.0 / 3.0 * math.pi * R**3 * (1.0 - math.sqrt(0.75))  # 6.7 % of each of two films


def scene(law="bridge_rabinovich", content=CONTENT, film=0.0, **pair) -> Scene:
    wet = {"surface_tension": TENSION} | pair if law != "none" else {}
    return Scene.model_validate({
        "materials": {"g": {"density": 2500, "young_modulus": "5 MPa", "poisson_ratio": 0.3}},
        "contact": {"liquid": law}, "pairs": [{"materials": ["g", "g"], "restitution": 0.8, **wet}],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}, "liquid_film": film}],
        "grains": [{"material": "g", "radius": R, "positions": [[0, 0, 2e-3], [0.01, 0, 2e-3]], "liquid_content": content}],
        "time": {"end": 1.0, "max_speed": 1.0},
    })  # fmt: skip


def of(**keys):
    sim = Simulation(scene(**keys), device="cpu", threads=1)
    return bridges(sim.scene, sim.expected), sim


def test_numbers_of_the_closed_form():
    (grains, wall), _ = of()
    pull = 2.0 * math.pi * R * TENSION
    assert grains.volume == pytest.approx(VOLUME, rel=1e-12)
    assert grains.pull == pytest.approx(pull, rel=1e-12)
    assert grains.bond_number == pytest.approx(pull / (MASS * 9.81), rel=1e-12)
    assert grains.rupture == pytest.approx(VOLUME ** (1 / 3), rel=1e-12)
    square, far = VOLUME / (math.pi * 0.5 * R), VOLUME ** (1 / 3)
    work = pull * (far + math.sqrt(square) - math.hypot(far, math.sqrt(square)))
    assert grains.sticking_speed == pytest.approx(math.sqrt(2.0 * work / (0.5 * MASS)), rel=1e-4)
    assert wall.wall and wall.pull == pytest.approx(2.0 * pull, rel=1e-12)
    # half a film is more than a film gives: 1.728 times what an equal grain gets of it
    assert wall.volume == pytest.approx(1.728 * 0.5 * VOLUME, rel=1e-12)


def test_a_wet_wall_adds_its_film_and_dry_grains_have_no_bridges():
    (wall,), sim = of(content=0.0, film=1e-5)
    assert wall.wall and wall.volume == pytest.approx(1e-5 * math.pi * R**2, rel=1e-12)
    assert bridges(scene(law="none", content=0.0), sim.expected) == []
    (full, _), _ = of(law="bridge", contact_angle="30 deg")
    cosine = math.cos(math.radians(30.0))
    assert full.pull == pytest.approx(bridge.force(0.0, VOLUME, 0.5 * R, TENSION, cosine), rel=1e-12)
    assert bridge_rabinovich.rupture(VOLUME, 0.5 * R, cosine) < full.rupture


def test_the_reach_of_the_lists_holds_the_longest_bridge():
    _, sim = of(law="bridge")
    most = 2.0 * sim.model.liquid.most_from_film * sim.model.liquid.quantum
    assert most == pytest.approx(1.728 * VOLUME, rel=1e-9)
    assert sim.plan.contact.gap == pytest.approx(1.2 * bridge.rupture(most, 0.5 * R, 1.0), rel=1e-9)
    assert sim.plan.contact.force_gap == 0.0


def test_the_step_knows_the_dashpot_of_the_thinnest_gap():
    _, sim = of(viscosity="1 Pa s", roughness="1 um")
    limit = 0.3 * MASS * 1e-6 / (6.0 * math.pi * 1.0 * R**2)  # at the wall, where R* is twice that of two grains
    assert sim.limits.thin_gap == pytest.approx(limit, rel=1e-12)
    assert sim.dt == pytest.approx(limit, rel=0.05) and sim.limits.binding == "the dashpot of the thinnest liquid gap"
    assert not np.isfinite(of()[1].limits.thin_gap)
    out = io.StringIO()
    check.print_description(check.describe(sim, probe=False), Console(file=out, width=400))
    line = "liquid between g (radius 0.001 m) and g: the first bridge holds 1.12e-11 m3, pulls with 0.000452 N"
    assert line in out.getvalue()
    assert "dashpot of the thinnest liquid gap" in out.getvalue()
