"""Walls that a program moves in a live run: the path asked for, the schedule that says the same, bits, and what is refused."""

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation

R, DT = 1e-3, 2e-6
STEPS = 4000
TARGET = 0.02  # N


def press(fixed_to="frame", frame=None, **lid):
    """Grains on a floor between walls, under a lid of triangles."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    positions = (2.1 * R) * grid + R + rng.uniform(0.0, 0.05 * R, grid.shape)
    side = 6.4 * R
    planes = [([0] * 3, n) for n in np.eye(3)[[2, 0, 1]].tolist()] + [([side] * 3, n) for n in (-np.eye(3)[:2]).tolist()]
    return Scene.model_validate(
        {
            "gravity": [0, 0, -9.81],
            "materials": {"g": {"density": 2500, "young_modulus": "5 MPa", "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.1, "friction": 0.4}],
            "grains": [{"material": "g", "radius": R, "positions": positions}],
            "walls": [
                *({"name": f"w{k}", "material": "g", "plane": {"point": p, "normal": n}} for k, (p, n) in enumerate(planes)),
                {"name": "lid", "material": "g", "plane": {"point": [0, 0, 6.3 * R], "normal": [0, 0, -1]}, "driven": True,
                 "fixed_to": fixed_to, **lid},
            ],
            "frame": frame,
            "measures": {"energy": True},
            "time": {"end": 0.1, "step": DT},
        }
    )  # fmt: skip


def height(sim) -> float:
    return sim.schedule.wall_placements(sim.scene, sim.time)["lid"].translation[2]


def velocity_for(force: float) -> float:
    """Down at 80 mm/s until the grains carry something, then in proportion to the difference of the force."""
    return -0.08 if force < 0.1 * TARGET else 0.3 * (force - TARGET)


def controlled(sim, until=STEPS, every=50):
    """A proportional controller of the force on the lid: one new velocity every 50 steps."""
    while sim.step_number < until:
        if sim.step_number % every == 0:
            force = sim.wall_loads()["lid"].force[2]
            sim.set_motion("lid", {"velocity": [0, 0, velocity_for(force)]})
        sim.step(min(every - sim.step_number % every, until - sim.step_number))
    return sim


@pytest.fixture(scope="module")
def reference():
    return controlled(Simulation(press(), device="cpu", threads=1))


def test_controller_lowers_the_lid_until_its_force_is_met(reference):
    assert reference.wall_loads()["lid"].force[2] == pytest.approx(TARGET, rel=0.1)
    assert height(reference) < -1e-4


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(reference, threads):
    assert controlled(Simulation(press(), device="cpu", threads=threads)).state_hash() == reference.state_hash()


def test_the_captured_graph_changes_no_bit(reference):
    sim = controlled(Simulation(press(), device="cpu", threads=1, resident=True))
    assert sim.state_hash() == reference.state_hash()


@pytest.mark.parametrize("cut", [1200, 1225, 1250])
def test_resume_goes_on_with_the_motion_bit_for_bit(reference, tmp_path, cut):
    """At a step where the motion changes, before and after the change, and between two of them."""
    sim = controlled(Simulation(press(), device="cpu", threads=1), until=cut)
    if cut == 1250:
        sim.set_motion("lid", {"velocity": [0, 0, -0.05]})
    sim.save_checkpoint(tmp_path / "a.h5")
    again = Simulation.from_checkpoint(tmp_path / "a.h5", device="cpu", threads=2)
    assert height(again) == height(sim)
    assert [one.state() for one in again.schedule.driven.values()] == [one.state() for one in sim.schedule.driven.values()]
    if cut == 1250:
        sim.step(500)
        again.step(500)
        assert again.state_hash() == sim.state_hash()
        assert again.energy() == sim.energy()
    else:
        assert controlled(again).state_hash() == reference.state_hash()


def test_a_changed_motion_is_that_of_a_schedule():
    """The same path told beforehand: equal but for the rounding of its pose, and for the force of the step of the change."""
    change, speed, steps = 500, -0.1, 2500
    told = {"schedule": [{"until": change * DT, "velocity": [0, 0, 0]}, {"velocity": [0, 0, speed]}]}
    scheduled, live = (Simulation(press(**keys), device="cpu", threads=1) for keys in ({"motion": told}, {}))
    scheduled.step(steps)
    live.step(change)
    live.set_motion("lid", {"velocity": [0, 0, speed]})
    live.step(steps - change)
    assert height(live) == pytest.approx(speed * (steps - change) * DT, rel=1e-12)
    np.testing.assert_allclose(live.particles.position, scheduled.particles.position, rtol=0, atol=1e-9 * R)
    assert live.wall_loads()["lid"].force[2] > 1e-2


def test_motions_follow_each_other_from_where_the_wall_is():
    """Down, a quarter turn about its own axis in axes at rest, back up: the turn stays."""
    sim = Simulation(press(), device="cpu", threads=1)
    sim.set_motion("lid", {"velocity": [0, 0, -0.01]})
    sim.step(100)
    sim.set_motion("lid", {"axis": [0, 0, 1], "rate": 0.5 * np.pi / (100 * DT)})
    sim.step(100)
    sim.set_motion("lid", {"velocity": [0, 0, 0.02]})
    sim.step(100)
    sim.set_motion("lid", None)
    sim.step(100)
    place = sim.schedule.wall_placements(sim.scene, sim.time)["lid"]
    np.testing.assert_allclose(place.translation, [0, 0, 0.01 * 100 * DT], rtol=0, atol=1e-15)
    np.testing.assert_allclose(place.rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], rtol=0, atol=1e-12)
    assert sim.wall_loads()["lid"].power == 0.0


def test_work_of_the_controlled_lid_is_in_the_energy_budget(reference):
    budget, now = reference.budget.energy(), reference.energy()
    stored = now["kinetic"] + now["rotational"] + now["elastic"]
    assert abs(budget["integration_error"]) < 0.02 * stored
    assert budget["lid work"] != 0.0


def test_in_a_lifted_frame_as_in_the_laboratory():
    lifted = {"velocity": [0, 0, 0.3]}
    here = press(fixed_to="laboratory")
    there = press(fixed_to="laboratory", frame=lifted)
    sims = [Simulation(scene, device="cpu", threads=1) for scene in (here, there)]
    for sim in sims:
        sim.step(200)
        sim.set_motion("lid", {"velocity": [0, 0, -0.1]})
        sim.step(300)
    places = [sim.schedule.wall_places(np.array([sim.time]))[0, -1, 9:12] for sim in sims]
    assert places[1][2] - places[0][2] == pytest.approx(-0.3 * 500 * DT, rel=1e-12)


def test_what_cannot_be_moved_is_answered(tmp_path):
    sim = Simulation(press(), device="cpu", threads=1)
    with pytest.raises(SceneError, match=r"'w0' is not driven: add driven = true to it; driven walls: 'lid'"):
        sim.set_motion("w0", {"velocity": [0, 0, 1]})
    with pytest.raises(SceneError, match="'led' is no wall of the scene"):
        sim.set_motion("led", None)
    with pytest.raises(SceneError, match=r"(?s)set_motion\('lid', ...\).*motion.velocty.*did you mean \"velocity\""):
        sim.set_motion("lid", {"velocty": [0, 0, 1]})
    assert not sim.schedule.driven["lid"].is_changed


def test_a_mesh_too_fast_for_its_step_is_refused(tmp_path):
    (tmp_path / "lid.obj").write_text("v -1 -1 .0066\nv 1 -1 .0066\nv 0 1 .0066\nf 1 2 3\n", encoding="utf-8")
    mesh = {"plane": None, "mesh": str(tmp_path / "lid.obj"), "open": True}
    sim = Simulation(press(**mesh), device="cpu", threads=1)
    with pytest.raises(SceneError, match=r"at up to 60 m/s, 0.12 of the smallest radius.*0.1 is allowed.* below 50 m/s"):
        sim.set_motion("lid", {"velocity": [0, 0, -60]})
    sim.set_motion("lid", {"velocity": [0, 0, -0.1]})
    sim.step(10)
    assert height(sim) == pytest.approx(-0.1 * 10 * DT)


def test_driven_walls_and_periodic_borders_are_refused():
    scene = press().model_dump(mode="json", exclude_unset=True)
    scene["borders"] = {"x": {"min": 0, "max": 0.02, "kind": "periodic"}}
    scene["walls"] = [w for w in scene["walls"] if w["name"] not in ("w1", "w3")]
    with pytest.raises(SceneError, match=r"borders.x: periodic, but walls\[3\] \('lid'\) is driven"):
        Simulation(Scene.model_validate(scene), device="cpu", threads=1)


def test_another_scene_does_not_go_on_with_a_motion_that_no_scene_gives(tmp_path):
    sim = Simulation(press(), device="cpu", threads=1)
    sim.step(10)
    sim.set_motion("lid", {"velocity": [0, 0, -0.01]})
    sim.step(10)
    sim.save_checkpoint(tmp_path / "a.h5")
    scene = press().model_dump(mode="json", exclude_unset=True) | {"base": tmp_path}
    del scene["grains"]
    scene["start"] = {"checkpoint": "a.h5"}
    then = Simulation(Scene.model_validate(scene), device="cpu", threads=1)
    assert height(then) == pytest.approx(-0.01 * 10 * DT, rel=1e-9)
    scene["start"]["continues"] = ["lid"]
    with pytest.raises(SceneError, match="as set_motion said"):
        Simulation(Scene.model_validate(scene), device="cpu", threads=1)
