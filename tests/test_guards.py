"""Each way in which a run becomes worthless is noticed in it, with grain, place and time; sound runs are left alone."""

from pathlib import Path

import numpy as np
import pytest

from warpdem import Scene, Simulation, StabilityError
from warpdem.engine import checkpoint
from warpdem.guards import stability, watch
from warpdem.guards.energy import driven
from warpdem.runner import run_scene

BOX = str(Path(__file__).resolve().parents[1] / "scenes/meshes/box.stl")
FLOOR = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
PRESSED = [[0.0, 0.0, 0.0], [1.99e-3, 0.0, 0.0]]


def simulate(make_scene, *args, **keys) -> Simulation:
    return Simulation(make_scene(*args, **keys), device="cpu", threads=1)


def put(sim: Simulation, number: int, column, value) -> None:
    """Change the record of grain ``number`` behind the engine's back."""
    record = sim.state.record.numpy()
    record[sim.state.rank[number], column] = value
    sim.state.record.assign(record)
    sim._forces_ready, sim._grown = False, True


# -- energy ----------------------------------------------------------------------------------------


def test_energy_from_nowhere_stops_the_run_and_names_the_fastest(make_scene):
    sim = simulate(make_scene, [[0, 0, 1], [0.5, 0, 1]], velocities=[[1, 0, 0], [0, 1, 0]], step=1e-5, gravity=(0, 0, -9.81))
    sim.step(1500)
    put(sim, 1, 5, 1.5)
    with pytest.raises(StabilityError, match=r"stopped at t = 0.02.* s \(step 20..\): .* J appeared.*grain 1 at \(0.5, 0.02"):
        sim.step(600)


def test_energy_that_falls_swings_or_comes_in_is_no_alarm(make_scene):
    """A ball that bounces: potential to motion to spring and back, hundreds of times."""
    keys = {"restitution": 1.0, "step": 1e-5, "gravity": (0, 0, -9.81), "max_speed": 0.1}
    sim = simulate(make_scene, [[0, 0, 1.2e-3]], walls=[FLOOR], **keys)
    for _ in range(200):
        sim.step(20)
        sim.guards.look()
    assert not sim.noticed


def test_what_brings_energy_in_is_known(make_scene):
    above = [[x, y, z + 2e-3] for x, y, z in PRESSED]
    still, spring = {"positions": above, "step": 1e-6}, {"model": "harmonic", "parameters": {"stiffness": 1.0}}
    turning = {"axis": [0, 0, 1], "rate": 1.0}
    falling = {"z": {"min": 0.0, "max": 1.0, "kind": "periodic"}}
    cases = [
        ({}, False), ({"frame": turning}, False), ({"walls": [FLOOR]}, False), ({"walls": [FLOOR], "frame": turning}, True),
        ({"walls": [FLOOR | {"fixed_to": "laboratory"}], "frame": turning}, False),
        ({"walls": [FLOOR | {"motion": {"velocity": [0, 0, 1]}}]}, True), ({"fields": [spring]}, False),
        ({"fields": [spring | {"axes": "frame"}], "frame": turning}, True),
        ({"tangential": "mindlin_displacement", "friction": 0.5}, True), ({"tangential": "mindlin", "friction": 0.5}, False),
    ]  # fmt: skip
    for change, expected in cases:
        assert driven(simulate(make_scene, **(still | change))) is expected, change
    wide = make_scene(**still, gravity=(0, 0, -9.81)).model_dump(mode="json") | {"borders": falling}
    assert driven(Simulation(Scene.model_validate(wide), device="cpu", threads=1))


def test_a_driven_scene_is_watched_by_its_budget(make_scene):
    lift = FLOOR | {"motion": {"velocity": [0, 0, 0.5]}}
    data = make_scene([[0, 0, 1e-3]], walls=[lift], step=1e-6, max_speed=0.5).model_dump(mode="json")
    sim = Simulation(Scene.model_validate(data | {"measures": {"energy": True}}), device="cpu", threads=1)
    sim.step(1200)
    assert sim.particles.velocity[0, 2] > 0.5, "the floor has thrown it"
    put(sim, 0, 6, 3.0)
    with pytest.raises(StabilityError, match="appeared from nowhere"):
        sim.step(1000)


# -- time step -------------------------------------------------------------------------------------


def test_rate_of_a_pair_is_exact(make_scene):
    """Normal 2k/m; shear with rotation k_t (2/m)(1 + 5 a^2/(2 R^2)) at arms a."""
    for friction in (0.0, 0.5):
        tangential = "mindlin" if friction else "none"
        sim = simulate(make_scene, PRESSED, step=1e-6, restitution=0.5, friction=friction, tangential=tangential)
        p, found = sim.particles, stability.springs(sim, sim.contacts())
        rate, damping, _ = stability.largest_rate(found, p.mass, p.inertia)
        k, k_t = found.stiffness[:, 0]
        arm = 0.995  # of the radius
        assert k == pytest.approx(1.5 * 4 / 3 * 5e6 / (2 * 0.91) * np.sqrt(0.5e-3 * 0.01e-3), rel=1e-5)
        expected = k_t * 2 / p.mass[0] * (1 + 2.5 * arm**2) if friction else 2 * k / p.mass[0]
        assert rate == pytest.approx(np.sqrt(expected), rel=1e-6)
        beta = np.log(2.0) / np.hypot(np.log(2.0), np.pi)
        shear = np.sqrt(1 + 2.5 * arm**2) if friction else 1.0
        assert damping == pytest.approx(np.sqrt(5 / 6) * beta * shear, rel=1e-4)


def sheared_pair(make_scene, step: float, restitution: float = 0.5) -> Simulation:
    """Two grains held together by a field, with a trace of spin."""
    hold = {"model": "harmonic", "parameters": {"stiffness": 5e-3 / 0.995e-3}}
    return simulate(
        make_scene, [[-0.995e-3, 0, 0], [0.995e-3, 0, 0]], spins=[[0, 0, 1e-6], [0, 0, 1e-6]], step=step, normal="hooke",
        stiffness=500.0, tangential="mindlin", tangential_stiffness_ratio=0.8, friction=1e6, restitution=restitution,
        max_speed=1e-9, engine={"guards": "record"}, fields=[hold],
    )  # fmt: skip


def measured_limit(sim: Simulation) -> float:
    p = sim.particles
    return stability.stable_step(stability.springs(sim, sim.contacts()), p.mass, p.inertia)[0]


@pytest.mark.parametrize("restitution", [1.0, 0.5, 0.1])
def test_measured_limit_is_where_a_spring_loses_hold(make_scene, restitution):
    """A pair that rolls on itself: held 3 % below the limit that the guard measures, lost 3 % above."""
    limit = measured_limit(sheared_pair(make_scene, 1e-7, restitution))
    spin = []
    for share in (0.97, 1.03):
        sim = sheared_pair(make_scene, share * limit, restitution)
        sim.step(400)
        spin.append(float(np.abs(sim.particles.spin).max()))
    assert spin[0] < 1e-5
    assert spin[1] > 1e-3


def test_step_over_the_limit_of_present_contacts_is_noticed(make_scene):
    limit = measured_limit(sheared_pair(make_scene, 1e-7))
    for share, expected in ((0.98, False), (1.02, True)):
        sim = sheared_pair(make_scene, share * limit)
        sim.step(50)
        assert ("stability" in sim.noticed) is expected
    assert "is over the limit 5.88e-05 s of the contacts that there are" in sim.noticed["stability"]
    assert "grain 0 at (" in sim.noticed["stability"] or "grain 1 at (" in sim.noticed["stability"]


# -- sides -----------------------------------------------------------------------------------------


def test_a_grain_put_outside_its_container_is_named(make_scene):
    box = {"name": "box", "mesh": BOX}
    sim = simulate(make_scene, [[0.5, 0.5, 0.5], [0.3, 0.3, 0.3]], radius=0.01, walls=[box], step=1e-4)
    sim.guards.look()
    put(sim, 1, 0, 1.2)
    with pytest.raises(StabilityError, match=r"grain 1 at \(1.2, 0.3, 0.3\) m is on the wrong side of the wall 'box', 20 "):
        sim.guards.look()


def test_a_grain_that_was_outside_may_be_there_and_not_inside(make_scene):
    box = {"name": "box", "mesh": BOX, "motion": {"velocity": [0.1, 0.0, 0.0]}}
    sim = simulate(make_scene, [[1.5, 0.5, 0.5]], radius=0.01, walls=[box], step=1e-4)
    sim.step(1100)
    assert not sim.noticed
    put(sim, 0, 0, 0.9)
    with pytest.raises(StabilityError, match="wrong side of the wall 'box'"):
        sim.guards.look()


@pytest.mark.parametrize(("start", "end"), [(0.5, 1.2), (1.2, 0.5)])
def test_what_has_passed_is_not_taken_for_granted(make_scene, start, end):
    """With guards that record, a grain that has gone through a wall is still on the wrong side at the next look."""
    sim = simulate(make_scene, [[start, 0.5, 0.5]], radius=0.01, walls=[{"name": "box", "mesh": BOX}], step=1e-4,
                   engine={"guards": "record"})  # fmt: skip
    put(sim, 0, 0, end)
    for _ in range(2):
        sim.noticed.clear()
        sim.guards.look()
        assert "side" in sim.noticed


def test_a_grain_beyond_a_plane_is_named_though_overlaps_are_recorded(make_scene):
    sim = simulate(make_scene, [[0, 0, 2e-3]], walls=[FLOOR], step=1e-6, engine={"guards": "record"})
    put(sim, 0, 2, -1.1e-3)
    sim.guards.look()
    assert "wrong side of the wall 'floor', 1.1 of its radius beyond (1 of 1 grains are)" in sim.noticed["side"]


# -- lists, and what follows -----------------------------------------------------------------------


def test_lists_that_cannot_be_counted_stop_the_run(make_scene, monkeypatch):
    crowd = np.random.default_rng(0).random((40, 3)) * 1e-4
    engine = {"max_overlap": 1.0, "guards": "record"}
    sim = simulate(make_scene, np.arange(40)[:, None] * [5e-3, 0, 0], step=1e-6, engine=engine)
    monkeypatch.setattr(watch, "LIST_ENTRIES", 1000)
    for number, point in enumerate(crowd):
        put(sim, number, slice(0, 3), point)
    with pytest.raises(StabilityError, match=r"the lists need 1720 entries, more than 1000: grain \d+ at \(.*\) m has 39 n"):
        sim.step(1)


def test_looks_come_often_at_first_and_change_no_bit(make_scene, monkeypatch):
    keys = {"walls": [FLOOR], "step": 1e-5, "gravity": (0, 0, -9.81), "friction": 0.5, "tangential": "mindlin"}
    looks, look = [], watch.Guards.look
    monkeypatch.setattr(watch.Guards, "look", lambda self: (looks.append(self.sim.step_number), look(self)))
    watched = simulate(make_scene, [[0, 0, 1e-3], [1e-3, 0, 2.8e-3]], **keys)
    watched.step(9000)
    assert len(looks) == 4
    monkeypatch.setattr(watch.Guards, "steps_done", lambda self: None)
    alone = simulate(make_scene, [[0, 0, 1e-3], [1e-3, 0, 2.8e-3]], **keys)
    alone.step(9000)
    assert watched.state_hash() == alone.state_hash()


def test_a_bad_state_is_not_saved_over_a_good_checkpoint(make_scene, tmp_path, monkeypatch):
    """A grain gets out of its box between two checkpoints: the one before stays, and the exit code is 3."""
    scene = make_scene([[0.5, 0.5, 0.5]], radius=0.01, walls=[{"name": "box", "mesh": BOX}], step=1e-4)
    output = {"checkpoint_interval": 0.01, "formats": [], "interval": 0.01, "picture": False}
    scene = Scene.model_validate(scene.model_dump(mode="json") | {"output": output, "time": {"end": 0.05, "step": 1e-4}})
    step = Simulation.step

    def slip(sim, count=1):
        step(sim, count)
        if sim.step_number == 300:
            put(sim, 0, 0, 1.5)

    monkeypatch.setattr(Simulation, "step", slip)
    with pytest.raises(StabilityError, match="wrong side") as stopped:
        run_scene(scene, tmp_path, device="cpu", threads=1, quiet=True)
    assert stopped.value.exit_code == 3
    assert checkpoint.read(tmp_path / "checkpoint.h5")["step"] == 200
