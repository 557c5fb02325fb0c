"""The stability limit by the rolling spring, k_r = 2.25 k_n (mu_r R)^2: a ball on a floor holds just below it and not above.

Its rolling bends the spring and slips at once: w^2 is the larger root of m I w^4 - (k_t (I + m R^2) + k_r m) w^2 + k_t k_r = 0
with I = (2/5) m R^2. Without dashpot the limit of the predicted velocity is dt = 2/w; with one it is bounded from below, by
30 % at most.
"""

import numpy as np
import pytest

from warpdem import Scene, Simulation

RADIUS, DENSITY, YOUNG = 5e-3, 2500.0, 5e6
MASS = DENSITY * 4 / 3 * np.pi * RADIUS**3
STIFFNESS = 4 / 3 * YOUNG / (2 * (1 - 0.3**2)) * np.sqrt(RADIUS)
DEPTH = (MASS * 9.81 / STIFFNESS) ** (2 / 3)
SPEED = float(np.sqrt(0.8 * STIFFNESS * DEPTH**2.5 / MASS))
"""An impact at this speed has the overlap of rest."""


def simulation(friction: float, damping: float, step: float, max_speed: float) -> Simulation:
    data = dict(
        materials=dict(g=dict(density=DENSITY, young_modulus=YOUNG, poisson_ratio=0.3)),
        contact=dict(rolling="spring"),
        pairs=[dict(materials=["g", "g"], restitution=0.2, friction=2.0, rolling_friction=friction, rolling_damping=damping)],
        grains=[dict(material="g", positions=[[0, 0, RADIUS - DEPTH]], radius=RADIUS, velocities=[[1e-6, 0, 0]])],
        walls=[dict(name="floor", material="g", plane=dict(point=[0, 0, 0], normal=[0, 0, 1]))],
        time=dict(end=100.0, step=step, max_speed=max_speed),
        engine=dict(guards="record"),
    )
    return Simulation(Scene.model_validate(data), device="cpu", threads=1)


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("friction", [3.0, 10.0])
def test_a_ball_rests_below_the_limit_and_not_above(friction, damping):
    limit = simulation(friction, damping, 1e-7, SPEED).limits.stable
    spins = []
    for share in (0.95, 1.3):
        sim = simulation(friction, damping, share * limit, 1e-6)
        sim.step(3000)
        spins.append(float(np.abs(sim.particles.spin).max()))
    assert spins[0] < 1e-12
    assert spins[1] > 1e-3
