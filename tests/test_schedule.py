"""Tables of the schedule against rotations computed on their own (scipy) and against finite differences of the poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from warpdem import Scene
from warpdem.model.schedule import Schedule

DT = 1.0e-3
AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
ORIGIN = np.array([0.1, -0.2, 0.3])
GRAVITY = np.array([1.0, -2.0, -9.0])
RAMP = [{"until": 0.1, "rate": [0, 30]}, {"until": 0.2, "rate": 30}, {"until": 0.25, "rate": [30, -10]}, {"rate": 5}]
OWN = {"axis": [0, 1, 1], "origin": [0.5, 0.1, -0.3], "schedule": [{"until": 0.15, "rate": [0, -8]}, {"rate": -8}]}


def schedule(walls=(), frame=RAMP, **options) -> Schedule:
    """Schedule of the ramp, of another list of rate stretches, of any motions (a tuple), or of none."""
    if isinstance(frame, list):
        frame = {"axis": AXIS.tolist(), "origin": ORIGIN.tolist(), "schedule": frame}
    material = {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}
    scene = Scene.model_validate(
        {
            "gravity": GRAVITY.tolist(),
            "materials": {"glass": material},
            "pairs": [{"materials": ["glass", "glass"], "restitution": 0.5}],
            "grains": [{"material": "glass", "positions": [[0, 0, 0]], "radius": 1e-3}],
            "walls": [
                {
                    "name": f"w{k}",
                    "material": "glass",
                    "plane": {"point": [0, 0, -1], "normal": [0, 0, 1]},
                    "fixed_to": fixed_to,
                    "motion": motion,
                }
                for k, (fixed_to, motion) in enumerate(walls)
            ],
            "frame": frame,
            "time": {"end": 1},
        }
    )
    made = Schedule(scene, **options)
    made.dt = DT
    return made


def frame_angle(time):
    """Integral of the ramp, by hand."""
    if time < 0.1:
        return 0.5 * 300.0 * time**2
    if time < 0.2:
        return 1.5 + 30.0 * (time - 0.1)
    if time < 0.25:
        return 4.5 + 30.0 * (time - 0.2) - 0.5 * 800.0 * (time - 0.2) ** 2
    return 5.0 + 5.0 * (time - 0.25)


def to_laboratory(time) -> np.ndarray:
    return Turn.from_rotvec(AXIS * frame_angle(time)).as_matrix()


def own_turn(time) -> np.ndarray:
    """Turn of a wall with the motion OWN relative to what it is fixed to."""
    rate = 8.0 / 0.15
    angle = -0.5 * rate * time**2 if time < 0.15 else -0.6 - 8.0 * (time - 0.15)
    return Turn.from_rotvec(np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0) * angle).as_matrix()


@pytest.mark.parametrize("step", [0, 1, 57, 99, 100, 101, 249, 400])
def test_rows_hold_gravity_and_drifts_of_their_steps(step):
    rows = schedule().rows(step, 5)
    assert rows.shape == (6, 29)
    for k, row in enumerate(rows, start=step):
        now, after, before = (to_laboratory(max(i, 0) * DT) for i in (k, k + 1, k - 1))
        np.testing.assert_allclose(row[2:5], now.T @ GRAVITY, rtol=0, atol=1e-13)
        # a direction fixed in the laboratory: R takes its frame components from one instant to the next
        for drift, turn in ((row[5:17], after.T @ now - np.eye(3)), (row[17:29], now.T @ before - np.eye(3))):
            np.testing.assert_allclose(drift[:9].reshape(3, 3), turn, rtol=0, atol=1e-14)
            np.testing.assert_allclose(drift[9:], -turn @ ORIGIN, rtol=0, atol=1e-14)


def test_first_instant_kicks_half_and_slips_nothing():
    rows = schedule().rows(0, 3)
    np.testing.assert_array_equal(rows[:, 0], [0.0, DT, DT, DT])
    np.testing.assert_array_equal(rows[:, 1], [0.5 * DT, DT, DT, DT])


def test_turns_of_many_steps_make_the_whole_turn():
    rows = schedule().rows(0, 5000)
    whole = np.eye(3)
    for row in rows[:-1]:
        whole = whole + row[5:14].reshape(3, 3) @ whole
    np.testing.assert_allclose(whole, to_laboratory(5000 * DT).T, rtol=0, atol=1e-12)


def test_rows_do_not_depend_on_where_a_batch_begins():
    made = schedule([("laboratory", OWN)])
    np.testing.assert_array_equal(made.rows(90, 20)[7:], made.rows(97, 13))
    np.testing.assert_array_equal(made.placements(90, 20)[7:], made.placements(97, 13))


def test_without_a_frame_nothing_turns():
    for frame in (None, [{"rate": 0}]):
        made = schedule([("laboratory", None), ("frame", None)], frame)
        rows = made.rows(3, 2)
        np.testing.assert_array_equal(rows[:, 2:5], [GRAVITY] * 3)
        np.testing.assert_array_equal(rows[:, 5:29], 0.0)
        assert not made.rotates
        assert not made.shifting
        assert made.moving == 0
        assert len(made.motions) == 1, "the laboratory is the frame then"


def test_motions_are_shared_and_moving_ones_come_first():
    made = schedule([("frame", None), ("laboratory", None), ("frame", OWN), ("frame", None), ("laboratory", None)])
    assert len(made.motions) == 3
    assert made.moving == 2
    assert made.wall_motion[0] == made.wall_motion[3] == 2
    assert made.wall_motion[1] == made.wall_motion[4] < 2
    assert made.wall_motion[2] < 2


@pytest.mark.parametrize("fixed_to", ["frame", "laboratory"])
@pytest.mark.parametrize("motion", [None, OWN])
def test_placements_follow_the_wall_exactly(fixed_to, motion):
    """Position, absolute spin and absolute velocity of body points, against the path in the laboratory."""
    made = schedule([(fixed_to, motion)])
    centre = np.array(OWN["origin"])
    body = np.array([[0.3, 0.4, -0.2], [0.0, 0.0, 0.0], [-1.0, 2.0, 0.5]])

    def in_laboratory(time):
        own = own_turn(time) if motion else np.eye(3)
        turned = (body - centre) @ own.T + centre
        return turned if fixed_to == "laboratory" else (turned - ORIGIN) @ to_laboratory(time).T + ORIGIN

    for step in (0, 40, 99, 130, 170, 230, 300):
        time = step * DT
        placement = made.placements(step, 0)[1, made.wall_motion[0]]
        turn, shift = placement[:9].reshape(3, 3), placement[9:12]
        spin, drift = placement[12:15], placement[15:18]
        frame = to_laboratory(time)
        points = body @ turn.T + shift
        np.testing.assert_allclose((points - ORIGIN) @ frame.T + ORIGIN, in_laboratory(time), rtol=0, atol=1e-13)
        if step == 0:
            continue  # no instant before it
        h = 1e-6
        velocity = (in_laboratory(time + h) - in_laboratory(time - h)) / (2.0 * h)
        velocity = velocity @ frame  # resolved in frame axes
        np.testing.assert_allclose(drift + np.cross(spin, points), velocity, rtol=0, atol=1e-6)


def test_placements_cover_the_instants_around_a_batch():
    made = schedule([("laboratory", None)])
    many = made.placements(10, 4)
    assert many.shape == (7, 1, 24)
    for k in range(7):
        np.testing.assert_array_equal(many[k], made.placements(9 + k, 0)[1])
    np.testing.assert_array_equal(made.placements(0, 0)[0], made.placements(0, 0)[1])


def test_wall_rests_in_the_frame_with_its_absolute_motion():
    made = schedule([("frame", None)])
    placement = made.placements(150, 0)[1, 0]
    np.testing.assert_array_equal(placement[:9].reshape(3, 3), np.eye(3))
    np.testing.assert_array_equal(placement[9:12], 0.0)
    np.testing.assert_allclose(placement[12:15], 30.0 * AXIS, rtol=1e-13)
    np.testing.assert_allclose(placement[15:18], -np.cross(30.0 * AXIS, ORIGIN), rtol=1e-13)


# --- any motion ------------------------------------------------------------------------------------------------------

MILL = (
    {"axis": [0, 0, 1], "origin": [0.1, -0.2, 0.3], "rate": 12},
    {"axis": [0.2, 0.1, 1], "origin": [0.5, 0, 0], "sinusoid": {"mean": -30, "amplitude": 5, "frequency": 3}},
)
SHAKER = ({"velocity": [0.1, 0, 0.2], "amplitude": [0.01, 0.02, 0], "frequency": 5, "phase": 1},)
FRAMES = {"mill": MILL, "shaker": SHAKER, "drum on a shaker": (*SHAKER, OWN)}


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_drifts_lead_a_point_at_rest_along_its_places_in_the_frame(frame):
    made = schedule([], frame)
    rows = made.rows(0, 300)
    point = np.array([0.3, 0.4, -0.5])
    seen = (point - made.pose(0.0).translation) @ made.pose(0.0).rotation
    for k, row in enumerate(rows[:-1]):
        seen = seen + (row[5:14].reshape(3, 3) @ seen + row[14:17])
        np.testing.assert_array_equal(rows[k + 1, 17:29], row[5:17])
    pose = made.pose(300 * DT)
    np.testing.assert_allclose(seen, (point - pose.translation) @ pose.rotation, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rows[300, 2:5], GRAVITY @ pose.rotation, rtol=0, atol=1e-13)


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_frame_rows_are_the_derivatives_of_the_pose(frame):
    made, h = schedule([], frame), 1e-5
    for row in made.frames(37, 2):
        time = row[30]
        poses = [made.frame.pose(np.array([time + k * h])) for k in (-1, 0, 1)]
        axes = row[:9].reshape(3, 3)
        np.testing.assert_allclose(axes, poses[1].axes[0].astype(float), rtol=0, atol=1e-15)
        np.testing.assert_allclose(row[9:12], poses[1].origin[0].astype(float), rtol=0, atol=1e-15)
        body = np.array([0.3, 0.4, -0.2])
        path = [(p.axes[0] @ body.astype(np.longdouble)) + p.origin[0] for p in poses]
        first, second = (path[2] - path[0]) / (2 * h), (path[2] - 2 * path[1] + path[0]) / h**2
        spin, velocity, spin_rate, acceleration = row[12:15], row[15:18], row[24:27], row[27:30]
        np.testing.assert_allclose(velocity + np.cross(spin, body), (first @ axes).astype(float), rtol=0, atol=1e-5)
        own = acceleration + np.cross(spin_rate, body) + np.cross(spin, np.cross(spin, body))
        np.testing.assert_allclose(own, (second @ axes).astype(float), rtol=0, atol=1e-3)
        np.testing.assert_array_equal(row[12:18], row[18:24])


def test_frame_rows_know_both_sides_of_a_jump_and_the_mean_of_a_kink():
    row = schedule().frames(200, 0)[0]  # from 30 rad/s into a ramp of -800 rad/s2
    np.testing.assert_allclose(row[12:15], 30.0 * AXIS, rtol=1e-13)
    np.testing.assert_array_equal(row[18:21], row[12:15])
    np.testing.assert_allclose(row[24:27], -400.0 * AXIS, rtol=1e-13)
    row = schedule().frames(250, 0)[0]  # from -10 to 5 rad/s
    np.testing.assert_allclose(row[12:15], -10.0 * AXIS, rtol=1e-12)
    np.testing.assert_allclose(row[18:21], 5.0 * AXIS, rtol=1e-13)
    np.testing.assert_allclose(row[21:24], -np.cross(5.0 * AXIS, ORIGIN), rtol=1e-12)
    for step in (249, 251):
        row = schedule().frames(step, 0)[0]
        np.testing.assert_array_equal(row[12:18], row[18:24])


def test_a_jump_between_two_instants_counts_at_the_nearer_one():
    made = schedule([], [{"until": 0.0102, "rate": 3}, {"until": 0.0208, "rate": 7}, {"rate": 1}])
    rate = made.frames(0, 30)[:, [12, 18]] / AXIS[0]
    jumps = np.flatnonzero(np.abs(np.diff(rate, axis=1)[:, 0]) > 1e-9)
    np.testing.assert_array_equal(jumps, [10, 21])
    np.testing.assert_allclose(rate[10], [3, 7], rtol=1e-12)
    np.testing.assert_array_equal(rate[1:, 0], rate[:-1, 1])  # nothing is lost from step to step


def test_stages_have_their_own_instants():
    stages = (0.0, 0.5, 1.0)
    one, many = schedule([("laboratory", None)]), schedule([("laboratory", None)], stages=stages)
    rows = many.rows(7, 3).reshape(4, 3, 29)
    np.testing.assert_array_equal(rows[:, 0], one.rows(7, 3))
    np.testing.assert_array_equal(rows[:, 1:, 0], [[0.5 * DT, DT]] * 4)
    np.testing.assert_array_equal(rows[:, 1:, 1], 0.0)
    np.testing.assert_array_equal(rows[:, 1:, 5:], 0.0)
    np.testing.assert_array_equal(rows[:-1, 2, 2:5], rows[1:, 0, 2:5])
    np.testing.assert_allclose(rows[1, 1, 2:5], to_laboratory(8.5 * DT).T @ GRAVITY, rtol=0, atol=1e-13)
    placements = many.placements(7, 3).reshape(6, 3, 1, 24)
    np.testing.assert_array_equal(placements[:, 0], one.placements(7, 3))
    np.testing.assert_array_equal(placements[:-1, 2], placements[1:, 0])
    np.testing.assert_allclose(placements[2, 1, 0, :9].reshape(3, 3), to_laboratory(8.5 * DT).T, rtol=0, atol=1e-13)
    np.testing.assert_allclose(many.frames(7, 3)[:, 30], np.add.outer(np.arange(7, 11), stages).ravel() * DT, rtol=1e-15)
    start = many.placements(0, 0)
    np.testing.assert_array_equal(start[:3], start[[3, 3, 3]], "before time 0 all rests in its first place")


def test_stages_of_one_step_know_one_side_of_a_jump():
    frames = schedule(stages=(0.0, 0.5, 1.0)).frames(249, 1).reshape(2, 3, 31)
    np.testing.assert_allclose(frames[0, :, 18:21] @ AXIS, [-9.2, -9.6, -10.0], rtol=1e-12)
    np.testing.assert_allclose(frames[1, :, 18:21] @ AXIS, [5.0, 5.0, 5.0], rtol=1e-12)
    np.testing.assert_allclose(frames[0, :, 24:27] @ AXIS, [-800.0] * 3, rtol=1e-12)
    np.testing.assert_array_equal(frames[:, 1:, 12:18], frames[:, 1:, 18:24])


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
@pytest.mark.parametrize("own", [None, MILL, SHAKER[0]], ids=["no own motion", "mill", "shaker"])
@pytest.mark.parametrize("fixed_to", ["frame", "laboratory"])
def test_walls_move_as_their_motions_say(frame, own, fixed_to):
    """Places against composed poses; velocities, absolute and relative, against differences of the wall's path."""
    made = schedule([(fixed_to, own)], frame)
    assert made.shifting
    assert made.moving == (fixed_to == "laboratory" or own is not None)
    body, h = np.array([[0.3, 0.4, -0.2], [-1.0, 2.0, 0.5]]), 1e-6

    def in_laboratory(time):
        at = np.array([time])
        pose = made.motions[0].own.pose(at)
        points = (body @ pose.axes[0].T + pose.origin[0]).astype(float)
        return points if fixed_to == "laboratory" else made.pose(time).to_laboratory(points)

    def in_frame(time):
        return (in_laboratory(time) - made.pose(time).translation) @ made.pose(time).rotation

    time = 130 * DT
    placement = made.placements(130, 0)[1, 0]
    points = body @ placement[:9].reshape(3, 3).T + placement[9:12]
    np.testing.assert_allclose(points, in_frame(time), rtol=0, atol=1e-13)
    velocity = (in_laboratory(time + h) - in_laboratory(time - h)) / (2 * h) @ made.pose(time).rotation
    np.testing.assert_allclose(placement[15:18] + np.cross(placement[12:15], points), velocity, rtol=0, atol=1e-6)
    relative = schedule([(fixed_to, own)], frame, relative=True).placements(130, 0)[1, 0]
    np.testing.assert_array_equal(relative[:12], placement[:12])
    velocity = (in_frame(time + h) - in_frame(time - h)) / (2 * h)
    np.testing.assert_allclose(relative[15:18] + np.cross(relative[12:15], points), velocity, rtol=0, atol=1e-6)


def test_a_wall_at_rest_in_the_laboratory_moves_in_a_frame_that_only_shifts():
    made = schedule([("laboratory", None), ("frame", None), ("laboratory", {"velocity": [0, 0, 0]})], SHAKER)
    assert made.moving == 1
    assert not made.rotates
    np.testing.assert_array_equal(made.wall_motion, [0, 1, 0])
    np.testing.assert_allclose(made.placements(55, 0)[1, 0, 9:12], -made.pose(55 * DT).translation, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(made.placements(55, 0)[1, 0, 12:18], 0.0)


def test_pose_tells_places_angles_and_velocities():
    made = schedule([], FRAMES["drum on a shaker"])
    pose, h = made.pose(0.2), 1e-6
    shift, rotation = pose.parts
    np.testing.assert_allclose(shift.shift, made.pose(0.2).parts[0].shift)
    assert pose.angle == rotation.angle == pytest.approx(-0.6 - 8.0 * 0.05)
    points = np.eye(3)
    velocity = (made.pose(0.2 + h).to_laboratory(points) - made.pose(0.2 - h).to_laboratory(points)) / (2 * h)
    np.testing.assert_allclose(pose.velocity_at(points) @ pose.rotation.T, velocity, rtol=0, atol=1e-7)
    still = schedule([], None).pose(3.0)
    assert (still.angle, still.parts) == (0.0, ())
    np.testing.assert_array_equal(still.to_laboratory(points), points)
