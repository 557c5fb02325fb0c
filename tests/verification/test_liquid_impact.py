"""Two wet grains, or one and a wall, meet and part: a bridge costs its work from contact to rupture; against that integral."""

import math

import numpy as np
import pytest
from warpdem.kernels.liquid import bridge_rabinovich

from warpdem import Scene, Simulation

R, TENSION, SPEED, CONTACT_TIME = 1e-3, 0.07, 0.3, 3.0e-4
MASS = 0.5 * 2500.0 * 4.0 / 3.0 * math.pi * R**3  # m*
FILM = 0.02 * 4.0 / 3.0 * math.pi * R**3  # of a grain
VOLUME = FILM * (1.0 - math.sqrt(0.75))
FROM_FULLEST = 1.728 * 0.5 * VOLUME
"""What a film gives to a bridge at most where it is the fullest there is."""


def met(dt: float, phase: float, **changes) -> Simulation:
    """After two have met and parted; ``phase``: of the step at which they touch. ``changes`` of the scene."""
    x = R + 1e-6 + 0.5 * phase * SPEED * dt
    sim = Simulation(Scene.model_validate({
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500, "young_modulus": "10 MPa", "poisson_ratio": 0.3}},
        "contact": {"liquid": "bridge_rabinovich", "tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "surface_tension": TENSION}],
        "grains": [{"material": "g", "radius": R, "liquid_content": 0.02, "positions": [[-x, 0, 0], [x, 0, 0]],
                    "velocities": [[0.5 * SPEED, 0, 0], [-0.5 * SPEED, 0, 0]]}],
        "time": {"end": 1.0, "step": dt, "max_speed": SPEED},
    } | changes), device="cpu", threads=1)  # fmt: skip
    sim.step(round(3e-3 / dt))
    assert sim.liquid().bridge_count == 0
    return sim


def restitution(dt: float, phase: float) -> float:
    """Speed at which two grains part over that at which they met."""
    sim = met(dt, phase)
    assert sim.liquid().films == sim.liquid().brought
    left, right = sim.particles.velocity[:, 0]
    return float(right - left) / SPEED


def restitution_at_a_wall(dt: float, phase: float, film: float) -> float:
    """Of a wet grain on a plane with a film [m]; half of the bridge stays on a wet one, all of it goes along from a dry one."""
    x = R + 1e-6 + phase * SPEED * dt
    grain = {"material": "g", "radius": R, "liquid_content": 0.02, "positions": [[x, 0, 0]], "velocities": [[-SPEED, 0, 0]]}
    plane = {"name": "plane", "material": "g", "plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}, "liquid_film": film}
    sim = met(dt, phase, grains=[grain], walls=[plane])
    totals = sim.liquid()
    assert totals.films == totals.brought + totals.from_walls
    kept = 0.5 * film * math.pi * R**2 - 0.25 * FILM if film > 0.0 else 0.0
    assert totals.volume("from_walls") == pytest.approx(kept, rel=1e-9, abs=0)
    return float(sim.particles.velocity[0, 0]) / SPEED


def expected(mass: float, radius: float, volume: float) -> float:
    """Restitution where the work of the bridge is all that is lost."""
    far, square = volume ** (1 / 3), volume / (math.pi * radius)
    work = -float(bridge_rabinovich.energy(0.0, 4.0 * math.pi * radius * TENSION, square, far))
    return math.sqrt(1.0 - 2.0 * work / (mass * SPEED**2))


def worst(of, exact: float, *arguments) -> tuple[float, float]:
    """Error over the phases of the touch, at 40 and at 160 steps per contact."""
    phases = np.linspace(0.0, 1.0, 4, endpoint=False)
    coarse, fine = (max(abs(of(CONTACT_TIME / n, p, *arguments) - exact) for p in phases) for n in (40, 160))
    return coarse, fine


def test_an_impact_loses_the_work_of_its_bridge_by_more_than_first_order():
    exact = expected(MASS, 0.5 * R, VOLUME)
    coarse, fine = worst(restitution, exact)
    assert exact == pytest.approx(0.93328, abs=1e-5)
    assert coarse < 2.5e-4 and fine < 2e-5 and fine < coarse / 8.0


@pytest.mark.parametrize(("film", "given"), [(0.0, FROM_FULLEST), (10e-6, 0.5 * FILM)], ids=["dry", "wet"])
def test_so_does_an_impact_on_a_wall_which_keeps_half_of_the_bridge_if_it_is_wet(film, given):
    """A film of 10 um under the grain is more than the grain gives to another, so that the grain gives half of its own."""
    exact = expected(2.0 * MASS, R, given + film * math.pi * R**2)
    coarse, fine = worst(restitution_at_a_wall, exact, film)
    assert coarse < 1e-4 and fine < 1e-5 and fine < coarse / 8.0
