"""Order of convergence where the forces are smooth (design section 4: the predicted velocity v*)."""

import math

import numpy as np


def test_a_damped_linear_contact_converges_with_second_order(make_simulation):
    """Damped oscillation q'' = -w^2 q - 2 l q' about the rest overlap, always in contact (exact_solutions 8)."""
    g, radius, density, stiffness, e = 9.81, 5e-3, 2500.0, 500.0, 0.5
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    beta = -math.log(e) / math.hypot(math.log(e), math.pi)
    w, rest = math.sqrt(stiffness / mass), mass * g / stiffness
    rate = beta * w
    damped = math.sqrt(w**2 - rate**2)
    start, end = 0.6 * rest, 3.0 / w  # stays in contact: the oscillation is smaller than the rest overlap

    def exact(t):
        return start * math.exp(-rate * t) * (math.cos(damped * t) + rate / damped * math.sin(damped * t))

    steps = np.array([20, 40, 80, 160, 320])
    error = []
    for n in steps:
        sim = make_simulation(
            [[0, 0, radius - rest + start]],
            radius=radius,
            density=density,
            gravity=[0, 0, -g],
            normal="hooke",
            stiffness=stiffness,
            restitution=e,
            walls=({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},),
            step=end / n,
        )
        sim.step(int(n))
        error.append(abs(sim.particles.position[0, 2] - (radius - rest + exact(end))) / start)
    order = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert 1.9 < order < 2.1
    assert error[-1] < 1e-4


def test_a_damped_pair_converges_with_second_order(make_simulation):
    """Two grains that push each other apart from rest: q'' = -w^2 q - 2 l q' of their overlap, while they touch."""
    radius, density, stiffness, e, start = 5e-3, 2500.0, 500.0, 0.5, 1e-4
    reduced = 0.5 * density * 4.0 / 3.0 * math.pi * radius**3
    w = math.sqrt(stiffness / reduced)
    rate = -math.log(e) / math.hypot(math.log(e), math.pi) * w
    damped = math.sqrt(w**2 - rate**2)
    end = 1.0 / w  # a sixth of a period: they still touch
    exact = start * math.exp(-rate * end) * (math.cos(damped * end) + rate / damped * math.sin(damped * end))
    steps = np.array([10, 20, 40, 80])
    error = []
    for n in steps:
        sim = make_simulation(
            [[0, 0, 0], [2 * radius - start, 0, 0]], radius=radius, density=density, normal="hooke", stiffness=stiffness,
            restitution=e, step=end / n,
        )  # fmt: skip
        sim.step(int(n))
        x = sim.particles.position[:, 0]
        error.append(abs(2 * radius - (x[1] - x[0]) - exact) / start)
    order = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert exact > 0.4 * start
    assert 1.9 < order < 2.1
    assert error[-1] < 1e-3
