"""Each way in which a run becomes worthless is noticed in it, with grain, place and time; sound runs are left alone."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from warpdem.kernels.step.motion import BEYOND

from law_scenes import contact_time, impacts
from stability_scenes import RADIUS, scene
from warpdem import Scene, Simulation, StabilityError
from warpdem.app.run import run_scene
from warpdem.engine import host_build, stops
from warpdem.guards import stability, watch
from warpdem.guards.energy import driven
from warpdem.state import checkpoint, checkpoint_file

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
    sim.live.clock.forces_evaluated, sim.lists.pending = False, BEYOND


# -- energy ----------------------------------------------------------------------------------------


def test_energy_from_nowhere_stops_the_run_and_names_the_fastest(make_scene):
    sim = simulate(make_scene, [[0, 0, 1], [0.5, 0, 1]], velocities=[[1, 0, 0], [0, 1, 0]], step=1e-5, gravity=(0, 0, -9.81))
    sim.step(1500)
    put(sim, 1, 5, 1.5)
    with pytest.raises(StabilityError, match=r"stopped at t = 0.016 s \(step 1600\): .* J appeared.*grain 1 at \(0.5, 0.01"):
        sim.step(600)


def test_energy_that_falls_swings_or_comes_in_is_no_alarm(make_scene):
    """A ball that bounces: potential to motion to spring and back, hundreds of times."""
    keys = {"restitution": 1.0, "step": 1e-5, "gravity": (0, 0, -9.81), "max_speed": 0.1}
    sim = simulate(make_scene, [[0, 0, 1.2e-3]], walls=[FLOOR], **keys)
    for _ in range(200):
        sim.step(20)
        sim.guards.look()
    assert not sim.noticed


def test_energy_of_rounding_is_no_alarm_and_a_little_more_is(make_scene):
    """Grains that touch, at rest in the laboratory, in a turning frame: their velocities are what rounding leaves of w x r."""
    def turning():
        at = [[2e-3 * k - 0.05, 2e-3 * j, 0.0] for k in range(3) for j in range(3)]
        still = [[7.0 * y, -7.0 * x, 0.0] for x, y, _ in at]
        spins = [[0.0, 0.0, -7.0]] * 9
        frame = {"axis": [0, 0, 1], "rate": 7.0}
        sim = simulate(make_scene, at, velocities=still, spins=spins, step=1e-6, frame=frame)
        sim.guards.look()
        return sim

    sim = turning()
    for _ in range(30):
        sim.step(10)
        sim.guards.look()
    assert not sim.noticed
    sim = turning()
    put(sim, 4, 6, sim.state.record.numpy()[sim.state.rank[4], 6] + 1e-9)  # m/s
    with pytest.raises(StabilityError, match=r"e-2\d J appeared from nowhere"):
        sim.guards.look()


def test_what_brings_energy_in_is_known(make_scene):
    above = [[x, y, z + 2e-3] for x, y, z in PRESSED]
    still, spring = {"positions": above, "step": 1e-6}, {"model": "harmonic", "parameters": {"stiffness": 1.0}}
    turning = {"axis": [0, 0, 1], "rate": 1.0}
    falling = {"z": {"min": 0.0, "max": 1.0, "kind": "periodic"}}
    cases = [
        ({}, False), ({"frame": turning}, False), ({"walls": [FLOOR]}, False), ({"walls": [FLOOR], "frame": turning}, True),
        ({"walls": [FLOOR | {"fixed_to": "laboratory"}], "frame": turning}, False),
        ({"walls": [FLOOR | {"motion": {"velocity": [0, 0, 1]}}]}, True), ({"fields": [spring]}, False),
        ({"walls": [FLOOR | {"driven": True}]}, True), ({"walls": [FLOOR | {"surface_velocity": [1, 0, 0]}]}, True),
        ({"fields": [spring | {"axes": "frame"}], "frame": turning}, True),
        ({"tangential": "mindlin_displacement", "friction": 0.5}, True), ({"tangential": "mindlin", "friction": 0.5}, False),
    ]  # fmt: skip
    for change, expected in cases:
        assert driven(simulate(make_scene, **(still | change)).model) is expected, change
    wide = make_scene(**still, gravity=(0, 0, -9.81)).model_dump(mode="json") | {"borders": falling}
    assert driven(Simulation(Scene.model_validate(wide), device="cpu", threads=1).model)


ATTRACT = {
    "dmt": {"surface_energy": 0.1}, "sjkr": {"cohesion_energy_density": 1e5},
    "edinburgh": {"surface_energy": 0.1, "pull_off_force": 1e-4},
}  # fmt: skip


@pytest.mark.parametrize("normal", ATTRACT)
def test_laws_that_attract_are_watched_and_no_alarm(normal):
    """Impacts, from before the touch until long after it, at 20 steps per contact."""
    step = contact_time(0.05) / 20.0
    sim = Simulation(impacts(normal, {"restitution": 0.9} | ATTRACT[normal], 0.05, step), device="cpu", threads=1)
    assert not driven(sim.model)
    for _ in range(60):
        sim.step(3)
        sim.guards.look()
    assert not sim.noticed
    put(sim, 0, 6, 1.0)
    with pytest.raises(StabilityError, match="appeared from nowhere"):
        sim.step(200)


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
        p, found = sim.particles, stability.springs(sim.view, sim.contacts())
        square, motion, _ = stability.stiffest_mode(found, p.mass, p.inertia)
        rate = np.sqrt(square)
        damping = np.sum(found.damping * motion) / (2.0 * rate)
        k, k_t = found.stiffness[:, 0]
        arm = 0.995  # of the radius
        assert k == pytest.approx(1.5 * 4 / 3 * 5e6 / (2 * 0.91) * np.sqrt(0.5e-3 * 0.01e-3), rel=1e-5)
        expected = k_t * 2 / p.mass[0] * (1 + 2.5 * arm**2) if friction else 2 * k / p.mass[0]
        assert rate == pytest.approx(np.sqrt(expected), rel=1e-6)
        beta = np.log(2.0) / np.hypot(np.log(2.0), np.pi)
        shear = np.sqrt(1 + 2.5 * arm**2) if friction else 1.0
        assert damping == pytest.approx(np.sqrt(5 / 6) * beta * shear, rel=1e-4)


def sheared_pair(make_scene, step: float, restitution: float = 0.5, spin: float = 1e-6) -> Simulation:
    """Two grains held together by a field, with a trace of spin."""
    hold = {"model": "harmonic", "parameters": {"stiffness": 5e-3 / 0.995e-3}}
    return simulate(
        make_scene, [[-0.995e-3, 0, 0], [0.995e-3, 0, 0]], spins=[[0, 0, spin], [0, 0, spin]], step=step, normal="hooke",
        stiffness=500.0, tangential="mindlin", tangential_stiffness_ratio=0.8, friction=1e6, restitution=restitution,
        max_speed=1e-9, engine={"guards": "record"}, fields=[hold],
    )  # fmt: skip


def measured_limit(sim: Simulation) -> float:
    p = sim.particles
    return stability.stable_step(stability.springs(sim.view, sim.contacts()), p.mass, p.inertia)[0]


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


def yielded_pair(step: float, k1: float = 100.0, limit: float = 500.0) -> Simulation:
    """Two grains that a field presses together to twice the depth up to which they yield, with a trace of speed."""
    overlap = 1e-8
    depth, place = 0.5 * overlap, RADIUS - 0.5 * overlap
    force = limit * (overlap - depth) + k1 * depth
    pair = {"restitution": 0.5, "stiffness": k1, "unloading_stiffness": limit,
            "plasticity_depth": depth / RADIUS * (limit - k1) / limit}  # fmt: skip
    grains = {"positions": [[-place, 0, 0], [place, 0, 0]], "radius": RADIUS, "velocities": [[1e-11, 0, 0], [-1e-11, 0, 0]]}
    hold = [{"model": "harmonic", "parameters": {"stiffness": force / place}}]
    made = scene(1e7, step, grains, {"normal": "luding"}, pair, 1e-9, fields=hold, engine={"guards": "record"})
    return Simulation(made, device="cpu", threads=1)


def test_measured_limit_of_a_yielded_contact_goes_by_the_dashpot_as_it_acts():
    """Luding's unloading is steeper than k1, by which its dashpot is reduced: held below the limit, lost above."""
    limit, speed = measured_limit(yielded_pair(1e-7)), []
    for share in (0.98, 1.02):
        sim = yielded_pair(share * limit)
        sim.step(400)
        speed.append(float(np.abs(sim.particles.velocity).max()))
    assert speed[0] < 2e-11
    assert speed[1] > 1e-9


@pytest.mark.parametrize(("share", "noticed"), [(0.98, 0), (1.2, 0), (1.6, 1)])
def test_step_in_danger_at_two_looks_in_a_row_is_noticed(make_scene, share, noticed):
    """Over the limit is told, 1.25 times over it stops: at the look that confirms the one before."""
    limit = measured_limit(sheared_pair(make_scene, 1e-7))
    sim = sheared_pair(make_scene, share * limit, spin=1e-15)
    sim.step(1)
    seen = sim.guards.stability.seen
    assert "stability" not in sim.noticed
    assert seen.largest == pytest.approx(share, rel=0.01) if share > 1 else seen.largest < 1
    assert sim.guards.next_look == (stability.CONFIRM if noticed else 100)
    sim.guards.judge()  # as at the end of a run: one look is no confirmation of itself
    assert "stability" not in sim.noticed
    sim.step(stability.CONFIRM)
    assert ("stability" in sim.noticed) == noticed
    if noticed:
        assert "is 1.6 times the stability limit 0.000106 s of the present contacts, at two" in sim.noticed["stability"]
        assert "grain 0 at (" in sim.noticed["stability"] or "grain 1 at (" in sim.noticed["stability"]


# -- sides -----------------------------------------------------------------------------------------


def test_a_grain_put_outside_its_container_is_named(make_scene):
    box = {"name": "box", "mesh": BOX}
    sim = simulate(make_scene, [[0.5, 0.5, 0.5], [0.3, 0.3, 0.3]], radius=0.01, walls=[box], step=1e-4)
    sim.guards.look()
    put(sim, 1, 0, 1.2)
    with pytest.raises(StabilityError, match=r"grain 1 at \(1.2, 0.3, 0.3\) m is on the wrong side of the wall 'box', 20 "):
        sim.guards.look()


def test_a_mesh_that_folds_back_onto_itself_is_named_as_the_cause(make_scene):
    sim = simulate(make_scene, [[0.5, 0.5, 0.5]], radius=0.01, walls=[{"name": "box", "mesh": BOX}], step=1e-4)
    sim.guards.look()
    sim.model.meshes["box"] = dataclasses.replace(sim.model.meshes["box"], folded_edges=3)
    put(sim, 0, 0, 1.2)
    with pytest.raises(StabilityError, match=r"folds back onto itself at 3 edges, .*: mend box\.stl \(the notes of check"):
        sim.guards.look()


def test_a_grain_that_was_outside_may_be_there_and_not_inside(make_scene):
    box = {"name": "box", "mesh": BOX, "motion": {"velocity": [0.1, 0.0, 0.0]}}
    sim = simulate(make_scene, [[1.5, 0.5, 0.5]], radius=0.01, walls=[box], step=1e-4)
    sim.step(1100)
    assert not sim.noticed
    put(sim, 0, 0, 0.9)
    with pytest.raises(StabilityError, match="wrong side of the wall 'box'"):
        sim.guards.look()


def test_looks_do_not_count_on_grains_that_have_left(make_scene):
    """They keep their places in memory until the next lists; a look names the others by their own ids."""
    box = {"name": "box", "mesh": BOX}
    positions = [[1.4, 0.1, 0.1], [1.5, 0.5, 0.5], [1.5, 0.3, 0.3], [1.5, 0.7, 0.7], [1.5, 0.3, 0.7]]
    scene = make_scene(positions, radius=0.01, walls=[box], velocities=[[10, 0, 0]] + 4 * [[0, 0, 0]], step=1e-4)
    border = {"borders": {"x": {"max": 1.8, "kind": "open"}}}
    sim = Simulation(Scene.model_validate(scene.model_dump(mode="json") | border), device="cpu", threads=1)
    sim.step(450)
    assert len(sim.state) == 4 < sim.state.slots
    sim.guards.look()
    put(sim, 1, 0, 0.5)
    with pytest.raises(StabilityError, match=r"grain 2 at \(0.5, 0.3, 0.3\) m is on the wrong side of the wall 'box'"):
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
    monkeypatch.setattr(host_build, "LONGEST", 1000)
    monkeypatch.setattr(stops, "LONGEST", 1000)
    for number, point in enumerate(crowd):
        put(sim, number, slice(0, 3), point)
    with pytest.raises(StabilityError, match=r"the lists need 1720 entries, more than 1000: grain \d+ at \(.*\) m has 39 n"):
        sim.step(1)


def looked_at(monkeypatch) -> list[int]:
    """Steps at which guards look from now on."""
    looks, look = [], watch.Guards.look
    monkeypatch.setattr(watch.Guards, "look", lambda self: (looks.append(self.view.clock.step_number), look(self)))
    return looks


def test_looks_come_often_at_first_and_change_no_bit(make_scene, monkeypatch):
    keys = {"walls": [FLOOR], "step": 1e-5, "gravity": (0, 0, -9.81), "friction": 0.5, "tangential": "mindlin"}
    looks = looked_at(monkeypatch)
    watched = simulate(make_scene, [[0, 0, 1e-3], [1e-3, 0, 2.8e-3]], **keys)
    watched.step(21000)
    assert looks == [0, 100, 200, 400, 800, 1600, 3200, 6400, 10000, 20000]
    monkeypatch.setattr(watch.Guards, "steps_done", lambda self: setattr(self, "next_look", 10**9))
    alone = simulate(make_scene, [[0, 0, 1e-3], [1e-3, 0, 2.8e-3]], **keys)
    alone.step(21000)
    assert watched.state_hash() == alone.state_hash()


def test_a_danger_that_was_recorded_is_not_confirmed_again(make_scene, monkeypatch):
    """With guards that only record, a run in danger goes on, and is not looked at every few steps from then on."""
    looks = looked_at(monkeypatch)
    sim = sheared_pair(make_scene, 1.6 * measured_limit(sheared_pair(make_scene, 1e-7)), spin=1e-15)
    monkeypatch.setattr(stability, "_step_ratio", lambda view, now: stability.Ratio(1.6, 1e-5, "grain 0"))
    sim.step(250)
    assert looks == [0, stability.CONFIRM, 100, 200]


def test_what_an_unstable_pair_gains_is_noticed(make_scene):
    """It has flown apart before a second look at its contact could confirm the first."""
    sim = sheared_pair(make_scene, 1.2 * measured_limit(sheared_pair(make_scene, 1e-7)))
    sim.step(3000)
    assert "appeared from nowhere" in sim.noticed["energy"]


@pytest.mark.parametrize("chunk", [7, 999, 1001])
def test_looks_come_at_the_same_steps_however_a_run_is_cut(make_scene, monkeypatch, chunk):
    looks = looked_at(monkeypatch)
    sim = simulate(make_scene, [[0, 0, 1]], step=1e-5)
    while sim.step_number < 4500:
        sim.step(chunk)
    assert looks == [0, 100, 200, 400, 800, 1600, 3200]


def thrown(make_scene, threads: int = 1, resident: bool = False, skin="auto", guards: str = "stop") -> Simulation:
    """A row of grains of which the first is thrown at the others, far too fast for what may overlap."""
    positions, velocities = np.zeros((20, 3)), np.zeros((20, 3))
    positions[:, 0], velocities[0, 0] = 2.05e-3 * np.arange(20), 6.0
    engine = {"max_overlap": 0.15, "guards": guards, "skin": skin}
    scene = make_scene(positions, velocities=velocities, restitution=0.9, step=5e-7, max_speed=0.5, engine=engine)
    return Simulation(scene, device="cpu", threads=threads, resident=resident)


@pytest.mark.parametrize(
    ("chunk", "keys"),
    [(1, {}), (17, {}), (10**6, {"threads": 2}), (50, {"threads": 3}), (10**6, {"skin": 5e-4}), (10**6, {"resident": True}),
     (3, {"resident": True})],
)  # fmt: skip
def test_overlap_stops_the_run_in_the_step_it_happens_in(make_scene, chunk, keys):
    """The same step with the same bits, whatever the batches, threads, lists or launches."""
    stopped = []
    for size, more in ((10**6, {}), (chunk, keys)):
        sim = thrown(make_scene, **more)
        with pytest.raises(StabilityError, match=r"grains overlap by 0.15\d* of the radius"):
            while True:
                sim.step(size)
        stopped.append((sim.step_number, sim.state_hash(), sim.extremes))
    assert 10 < stopped[0][0] == stopped[1][0]
    assert stopped[0] == stopped[1]


@pytest.mark.parametrize("resident", [False, True])
def test_an_overlap_that_is_recorded_changes_no_bit(make_scene, monkeypatch, resident):
    sim = thrown(make_scene, resident=resident, guards="record")
    sim.step(400)
    assert "overlap" in sim.noticed
    alone = thrown(make_scene, guards="record")
    alone.engine.ignore_overlaps()
    monkeypatch.setattr(watch.Guards, "steps_done", lambda self: setattr(self, "next_look", 10**9))
    alone.step(400)
    assert sim.state_hash() == alone.state_hash()


def test_asking_whether_a_state_is_sound_changes_no_later_verdict(make_scene):
    """Energy is compared with the least at looks: a question in between must not become one."""
    sim = simulate(make_scene, [[0, 0, 1], [0.5, 0, 1]], velocities=[[1, 0, 0], [0, 1, 0]], step=1e-5)
    sim.step(1000)
    put(sim, 1, 5, 0.5)
    assert sim.guards.is_sound()
    before = sim.guards.state()
    sim.guards.judge()
    assert sim.guards.state() == before
    put(sim, 1, 5, 1.02)
    sim.guards.look()


def test_a_resumed_run_is_judged_as_the_uncut_one(make_scene, tmp_path):
    """What looks compare with is in the checkpoint: energies, sides, and when the next look is due."""
    box = {"name": "box", "mesh": BOX}
    sim = simulate(make_scene, [[0.5, 0.5, 0.5], [0.3, 0.3, 0.3]], radius=0.01, walls=[box], step=1e-4,
                   velocities=[[0.1, 0, 0], [0, 0, 0]])  # fmt: skip
    sim.step(1700)
    put(sim, 1, 0, 1.2)
    sim.save_checkpoint(tmp_path / "out.h5")
    again = Simulation.from_checkpoint(tmp_path / "out.h5", device="cpu", threads=1)
    assert again.guards.state() == sim.guards.state()
    assert again.guards.next_look == 3200
    for one in (sim, again):
        with pytest.raises(StabilityError, match=r"step 3200\): grain 1 at .* is on the wrong side of the wall 'box'"):
            one.step(2000)


@pytest.mark.parametrize("missing", ["energy", "stability", "next_look", "sides"])
def test_what_an_older_checkpoint_lacks_of_a_guard_begins_anew(make_scene, missing):
    """The others take over what was kept."""
    box = {"name": "box", "mesh": BOX}
    scene = make_scene([[0.5, 0.5, 0.5]], radius=0.01, walls=[box], step=1e-4)
    old, new = (Simulation(scene, device="cpu", threads=1) for _ in range(2))
    old.step(300)
    kept, fresh = old.guards.state(), new.guards.state()
    assert kept["energy"] != fresh["energy"] and kept["next_look"] == 400
    data = {"guards": {key: value for key, value in kept.items() if key != missing}}
    new.guards.restore(data if missing == "sides" else {**data, **old.guards.arrays()})
    found = new.guards.state()
    for key in kept.keys() - {missing}:
        assert found[key] == kept[key], key
    if missing == "next_look":
        assert found[missing] == watch.look_after(0)
    elif missing != "sides":
        assert found[missing] == fresh[missing]


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
    assert checkpoint_file.read(tmp_path / "checkpoint.h5")["step"] == 200


@pytest.mark.parametrize("wall_time", [1e-6, 1e6])
def test_when_checkpoints_are_saved_changes_no_verdict(make_scene, tmp_path, monkeypatch, wall_time):
    """A grain is out of its box for some steps in between: no look sees it, and what the clock asks for is no look."""
    output = {"checkpoint_wall_time": wall_time, "formats": [], "interval": 0.01, "picture": False}
    scene = make_scene([[0.5, 0.5, 0.5]], radius=0.01, walls=[{"name": "box", "mesh": BOX}], step=1e-4)
    scene = Scene.model_validate(scene.model_dump(mode="json") | {"output": output, "time": {"end": 0.07, "step": 1e-4}})
    step, saved, save = Simulation.step, [], checkpoint.save

    def slip(sim, count=1):
        step(sim, count)
        put(sim, 0, 0, 1.5 if 450 <= sim.step_number < 650 else 0.5)

    def note(sim, path):
        saved.append(sim.step_number)
        save(sim, path)

    monkeypatch.setattr(Simulation, "step", slip)
    monkeypatch.setattr(checkpoint, "save", note)
    sim = run_scene(scene, tmp_path, device="cpu", threads=1, quiet=True)
    assert sim.step_number == 700
    assert not [number for number in saved if 450 <= number < 650]
    assert len(saved) > 2 if wall_time < 1.0 else saved == [0, 700]
