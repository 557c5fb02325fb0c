"""Two wet grains meet and part: what a bridge costs is its work from contact to rupture; against that integral."""

import math

import numpy as np
import pytest
from warpdem.kernels.liquid import bridge_rabinovich

from warpdem import Scene, Simulation

R, TENSION, SPEED, CONTACT_TIME = 1e-3, 0.07, 0.3, 3.0e-4
MASS = 0.5 * 2500.0 * 4.0 / 3.0 * math.pi * R**3  # m*
VOLUME = 0.02 * 4.0 / 3.0 * math.pi * R**3 * (1.0 - math.sqrt(0.75))


def restitution(dt: float, phase: float) -> float:
    """Speed at which they part over that at which they met; ``phase``: of the step at which they touch."""
    x = R + 1e-6 + 0.5 * phase * SPEED * dt
    sim = Simulation(Scene.model_validate({
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500, "young_modulus": "10 MPa", "poisson_ratio": 0.3}},
        "contact": {"liquid": "bridge_rabinovich", "tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "surface_tension": TENSION}],
        "grains": [{"material": "g", "radius": R, "liquid_content": 0.02, "positions": [[-x, 0, 0], [x, 0, 0]],
                    "velocities": [[0.5 * SPEED, 0, 0], [-0.5 * SPEED, 0, 0]]}],
        "time": {"end": 1.0, "step": dt, "max_speed": SPEED},
    }), device="cpu", threads=1)  # fmt: skip
    sim.step(round(2e-3 / dt))
    assert sim.liquid().bridge_count == 0 and sim.liquid().films == sim.liquid().brought
    left, right = sim.particles.velocity[:, 0]
    return float(right - left) / SPEED


def test_an_impact_loses_the_work_of_its_bridge_by_more_than_first_order():
    far, square = VOLUME ** (1 / 3), VOLUME / (math.pi * 0.5 * R)
    pull = 2.0 * math.pi * R * TENSION
    work = -float(bridge_rabinovich.energy(0.0, pull, square, far))
    exact = math.sqrt(1.0 - 2.0 * work / (MASS * SPEED**2))
    phases = np.linspace(0.0, 1.0, 4, endpoint=False)
    coarse, fine = (max(abs(restitution(CONTACT_TIME / n, p) - exact) for p in phases) for n in (40, 160))
    assert exact == pytest.approx(0.93328, abs=1e-5)
    assert coarse < 2.5e-4 and fine < 2e-5 and fine < coarse / 8.0
