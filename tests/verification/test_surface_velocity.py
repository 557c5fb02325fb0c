"""Belts: surfaces that move along themselves (Coulomb's law and rigid bodies by hand; the same surface as a moving wall)."""

import math

import numpy as np
import pytest

from warpdem import Scene, Simulation
from warpdem.measure.totals import Totals
from warpdem.measure.wall_loads import total_loads

R, MU, G, V = 1e-3, 0.3, 9.81, 0.2
STEP = 5e-6
MASS = 2500 * 4 / 3 * math.pi * R**3
FLOOR = {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
SHEET = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"


def simulation(wall, *, positions=((0, 0, R),), velocities=None, rolling=0.0, threads=1, resident=None, **keys):
    grains = {"material": "g", "radius": R, "positions": positions, "velocities_in": "laboratory"}
    scene = {
        "gravity": [0, 0, -G],
        "materials": {"g": {"density": 2500, "young_modulus": "5 MPa", "poisson_ratio": 0.3}},
        "contact": {"rolling": "constant" if rolling else "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5, "friction": MU, "rolling_friction": rolling}],
        "grains": [grains | ({} if velocities is None else {"velocities": velocities})],
        "walls": [{"name": "belt", "material": "g", **wall}],
        "measures": {"energy": True},
        "time": {"end": 1, "step": STEP},
    }
    return Simulation(Scene.model_validate(scene | keys), device="cpu", threads=threads, resident=resident)


def test_power_of_a_belt_is_that_of_its_present_speed():
    """At rest until 5 ms: then mu m g V. What it brings in is no instability, and what was read stays when the run goes on."""
    start = {"schedule": [{"until": 5e-3, "velocity": [0, 0, 0]}, {"velocity": [V, 0, 0]}]}
    sim = simulation({**FLOOR, "surface_velocity": start}, measures={})
    assert sim.wall_loads()["belt"].power == 0.0
    sim.run(until=0.015)
    expected = MU * MASS * G * V
    assert sim.wall_loads()["belt"].power == pytest.approx(expected, rel=2e-3)
    read = Totals(sim.view).made()
    sim.run(until=0.1)  # it rolls along, and nothing is lost any more
    assert abs(sim.wall_loads()["belt"].power) < 0.1 * expected
    assert total_loads(read)["belt"].power == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("mesh", [False, True], ids=["plane", "mesh"])
def test_a_grain_laid_on_a_belt_slides_as_coulomb_says_then_rolls(tmp_path, mesh):
    """Sliding at a = mu g, R w' = 5/2 mu g, until v + R w = V: t = 2/7 V/(mu g) = 19.4 ms, v = 2/7 V, way v^2/(2 mu g).

    The sinking into the floor (3e-4 of R) and the bounce of its onset are what is left: 2e-3.
    """
    (tmp_path / "belt.obj").write_text(SHEET, encoding="utf-8")
    wall = {"mesh": str(tmp_path / "belt.obj"), "open": True} if mesh else FLOOR
    sim = simulation({**wall, "surface_velocity": [V, 0, 0.7]})  # what points off the surface has no effect
    end = 2 / 7 * V / (MU * G)
    sim.run(until=0.5 * end)
    assert sim.particles.velocity[0, 0] == pytest.approx(MU * G * sim.time, rel=2e-3)
    assert sim.wall_loads()["belt"].power == pytest.approx(MU * MASS * G * V, rel=2e-3)
    sim.run(until=0.97 * end)
    assert sim.particles.velocity[0, 0] == pytest.approx(MU * G * sim.time, rel=2e-3)
    sim.run(until=1.03 * end)
    assert sim.particles.velocity[0, 0] == pytest.approx(2 / 7 * V, rel=2e-3)
    way = 0.5 * MU * G * end**2 + 2 / 7 * V * (sim.time - end)
    assert sim.particles.position[0, 0] == pytest.approx(way, rel=2e-3)
    sim.run(until=2 * end)
    assert sim.particles.velocity[0, 0] == pytest.approx(2 / 7 * V, rel=2e-3)
    assert sim.particles.spin[0, 1] * R == pytest.approx(-5 / 7 * V, rel=2e-3)
    # the belt works over V t, half of it heats the contact: mu m g V t/2
    books = sim.budget.energy()
    assert books["belt work"] == pytest.approx(MU * MASS * G * V * end, rel=2e-3)
    assert books["dissipated_sliding"] == pytest.approx(0.5 * MU * MASS * G * V * end, rel=2e-3)
    assert abs(books["integration_error"]) < 1e-3 * books["belt work"]


def test_rolling_friction_brings_the_grain_to_the_speed_of_the_belt():
    """Seen from the belt: sliding, then rolling at 5/7 V that ends after V/(mu_r g) in all, as on a floor at rest."""
    rolling = 0.1
    sim = simulation({**FLOOR, "surface_velocity": [V, 0, 0]}, rolling=rolling)
    floor = simulation(FLOOR, rolling=rolling, velocities=[[-V, 0, 0]])
    for until in (0.05, 0.15, 0.25):
        sim.run(until=until)
        floor.run(until=until)
        assert sim.particles.velocity[0, 0] - V == pytest.approx(floor.particles.velocity[0, 0], abs=1e-9 * V)
    assert sim.particles.velocity[0, 0] == pytest.approx(V, rel=1e-2)
    assert abs(sim.particles.spin[0, 1]) * R < 0.01 * V


SCHEDULES = {
    "vector": ({"velocity": [V, -0.1, 0]}, [V, -0.1, 0]),
    "ramp": ({"schedule": [{"until": 0.01, "velocity": [[0, 0, 0], [V, 0, 0]]}, {"velocity": [0.1, 0, 0]}]},) * 2,
    "table": ({"table": [[0, 0, 0, 0], [0.02, V, 0.1, 0]]},) * 2,
    "bounded": ({"velocity": [V, 0, 0], "start": 0.004, "until": 0.012},) * 2,
    "shaken": ({"amplitude": [1e-3, 0, 0], "frequency": 40},) * 2,
}


@pytest.mark.parametrize("frame", [None, {"axis": [0, 0, 1], "rate": 5.0}], ids=["laboratory", "turning frame"])
@pytest.mark.parametrize("name", SCHEDULES)
def test_a_conveying_plane_is_a_plane_that_moves_along_itself(name, frame):
    """An endless plane that moves along itself is the same surface: motions and power, in both frames.

    The slip over a step is that of the mean of its ends, the moved plane's exact: they differ where the velocity bends.
    """
    motion, surface = SCHEDULES[name]
    keys = {"positions": [[0, 0, R], [2.001 * R, 0, R], [R, 0, 2.73 * R]], "velocities": [[0, 0.05, 0]] * 3}
    keys |= {"frame": frame}
    fixed = {"fixed_to": "laboratory"}
    moved = simulation({**FLOOR, **fixed, "motion": motion}, **keys)
    conveying = simulation({**FLOOR, **fixed, "surface_velocity": surface}, **keys)
    for steps in (500, 1500, 2000):
        moved.step(steps)
        conveying.step(steps)
        one, other = moved.particles, conveying.particles
        np.testing.assert_allclose(one.position_lab, other.position_lab, rtol=0, atol=1e-5 * R)
        np.testing.assert_allclose(one.velocity_lab, other.velocity_lab, rtol=0, atol=2e-4 * V)
        np.testing.assert_allclose(one.spin_lab, other.spin_lab, rtol=0, atol=2e-4 * V / R)
    assert np.linalg.norm(one.position_lab[0, :2]) > 0.1 * R
    powers = [sim.budget.energy()["belt work"] for sim in (moved, conveying)]
    assert powers[1] == pytest.approx(powers[0], rel=2e-3)


DRUM = {"point": [0, -1, 0], "axis": [0, 1, 0], "radius": 0.02, "inside": False}


@pytest.mark.parametrize("speed", ["speed", "schedule", "table"])
def test_a_belt_around_a_drum_is_a_turning_drum(speed):
    """A speed along axis x n on a cylinder is the surface of one that turns at speed/radius; the grain rides over its top."""
    given = {"speed": {"speed": V}, "schedule": {"schedule": [{"speed": V}]}, "table": {"table": [[0, V]]}}[speed]
    start = {"positions": [[0.002, 0, math.sqrt(0.021**2 - 0.002**2)]]}
    turning = simulation({"cylinder": DRUM, "motion": {"axis": [0, 1, 0], "rate": V / 0.02}}, **start)
    belt = simulation({"cylinder": DRUM, "surface_velocity": {"axis": [0, 1, 0], **given}}, **start)
    for sim in (turning, belt):
        sim.step(4000)
    np.testing.assert_allclose(belt.particles.position, turning.particles.position, rtol=0, atol=1e-6 * R)
    np.testing.assert_allclose(belt.particles.spin, turning.particles.spin, rtol=0, atol=1e-6 * V / R)
    assert abs(belt.particles.spin[0, 1]) * R > 0.1 * V
    loads = [sim.wall_loads()["belt"].power for sim in (turning, belt)]
    assert loads[1] == pytest.approx(loads[0], rel=1e-5)


def test_a_belt_around_two_drums_carries_a_grain_along_its_top_and_back_below(tmp_path):
    """Top and bottom of a closed box under one speed about one axis move in opposite directions."""
    box = ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "v 0 0 1", "v 1 0 1", "v 1 1 1", "v 0 1 1"]
    faces = ["4 3 2 1", "5 6 7 8", "1 2 6 5", "2 3 7 6", "3 4 8 7", "4 1 5 8"]
    (tmp_path / "box.obj").write_text("\n".join([*box, *("f " + f for f in faces)]) + "\n", encoding="utf-8")
    wall = {"mesh": str(tmp_path / "box.obj"), "scale": [0.1, 0.02, 0.01], "surface_velocity": {"axis": [0, 1, 0], "speed": V}}
    top = simulation(wall, positions=[[0.05, 0.01, 0.01 + R]])
    bottom = simulation(wall, positions=[[0.05, 0.01, -R]], gravity=[0, 0, G])
    for sim in (top, bottom):
        sim.run(until=0.04)
    assert top.particles.velocity[0, 0] == pytest.approx(2 / 7 * V, rel=2e-3)
    assert bottom.particles.velocity[0, 0] == pytest.approx(-2 / 7 * V, rel=2e-3)


def test_bits_on_threads_in_the_graph_and_after_a_resume(tmp_path):
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0), np.arange(3.0), indexing="ij"), axis=-1).reshape(-1, 3)
    keys = {"positions": 2.05 * R * grid + [0, 0, R] + rng.uniform(0, 0.04 * R, grid.shape)}
    wall = {**FLOOR, "surface_velocity": {"axis": [0, 1, 0], "schedule": [{"until": 0.004, "speed": [0, V]}, {"speed": V}]}}
    one = simulation(wall, **keys)
    one.step(600)
    one.save_checkpoint(tmp_path / "a.h5")
    one.step(900)
    resumed = Simulation.from_checkpoint(tmp_path / "a.h5", device="cpu", threads=2)
    resumed.step(900)
    others = [simulation(wall, threads=2, **keys), simulation(wall, resident=True, **keys)]
    for sim in others:
        sim.step(1500)
    assert {sim.state_hash() for sim in (resumed, *others)} == {one.state_hash()}
    assert one.particles.velocity[:, 0].mean() > 0.02
