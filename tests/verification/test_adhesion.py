"""Adhesion (``normal = "jkr"``): impacts, sticking, what a touch costs, contacts that hang; against the theory's closed forms.

Reference numbers are of an integration of the equation of motion to 1e-12, by another program (scipy), for the pair of
``helpers/adhesion.py``.
"""

import math

import numpy as np
import pytest

from adhesion import ENERGY, MASS, PULL, PULL_OFF, RADIUS, meeting
from law_scenes import impacts, parting_speeds
from warpdem import Scene, Simulation
from warpdem.state import restart

LOSS = 0.935502783271928609 * PULL * PULL_OFF
"""What a touch and a parting of the pair cost [J]."""
STICKING = math.sqrt(2.0 * LOSS / MASS)
# speed [m/s], on a plane, restitution, time of contact [s]
IMPACTS = {
    "gentle": (0.02, False, 0.902240030518, 5.27090413841e-4),
    "fast": (0.1, False, 0.996273799167, 3.36083069259e-4),
    "on a plane": (0.1, True, 0.995302996948, 3.87734256579e-4),
}


def rebound(speed, step, phase=0.5, *, wall=False, steps=0, **keys) -> float:
    """Speed at which the two part over that at which they meet."""
    sim = Simulation(meeting(speed, step, phase, wall=wall, **keys), device="cpu", threads=1)
    sim.step(steps or round(1.6 * 5.3e-4 / step))
    velocity = sim.particles.velocity[:, 2]
    return float(velocity[0] if wall else velocity[0] - velocity[1]) / speed


@pytest.mark.parametrize("case", IMPACTS)
def test_impacts_are_of_order_three_halves_through_both_jumps(case):
    speed, wall, restitution, time = IMPACTS[case]
    worst, mean = [], []
    for steps in (40, 160):
        scene = impacts("jkr", {"surface_energy": ENERGY}, speed, time / steps, phases=16)
        sim = Simulation(scene, device="cpu", threads=1)
        sim.step(round(1.6 * steps))
        error = parting_speeds(sim, 16)[wall] / speed - restitution
        worst.append(np.abs(error).max())
        mean.append(abs(error.mean()))
    assert mean[0] < 1e-4 and mean[1] < 1e-5
    assert worst[0] < 4e-3
    assert worst[1] < 4e-4
    assert math.log(worst[0] / worst[1], 4.0) > 1.4


@pytest.mark.parametrize("case", IMPACTS)
def test_contact_time_and_restitution_are_those_of_the_theory(case):
    speed, wall, restitution, time = IMPACTS[case]
    step = time / 4000
    sim = Simulation(meeting(speed, step, wall=wall), device="cpu", threads=1)
    held = deepest = 0
    for _ in range(4900):
        sim.step(1)
        contacts = sim.contacts()
        if len(contacts.i) and contacts.own["depth"][0] > 0.0:
            held += 1
            deepest = max(deepest, contacts.overlap[0])
    assert held * step == pytest.approx(time, rel=1e-3)
    velocity = sim.particles.velocity[:, 2]
    assert (velocity[0] - (0.0 if wall else velocity[1])) / speed == pytest.approx(restitution, abs=2e-5)
    if case != "on a plane":
        assert deepest == pytest.approx({"gentle": 3.68333406693e-6, "fast": 1.12957476594e-5}[case], rel=1e-5)


@pytest.mark.parametrize(
    ("speed", "restitution"), [(0.02, 0.671223462), (0.05, 0.8400285197), (0.1, 0.8716659854), (0.5, 0.8921415229)]
)
def test_damped_impacts_give_back_what_the_equation_of_motion_does(speed, restitution):
    steps = 320
    step = 5.3e-4 * (0.02 / speed) ** 0.2 / steps
    assert rebound(speed, step, restitution=0.9, steps=2 * steps) == pytest.approx(restitution, abs=2e-4)


@pytest.mark.parametrize(("normal", "lost"), [("jkr", 0.935502783271928609), ("jkr_fixed_load", 0.462014008967731)])
def test_grains_stick_below_the_speed_whose_energy_a_touch_takes(normal, lost):
    """And rebound at sqrt(1 - (v_s/v)^2) above: LAMMPS, whose contacts end at the largest pull, measures 0.99811 at 0.1 m/s."""
    speed = math.sqrt(2.0 * lost * PULL * PULL_OFF / MASS)
    assert STICKING == pytest.approx(8.62468381638e-3, rel=1e-10)
    low, high = 0.99 * speed, 1.01 * speed
    assert rebound(high, 2e-6, normal=normal, steps=1500) > 0.05
    sim = Simulation(meeting(low, 2e-6, normal=normal), device="cpu", threads=1)
    for _ in range(6):
        sim.step(1500)
        assert sim.contacts().own["depth"][0] > 0.0
    fast = rebound(0.1, 2e-6, normal=normal, steps=400)
    assert fast == pytest.approx(math.sqrt(1.0 - (speed / 0.1) ** 2), abs=1e-4)


def test_a_touch_costs_what_the_theory_says_and_energy_closes():
    time = IMPACTS["gentle"][3]
    errors = []
    for steps in (80, 320):
        sim = Simulation(meeting(0.02, time / steps, measures={"energy": True}), device="cpu", threads=1)
        motion = sim.energy()["kinetic"]
        sim.step(round(1.6 * steps))
        budget = sim.budget.energy()
        assert budget["dissipated_adhesion"] == pytest.approx(LOSS, rel=1e-10)
        assert budget["elastic_normal"] == 0.0
        errors.append(abs(budget["integration_error"]) / motion)
    assert errors[1] < 1e-3
    assert errors[0] > 4 * errors[1]
    # grains that stick: the binding energy of their overlap at rest, when all else is damped
    stuck = Simulation(meeting(0.005, 5e-6, restitution=0.3, measures={"energy": True}), device="cpu", threads=1)
    stuck.step(4000)
    budget = stuck.budget.energy()
    assert budget["elastic_normal"] == pytest.approx(-1.5426 * PULL * PULL_OFF, rel=1e-4)
    assert stuck.contacts().overlap[0] == pytest.approx(1.21141372855476 * PULL_OFF, rel=1e-6)
    assert abs(budget["integration_error"]) < 1e-3 * (budget["dissipated_normal_damping"] + budget["dissipated_adhesion"])


def parting(**keys) -> Simulation:
    """The pair as it is at 0.9 to 0.95 d_c on its way out."""
    scene = meeting(0.02, 5e-7, engine={"skin": keys.pop("skin", "auto")})
    sim = Simulation(scene, device="cpu", **{"threads": 1, **keys})
    sim.step(1222)
    return sim


def test_a_contact_that_hangs_at_nine_tenths_of_its_reach_holds_through_lists_resume_and_phases(tmp_path):
    sims = {
        "auto": parting(), "narrow": parting(skin=1e-6), "wide": parting(skin=2e-4), "threads": parting(threads=2),
        "graph": parting(resident=True), "rebuilt": parting(),
    }  # fmt: skip
    rebuilt = sims["rebuilt"]
    before = rebuilt.lists.rebuilds
    whole = sims["auto"]
    assert -0.95 < whole.contacts().overlap[0] / PULL_OFF < -0.9
    assert whole.contacts().own["depth"][0] > 0.0
    whole.save_checkpoint(tmp_path / "saved.h5")
    sims["resumed"] = Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1)
    started = Simulation(restart.started_from(whole.scene, tmp_path / "saved.h5"), device="cpu", threads=1)
    for steps in (2, 300, 1000):
        for sim in (*sims.values(), started):
            for _ in range(steps):
                if sim is rebuilt:
                    sim.lists.update(force_rebuild=True)
                sim.step(1)
        assert len({sim.state_hash() for sim in sims.values()}) == 1, steps
        held = [sim.contacts().own["depth"].max(initial=0.0) > 0.0 for sim in (*sims.values(), started)]
        assert held == [steps == 2] * len(held)
    assert rebuilt.lists.rebuilds - before == 1302
    np.testing.assert_allclose(started.particles.velocity, whole.particles.velocity, rtol=1e-9)


def test_a_contact_that_ends_at_the_largest_pull_goes_on_after_a_resume(tmp_path):
    whole = Simulation(meeting(0.02, 2e-6, normal="jkr_fixed_load"), device="cpu", threads=1)
    whole.step(1)
    while not whole.contacts().overlap[0] < -0.3 * PULL_OFF or whole.contacts().own["depth"][0] == 0.0:
        whole.step(1)
    whole.save_checkpoint(tmp_path / "saved.h5")
    resumed = Simulation.from_checkpoint(tmp_path / "saved.h5", device="cpu", threads=1)
    for steps, held in ((1, True), (100, False)):
        for sim in (whole, resumed):
            sim.step(steps)
        assert resumed.state_hash() == whole.state_hash()
        assert (resumed.contacts().own["depth"].max(initial=0.0) > 0.0) == held


def chain(count: int) -> Scene:
    """Grains that hang from each other, the first from a ceiling, each at the overlap that carries those below it."""
    weight = 2.0 * MASS * 9.81
    heights, z = [], 0.0
    for k in range(count):
        load, reduced = (count - k) * weight, RADIUS if k == 0 else 0.5 * RADIUS
        z -= (RADIUS if k == 0 else 2.0 * RADIUS) - hanging(load, reduced)
        heights.append([0.0, 0.0, z])
    ceiling = {"name": "ceiling", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, -1]}}
    return meeting(0.02, 5e-6, gravity=[0, 0, -9.81], walls=[ceiling],
                   grains=[{"material": "g", "radius": RADIUS, "positions": heights}])  # fmt: skip


def hanging(load: float, reduced: float) -> float:
    """Stable overlap [m] of a contact of R* ``reduced`` [m] that is pulled by ``load`` [N], or by as much as it holds."""
    share = reduced / (0.5 * RADIUS)
    held = min(load / (PULL * share), 0.88)
    cube = 3.0 + math.sqrt(9.0 - 9.0 * held)  # s^3: s^6 - 6 s^3 = -9 F/F_c
    s = cube ** (1.0 / 3.0)
    return PULL_OFF * share ** (1.0 / 3.0) * (s**4 - 4.0 * s) / 3.0


@pytest.mark.parametrize("count", [1, 3, 4])
def test_a_chain_hangs_while_its_weight_is_less_than_the_pull_off_force(count):
    """A contact of two grains holds 2.29 of their weights, that with the ceiling 4.59: of four the lower three fall."""
    sim = Simulation(chain(count), device="cpu", threads=1)
    start = sim.particles.position[:, 2].copy()
    sim.step(6000)
    fallen = start - sim.particles.position[:, 2]
    if count < 4:
        assert np.abs(fallen).max() < 1e-15
        assert (sim.contacts().own["depth"] > 0.0).sum() == count
    else:
        assert (fallen > 2.0 * RADIUS).tolist() == [False, True, True, True]
        assert fallen[1:] == pytest.approx(0.5 * 9.81 * sim.time**2, rel=0.02)  # the contact holds on until it tears


@pytest.mark.parametrize(("share", "holds"), [(1.05, True), (0.95, False)])
def test_friction_of_a_grain_on_a_vertical_wall_goes_by_twice_the_pull_off_force(share, holds):
    """Nothing presses it to the wall: F = 0, so friction may carry mu 2 F_c, its weight at mu = 0.11."""
    weight, pull = 2.0 * MASS * 9.81, 2.0 * PULL
    wall = {"name": "wall", "material": "g", "plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}
    rest = 1.21141372855476 * PULL_OFF * 2.0 ** (1.0 / 3.0)
    pair = {"materials": ["g", "g"], "restitution": 0.5, "surface_energy": 0.1}
    sim = Simulation(
        meeting(
            0.02, 5e-6, gravity=[0, 0, -9.81], walls=[wall],
            contact={"normal": "jkr", "tangential": "mindlin", "rolling": "spring"},
            pairs=[{**pair, "friction": share * weight / (2.0 * pull), "rolling_friction": 0.5}],
            grains=[{"material": "g", "radius": RADIUS, "positions": [[RADIUS - rest, 0, 0]]}],
        ),
        device="cpu", threads=1,
    )  # fmt: skip
    sim.step(6000)
    contacts = sim.contacts()
    assert contacts.load[0] == pytest.approx(2.0 * pull, rel=1e-3)
    assert contacts.overlap[0] == pytest.approx(rest, rel=1e-3)
    fallen = -float(sim.particles.position[0, 2])
    assert contacts.force[0, 2] == pytest.approx(min(share, 1.0) * weight, rel=1e-2)
    assert 0.0 < fallen < 5e-6 if holds else fallen > 1e-4


@pytest.mark.parametrize("speed", [0.1, 0.008])
def test_a_floor_of_triangles_is_a_plane(speed, tmp_path):
    """Grains that rebound and that stick, on two triangles and on 3 200."""
    vertices, faces = [], []
    found = []
    for cells in (0, 1, 40):
        wall = {"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
        if cells:
            edge = np.linspace(-5e-3, 5e-3, cells + 1)
            vertices = [(x, y, 0.0) for x in edge for y in edge]
            corner = [i * (cells + 1) + j for i in range(cells) for j in range(cells)]
            faces = [t for a in corner for t in ((a, a + cells + 1, a + 1), (a + 1, a + cells + 1, a + cells + 2))]
            path = tmp_path / f"floor{cells}.obj"
            lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in vertices]
            path.write_text("\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]))
            wall = {"name": "floor", "material": "g", "mesh": str(path), "open": True}
        start = [[0.3e-3, 0.1e-3, RADIUS + 2.0 * PULL_OFF]]
        grains = {"material": "g", "radius": RADIUS, "positions": start, "velocities": [[0.0, 0.0, -speed]]}
        sim = Simulation(meeting(speed, 2e-6, wall=True, walls=[wall], grains=[grains]), device="cpu", threads=1)
        sim.step(500)
        found.append(sim.particles.position[0])
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=0, atol=1e-13)
