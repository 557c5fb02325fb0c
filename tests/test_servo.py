"""Walls that a servo moves: the load asked for, its path in time, bits, both frames, phases, and what is refused."""

import math

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation
from warpdem.app import summary
from warpdem.measure.column import Readings
from warpdem.measure.dynamic_walls import dynamic_wall
from warpdem.measure.snapshot import take_snapshot
from warpdem.measure.totals import Totals
from warpdem.output.history import history_columns, history_row
from warpdem.output.staged_state import StagedState, StagingBuffer

R, DT = 1e-3, 5e-6
E_STAR = 50e6 / (2 * (1 - 0.3**2))  # of two grains; a grain and a wall of one material are alike
MASS = 2500 * 4 / 3 * math.pi * R**3


def scene(positions, lid, *, walls=(), friction=0.0, **keys):
    """Grains on a floor under a plane with a servo."""
    given = {
        "gravity": [0, 0, 0],
        "materials": {"g": {"density": 2500, "young_modulus": "50 MPa", "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.3, "friction": friction}],
        "grains": [{"material": "g", "radius": R, "positions": positions, "velocities_in": "laboratory"}],
        "walls": [{"name": "floor", "material": "g", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}, *walls,
                  {"name": "lid", "material": "g", **lid}],
        "time": {"end": 1, "step": DT},
    }  # fmt: skip
    return Scene.model_validate(given | keys)


def bed(n=3, **keys):
    """Grains in a box under a lid that presses with 500 Pa."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(float(n))] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    side = (2.1 * n + 0.1) * R
    planes = [([0] * 3, m) for m in np.eye(3)[:2].tolist()] + [([side] * 3, m) for m in (-np.eye(3)[:2]).tolist()]
    walls = [{"name": f"w{k}", "material": "g", "plane": {"point": p, "normal": m}} for k, (p, m) in enumerate(planes)]
    lid = {
        "plane": {"point": [0, 0, side], "normal": [0, 0, -1]},
        "servo": {"axis": [0, 0, -1], "pressure": 500, "area": side**2, "max_speed": 0.1},
    }
    positions = 2.1 * R * grid + R + rng.uniform(0.0, 0.05 * R, grid.shape)
    more = {"gravity": [0, 0, -9.81], "measures": {"energy": True}}
    return scene(positions, lid, walls=walls, friction=0.4, **more | keys), side**2


def run(given, threads=1, **keys):
    return Simulation(given, device="cpu", threads=threads, **keys)


def servo_of(sim, number=0):
    return sim.schedule.dynamic[number]


def hertz(force, radius=R, modulus=E_STAR):
    """Overlap of a contact under ``force`` [m]."""
    return (force / (4 / 3 * modulus * math.sqrt(radius))) ** (2 / 3)


COLUMN = [[0, 0, R + 2 * k * R] for k in range(5)]
LID = {"plane": {"point": [0, 0, 10 * R], "normal": [0, 0, -1]}}


@pytest.mark.parametrize("force", [1e-4, 1e-2, 0.3])
def test_the_uniaxial_curve_of_a_chain_is_that_of_hertz(force):
    """Five grains between floor and lid: the lid goes down by the overlaps of four pairs and two walls at that force."""
    sim = run(scene(COLUMN, LID | {"servo": {"axis": [0, 0, -1], "force": force, "max_speed": 0.05}}))
    sim.run(until=0.2)
    down = 4 * hertz(force, R / 2) + 2 * hertz(force)
    assert servo_of(sim).value("position") == pytest.approx(down, rel=1e-6)
    assert sim.wall_loads()["lid"].force[2] == pytest.approx(force, rel=1e-6)
    assert sim.wall_loads()["floor"].force[2] == pytest.approx(-force, rel=1e-6)


def test_a_load_that_changes_in_time_is_followed():
    """A slow ramp: the force of the time, and what holds before the start and after the end."""
    course = {"axis": [0, 0, -1], "force": [[0, 0.01], [0.1, 0.02]], "max_speed": 0.05, "start": 0.01, "until": 0.12}
    sim = run(scene(COLUMN, LID | {"servo": course}))
    sim.run(until=0.009)
    assert servo_of(sim).value("position") == 0.0
    for time in (0.06, 0.08, 0.10):
        sim.run(until=time)
        # the ramp has its own time, and sets the chain swinging a little
        assert sim.wall_loads()["lid"].force[2] == pytest.approx(0.01 + 0.1 * (time - 0.01), rel=2e-3)
    sim.run(until=0.12)
    held = servo_of(sim).value("position")
    sim.run(until=0.13)
    assert servo_of(sim).value("position") == pytest.approx(held, abs=1e-4 * R)
    assert servo_of(sim).value("rate") == 0.0


def test_a_servo_comes_with_its_largest_speed_and_goes_on_without_grains():
    """A step of dt/2 brings it to full speed: the drive over the mass of a grain; nobody is there."""
    lid = {"plane": {"point": [0, 0, 0.1], "normal": [0, 0, -1]}, "fixed_to": "laboratory"}
    lid["servo"] = {"axis": [0, 0, -1], "force": 1.0, "max_speed": 0.05}
    far = scene([[0, 0, R]], lid)
    left = scene([[0, 0, R]], lid, grains=[], streams=[
        {"material": "g", "diameter": 2 * R, "count_rate": 10, "start": 0.5, "box": {"min": [-0.01] * 3, "max": [0.01] * 3}}
    ])  # fmt: skip
    for given in (far, left):
        sim = run(given)
        sim.step(5000)
        assert servo_of(sim).value("position") == pytest.approx(0.05 * 5000 * DT, rel=1e-12)
        assert sim.schedule.wall_placements(given, sim.time)["lid"].translation[2] == pytest.approx(-0.05 * sim.time)


def test_its_first_step_is_that_of_a_wall_of_the_mass_of_the_grain():
    """Rate (dt/2) (D - L)/m of the grain that it touches, then a whole step: by hand from the force of the first instant."""
    overlap, drive = 1e-5, 0.02
    lid = {"plane": {"point": [0, 0, 2 * R - overlap], "normal": [0, 0, -1]}}
    sim = run(scene([[0, 0, R]], lid | {"servo": {"axis": [0, 0, -1], "force": drive, "max_speed": 10}}))
    load = sim.wall_loads()["lid"].force[2]
    assert load == pytest.approx(4 / 3 * E_STAR * math.sqrt(R) * overlap**1.5, rel=1e-9)
    sim.step(1)
    first = 0.5 * DT * (drive - load) / MASS
    assert servo_of(sim).value("rate") == pytest.approx(first, rel=1e-12)
    assert servo_of(sim).value("position") == pytest.approx(DT * first, rel=1e-12)
    assert servo_of(sim).value("predicted") == pytest.approx(2 * first, rel=1e-12)
    load = sim.wall_loads()["lid"].force[2]
    sim.step(1)
    assert servo_of(sim).value("rate") == pytest.approx(first + DT * (drive - load) / MASS, rel=1e-12)


def test_work_is_that_of_the_mean_velocity_of_each_step():
    """The sum of dt L (u_k-1/2 + u_k+1/2)/2 from steps done one by one, which is what a kick changes of a body's energy."""
    servo = {"axis": [0, 0, -1], "force": 0.02, "max_speed": 0.05}
    sim = run(scene(COLUMN, LID | {"servo": servo}, measures={"energy": True}))
    work, before = 0.0, 0.0
    for step in range(300):
        load = sim.wall_loads()["lid"].force[2]
        sim.step(1)
        rate = servo_of(sim).value("rate")
        work += (0.5 if step == 0 else 1.0) * DT * load * 0.5 * (before + rate)
        before = rate
    present = 0.5 * DT * sim.wall_loads()["lid"].force[2] * servo_of(sim).value("predicted")
    assert sim.budget.energy()["lid work"] == pytest.approx(work + present, rel=1e-10)
    assert servo_of(sim).value("correction") != 0.0


@pytest.mark.parametrize("fixed_to", ["frame", "laboratory"])
def test_a_torque_presses_with_its_arm(fixed_to):
    """A plate that turns about the y axis on a grain at x = a: force T/a; the arm is that of the contact point."""
    torque, arm = 1e-4, 0.01
    # about +y the plate above the x axis goes down
    lid = {"plane": {"point": [0, 0, 2.05 * R], "normal": [0, 0, -1]}, "fixed_to": fixed_to}
    lid["servo"] = {"axis": [0, 1, 0], "origin": [0, 0, 2 * R], "torque": torque, "max_rate": 5}
    held = [{"name": f"w{k}", "material": "g", "plane": {"point": [arm + k * R, 0, 0], "normal": [-k, 0, 0]}} for k in (-1, 1)]
    sim = run(scene([[arm, 0, R]], lid, walls=held))
    sim.run(until=0.15)
    load = sim.wall_loads()["lid"]
    assert -load.torque[1] == pytest.approx(torque, rel=1e-5)
    assert load.about[2] == pytest.approx(2 * R)
    angle = servo_of(sim).value("position")
    assert angle > 0.0
    (z,) = sim.particles.position[:, 2]
    normal = np.array([-math.sin(angle), 0.0, -math.cos(angle)])
    point = sim.particles.position[0] - normal * R
    lever = np.cross(point - [0, 0, 2 * R], -normal)[1]
    assert np.linalg.norm(load.force) * abs(lever) == pytest.approx(torque, rel=1e-2)
    assert z < R


def test_a_pressure_is_held_within_a_per_cent():
    """500 Pa on a bed with friction, once it has settled; the work of the servo is in the books."""
    given, area = bed()
    sim = run(given)
    sim.run(until=0.1)
    found = []
    for _ in range(50):
        sim.step(100)
        found.append(sim.wall_loads()["lid"].force[2] / area)
    assert np.abs(np.array(found) / 500 - 1).max() < 0.01
    books, now = sim.budget.energy(), sim.energy()
    assert books["lid work"] > 10 * now["elastic"]
    assert abs(books["integration_error"]) < 0.02 * books["lid work"]


def test_a_mesh_has_the_area_that_the_axis_sees(tmp_path):
    """A closed box of 4 x 6 x 1 mm along x: 6 mm2; without its faces across y, as an open mesh, the same of what is left."""
    x, y, z = 4e-3, 6e-3, 1e-3
    corners = [(i * x, j * y, 0.02 + k * z) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 5, 7, 3), (2, 4, 8, 6), (1, 2, 6, 5), (3, 7, 8, 4)]
    for name, chosen, axis, area in (
        ("closed", faces, [1, 0, 0], y * z), ("closed", faces, [0, 0, -1], x * y), ("sheet", faces[:1], [0, 0, 1], x * y)
    ):  # fmt: skip
        text = "".join(f"v {a} {b} {c}\n" for a, b, c in corners) + "".join(f"f {' '.join(map(str, f))}\n" for f in chosen)
        (tmp_path / f"{name}.obj").write_text(text, encoding="utf-8")
        lid = {"mesh": str(tmp_path / f"{name}.obj"), "open": name == "sheet"}
        sim = run(scene([[0, 0, R]], lid | {"servo": {"axis": axis, "pressure": 1e-3, "max_speed": 1e-3}}))
        assert servo_of(sim).area == pytest.approx(area, rel=1e-6)


@pytest.fixture(scope="module")
def reference():
    sim = run(bed()[0])
    sim.step(3000)
    return sim


def same(one, other):
    assert one.state_hash() == other.state_hash()
    np.testing.assert_array_equal(servo_of(one).state, servo_of(other).state)
    np.testing.assert_array_equal(servo_of(one).now, servo_of(other).now)


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(reference, threads):
    sim = run(bed()[0], threads=threads)
    sim.step(3000)
    same(sim, reference)


def test_neither_reading_nor_the_lists_nor_the_batches_change_a_bit(reference):
    sim = run(bed(engine={"skin": 0.3 * R})[0])
    for steps in (1, 2, 597, 1400, 1000):
        sim.step(steps)
        sim.particles.position, sim.wall_loads()
    same(sim, reference)


@pytest.mark.parametrize("cut", [1, 1234, 1300])
def test_resume_goes_on_bit_for_bit(reference, tmp_path, cut):
    sim = run(bed()[0])
    sim.step(cut)
    sim.save_checkpoint(tmp_path / "a.h5")
    again = Simulation.from_checkpoint(tmp_path / "a.h5", device="cpu", threads=2)
    same(again, sim)
    again.step(3000 - cut)
    same(again, reference)
    assert again.budget.energy()["lid work"] == reference.budget.energy()["lid work"]


def test_what_was_read_stays_when_the_run_goes_on(tmp_path):
    """A copy that a writer reads later shows the wall where it was."""
    sim = run(bed()[0])
    sim.step(500)
    now = sim.snapshot()
    copy = StagedState(sim.view, StagingBuffer(sim.device))
    sim.step(500)
    then = take_snapshot(copy.view())
    np.testing.assert_array_equal(then.walls["lid"].translation, now.walls["lid"].translation)
    np.testing.assert_array_equal(then.loads["lid"].force, now.loads["lid"].force)
    assert sim.snapshot().walls["lid"].translation[2] < now.walls["lid"].translation[2] - 1e-5


def test_in_moving_axes_as_in_the_laboratory():
    """A lid fixed to the laboratory, or one that goes with the frame: seen from a lifted frame and from a turning one."""
    shown = {}
    for name, frame in {
        "none": None, "lifted": {"velocity": [0.02, 0, 0.3]}, "turning": {"axis": [0, 0.6, 0.8], "rate": 3.0}
    }.items():  # fmt: skip
        given, _ = bed(frame=frame)
        walls = [wall.model_copy(update={"fixed_to": "laboratory"}) for wall in given.walls]
        sim = run(given.model_copy(update={"walls": walls}))
        sim.step(2000)
        shown[name] = sim.particles.position_lab, servo_of(sim).value("position"), sim.wall_loads(lab=True)["lid"].force
    for name in ("lifted", "turning"):
        for found, expected, size in zip(shown[name], shown["none"], (R, R, 0.02), strict=True):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * size)
    assert shown["none"][1] > 0.1 * R


def test_a_servo_acts_on_top_of_a_motion():
    """A lid that slides by its motion while the servo presses: where it is, and friction that its power pays for."""
    lid = LID | {"motion": {"velocity": [0.02, 0, 0]}, "servo": {"axis": [0, 0, -1], "force": 0.01, "max_speed": 0.05}}
    sim = run(scene(COLUMN[:1], lid | {"plane": {"point": [0, 0, 2 * R], "normal": [0, 0, -1]}}, friction=0.2))
    sim.run(until=0.1)
    place = sim.schedule.wall_placements(sim.scene, sim.time)["lid"].translation
    assert place[0] == pytest.approx(0.02 * sim.time, rel=1e-9)
    assert place[2] == -servo_of(sim).value("position")
    assert sim.wall_loads()["lid"].force[2] == pytest.approx(0.01, rel=1e-3)
    assert sim.particles.velocity[0, 0] == pytest.approx(0.01, rel=1e-2)  # it rolls between lid and floor


def test_the_next_phase_goes_on_from_where_the_servo_is(tmp_path):
    """The load doubles; its time begins anew where the phase names it, and goes on where it does not."""
    servo = {"axis": [0, 0, -1], "force": [[0, 0.01], [1, 0.02]], "max_speed": 0.05}
    first = run(scene(COLUMN, LID | {"servo": servo}))
    first.step(4000)
    first.save_checkpoint(tmp_path / "a.h5")
    start = {"start": {"checkpoint": str(tmp_path / "a.h5")}, "grains": []}
    went = servo_of(first).value("position")
    again = run(scene([], LID | {"servo": servo}, **start))
    assert again.schedule.bodies(0.0)[1, 11] == pytest.approx(-went, rel=1e-12)
    assert servo_of(again).drive(np.array([0.5]))[0] == pytest.approx(0.015)
    start["start"]["continues"] = ["lid"]
    goes_on = run(scene([], LID | {"servo": servo}, **start))
    assert goes_on.schedule.bodies(0.0)[1, 11] == pytest.approx(-went, rel=1e-12)
    assert servo_of(goes_on).drive(np.array([0.5]))[0] == pytest.approx(0.01 + 0.01 * (0.5 + first.time))
    goes_on.step(2000)
    assert goes_on.wall_loads()["lid"].force[2] == pytest.approx(0.01 * (1 + first.time + goes_on.time), rel=1e-3)


def test_history_and_check_tell_of_a_servo():
    given, area = bed()
    sim = run(given)
    sim.step(2000)
    columns = history_columns(given)
    row = dict(zip((c.header for c in columns), history_row(columns, Readings(sim.view)), strict=True))
    assert row["lid displacement [m]"] == servo_of(sim).value("position") > 0.0
    assert row["lid speed [m/s]"] == servo_of(sim).value("predicted")
    assert row["lid load [N]"] == pytest.approx(row["lid force z [N]"], rel=1e-12)
    assert row["lid pressure [Pa]"] == pytest.approx(row["lid load [N]"] / area, rel=1e-12)
    assert not any(header.startswith("floor load") for header in row)
    said = sim.plan.explain()
    assert any("walls that move by the load on them (servos, free walls): 1" in line for line in said)
    without = Simulation(scene([[0, 0, R]], {"plane": {"point": [0, 0, 1], "normal": [0, 0, -1]}}), device="cpu", threads=1)
    assert without.plan.left_out["walls that move by the load on them"] == "no wall has a servo or is free"
    assert without.kernels.dynamic is None


BAD = [
    ({"force": 1, "torque": 1, "max_speed": 1}, "give exactly one of force, pressure, torque; found force and torque"),
    ({"max_speed": 1}, "give exactly one of force, pressure, torque; found none"),
    ({"force": 1}, r"servo.max_speed\n.*missing: a servo needs its largest speed"),
    ({"torque": 1}, r"servo.max_rate\n.*missing: a servo needs its largest rate"),
    ({"torque": 1, "max_rate": 1, "max_speed": 1}, r"servo.max_speed = 1.0\n.*not with torque"),
    ({"force": 1, "max_speed": 1, "area": 1}, r"servo.area = 1.0\n.*not with force"),
    ({"force": 1, "max_speed": 1, "origin": [1, 0, 0]}, r"servo.origin.*\n.*not with force"),
    ({"pressure": 1, "max_speed": 1}, r"servo.area\n.*missing: the pressure on a shape needs its area"),
    ({"force": 1, "max_speed": 0}, r"servo.max_speed = 0\n.*above 0|greater than 0|> 0"),
    ({"force": [[1, 1], [1, 2]], "max_speed": 1}, r"servo.force\[1\]\[0\] = 1.0\n.*must be later than 1 s"),
    ({"force": [[1, 1, 1]], "max_speed": 1}, r"force in \[N\]"),
    ({"force": "1 Pa", "max_speed": 1}, "a force"),
    ({"force": 1, "max_speed": 1, "axis": [0, 0, 0]}, "zero vector"),
    ({"force": 1, "max_sped": 1}, 'did you mean "max_speed"'),
]  # fmt: skip


@pytest.mark.parametrize("servo, message", BAD, ids=[str(n) for n in range(len(BAD))])
def test_what_is_wrong_with_a_servo_is_said(servo, message):
    with pytest.raises(SceneError, match=rf"(?s){message}"):
        scene([[0, 0, R]], LID | {"servo": {"axis": [0, 0, -1], **servo}})


def test_what_a_servo_cannot_have_is_refused():
    servo = {"axis": [0, 0, -1], "force": 1, "max_speed": 1}
    with pytest.raises(SceneError, match="not with servo: either a program moves the wall or the servo does"):
        scene([[0, 0, R]], LID | {"servo": servo, "driven": True})
    with pytest.raises(SceneError, match=r'walls\[1\].servo: not with engine.integrator = "rk4", whose steps have stages'):
        run(scene([[0, 0, R]], LID | {"servo": servo}, engine={"integrator": "rk4"}))
    borders = {"x": {"min": -0.02, "max": 0.02, "kind": "periodic"}}
    with pytest.raises(SceneError, match=r"borders.x: periodic, but walls\[1\].servo moves it along that axis"):
        run(scene([[0, 0, R]], LID | {"servo": servo | {"axis": [1, 0, -1]}}, borders=borders))
    turning = {"axis": [0, 1, 0], "torque": 1, "max_rate": 1}
    with pytest.raises(SceneError, match=r"borders.x: periodic, but walls\[1\].servo turns it"):
        run(scene([[0, 0, R]], LID | {"servo": turning}, borders=borders))


def test_across_periodic_borders_a_servo_presses_as_between_none():
    """A column in the middle of a periodic box does not know of its borders, whatever list is made."""
    servo = {"axis": [0, 0, -1], "force": 0.01, "max_speed": 0.05}
    borders = {"x": {"min": -0.005, "max": 0.005, "kind": "periodic"}}
    sims = [run(scene(COLUMN, LID | {"servo": servo}, **keys)) for keys in ({}, {"borders": borders})]
    for sim in sims:
        sim.step(3000)
    np.testing.assert_array_equal(*(sim.particles.position for sim in sims))
    assert servo_of(sims[1]).value("position") > 1e-6


def test_regions_of_the_laboratory_do_not_go_with_a_servo():
    """In a lifted frame: an outlet is at rest in the laboratory, as the lid is but for its servo; none may follow the lid."""
    lid = LID | {"fixed_to": "laboratory", "servo": {"axis": [0, 0, -1], "force": 0.01, "max_speed": 0.05}}
    box = {"box": {"min": [1, 0, 0], "max": [2, 1, 1]}}
    outlets = [{"name": "a", "fixed_to": "laboratory", **box}]
    sim = run(scene(COLUMN, lid, outlets=outlets, frame={"velocity": [0, 0, 0.1]}))
    sim.step(200)
    carrier = sim.schedule.carrier(sim.scene.outlets[0])
    assert sim.schedule.place(carrier, sim.time)[1][2] + 0.1 * sim.time == pytest.approx(0.0, abs=1e-15)
    assert abs(servo_of(sim).value("position")) > 1e-6  # the floor pushes it up
    with pytest.raises(SceneError, match="has a servo or is free: its load moves it"):
        scene(COLUMN, lid, outlets=[{"name": "a", "follows": "lid", **box}])


def noted(servo, time=0.02, rows=20):
    """Closing warnings of a run of one grain under a lid."""
    sim = run(scene(COLUMN[:1], {"plane": {"point": [0, 0, 2.02 * R], "normal": [0, 0, -1]}, "servo": servo}))
    for k in range(1, rows + 1):
        sim.run(until=time * k / rows)
        sim.record()
    return summary.shortfalls(sim)


def test_a_servo_that_never_meets_grains_is_told_at_the_end():
    push = {"axis": [0, 0, -1], "force": 0.02, "max_speed": 0.05}
    pressed = {"axis": [0, 0, -1], "pressure": 500, "area": 4e-5, "max_speed": 0.05}
    assert noted(push) == [] and noted(pressed) == []
    for away, said in (
        (push | {"axis": [0, 0, 1]}, "mean 0 of 0.02 N asked"),
        (push | {"force": -0.02}, "mean 0 of -0.02 N asked"),
        (pressed | {"pressure": -500}, "mean 0 of -500 Pa asked"),
        (pressed | {"max_speed": 1e-4}, "mean 0 of 500 Pa asked"),
    ):
        [line] = noted(away)
        assert line.startswith(f"lid never carried its load: {said}")
    assert noted(push | {"axis": [0, 0, 1], "start": 0.5}) == []  # not yet asked


def test_a_row_that_is_written_later_has_the_place_of_its_time():
    """Rows are written beside the run, which has gone on by then."""
    sim = run(bed(2)[0])
    sim.step(5)
    now, there = Totals(sim.view).made(), sim.live.model.schedule.dynamic[0].value("position")
    sim.step(5)
    assert dynamic_wall(now, "lid").value("position") == there != servo_of(sim).value("position")
