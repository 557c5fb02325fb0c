"""Rows and placements of the schedule against rotations computed on their own (scipy) and against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Turn

from warpdem import Scene
from warpdem.schedule import Schedule, turn_increment

DT = 1.0e-3
AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
ORIGIN = np.array([0.1, -0.2, 0.3])
GRAVITY = np.array([1.0, -2.0, -9.0])
RAMP = [{"until": 0.1, "rate": [0, 30]}, {"until": 0.2, "rate": 30}, {"until": 0.25, "rate": [30, -10]}, {"rate": 5}]
OWN = {"axis": [0, 1, 1], "origin": [0.5, 0.1, -0.3], "schedule": [{"until": 0.15, "rate": [0, -8]}, {"rate": -8}]}


def schedule(walls=(), frame=RAMP) -> Schedule:
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
                    "rotation": rotation,
                }
                for k, (fixed_to, rotation) in enumerate(walls)
            ],
            "frame": {"axis": AXIS.tolist(), "origin": ORIGIN.tolist(), "schedule": frame} if frame else None,
            "time": {"end": 1},
        }
    )
    made = Schedule(scene)
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


def test_turn_increment_is_the_turn_less_one():
    angles = np.array([0.0, 1e-9, -1e-5, 0.3, 3.0, 40.0])
    for angle, increment in zip(angles, turn_increment(AXIS, angles), strict=True):
        np.testing.assert_allclose(increment, Turn.from_rotvec(AXIS * angle).as_matrix() - np.eye(3), atol=1e-14)
    # small angles keep all their digits: the second order of 1e-9 is 5e-19, lost in 1 - cos
    small = turn_increment(AXIS, np.array([1e-9]))[0]
    np.testing.assert_allclose(AXIS @ small, 0.0, atol=1e-25)
    across = np.array([2.0, -1.0, 0.0])
    np.testing.assert_allclose(across @ small @ across, -0.5e-18 * (across @ across), rtol=1e-6)


@pytest.mark.parametrize("step", [0, 1, 57, 99, 100, 101, 249, 400])
def test_rows_hold_gravity_and_turns_of_their_steps(step):
    rows = schedule().rows(step, 5)
    assert rows.shape == (6, 26)
    for k, row in enumerate(rows, start=step):
        now, after, before = (to_laboratory(max(i, 0) * DT) for i in (k, k + 1, k - 1))
        np.testing.assert_allclose(row[2:5], now.T @ GRAVITY, atol=1e-13)
        # a direction fixed in the laboratory: R takes its frame components from one instant to the next
        np.testing.assert_allclose(row[5:14].reshape(3, 3), after.T @ now - np.eye(3), atol=1e-14)
        np.testing.assert_allclose(row[14:23].reshape(3, 3), now.T @ before - np.eye(3), atol=1e-14)
        np.testing.assert_array_equal(row[23:26], ORIGIN)


def test_first_instant_kicks_half_and_slips_nothing():
    rows = schedule().rows(0, 3)
    np.testing.assert_array_equal(rows[:, 0], [0.0, DT, DT, DT])
    np.testing.assert_array_equal(rows[:, 1], [0.5 * DT, DT, DT, DT])


def test_turns_of_many_steps_make_the_whole_turn():
    rows = schedule().rows(0, 5000)
    whole = np.eye(3)
    for row in rows[:-1]:
        whole = whole + row[5:14].reshape(3, 3) @ whole
    np.testing.assert_allclose(whole, to_laboratory(5000 * DT).T, atol=1e-12)


def test_rows_do_not_depend_on_where_a_batch_begins():
    made = schedule([("laboratory", OWN)])
    np.testing.assert_array_equal(made.rows(90, 20)[7:], made.rows(97, 13))
    np.testing.assert_array_equal(made.placements(90, 20)[7:], made.placements(97, 13))


def test_without_a_frame_nothing_turns():
    for frame in (None, [{"rate": 0}]):
        made = schedule([("laboratory", None), ("frame", None)], frame)
        rows = made.rows(3, 2)
        np.testing.assert_array_equal(rows[:, 2:5], [GRAVITY] * 3)
        np.testing.assert_array_equal(rows[:, 5:23], 0.0)
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
@pytest.mark.parametrize("rotation", [None, OWN])
def test_placements_follow_the_wall_exactly(fixed_to, rotation):
    """Position, absolute spin and absolute velocity of body points, against the path in the laboratory."""
    made = schedule([(fixed_to, rotation)])
    centre = np.array(OWN["origin"])
    body = np.array([[0.3, 0.4, -0.2], [0.0, 0.0, 0.0], [-1.0, 2.0, 0.5]])

    def in_laboratory(time):
        own = own_turn(time) if rotation else np.eye(3)
        turned = (body - centre) @ own.T + centre
        return turned if fixed_to == "laboratory" else (turned - ORIGIN) @ to_laboratory(time).T + ORIGIN

    for step in (0, 40, 99, 130, 170, 230, 300):
        time = step * DT
        placement = made.placements(step, 0)[1, made.wall_motion[0]]
        turn, shift = placement[:9].reshape(3, 3), placement[9:12]
        spin, drift = placement[12:15], placement[15:18]
        frame = to_laboratory(time)
        points = body @ turn.T + shift
        np.testing.assert_allclose((points - ORIGIN) @ frame.T + ORIGIN, in_laboratory(time), atol=1e-13)
        if step == 0:
            continue  # no instant before it
        h = 1e-6
        velocity = (in_laboratory(time + h) - in_laboratory(time - h)) / (2.0 * h)
        velocity = velocity @ frame  # resolved in frame axes
        np.testing.assert_allclose(drift + np.cross(spin, points), velocity, atol=1e-6)


def test_placements_cover_the_instants_around_a_batch():
    made = schedule([("laboratory", None)])
    many = made.placements(10, 4)
    assert many.shape == (7, 1, 18)
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
