"""The Python interface, scenes with hardly anything in them, and runs that go wrong."""

import math
from pathlib import Path

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation, StabilityError, WarpdemError
from warpdem.app.run import run_scene

RADIUS = 1.0e-3
MASS = 2500 * 4 / 3 * math.pi * RADIUS**3
FLOOR = {"name": "floor", "material": "glass", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}


def simulate(positions, *, velocities=None, spins=None, contact=None, pair=None, threads=1, ids=None, **changes):
    n = len(positions)
    data = {
        "gravity": [0, 0, 0],
        "materials": {"glass": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": contact or {},
        "pairs": [{"materials": ["glass", "glass"], "restitution": 0.5, **({"friction": 0.5} | (pair or {}))}],
        "grains": [
            {
                "material": "glass",
                "positions": positions,
                "radius": RADIUS,
                "velocities": np.zeros((n, 3)) if velocities is None else velocities,
                "spins": np.zeros((n, 3)) if spins is None else spins,
                "ids": np.arange(n) if ids is None else ids,
            }
        ],
        "time": {"end": 1, "step": 1e-5, "max_speed": 0.5},
    }
    return Simulation(Scene.model_validate(data | changes), device="cpu", threads=threads)


PAIR = [[0, 0, 0], [1.99e-3, 0, 0]]


def test_readings_have_their_shapes_types_and_order():
    sim = simulate([[0, 0, 0], [1, 0, 0], [2, 0, 0]], ids=[7, 3, 5])
    p = sim.particles
    np.testing.assert_array_equal(p.id, [3, 5, 7])
    np.testing.assert_array_equal(p.position, [[1, 0, 0], [2, 0, 0], [0, 0, 0]])
    for name in ("position", "velocity", "spin", "position_lab", "velocity_lab", "spin_lab"):
        values = getattr(p, name)
        assert (values.shape, values.dtype) == ((3, 3), np.float64), name
    np.testing.assert_allclose(p.mass, MASS, rtol=1e-14)
    np.testing.assert_allclose(p.inertia, 0.4 * MASS * RADIUS**2, rtol=1e-14)
    np.testing.assert_array_equal(p.radius, RADIUS)
    assert set(sim.energy()) == {"kinetic", "rotational", "elastic", "potential"}
    assert len(sim.state_hash()) == 64


def test_what_is_no_scene_is_refused_with_the_call_that_makes_one(tmp_path):
    for call in (Simulation, lambda given: run_scene(given, tmp_path / "out")):
        with pytest.raises(TypeError, match=r"a Scene is needed, not str: give load_scene\('own\.toml'\)$"):
            call("own.toml")
    with pytest.raises(TypeError, match=r"not (Posix|Windows)Path: give load_scene\('own\.toml'\)$"):
        Simulation(Path("own.toml"))
    with pytest.raises(TypeError, match=r"not dict: give Scene\.model_validate\(\{\.\.\.\}\)$"):
        Simulation({"time": {"end": 1}})
    assert not list(tmp_path.iterdir())


def test_time_does_not_run_back():
    sim = simulate(PAIR)
    sim.step(20)
    before = sim.state_hash()
    with pytest.raises(ValueError, match=r"step\(-5\): must be 0 or more"):
        sim.step(-5)
    for until in (1e-4, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=rf"run\(until={until:g}\): .* the present time, 0\.0002 s"):
            sim.run(until=until)
    sim.step(0)
    sim.run(until=sim.time)
    assert (sim.step_number, sim.state_hash()) == (20, before)


def test_a_simulation_says_what_and_where_it_is():
    sim = simulate(PAIR)
    sim.step(20)
    assert repr(sim) == str(sim) == "<Simulation of <scene>: 2 grains at t = 0.0002 s (step 20) on cpu>"


def test_readings_are_copies():
    sim = simulate(PAIR)
    before = sim.state_hash()
    for name in ("position", "velocity", "spin", "radius", "mass", "id"):
        getattr(sim.particles, name)[:] = 99
    sim.loads()[0][:] = 99.0
    assert sim.state_hash() == before
    assert sim.particles.position[0, 0] == 0.0


def test_time_is_step_times_dt():
    sim = simulate([[0, 0, 0]])
    assert (sim.time, sim.step_number) == (0.0, 0)
    sim.step(1)
    sim.step(999)
    assert sim.step_number == 1000
    assert sim.time == 1000 * sim.dt == 1000 * 1e-5
    sim.step(0)
    assert sim.step_number == 1000


def test_run_goes_to_the_first_step_at_or_after_its_time():
    sim = simulate([[0, 0, 0]])
    sim.run(until=1e-3)
    assert sim.step_number == 100, "1e-3 / 1e-5 is 100 and a rounding error"
    sim.run(until=1.0001e-3)
    assert sim.step_number == 101
    sim.run(until=1.0001e-3)
    assert sim.step_number == 101, "that is now"


def test_one_grain_flies_its_parabola():
    """Kick and drift are exact in uniform gravity."""
    sim = simulate([[0, 0, 1]], velocities=[[0.3, 0, 0.2]], gravity=[0, 0, -9.81])
    sim.step(5000)
    t = sim.time
    np.testing.assert_allclose(sim.particles.position[0], [0.3 * t, 0, 1 + 0.2 * t - 0.5 * 9.81 * t**2], rtol=1e-12)
    np.testing.assert_allclose(sim.particles.velocity[0], [0.3, 0, 0.2 - 9.81 * t], rtol=1e-12)
    contacts = sim.contacts()
    assert len(contacts.i) == 0
    assert contacts.normal.shape == (0, 3)


def test_two_grains_that_never_touch():
    sim = simulate([[0, 0, 0], [0.5, 0, 0]], velocities=[[0.1, 0, 0], [-0.1, 0, 0]])
    sim.step(2000)
    np.testing.assert_allclose(sim.particles.position[:, 0], [2e-3, 0.498], rtol=1e-12)
    assert sim.extremes["pair_overlap_share"] == 0.0
    assert sim.lists.contact_count == 0


def test_scene_without_grains_is_refused_or_runs():
    """The scene asks for at least one group with at least one position."""
    with pytest.raises(SceneError, match="positions"):
        simulate(np.zeros((0, 3)))


def test_momentum_is_kept_and_action_is_reaction():
    sim = simulate(PAIR, velocities=[[0.1, 0.2, 0], [-0.3, 0, 0.1]], spins=[[0, 0, 100], [50, 0, 0]])
    sim.step(1)
    contacts = sim.contacts()
    np.testing.assert_array_equal(contacts.i, [0])
    np.testing.assert_array_equal(contacts.j, [1])
    np.testing.assert_allclose(contacts.normal[0], [-1, 0, 0], rtol=0, atol=1e-3)
    force, torque = sim.loads()
    np.testing.assert_array_equal(force[0], -force[1])
    np.testing.assert_array_equal(force[0], contacts.force[0])
    assert contacts.force[0] @ contacts.normal[0] > 0, "pushes apart"

    def angular(p):
        orbital = np.cross(p.position, p.mass[:, None] * p.velocity).sum(axis=0)
        return orbital + (p.inertia[:, None] * p.spin).sum(axis=0)

    before = angular(sim.particles)
    sim.step(500)
    p = sim.particles
    np.testing.assert_allclose(
        (p.mass[:, None] * p.velocity).sum(axis=0), MASS * np.array([-0.2, 0.2, 0.1]), rtol=1e-11
    )
    np.testing.assert_allclose(angular(p), before, rtol=0, atol=1e-12 * np.abs(before).max())
    assert torque.any()


def test_laboratory_and_frame_readings_agree():
    frame = {"axis": [0, 0, 1], "origin": [0.1, 0, 0], "rate": 20.0}
    sim = simulate([[0.3, 0, 0]], velocities=[[0, 0.5, 0.1]], spins=[[1, 2, 3]], frame=frame)
    np.testing.assert_allclose(sim.particles.velocity_lab[0], [0, 0.5 + 20 * 0.2, 0.1], rtol=1e-12)
    np.testing.assert_allclose(sim.particles.spin_lab[0], [1, 2, 23], rtol=1e-12)
    sim.step(3000)
    p, t = sim.particles, sim.time
    expected = np.array([0.3, (0.5 + 4.0) * t, 0.1 * t])
    np.testing.assert_allclose(p.position_lab[0], expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(p.velocity_lab[0], [0, 4.5, 0.1], rtol=0, atol=1e-12)
    c, s = math.cos(20 * t), math.sin(20 * t)
    back = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    origin = np.array([0.1, 0, 0])
    np.testing.assert_allclose(p.position[0], origin + back @ (expected - origin), rtol=0, atol=1e-13)
    relative = back @ [0, 4.5, 0.1] - np.cross([0, 0, 20], p.position[0] - origin)
    np.testing.assert_allclose(p.velocity[0], relative, rtol=0, atol=1e-11)
    np.testing.assert_allclose(p.spin[0], back @ [1, 2, 23] - [0, 0, 20], rtol=0, atol=1e-11)


def test_velocities_may_be_given_in_the_laboratory():
    grains = {"material": "glass", "positions": [[0.3, 0, 0]], "radius": RADIUS, "velocities": [[1, 2, 3]],
              "spins": [[4, 5, 6]], "velocities_in": "laboratory"}  # fmt: skip
    sim = simulate([[0, 0, 0]], grains=[grains], frame={"axis": [0, 0, 1], "rate": 20.0})
    np.testing.assert_allclose(sim.particles.velocity_lab[0], [1, 2, 3], rtol=0, atol=1e-13)
    np.testing.assert_allclose(sim.particles.spin_lab[0], [4, 5, 6], rtol=0, atol=1e-13)


def test_energies_are_those_of_a_pressed_moving_pair():
    sim = simulate(PAIR, velocities=[[0, 0, 0.5], [0, 0, 0.5]], spins=[[10, 0, 0], [0, 0, 0]], gravity=[0, 0, -9.81])
    energy = sim.energy()
    assert energy["kinetic"] == pytest.approx(2 * 0.5 * MASS * 0.25, rel=1e-12)
    assert energy["rotational"] == pytest.approx(0.5 * 0.4 * MASS * RADIUS**2 * 100, rel=1e-12)
    stiffness = 4 / 3 * (5e6 / (2 * (1 - 0.3**2))) * math.sqrt(RADIUS / 2)
    assert energy["elastic"] == pytest.approx(0.4 * stiffness * (0.01e-3) ** 2.5, rel=1e-9)
    assert energy["potential"] == pytest.approx(0.0, abs=1e-20)


def test_energy_of_elastic_frictionless_grains_is_kept():
    """After the contact all of it is back; in it the sum of kinetic and elastic is the same."""
    keys = {"contact": {"tangential": "none"}, "pair": {"restitution": 1.0, "friction": 0.0}}
    sim = simulate([[0, 0, 0], [2.05e-3, 0.3e-3, 0]], velocities=[[0.1, 0, 0], [-0.1, 0, 0]],
                   time={"end": 1, "step": 2e-6, "max_speed": 0.5}, **keys)  # fmt: skip
    first = sum(sim.energy().values())
    deepest = 0.0
    for _ in range(60):
        sim.step(25)
        energy = sim.energy()
        deepest = max(deepest, energy["elastic"])
        assert sum(energy.values()) == pytest.approx(first, rel=2e-3)
    assert deepest > 0.5 * first
    assert energy["elastic"] == 0.0
    assert energy["kinetic"] == pytest.approx(first, rel=1e-4)


def test_snapshot_is_what_is_read():
    sim = simulate(PAIR, velocities=[[0.1, 0, 0], [0, 0, 0]], frame={"axis": [0, 0, 1], "rate": 5.0})
    sim.step(10)
    shot, p = sim.snapshot(), sim.particles
    assert (shot.step, shot.time) == (10, sim.time)
    for name in ("id", "type", "radius", "mass", "position", "velocity", "spin"):
        np.testing.assert_array_equal(getattr(shot, name), getattr(p, name))
    np.testing.assert_array_equal(shot.force, sim.loads()[0])
    assert shot.frame.angle == pytest.approx(5.0 * sim.time)


# -- runs that go wrong --------------------------------------------------------------------------


def test_speed_far_over_the_stated_one_stops_the_run_by_name():
    """max_speed lied about: an impact at 30 m/s with a step made for 0.5 m/s."""
    sim = simulate(
        [[0, 0, 0], [0.01, 0, 0], [1, 0, 0]], velocities=[[30, 0, 0], [0, 0, 0], [0, 0, 0]], ids=[11, 12, 13]
    )
    with pytest.raises(StabilityError) as error:
        sim.step(5000)
    text = str(error.value)
    assert error.value.exit_code == 3
    assert "grain 11 with grain 12" in text
    assert f"t = {sim.time:.6g} s (step {sim.step_number})" in text
    assert "engine.max_overlap = 0.1" in text
    assert "30 m/s" in text or "largest approach speed met 30" in text
    assert "time.step" in text
    assert np.isfinite(sim.particles.position).all()


def test_pressed_too_deep_at_a_wall_stops_the_run():
    sim = simulate([[0, 0, 5e-3]], velocities=[[0, 0, -10]], walls=[FLOOR], ids=[42])
    with pytest.raises(StabilityError, match=r"a grain and a wall overlap.*grain 42 with wall 0"):
        sim.step(1000)


def test_step_over_the_stability_limit_is_refused_before_anything_runs():
    with pytest.raises(SceneError, match=r"time\.step = 0\.001 s is over the stability limit"):
        simulate(PAIR, time={"end": 1, "step": 1e-3, "max_speed": 0.5})


def test_a_number_that_is_none_is_noticed_and_named():
    sim = simulate([[0, 0, 0], [0.5, 0, 0]], velocities=[[0, 0, 0.1], [0, 0, 0.1]], ids=[8, 9])
    sim.step(10)
    record = sim.state.record.numpy()
    record[sim.state.rank[1], 4] = math.nan
    sim.state.record.assign(record)
    with pytest.raises(StabilityError, match=r"grain 9 is not finite \(1 of 2 grains\)"):
        sim.step(10)


def test_an_interrupted_batch_of_steps_is_not_gone_on_with(monkeypatch):
    """Its steps are done but not counted: whatever came after would be at the wrong time."""
    sim = simulate(PAIR)
    sim.step(3)
    advance = sim.engine.advance

    def interrupted(*args, **kwargs):
        advance(*args, **kwargs)
        raise KeyboardInterrupt

    monkeypatch.setattr(sim.engine, "advance", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sim.step(5)
    monkeypatch.undo()
    with pytest.raises(WarpdemError, match="interrupted in the middle of its steps: go on from a checkpoint"):
        sim.step(1)


def test_extremes_are_the_largest_met():
    sim = simulate([[0, 0, 0], [2.01e-3, 0, 0]], velocities=[[0.2, 0, 0], [0, 0, 0]])
    sim.step(400)
    met = sim.extremes
    assert met["pair_approach_speed"] == pytest.approx(0.2, rel=1e-3)
    assert 0.01 < met["pair_overlap_share"] < 0.05
    assert met["wall_overlap_share"] == met["wall_approach_speed"] == 0.0
    assert len(sim.contacts().i) == 0, "they have parted"


def test_overlaps_are_shares_of_the_smaller_radius():
    grains = {"positions": [[0, 0, 0], [3.01e-3, 0, 0]], "radii": [1e-3, 2e-3], "velocities": [[0.2, 0, 0], [0, 0, 0]]}
    sim = simulate([], grains=[{"material": "glass", **grains}])
    overlaps = [0.0]
    for _ in range(60):
        sim.step(5)
        overlaps += sim.contacts().overlap.tolist()
    assert sim.extremes["pair_overlap_share"] == pytest.approx(max(overlaps) / 1e-3, rel=1e-2)
    assert max(overlaps) > 1e-5, "they did not meet"


def test_wrong_device_and_thread_count_are_refused():
    scene = simulate([[0, 0, 0]]).scene
    with pytest.raises(SceneError, match=r"device = 'tpu:7': not on this machine; there is cpu"):
        Simulation(scene, device="tpu:7")
    with pytest.raises(SceneError, match="threads = 0"):
        Simulation(scene, device="cpu", threads=0)


def test_guards_record_instead_of_stopping(make_scene):
    """For studies of schemes that are meant to fail: noted once, with grain, place and time, and the run goes on."""
    crash = {"positions": [[0, 0, 0], [2.1e-3, 0, 0]], "velocities": [[5.0, 0, 0], [-5.0, 0, 0]], "step": 1e-6}
    with pytest.raises(StabilityError, match=r"stopped at t = .* grains overlap by"):
        Simulation(make_scene(**crash), device="cpu", threads=1).step(200)
    sim = Simulation(make_scene(**crash, engine={"guards": "record"}), device="cpu", threads=1)
    sim.step(200)
    assert list(sim.noticed) == ["overlap"]
    assert "grain 0 with grain 1 at (0.00105" in sim.noticed["overlap"]
    assert sim.step_number == 200


def test_a_step_over_the_limit_is_recorded_too(make_scene):
    keys = {"positions": [[0, 0, 0], [0, 0, 1]], "step": 1e-2, "max_speed": 1.0}
    with pytest.raises(SceneError, match="over the stability limit"):
        Simulation(make_scene(**keys), device="cpu", threads=1)
    sim = Simulation(make_scene(**keys, engine={"guards": "record"}), device="cpu", threads=1)
    assert "over the stability limit" in sim.noticed["time step"]
