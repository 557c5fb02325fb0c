import math

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.twisting import marshall

from law_scenes import DENSITY, HERTZ, MASS, POISSON, RADIUS, YOUNG
from model_probes import RTOL
from warpdem import Scene, SceneError, Simulation

PRESSED, FRICTION = 1e-3, 0.5  # [N], [-]
DEPTH = (PRESSED / HERTZ) ** (2.0 / 3.0)
A = 4.086651012781559e-5  # radius of the contact [m]
STIFFNESS = 3.088235294117653e-7  # k_q [N m/rad]
LIMIT = 1.3622170042605196e-8  # [N m]
INERTIA = 0.2 * MASS * RADIUS**2  # of the relative spin of two grains [kg m2]
SHEAR = 4.0 * (1 - POISSON) / (2.0 * (2.0 - POISSON)) * 1.5  # k_t/k_n


def torque(real, *inputs):
    of_law = marshall.build(real)

    @wp.kernel(module="unique", enable_backward=False)
    def probe(
        angle: real, rate: real, radius: real, stiffness: real, damping: real, load: real, out: wp.array(dtype=real)
    ):
        moment, held = of_law(angle, rate, radius, stiffness, damping, load)
        out[0] = moment
        out[1] = held

    out = wp.zeros(2, dtype=real, device="cpu")
    wp.launch(probe, dim=1, inputs=[*inputs, out], device="cpu")
    return [float(x) for x in out.numpy()]


def test_spring_dashpot_and_limit_are_those_of_the_area(real):
    k_t, gamma = 370.0, 0.02
    half = 0.5 * A**2
    close = {"rel": 3 * RTOL[real], "abs": 0}
    moment, held = torque(real, 1e-3, 2.0, A, k_t, gamma, 1.0)
    assert moment == pytest.approx(-half * (k_t * 1e-3 + gamma * 2.0), **close)
    assert held == pytest.approx(1e-3, **close)
    moment, held = torque(real, -0.2, 0.0, A, k_t, gamma, 5e-4)
    assert moment == pytest.approx(2.0 / 3.0 * A * 5e-4, **close)
    assert held == pytest.approx(-2.0 / 3.0 * A * 5e-4 / (half * k_t), **close)
    moment, held = torque(real, 0.9 * 2.0 / 3.0 * A * 5e-4 / (half * k_t), 1e3, A, k_t, gamma, 5e-4)  # the dashpot is cut
    assert moment == pytest.approx(-2.0 / 3.0 * A * 5e-4, **close)
    assert torque(real, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0) == [0.0, 0.0]
    assert marshall.energy(0.1, A, k_t) == pytest.approx(0.5 * half * k_t * 0.01, rel=1e-14, abs=0)


def pressed(spin: float, step: float = 1e-6, friction: float = FRICTION, wall: bool = False, **changes) -> Simulation:
    """Two grains, or a grain and a plane, that a field presses together along x and that spin against each other."""
    apart = RADIUS - 0.5 * DEPTH
    places, spins = [[-apart, 0, 0], [apart, 0, 0]], [[0.5 * spin, 0, 0], [-0.5 * spin, 0, 0]]
    centre, walls = [0, 0, 0], []
    if wall:  # R* and m* twice as large
        depth = (PRESSED / (HERTZ * math.sqrt(2.0))) ** (2.0 / 3.0)
        apart = RADIUS - depth
        places, spins = [[apart, 0, 0]], [[spin, 0, 0]]
        walls = [{"name": "plane", "material": "g", "plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}]
    data = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": DENSITY, "young_modulus": YOUNG, "poisson_ratio": POISSON}},
        "contact": {"twisting": "marshall"},
        "pairs": [{"materials": ["g", "g"], "restitution": 1.0, "friction": friction}],
        "grains": [{"material": "g", "radius": RADIUS, "positions": places, "spins": spins}],
        "walls": walls,
        "fields": [{"model": "harmonic", "parameters": {"stiffness": PRESSED / apart, "centre": centre}}],
        "time": {"end": 1.0, "step": step, "max_speed": 1e-3},
        "measures": {"energy": True},
    }
    return Simulation(Scene.model_validate(data | changes), device="cpu", threads=1)


def relative(sim: Simulation) -> float:
    spin = sim.particles.spin[:, 0]
    return float(spin[0] - spin[1]) if len(spin) > 1 else float(spin[0])


def test_constants_of_the_reference():
    assert math.sqrt(0.5 * RADIUS * DEPTH) == pytest.approx(A, rel=1e-13, abs=0)
    k_t = SHEAR * HERTZ * math.sqrt(DEPTH)
    assert 0.5 * k_t * A**2 == pytest.approx(STIFFNESS, rel=1e-13, abs=0)
    assert 2.0 / 3.0 * A * FRICTION * PRESSED == pytest.approx(LIMIT, rel=1e-13, abs=0)
    assert LIMIT / STIFFNESS == pytest.approx(0.04410988394748, rel=1e-12, abs=0)


@pytest.mark.parametrize("wall", [False, True], ids=["pair", "wall"])
def test_small_twists_swing_at_the_rate_of_the_spring(wall):
    """61.11474666336 Hz for the pair; a wall has 2^(1/3) of the depth, twice R* and twice the inertia."""
    stiffness, inertia = STIFFNESS, INERTIA
    if wall:
        depth = (PRESSED / (HERTZ * math.sqrt(2.0))) ** (2.0 / 3.0)
        stiffness = 0.5 * SHEAR * HERTZ * math.sqrt(2.0) * math.sqrt(depth) * RADIUS * depth
        inertia = 0.4 * MASS * RADIUS**2
    rate = math.sqrt(stiffness / inertia)
    if not wall:
        assert rate / (2.0 * math.pi) == pytest.approx(61.11474666336, rel=1e-12)
    sim = pressed(1.0, 1e-5, wall=wall)
    quarter = 0.5 * math.pi / rate
    sim.run(until=2.0 * quarter)
    # the spring is a step old when the run begins, as the rolling spring is: the swing is ahead by a step
    assert relative(sim) == pytest.approx(math.cos(rate * sim.time), abs=1.1 * rate * 1e-5)
    sim.run(until=3.0 * quarter)
    assert relative(sim) == pytest.approx(math.cos(rate * sim.time), abs=1.1 * rate * 1e-5)
    energy = sim.energy()
    assert energy["rotational"] + energy["elastic"] > 0
    # the spring holds what the spin has lost
    held = sim.budget.energy()["elastic_rolling"]
    assert held == pytest.approx(0.5 * inertia * math.sin(rate * sim.time) ** 2, rel=1e-3, abs=0)
    assert abs(sim.budget.energy()["integration_error"]) < 1e-3 * 0.5 * inertia


def test_a_fast_twist_slips_at_the_limit_and_stops():
    """Counter-spun at 50 rad/s: slips after 9.00006864e-4 s with 47.0436455955 rad/s left, stops at 8.132920609e-3 s."""
    sim = pressed(50.0)
    sim.run(until=9.0e-4)
    assert relative(sim) == pytest.approx(47.0436455955, abs=1.2 * LIMIT / INERTIA * sim.dt)
    start, first = sim.time, relative(sim)
    sim.run(until=5.0e-3)
    slowing = (first - relative(sim)) / (sim.time - start)
    assert slowing == pytest.approx(LIMIT / INERTIA, rel=1e-5)
    sim.run(until=8.13e-3)
    assert relative(sim) > 0.0
    stops = sim.time + relative(sim) / (LIMIT / INERTIA)
    assert stops == pytest.approx(8.132920609e-3, abs=1.2 * sim.dt)
    lost = sim.budget.energy()["dissipated_rolling"]
    slipped = 0.21424119936 - 0.5 * 0.04410988394748  # its last half is in the spring
    assert lost == pytest.approx(LIMIT * slipped - LIMIT * 0.5 * 0.04410988394748, rel=2e-3, abs=0)
    assert abs(sim.budget.energy()["integration_error"]) < 1e-4 * lost
    sim.run(until=9.0e-3)
    assert relative(sim) < 0.0, "the spring swings back"


def test_friction_of_zero_leaves_it_out_and_other_choices_are_told():
    sim = pressed(50.0, friction=0.0)
    assert sim.plan.contact.twisting is None
    assert any("left out  twisting resistance: there is no friction" in line for line in sim.plan.explain())
    assert "twist" in pressed(1.0).plan.contact.history
    pair = [{"materials": ["g", "g"], "restitution": 1.0}]
    for contact, words in (
        ({"twisting": "marshall", "tangential": "none"}, ["contact.twisting", "set contact.tangential"]),
        ({"twisting": "marshall", "rolling": "spring", "torsion": True}, ["contact.twisting", "contact.torsion = true"]),
        ({"twisting": "marshal"}, ["contact.twisting", 'did you mean "marshall"']),
    ):
        with pytest.raises(SceneError) as error:
            pressed(1.0, contact=contact, pairs=pair)
        for word in words:
            assert word in str(error.value)


def test_pressing_a_twisted_contact_creates_no_energy():
    """The field presses twice as hard for a while: depth and stiffness swing, the energy in all only falls."""
    sim = pressed(8.0, 2.5e-6, fields=[{"model": "harmonic", "parameters": {"stiffness": 2.0 * PRESSED / RADIUS}}])
    total = []
    for _ in range(60):
        sim.step(40)
        total.append(sum(sim.energy().values()))
    spread = np.ptp(total) / total[0]
    budget = sim.budget.energy()
    assert budget["dissipated_rescaling"] > 1e-11
    assert budget["dissipated_rolling"] >= 0.0, "nothing slips: all that is lost, the spring gave up as the contact grew"
    assert abs(budget["integration_error"]) < 5e-3 * budget["dissipated_rescaling"]
    assert max(np.diff(total)) < 1e-3 * total[0] and spread < 0.5
