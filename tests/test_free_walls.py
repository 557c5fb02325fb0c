"""Free walls on sliders and hinges: momentum, energy, springs, dampers, motors, gravity; bits, both frames, refusals."""

import math

import numpy as np
import pytest
from warpdem.kernels.step.dynamic_walls import STATE
from warpdem.kernels.step.free_bodies import MOTION

from free_scenes import MASS, PLATE, G, R, body_of, columns, run, scene, slider
from warpdem import SceneError, Simulation
from warpdem.mesh.solid_body import solid_body
from warpdem.mesh.triangle_mesh import load_mesh


@pytest.mark.parametrize("fixed_to, frame", [("frame", None), ("laboratory", {"axis": [1, 2, 0], "rate": 4.0})])
def test_a_grain_and_a_free_plate_share_momentum_and_energy_exactly(fixed_to, frame):
    """Head on, elastic, M = 5 m: (m - M)/(m + M) v and 2 m/(m + M) v; momentum to round-off; work to and from the grain too."""
    ratio, v = 5.0, -0.2
    wall = PLATE | {"fixed_to": fixed_to}
    time = {"end": 1, "step": 1e-6}
    sim = run(scene(slider(ratio * MASS), wall, [[0, 0, 1.01 * R]], [[0, 0, v]], e=1.0, frame=frame, time=time))
    sim.step(90)
    assert sim.wall_loads(lab=True)["body"].force[2] < -0.01  # in the middle of it
    sim.step(910)
    after, plate = sim.particles.velocity_lab[0, 2], body_of(sim).value("rate")
    assert MASS * after + ratio * MASS * plate == pytest.approx(MASS * v, rel=1e-13)
    assert after == pytest.approx((1 - ratio) / (1 + ratio) * v, rel=1e-4)
    assert plate == pytest.approx(2 / (1 + ratio) * v, rel=1e-4)
    now = columns(sim)
    assert now["kinetic"] + sim.energy()["kinetic"] == pytest.approx(0.5 * MASS * v**2, rel=1e-4)
    assert sim.budget.energy()["body work"] == pytest.approx(-now["kinetic"], rel=1e-12)
    np.testing.assert_allclose(sim.particles.velocity_lab[0, :2], 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 5.0, 20.0])
@pytest.mark.parametrize("joint", ["slider", "hinge", "body"])
def test_the_restitution_is_that_of_the_pair_however_light_the_wall(joint, ratio):
    """The dashpot goes by 1/m + 1/M_eff at the contact; momentum and angular momentum to round-off.

    M_eff = M along the axis of a slider, I/l^2 at the arm l of a hinge, 1/(1/M + l^2/I_y) beside the center of a body.
    """
    v, e, arm = -0.2, 0.5, 2e-3
    if joint == "slider":
        free, inertia = slider(ratio * MASS), ratio * MASS
    elif joint == "hinge":
        free = {"joint": "hinge", "axis": [0, -1, 0], "inertia": ratio * MASS * arm**2}
        inertia = ratio * MASS * arm**2
    else:
        heavy = 2.0 * ratio * MASS
        moments = [heavy * arm**2, heavy * arm**2, 2 * heavy * arm**2]
        free = {"joint": "none", "mass": heavy, "centre": [0, 0, 0], "inertia": moments}
    sim = run(scene(free, PLATE, [[arm, 0, 1.01 * R]], [[0, 0, v]], e=e, time={"end": 1, "step": 5e-7}))
    sim.run(until=1e-3)
    p, body = sim.particles, body_of(sim)
    after, place = p.velocity_lab[0], p.position_lab[0]
    about = MASS * np.cross(place, after)[1]  # about y
    if joint == "body":
        velocity, turning, at = (body.motion[MOTION.of(name)] for name in ("velocity", "momentum", "place"))
        np.testing.assert_allclose(MASS * after + heavy * velocity, [0, 0, MASS * v], rtol=0, atol=1e-13 * MASS * abs(v))
        about += turning[1] + heavy * np.cross(at, velocity)[1]
        plate = velocity + np.cross([0, turning[1] / moments[1], 0], [arm, 0, 0])
    elif joint == "hinge":
        about -= inertia * body.value("rate")
        plate = np.array([0, 0, body.value("rate") * arm])
    else:
        assert MASS * after[2] + inertia * body.value("rate") == pytest.approx(MASS * v, rel=1e-13)
        about, plate = -MASS * v * arm, np.array([0, 0, body.value("rate")])
    assert about == pytest.approx(-MASS * v * arm, rel=1e-12)
    push = after - [0, 0, v]
    n = push / np.linalg.norm(push)  # in the mean: hinge and body tilt by a hundredth in the contact
    assert (after - plate) @ n / -v == pytest.approx(e, abs=0.003)


def test_a_wall_on_the_end_of_its_range_damps_as_one_at_rest():
    """Nothing yields: the bits of the same plate without freedom; pushed off its end it is a free one."""
    free = slider(2 * MASS, force=-0.5, range=[0, 1])
    given = scene(free, positions=[[0, 0, 1.01 * R]], velocities=[[0, 0, -0.2]], time={"end": 1, "step": 1e-6})
    still = given.model_copy(update={"walls": [given.walls[0].model_copy(update={"free": None})]})
    speeds = []
    for one in (given, still):
        sim = run(one)
        sim.run(until=1e-3)
        speeds.append(sim.particles.velocity_lab[0, 2])
    assert speeds[0] == speeds[1] == pytest.approx(0.1, abs=0.001)


def test_a_spring_and_a_damper_swing_as_they_should():
    """Place (x0 cos wt + x0 d/w sin wt) exp(-dt) about the rest, d = c/2M, w^2 = k/M - d^2; what is lost is what is missing."""
    mass, k, c, rest = 0.01, 40.0, 0.1, 2e-3
    sim = run(scene(slider(mass, stiffness=k, damping=c, rest=rest)))
    decay = c / (2 * mass)
    w = math.sqrt(k / mass - decay**2)
    for time in (0.02, 0.05, 0.1, 0.2):
        sim.run(until=time)
        t = sim.time
        exact = rest - rest * (math.cos(w * t) + decay / w * math.sin(w * t)) * math.exp(-decay * t)
        assert body_of(sim).value("position") == pytest.approx(exact, abs=2e-7 * rest)
        now = columns(sim)
        assert now["kinetic"] + now["spring"] + now["lost"] == pytest.approx(0.5 * k * rest**2, rel=1e-4)
    assert now["lost"] > 0.1 * 0.5 * k * rest**2


def test_a_slider_falls_freely_and_stops_dead_at_the_end_of_its_range():
    """By g sin over the axis; exact positions, no matter in which axes; the fall ends in what is lost."""
    axis = np.array([0, 0.6, -0.8])
    free = {"joint": "slider", "axis": axis, "mass": 0.1, "range": [0, 0.02], "velocity": 0.1}
    for fixed_to, frame in (("frame", None), ("laboratory", {"axis": [0, 1, 1], "rate": 3.0})):
        sim = run(scene(free, PLATE | {"fixed_to": fixed_to}, gravity=[0, 0, -G], frame=frame))
        sim.run(until=0.04)
        t = sim.time
        assert body_of(sim).value("position") == pytest.approx(0.1 * t + 0.4 * G * t**2, rel=1e-10)
        before = columns(sim)
        sim.run(until=0.1)
        assert body_of(sim).value("position") == pytest.approx(0.02, abs=1e-15)
        assert body_of(sim).value("rate") == 0.0
        now = columns(sim)
        total = before["kinetic"] + before["gravity"]
        assert now["kinetic"] + now["gravity"] + now["lost"] == pytest.approx(total, abs=2e-3 * now["lost"])
        assert now["lost"] > 0.0


def test_on_the_end_of_its_range_a_wall_takes_and_loses_nothing():
    """Pressed down with a damper and a motor, and hit by a grain: no work is done on what does not move."""
    free = slider(5 * MASS, force=-0.5, damping=0.01, motor=[[-1, -0.1], [1, -0.2]], range=[0, 1])
    sim = run(scene(free, positions=[[0, 0, 1.01 * R]], velocities=[[0, 0, -0.2]], e=1.0, time={"end": 1, "step": 1e-6}))
    sim.step(1000)
    assert sim.particles.velocity_lab[0, 2] == pytest.approx(0.2, rel=1e-3)
    now = columns(sim)
    assert (now["kinetic"], now["driven"], now["lost"]) == (0.0, 0.0, 0.0)
    assert sim.budget.energy()["body work"] == 0.0


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_the_books_of_a_wall_that_is_thrown_at_its_end_close(damping):
    """By a grain, against a force: what drive and grain gave is in its motion or lost, once the grain has left."""
    free = slider(5 * MASS, force=0.004, damping=damping, range=[-1e-6, 1])
    sim = run(scene(free, positions=[[0, 0, 1.01 * R]], velocities=[[0, 0, -0.2]], e=1.0, time={"end": 1, "step": 1e-6}))
    for _ in range(12):
        sim.step(100)
        one, now = body_of(sim), columns(sim)
        if now["load"] != 0.0:  # read in the middle of a kick of the grain
            continue
        half = 0.5 * one.inertia * one.value("rate") ** 2
        ahead = 0.5 * one.inertia * one.value("predicted") ** 2 - half
        given = now["driven"] - sim.budget.energy()["body work"]
        assert now["kinetic"] + now["lost"] == pytest.approx(given, abs=abs(ahead) + 1e-12 * 0.5 * MASS * 0.2**2)
    assert body_of(sim).value("position") > 0.0 and now["lost"] > 0.0


BAR = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (-0.005, 0.005) for z in (-0.002, 0.002)) + "".join(
    f"f {face}\n" for face in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
)


@pytest.fixture
def bar(tmp_path):
    """A bar of 100 x 10 x 4 mm along x from the origin."""
    (tmp_path / "bar.obj").write_text(BAR, encoding="utf-8")
    return {"mesh": str(tmp_path / "bar.obj")}


def test_a_closed_mesh_has_its_mass_center_and_inertia(bar):
    """A bar by hand: rho V, its middle, m (a^2 + b^2)/12, Steiner's theorem; scaled to a mass that is given."""
    mesh = load_mesh(bar["mesh"], 1.0, None, (0, 0, 0), "", "mesh", None, "")
    solid = solid_body(mesh, 2000.0)
    mass = 2000 * 0.1 * 0.01 * 0.004
    assert solid.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(solid.center, [0.05, 0, 0], rtol=0, atol=1e-15)
    sides = np.array([0.1, 0.01, 0.004])
    np.testing.assert_allclose(solid.inertia, np.diag(mass / 12 * (sides @ sides - sides**2)), rtol=0, atol=1e-15 * mass)
    about = mass * (0.1**2 + 0.004**2) / 12 + mass * 0.05**2
    assert solid.about(np.array([0, 1.0, 0]), np.zeros(3)) == pytest.approx(about, rel=1e-12)
    hinge = {"joint": "hinge", "axis": [0, 1, 0]}
    for given, factor in (({}, 2500 / 2000), ({"mass": 3 * mass}, 3.0)):
        one = body_of(run(scene(hinge | given, bar)))
        assert one.inertia == pytest.approx(factor * about, rel=1e-9)
        assert one.mass == pytest.approx(factor * mass, rel=1e-9)
        np.testing.assert_allclose(one.center, [0.05, 0, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize("fixed_to, frame", [("frame", None), ("laboratory", {"axis": [0, 0, 1], "rate": 5.0})])
def test_a_bar_on_a_hinge_swings_as_a_pendulum(bar, fixed_to, frame):
    """Let go level: at the bottom (1/2) I w^2 = m g l; the time of a quarter swing by the complete elliptic integral."""
    from scipy.special import ellipk

    sim = run(scene({"joint": "hinge", "axis": [0, 1, 0]}, bar | {"fixed_to": fixed_to}, gravity=[0, 0, -G], frame=frame,
                    time={"end": 1, "step": 1e-5}))  # fmt: skip
    one = body_of(sim)
    lever = one.mass * G * 0.05
    small = math.sqrt(one.inertia / lever)
    quarter = small * ellipk(math.sin(math.pi / 4) ** 2)
    sim.run(until=quarter)
    past = sim.time - quarter
    assert body_of(sim).value("position") == pytest.approx(math.pi / 2 + past * math.sqrt(2 * lever / one.inertia), rel=1e-6)
    assert body_of(sim).value("predicted") == pytest.approx(math.sqrt(2 * lever / one.inertia), rel=1e-6)
    now = columns(sim)
    assert now["kinetic"] + now["gravity"] == pytest.approx(0.0, abs=1e-6 * lever)
    sim.run(until=2 * quarter)
    assert body_of(sim).value("position") == pytest.approx(math.pi, rel=1e-5)


def test_a_motor_brings_a_drum_to_the_speed_at_which_the_torques_agree():
    """Stall torque and free rate, straight between: w = w_f (1 - exp(-t T/(I w_f))); under a load L, w_f (1 - L/T)."""
    inertia, stall, free, load = 1e-5, 2e-3, 10.0, 5e-4
    hinge = {"joint": "hinge", "axis": [0, 1, 0], "inertia": inertia, "motor": [[0, stall], [free, 0]]}
    cylinder = {"cylinder": {"point": [0, -1, 0], "axis": [0, 1, 0], "radius": 0.02}}
    sim = run(scene(hinge, cylinder, positions=[[0, 0, 0]], time={"end": 3, "step": 5e-5}))
    sim.run(until=0.03)
    assert body_of(sim).value("predicted") == pytest.approx(free * (1 - math.exp(-0.03 * stall / (inertia * free))), rel=1e-6)
    sim = run(scene(hinge | {"torque": -load}, cylinder, positions=[[0, 0, 0]], time={"end": 10, "step": 5e-5}))
    sim.run(until=0.8)
    assert body_of(sim).value("rate") == pytest.approx(free * (1 - load / stall), rel=1e-6)
    braked = hinge | {"motor": [[0, stall], [free, 0], [2 * free, -stall]], "rate": 3 * free}  # constant beyond its ends
    sim = run(scene(braked, cylinder, positions=[[0, 0, 0]], time={"end": 10, "step": 5e-5}))
    sim.run(until=0.04)
    assert body_of(sim).value("predicted") == pytest.approx(3 * free - stall / inertia * 0.04, rel=1e-9)
    sim.run(until=0.8)
    assert body_of(sim).value("predicted") == pytest.approx(free, rel=1e-6)


def drum(**keys):
    """Grains in a drum of 8 mm on a motor: its rate follows from what they weigh on it."""
    rng = np.random.default_rng(5)
    grid = np.stack(np.meshgrid(np.arange(-2, 3.0), np.arange(3.0), np.arange(-2, 1.0), indexing="ij"), axis=-1).reshape(-1, 3)
    positions = 2.1 * R * grid + [0, R, 0] + rng.uniform(0, 0.05 * R, grid.shape)
    hinge = {"joint": "hinge", "axis": [0, 1, 0], "inertia": 3e-7, "motor": [[0, 2e-5], [20, 0]]}
    cylinder = {"cylinder": {"point": [0, -1, 0], "axis": [0, 1, 0], "radius": 8 * R}}
    ends = [
        {"name": f"end{k}", "material": "g", "plane": {"point": [0, y, 0], "normal": [0, n, 0]}}
        for k, (y, n) in enumerate([(0, 1), (6.5 * R, -1)])
    ]
    more = {"gravity": [0, 0, -G], "time": {"end": 1, "step": 1e-5}} | keys
    return scene(hinge, cylinder, positions, e=0.3, friction=0.5, walls=ends, **more)


@pytest.fixture(scope="module")
def turning():
    sim = run(drum())
    sim.step(4000)
    return sim


def test_motor_and_grains_agree_in_the_mean(turning):
    """A driven drum lifts its grains: over the second half of a second its torque is, in the mean, what the motor gives."""
    sim = run(drum())
    sim.run(until=0.4)
    rates, loads, start = [], [], body_of(sim).value("predicted")
    began = sim.time
    while sim.time < 0.9:
        sim.step(20)
        rates.append(body_of(sim).value("predicted"))
        loads.append(columns(sim)["load"])
    given = 2e-5 * (1 - np.mean(rates) / 20)
    taken = np.mean(loads) + 3e-7 * (rates[-1] - start) / (sim.time - began)
    assert given == pytest.approx(taken, rel=0.02)
    assert 1.0 < np.mean(rates) < 19.0
    assert abs(sim.budget.energy()["integration_error"]) < 0.02 * sim.budget.energy()["body work"]
    now = columns(sim)
    assert now["kinetic"] == pytest.approx(now["driven"] - sim.budget.energy()["body work"], rel=1e-2)


def test_threads_batches_and_a_resume_change_no_bit(turning, tmp_path):
    other = run(drum(), threads=2)
    for steps in (1, 1999, 1000):
        other.step(steps)
    other.save_checkpoint(tmp_path / "a.h5")
    again = Simulation.from_checkpoint(tmp_path / "a.h5", device="cpu", threads=3)
    for sim in (other, again):
        sim.step(1000)
        assert sim.state_hash() == turning.state_hash()
        np.testing.assert_array_equal(body_of(sim).state, body_of(turning).state)
        np.testing.assert_array_equal(body_of(sim).now, body_of(turning).now)
    assert columns(again) == columns(turning)


def test_the_graph_moves_them_with_the_same_bits(turning):
    """Launches over grains in place of threads that meet, with a hinge, lists that are made on the way, and reads."""
    sim = Simulation(drum(), device="cpu", resident=True)
    for steps in (1, 1999, 2000):
        sim.step(steps)
    assert sim.state_hash() == turning.state_hash()
    np.testing.assert_array_equal(body_of(sim).state, body_of(turning).state)
    np.testing.assert_array_equal(body_of(sim).now, body_of(turning).now)


SLOW_SCHEMES = [pytest.param(name, marks=pytest.mark.slow) for name in ("scovel", "lobatto", "explicit_euler")]


@pytest.mark.parametrize("scheme", ["velocity_verlet", *SLOW_SCHEMES])
def test_other_schemes_share_momentum_exactly_too(scheme):
    """Grain and plate of 2 m, both kicked by one force; restitution within the error of the step's first order."""
    given = scene(slider(2 * MASS), PLATE | {"fixed_to": "laboratory"}, [[0, 0, 1.01 * R]], [[0, 0, -0.2]], measures={},
                  engine={"integrator": scheme}, time={"end": 1, "step": 2.5e-7})  # fmt: skip
    sim = run(given)
    sim.run(until=1e-3)
    after, plate = sim.particles.velocity_lab[0, 2], body_of(sim).value("rate")
    assert MASS * after + 2 * MASS * plate == pytest.approx(MASS * -0.2, rel=1e-12)
    assert (after - plate) / 0.2 == pytest.approx(0.5, abs=0.005)


def test_in_turning_axes_as_in_the_laboratory(turning):
    given = drum(frame={"axis": [0, 1, 0], "rate": 3.0})
    walls = [wall.model_copy(update={"fixed_to": "laboratory"}) for wall in given.walls]
    sim = run(given.model_copy(update={"walls": walls}))
    sim.step(1500)
    here = run(drum())
    here.step(1500)
    np.testing.assert_allclose(sim.particles.position_lab, here.particles.position_lab, rtol=0, atol=1e-6 * R)
    assert body_of(sim).value("position") == pytest.approx(body_of(here).value("position"), rel=1e-7)


def test_a_phase_goes_on_with_place_rate_and_spring(tmp_path):
    """Half a swing in one run, the rest in another: as without the break, but for the half kick that begins it anew."""
    free = slider(0.01, stiffness=40.0, rest=2e-3, range=[-1e-3, 5e-3])
    whole, first = run(scene(free)), run(scene(free))
    whole.run(until=0.05)
    first.run(until=0.02)
    first.save_checkpoint(tmp_path / "a.h5")
    for continues in ([], ["body"]):
        start = {"checkpoint": str(tmp_path / "a.h5"), "continues": continues}
        then = run(scene(free, start=start, grains=[]))
        then.run(until=0.03)
        found, expected = (sim.schedule.bodies(sim.time)[0, 11] for sim in (then, whole))
        assert found == pytest.approx(expected, rel=1e-6)
        assert body_of(then).value("predicted") == pytest.approx(body_of(whole).value("predicted"), rel=1e-5)
        assert body_of(then).given.range == pytest.approx([-1e-3 - first_place(first), 5e-3 - first_place(first)])


def first_place(sim):
    return body_of(sim).value("position")


def test_numbers_of_the_state_have_their_columns():
    assert STATE.names == ("position", "rate", "predicted", "correction", "driven", "lost", "held")


BAD = [
    ({"joint": "hing", "axis": [0, 0, 1]}, 'must be "slider", "hinge" or "none"'),
    ({"axis": [0, 0, 1]}, r"free.joint\n.*missing: What the wall may do"),
    ({"joint": "slider", "axis": [0, 0, 1]}, r"free.mass\n.*missing: only a closed mesh has one of its own"),
    ({"joint": "hinge", "axis": [0, 0, 1]}, r"free.inertia\n.*missing: only a closed mesh has one of its own"),
    ({"joint": "hinge", "axis": [0, 0, 1], "inertia": 1, "centre": [1, 0, 0]}, r"free.mass\n.*missing: only a closed mesh"),
    (slider(1, inertia=1), r"free.inertia = 1\n.*belongs to another kind|unknown key"),
    (slider(1, range=[1, 2]), r"free.range = \[1.0, 2.0\]\n.*around 0, where the wall begins"),
    (slider(1, motor=[[0, 1], [0, 2]]), r"free.motor\[1\]\[0\] = 0.0\n.*must be above 0, the entry before"),
    (slider(1, motor=[[k, 1] for k in range(17)]), r"free.motor\n.*has 17 points; at most 16 are read"),
    (slider(1, motor=[[0, 1, 2]]), r"speed in \[m/s\], force in \[N\]"),
    (slider(1, force=[[1, 1], [1, 2]]), r"free.force\[1\]\[0\] = 1.0\n.*must be later than 1 s"),
    (slider(-1), "free.mass"),
    (slider("1 m"), "a mass"),
]


@pytest.mark.parametrize("free, message", BAD, ids=[str(n) for n in range(len(BAD))])
def test_what_is_wrong_with_a_free_wall_is_said(free, message):
    with pytest.raises(SceneError, match=rf"(?s){message}"):
        scene(free)


def test_what_a_free_wall_cannot_have_is_refused():
    servo = {"axis": [0, 0, 1], "force": 1, "max_speed": 1}
    for keys, message in (
        ({"driven": True}, "not with free: either a program moves the wall"),
        ({"servo": servo}, "not with servo: a wall has one"),
        ({"motion": {"velocity": [0, 0, 1]}}, "not with free, but for a fixed placement"),
    ):  # fmt: skip
        with pytest.raises(SceneError, match=message):
            scene(slider(1), PLATE | keys)
    with pytest.raises(SceneError, match=r'walls\[0\].free: its axis would move with the frame.*fixed_to = "laboratory"'):
        run(scene(slider(1), frame={"axis": [0, 0, 1], "rate": 1.0}))
    with pytest.raises(SceneError, match=r"walls\[0\].free: its mass of 1e-06 kg is below that of the heaviest grain"):
        run(scene(slider(1e-6)))
    with pytest.raises(SceneError, match=r"free.stiffness: 1e\+09 N/m lets the wall swing.*take a time.step below 6.3e-06 s"):
        run(scene(slider(1, stiffness=1e9), time={"end": 1, "step": 1e-5}))
    with pytest.raises(SceneError, match=r"free.damping: 2e\+05 N s/m change its rate by 2 of itself.*below 5e-06 s"):
        run(scene(slider(1, damping=2e5), time={"end": 1, "step": 1e-5}))
    with pytest.raises(SceneError, match=r"free.motor: 3e\+05 N s/m change"):
        run(scene(slider(1, motor=[[0, 3e5], [1, 0], [2, 0]]), time={"end": 1, "step": 1e-5}))
