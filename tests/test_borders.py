"""Borders of the domain: periodic images, open and stopping borders, outlets, and streams of grains that come in."""

import numpy as np
import pytest
from warpdem.kernels.step.motion import LEFT

from warpdem import Scene, SceneError, Simulation, StabilityError

R = 1e-3
SIDE = 0.02


def scene(positions=(), **keys):
    grains = [{"material": "g", "positions": positions, "radius": R, **keys.pop("grain", {})}] if len(positions) else []
    return Scene.model_validate(
        {
            "gravity": [0, 0, 0],
            "materials": {"g": {"density": 2500.0, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "contact": {"normal": "hertz", "tangential": "mindlin", "rolling": "none"},
            "pairs": [{"materials": ["g", "g"], "restitution": 0.7, "friction": 0.5}],
            "grains": grains,
            "time": {"end": 1.0, "step": 2e-6, "max_speed": 2.0},
            **keys,
        }
    )


def simulated(*args, device="cpu", threads=1, **keys):
    return Simulation(scene(*args, **keys), device=device, threads=threads)


LOWER = -0.001


def around(axes="xyz"):
    return {axis: {"min": LOWER, "max": LOWER + SIDE, "kind": "periodic"} for axis in axes}


def gas():
    """216 grains at 40 % of the volume, with random velocities of 0.3 m/s and no net momentum."""
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*[np.arange(6)] * 3), -1).reshape(-1, 3) + 0.5
    velocity = rng.normal(scale=0.3, size=grid.shape)
    return grid * SIDE / 6 + rng.uniform(-2e-4, 2e-4, grid.shape), velocity - velocity.mean(axis=0)


# -- periodic ------------------------------------------------------------------------------------


def test_a_collision_across_the_border_is_the_one_in_the_middle(device):
    """Two grains that meet at a corner of the domain, and the same two in its middle."""
    velocity = [[0.2, 0.15, 0.1], [-0.2, -0.1, -0.15]]
    apart = np.array([[-1.0, -0.6, -0.7], [1.0, 0.6, 0.7]]) * 0.8 * R
    ends = []
    for middle in (LOWER + 0.5 * SIDE, LOWER):
        start = LOWER + (middle + apart - LOWER) % SIDE
        sim = simulated(start, grain={"velocities": velocity}, borders=around(), device=device)
        sim.step(1500)
        ends.append((sim.domain.nearest(sim.particles.position - middle), sim.particles.velocity, sim.particles.spin))
    assert np.abs(ends[0][2]).max() > 5.0, "they did not meet"
    for a, b, size in zip(*ends, (R, 0.2, 100.0), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * size)


def test_a_periodic_gas_keeps_its_momentum_and_its_grains_inside(device):
    position, velocity = gas()
    sim = simulated(position, grain={"velocities": velocity}, borders=around(), device=device)
    before = simulated(position, grain={"velocities": velocity}, borders=around()).particles.position
    sim.step(6000)
    p = sim.particles
    assert ((p.position >= LOWER) & (p.position < LOWER + SIDE)).all()
    assert (np.abs(p.position - before) > 0.5 * SIDE).any(), "no grain came round"
    speed = np.linalg.norm(p.velocity, axis=1).mean()
    assert speed < 0.8 * np.linalg.norm(velocity, axis=1).mean(), "nothing was lost: they do not meet"
    np.testing.assert_allclose(p.mass @ p.velocity, 0.0, rtol=0, atol=1e-14 * p.mass.sum())


def test_bits_of_a_periodic_run():
    position, velocity = gas()
    hashes = set()
    for threads, skin in ((1, "auto"), (2, "auto"), (1, 2e-4)):
        sim = simulated(
            position, grain={"velocities": velocity}, borders=around(), engine={"skin": skin}, threads=threads
        )
        sim.step(1500)
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_friction_on_a_plane_goes_on_across_the_border(device):
    """A grain that slides, then rolls over a periodic floor does the same as on an endless one."""
    floor = [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}]
    keys = {"grain": {"velocities": [[0.3, 0.2, 0]]}, "walls": floor, "gravity": [0, 0, -9.81], "device": device}
    keys["time"] = {"end": 1.0, "step": 1e-5, "max_speed": 1.0}
    ends = []
    for borders in ({}, {"borders": around("xy")}):
        sim = simulated([[0.001, 0.003, R]], **keys, **borders)
        sim.step(12_000)
        ends.append((sim.particles.velocity[0], sim.particles.spin[0], sim.particles.position[0]))
    assert ends[0][2][0] > SIDE
    assert ends[1][2][0] < SIDE
    np.testing.assert_allclose(ends[1][0], ends[0][0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ends[1][1], ends[0][1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(ends[1][2], np.r_[LOWER + (ends[0][2][:2] - LOWER) % SIDE, ends[0][2][2]], rtol=0, atol=1e-10)


def test_a_frame_may_turn_about_a_periodic_axis_only(device):
    position, velocity = gas()
    keys = {"grain": {"velocities": velocity, "velocities_in": "laboratory"}, "borders": around("z")}
    still, framed = (simulated(position, **keys, frame=f, device=device) for f in (None, {"axis": [0, 0, 1], "rate": 30.0}))
    for sim in (still, framed):
        sim.step(400)
    way = still.particles.position_lab - framed.particles.position_lab
    assert np.abs(still.domain.nearest(way)).max() < 1e-10
    with pytest.raises(SceneError, match=r"borders\.x: periodic, but the frame turns about another axis"):
        simulated([[R, R, R]], borders=around("x"), frame={"axis": [0, 0, 1], "rate": 1.0})


def test_too_short_a_period_is_refused():
    short = {"x": {"min": 0, "max": 4 * R, "kind": "periodic"}}
    with pytest.raises(SceneError, match=r"borders\.x: its length of 0\.004 m is below 2\.05 diameters"):
        simulated([[R, R, R]], borders=short)


def test_overlap_across_the_border_at_the_start_is_refused():
    with pytest.raises(SceneError, match=r"grain [01] overlaps another across the periodic borders of x"):
        simulated([[0.2 * R, 0, 0], [SIDE - 0.5 * R, 0, 0]], borders=around("x"))


# -- open, stop, outlets -------------------------------------------------------------------------


def test_grains_beyond_an_open_border_are_taken_out_at_the_step_they_cross(device):
    start = np.array([[0.0, 0, 0], [0.004, 0.01, 0], [-0.01, 0.02, 0]])
    sim = simulated(
        start, grain={"velocities": [[1.0, 0, 0]] * 3, "ids": [4, 2, 9]},
        borders={"x": {"min": -1.0, "max": 0.01, "kind": "open"}}, device=device,
    )  # fmt: skip
    assert sim.particles.id.tolist() == [2, 4, 9]
    sim.step(2999)  # 5.998 mm: the first at 9.998 mm
    assert sim.left == {"x min": [0, 0.0], "x max": [0, 0.0]}
    sim.step(1)
    assert sim.particles.id.tolist() == [4, 9]
    sim.step(2000)
    assert sim.particles.id.tolist() == [9]
    assert sim.left["x max"][0] == 2
    assert sim.left["x max"][1] == pytest.approx(2 * 2500 * 4 / 3 * np.pi * R**3)
    sim.step(10_000)
    assert len(sim.state) == 0
    assert sim.particles.position.shape == (0, 3)
    assert sim.energy()["kinetic"] == 0.0
    assert sim.time == pytest.approx(15_000 * 2e-6)


def test_a_border_that_stops_the_run_names_grain_place_and_border(device):
    borders = {"z": {"min": -0.01, "max": 0.01, "kind": ["stop", "open"]}}
    sim = simulated([[0, 0, 0]], grain={"velocities": [[0, 0, -1.0]]}, borders=borders, device=device)
    sim.step(4999)
    with pytest.raises(StabilityError, match=r"step 500[01]\): grain 0 at \(0, 0, -0\.01\d*\) m is beyond the border z min"):
        sim.step(5)


def test_outlets_and_periodic_borders_side_by_side(device):
    """What leaves does not change the rest: the grains that stay move on as if alone."""
    hole = [{"name": "hole", "box": {"min": [0.008, -1, -1], "max": [0.009, 1, 1]}}]
    keys = {"borders": around("z"), "device": device}
    both = simulated(
        [[0, 0, 0.01], [0.002, 0.005, 0.001]], grain={"velocities": [[0.5, 0, 0], [-0.5, 0, -0.7]]}, outlets=hole, **keys
    )
    alone = simulated([[0.002, 0.005, 0.001]], grain={"velocities": [[-0.5, 0, -0.7]], "ids": [1]}, **keys)
    for sim in (both, alone):
        sim.step(10_000)
    assert both.left == {"hole": [1, pytest.approx(2500 * 4 / 3 * np.pi * R**3)]}
    np.testing.assert_array_equal(both.particles.position, alone.particles.position)


def test_an_outlet_sees_grains_from_each_side_between_two_lists(device):
    """A box of 0.1 mm that a grain crosses within 50 steps, far from any renewal of the lists (skin 5 mm)."""
    hole = [{"name": "hole", "box": {"min": [-5e-5] * 3, "max": [5e-5] * 3}}]
    for way in np.concatenate([np.eye(3), -np.eye(3)]):
        grain = {"velocities": [way.tolist()]}
        sim = simulated([(-1e-3 * way).tolist()], grain=grain, outlets=hole, engine={"skin": 5e-3}, device=device)
        sim.step(600)
        assert sim.left["hole"][0] == 1, way


def test_grains_that_start_beyond_a_border_are_refused():
    with pytest.raises(SceneError, match=r"grain 1 at \(0\.02, 0, 0\) m starts beyond the border x max \(1 of 2 grains do\)"):
        simulated([[0, 0, 0], [0.02, 0, 0]], borders={"x": {"max": 0.01, "kind": "open"}})


@pytest.mark.parametrize(
    ("border", "words"),
    [
        ({"kind": "open"}, "give min, max or both"),
        ({"min": 0, "kind": "periodic"}, "a periodic axis needs min and max"),
        ({"min": 1, "max": 0, "kind": "open"}, "must be above min = 1 m"),
        ({"min": 0, "max": 1, "kind": ["open", "periodic"]}, "kind"),
    ],
)
def test_wrong_borders(border, words):
    with pytest.raises(SceneError, match=words):
        scene([[0, 0, 0]], borders={"x": border})


# -- streams -------------------------------------------------------------------------------------

STREAM = {
    "material": "g",
    "box": {"min": [0, 0, 0.03], "max": [0.02, 0.02, 0.04]},
    "diameter": {"uniform": [1e-3, 2e-3]},
    "velocity": [0, 0, -0.5],
    "count_rate": 3000.0,
    "until": 0.05,
    "seed": 4,
}


def chute(**keys):
    """A stream onto a tilted floor with a hole at its foot."""
    return scene(
        streams=[STREAM],
        walls=[{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0.3, 0, 1]}}],
        outlets=[{"name": "hole", "box": {"min": [0.012, -1, -1], "max": [1, 1, 0.002]}}],
        borders={"y": {"min": 0, "max": 0.02, "kind": "periodic"}},
        gravity=[0, 0, -9.81],
        time={"end": 1.0, "step": 1e-5, "max_speed": 1.0},
        **keys,
    )


def test_a_stream_brings_what_is_due_and_the_books_balance(tmp_path):
    hashes, resumed = set(), None
    for skin in ("auto", 2e-4):
        sim = Simulation(chute(engine={"skin": skin}), device="cpu", threads=1)
        sim.step(4000)
        assert sim.inlets[0].count == pytest.approx(3000 * 0.04, abs=8)
        if resumed is None:
            sim.save_checkpoint(tmp_path / "c.h5")
            resumed = Simulation.from_checkpoint(tmp_path / "c.h5", threads=2)
        sim.step(3000)
        count, mass = sim.left["hole"]
        inlet = sim.inlets[0]
        assert inlet.count == 150
        assert not inlet.blocked
        assert len(sim.state) + count == inlet.count
        assert sim.particles.mass.sum() + mass == pytest.approx(inlet.mass, rel=1e-12)
        assert count > 10
        hashes.add(sim.state_hash())
    resumed.step(3000)
    assert hashes == {resumed.state_hash()}


def made_anew(sim):
    """Lists made anew whenever they are looked at, at each grain that comes or leaves too."""
    update = sim.lists.update
    sim.lists.update = lambda grown: update(force_rebuild=True)
    return sim


def readings(sim):
    """What a run shows at an instant: nothing of those that have left."""
    contacts, p = sim.contacts(), sim.particles
    return [
        p.id, p.position, p.velocity, p.spin, p.force, p.mass, contacts.i, contacts.j, contacts.overlap, contacts.force,
        contacts.spring, np.array(list(sim.energy().values())), *(load.force for load in sim.wall_loads().values()),
    ]  # fmt: skip


@pytest.mark.parametrize("resident", [False, True])
def test_grains_that_come_and_leave_change_nothing_for_the_others(tmp_path, resident):
    """The lists stay as they are, with those that left in their slots and newcomers behind the others."""
    sim = Simulation(chute(), device="cpu", threads=1, resident=resident)
    anew = made_anew(Simulation(chute(), device="cpu", threads=1))
    there, in_slots = [], 0
    for part in range(10):
        for one in (sim, anew):
            one.step(650)
        in_slots += sim.state.slots > len(sim.state)
        assert sim.left == anew.left
        for mine, theirs in zip(readings(sim), readings(anew), strict=True):
            np.testing.assert_array_equal(mine, theirs)
        assert sim.state_hash() == anew.state_hash()
        if part in (6, 8):
            sim.save_checkpoint(tmp_path / f"{part}.h5")
            there.append(Simulation.from_checkpoint(tmp_path / f"{part}.h5", threads=2))
    assert sim.left["hole"][0] > 10 and in_slots > 0
    for resumed in there:
        resumed.step(sim.step_number - resumed.step_number)
        assert resumed.state_hash() == sim.state_hash() and resumed.left == sim.left
    if not resident:
        assert sim.lists.rebuilds < 0.5 * anew.lists.rebuilds


def test_a_grain_that_leaves_makes_no_lists(device):
    """A layer that nothing moves, and grains that leave one after the other."""
    rest = np.stack(np.meshgrid(*[np.arange(8)] * 2), -1).reshape(-1, 2) * 2.05 * R
    fast = np.column_stack([-0.001 * np.arange(12), np.full(12, 0.05)])
    places = np.pad(np.concatenate([rest, 2.1 * fast * [1, 1]]), ((0, 0), (0, 1)))
    ways = np.zeros_like(places)
    ways[64:, 0] = 1.0
    border = {"x": {"max": 0.02, "kind": "open"}}
    sim = simulated(places, grain={"velocities": ways}, borders=border, device=device)
    sim.step(14_000)
    before = sim.lists.rebuilds, sim.left["x max"][0]
    sim.step(5000)
    assert sim.left["x max"][0] - before[1] > 3
    assert sim.lists.rebuilds - before[0] <= 3


ROW = np.array([[0.0199 - 5e-4 * k, 0.01 * k, 0.0] for k in range(6)])
"""Positions of grains that leave one after the other at x = 0.02, at 1 m/s."""


def leaving(threads=1, resident=False, kind="open", **keys):
    """Six grains that leave, the first of them after 50 steps, and one at rest."""
    positions, velocities = np.vstack([ROW, [[0.0, -0.02, 0.0]]]), np.zeros((7, 3))
    velocities[:6, 0] = 1.0
    borders = {"x": {"max": 0.02, "kind": kind}}
    sim = Simulation(
        scene(positions, grain={"velocities": velocities}, borders=borders, **keys), device="cpu", threads=threads,
        resident=resident,
    )  # fmt: skip
    reported, advance = [], sim.engine.advance
    sim.engine.advance = lambda *args, **keys: reported.append(advance(*args, **keys)) or reported[-1]
    return sim, reported


@pytest.mark.parametrize(("threads", "resident"), [(1, False), (2, False), (1, True)])
def test_steps_go_on_without_a_grain_that_leaves(threads, resident):
    """No batch of steps ends for it, and its number and mass are those of a run that rests after every step."""
    sim, reported = leaving(threads, resident, engine={"skin": 0.05})
    sim.step(2000)
    assert sim.left["x max"][0] > 3
    assert not any(found & LEFT for _, found in reported)
    assert len(reported) < 10
    stepwise, _ = leaving(engine={"skin": 0.05})
    for _ in range(2000):
        stepwise.step(1)
    assert sim.left == stepwise.left
    assert sim.state_hash() == stepwise.state_hash()


def test_steps_rest_at_a_grain_whose_energy_is_asked_for():
    sim, reported = leaving(measures={"energy": True}, engine={"skin": 0.05})
    sim.step(200)
    assert sim.left["x max"][0] == 1
    assert [found & LEFT for _, found in reported].count(LEFT) == 1


def test_streamed_grains_fly_exactly(device):
    sim = Simulation(
        scene(streams=[{**STREAM, "count_rate": 100.0}], gravity=[0, 0, -9.81], frame={"axis": [0, 1, 0], "rate": 3.0}),
        device=device, threads=1,
    )  # fmt: skip
    sim.step(6000)
    first, p0, v0 = sim.step_number, sim.particles.position_lab, sim.particles.velocity_lab
    assert len(p0) == 1
    sim.step(2000)
    t = (sim.step_number - first) * sim.dt
    fallen = [0, 0, -0.5 * 9.81 * t**2]
    np.testing.assert_allclose(sim.particles.position_lab[0], p0[0] + v0[0] * t + fallen, rtol=0, atol=1e-15)


def test_a_stream_by_mass_waits_where_there_is_no_room(device):
    """A closed region fills up: what has no place waits, and nothing overlaps."""
    box = {"min": [0, 0, 0], "max": [0.01, 0.01, 0.01]}
    crowd = {"material": "g", "box": box, "diameter": 2e-3, "mass_rate": 1.0}
    sim = Simulation(scene(streams=[crowd]), device=device, threads=1)
    sim.step(2000)
    assert 30 < len(sim.state) < 90
    assert sim.extremes["pair_overlap_share"] == 0.0
    assert sim.inlets[0].blocked
    assert sim.inlets[0].waiting == 2e-3


def test_a_scene_needs_grains_or_a_stream():
    with pytest.raises(SceneError, match="give at least one group of grains, a stream, or a start"):
        scene()


def test_rates_of_a_stream():
    with pytest.raises(SceneError, match="exactly one of mass_rate, count_rate"):
        scene(streams=[{**STREAM, "mass_rate": 1.0}])
