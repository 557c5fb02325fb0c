"""Motions as scene data: angles and shifts by hand, poses against their own derivatives, and what is refused."""

import itertools
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import Rotation as Turn

from warpdem import SceneError
from warpdem.core.rigid_motion import PI
from warpdem.scene.file import scene_from_dict
from warpdem.scene.motion import FixedPlacement, Motions, Sampled, Translation
from warpdem.scene.motion_chain import Chain
from warpdem.scene.rotation import Rotation

MOTIONS = TypeAdapter(Motions)


def chain(*motions) -> Chain:
    return Chain(MOTIONS.validate_python(list(motions)), lambda name: name, "frame")


# --- rotation --------------------------------------------------------------------------------------------------------


def test_axis_is_normalised_once():
    rotation = Rotation(axis=[1, 2, 3], rate=1)
    np.testing.assert_allclose(rotation.axis, np.array([1, 2, 3]) / math.sqrt(14), rtol=1e-15)
    assert Rotation(axis=rotation.axis, rate=1).axis == rotation.axis
    assert Rotation(axis=[0, 0, 1e-300], rate=1).axis == (0.0, 0.0, 1.0)


def test_constant_rate_turns_for_ever():
    rotation = Rotation(axis=[0, 0, 1], rate="-30 rpm")
    assert rotation.angle(2.0) == -2 * math.pi
    assert rotation.rate_at(1e6) == -math.pi
    assert rotation.max_rate == math.pi
    np.testing.assert_array_equal(rotation.angle(np.array([0.0, 1.0])), [0, -math.pi])
    np.testing.assert_array_equal(rotation.rate_at(np.array([0.0, 1.0])), [-math.pi] * 2)


SCHEDULE = Rotation(
    axis=[0, 1, 0],
    schedule=[{"until": 1, "rate": 2}, {"until": 3, "rate": [2, -4]}, {"until": 4, "rate": 3}],
)


@pytest.mark.parametrize(
    ("time", "angle", "rate"),
    [
        (0.0, 0.0, 2.0),
        (0.5, 1.0, 2.0),
        (1.0, 2.0, 2.0),
        (2.0, 2.0 + 2.0 - 1.5, -1.0),
        (3.0, 0.0, 3.0),  # the jump from -4 to 3 shows the value after it
        (3.5, 1.5, 3.0),
        (4.0, 3.0, 0.0),  # after the last until the frame stands still
        (1e9, 3.0, 0.0),
    ],
)
def test_schedule_by_hand(time, angle, rate):
    assert SCHEDULE.angle(time) == pytest.approx(angle, abs=1e-15)
    assert SCHEDULE.rate_at(time) == rate
    assert type(SCHEDULE.angle(time)) is type(SCHEDULE.rate_at(time)) is float


def test_schedule_takes_arrays_and_knows_its_largest_rate():
    times = np.linspace(0, 5, 41).reshape(1, -1)
    np.testing.assert_array_equal(SCHEDULE.angle(times), [[SCHEDULE.angle(t) for t in times[0]]])
    np.testing.assert_array_equal(SCHEDULE.rate_at(times), [[SCHEDULE.rate_at(t) for t in times[0]]])
    assert SCHEDULE.max_rate == 4.0


def test_last_stretch_without_end_holds():
    rotation = Rotation(axis=[0, 1, 0], schedule=[{"until": 1, "rate": [0, 2]}, {"rate": 2}])
    assert rotation.rate_at(100.0) == 2.0
    assert rotation.angle(100.0) == 1.0 + 2.0 * 99.0


RATES = st.floats(-100, 100)
STRETCHES = st.lists(st.tuples(st.floats(0.01, 10), st.one_of(RATES, st.tuples(RATES, RATES))), min_size=1, max_size=5)


@settings(max_examples=50, deadline=None)
@given(STRETCHES)
def test_angle_is_the_integral_of_the_rate(stretches):
    ends = np.cumsum([length for length, _ in stretches])
    schedule = [{"until": end, "rate": rate} for end, (_, rate) in zip(ends, stretches, strict=True)]
    rotation = Rotation(axis=[0, 0, 1], schedule=schedule)
    # the midpoint rule is exact for a rate that is linear on each cell; cells end where stretches end
    knots = np.concatenate([[0.0], ends, [ends[-1] + 1.0]])
    grid = np.unique(np.concatenate([np.linspace(a, b, 8) for a, b in itertools.pairwise(knots)]))
    integral = np.concatenate([[0.0], np.cumsum(rotation.rate_at(0.5 * (grid[1:] + grid[:-1])) * np.diff(grid))])
    np.testing.assert_allclose(rotation.angle(grid), integral, rtol=0, atol=1e-13 * (1 + 100 * knots[-1]))


@pytest.mark.parametrize(
    "wrong",
    [
        {"axis": [0, 0, 0], "rate": 1},
        {"axis": [0, 0, 1]},
        {"axis": [0, 0, 1], "rate": 1, "schedule": [{"rate": 1}]},
        {"axis": [0, 0, 1], "schedule": []},
        {"axis": [0, 0, 1], "schedule": [{"rate": 1}, {"until": 1, "rate": 1}]},
        {"axis": [0, 0, 1], "schedule": [{"until": 1, "rate": 1}, {"until": 1, "rate": 1}]},
        {"axis": [0, 0, 1], "schedule": [{"until": 0, "rate": 1}]},
        {"axis": [0, 0, 1], "schedule": [{"rate": [0, 1]}]},
    ],
)
def test_wrong_rotation_is_refused(wrong):
    with pytest.raises(ValidationError):
        Rotation.model_validate(wrong)


def test_table_is_linear_between_its_entries_and_constant_outside():
    rotation = Rotation(axis=[0, 0, 1], table=[[1, 2], ["2 s", 4], [4, "0 rpm"]])
    times = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 10.0])
    np.testing.assert_allclose(rotation.rate_at(times), [2, 2, 2, 3, 4, 2, 0, 0], rtol=1e-15)
    np.testing.assert_allclose(rotation.angle(times), [0, 1, 2, 3.25, 5, 8, 9, 9], rtol=1e-15)
    assert rotation.max_rate == 4.0
    assert Rotation(axis=[0, 0, 1], table=[[0, -3]]).rate_at(7.0) == -3.0


def test_sinusoid_is_the_integral_of_its_rate():
    rotation = Rotation(
        axis=[0, 0, 1], sinusoid={"mean": 2, "amplitude": "-5 rad/s", "frequency": "3 Hz", "phase": "30 deg"}
    )
    times = np.array([0.0, 0.01, 0.3, 7.7, 1000.0])
    swing, phase = 6 * math.pi, math.pi / 6
    np.testing.assert_allclose(rotation.rate_at(times), 2 - 5 * np.sin(swing * times + phase), rtol=0, atol=1e-10)
    angle = 2 * times + 5 / swing * (np.cos(swing * times + phase) - np.cos(phase))
    np.testing.assert_allclose(rotation.angle(times), angle, rtol=0, atol=1e-10)
    assert rotation.angle(0.0) == 0.0
    assert rotation.max_rate == 7.0
    # 1e-9 s turn the axes by rate times time: 1 - cos would keep eight digits
    assert rotation.angle(1e-9) == pytest.approx(1e-9 * (2 - 5 * math.sin(phase)), rel=1e-7)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="long double is double on this machine")
def test_angles_stay_accurate_for_a_million_seconds():
    """At a rate of 2 pi f the whole swings leave no trace: what is left is the phase of the last part of a swing."""
    translation = Translation(amplitude=[1, 0, 0], frequency=1024.0)
    late = translation.pose(np.array([1e6 + 1 / 4096]), np.array([0.0])).origin[0, 0]
    assert abs(float(late) - 1.0) < 1e-12
    rotation = Rotation(axis=[0, 0, 1], rate=1e4)
    angle = rotation.angle_and_rates(np.array([1e6]), np.array([1e6]))[0][0]
    assert abs(float(np.sin(angle) - np.sin(np.longdouble(1e10) - 2 * PI * np.floor(np.longdouble(1e10) / (2 * PI))))) < 1e-8
    assert float(angle) == 1e10


# --- translation -----------------------------------------------------------------------------------------------------


def test_translation_starts_from_zero_whatever_the_phase():
    moved = chain({"velocity": [0, 1, 0], "amplitude": ["2 mm", 0, "-1 mm"], "frequency": "50 Hz", "phase": "90 deg"})
    times = np.array([0.0, 0.0013, 0.02, 3.3])
    pose = moved.pose(times)
    swing = 100 * math.pi * times + math.pi / 2
    shift = np.outer(times, [0, 1, 0]) + np.outer(np.sin(swing) - 1.0, [2e-3, 0, -1e-3])
    np.testing.assert_allclose(pose.origin.astype(float), shift, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(pose.axes, [np.eye(3)] * 4)
    np.testing.assert_array_equal(pose.origin[0], 0.0)


@pytest.mark.parametrize(
    ("time", "shift", "velocity"),
    [
        (0.0, 0.0, 0.0),
        (0.5, 0.25, 1.0),
        (1.0, 1.0, 3.0),  # the jump from 2 to 3 shows the velocity after it
        (1.5, 2.5, 3.0),
        (2.0, 4.0, 0.0),  # after the last until it rests
        (9.0, 4.0, 0.0),
    ],
)
def test_scheduled_velocity_by_hand(time, shift, velocity):
    schedule = [{"until": 1, "velocity": [[0, 0, 0], [0, 2, 0]]}, {"until": 2, "velocity": [0, "3 m/s", 0]}]
    pose = chain({"schedule": schedule}).pose(np.array([time]))
    assert pose.origin[0].tolist() == [0.0, shift, 0.0]
    assert pose.velocity[0].tolist() == [0.0, velocity, 0.0]


def test_table_of_velocities_is_linear_between_its_entries_and_constant_outside():
    made = chain({"table": [[1, 2, 0, 0], ["2 s", 4, "0 mm/s", -1]]})
    pose = made.pose(np.array([0.5, 1.0, 1.5, 2.0, 3.0]))
    np.testing.assert_allclose(pose.velocity[:, 0].astype(float), [2, 2, 3, 4, 4], rtol=1e-15)
    np.testing.assert_allclose(pose.origin[:, 0].astype(float), [1, 2, 3.25, 5, 9], rtol=1e-15)
    np.testing.assert_allclose(pose.origin[:, 2].astype(float), [0, 0, -0.125, -0.5, -1.5], rtol=1e-15, atol=1e-18)
    assert made.motions[0].max_speed == math.hypot(4, 1)


def test_screw_advances_by_its_pitch_each_revolution():
    made = chain({"axis": [0, 0, 2], "origin": [1, 0, 0], "rate": "2 rpm", "pitch": "5 mm"})
    pose = made.pose(np.array([30.0, 37.5]))  # one revolution, and a quarter more
    np.testing.assert_allclose(pose.origin.astype(float), [[0, 0, 0.005], [1, -1, 0.00625]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(pose.velocity[0].astype(float), [0, -2 * math.pi / 30, 0.005 / 30], rtol=0, atol=1e-15)
    assert [type(part).__name__ for part in made.parts(30.0)] == ["TranslationPart", "RotationPart"]
    assert made.keys == ["frame", "frame"]


def test_bounded_motions_make_a_sequence():
    """Up for 0.5 s, a quarter turn, then along x of the outer axes, since that motion is the outermost."""
    made = chain(
        {"velocity": [1, 0, 0], "start": 1.5},
        {"velocity": [0, 0, 2], "until": 0.5},
        {"axis": [0, 0, 1], "rate": math.pi / 2, "start": 0.5, "until": 1.5},
    )
    pose = made.pose(np.array([0.25, 0.5, 1.0, 1.5, 2.0]))
    np.testing.assert_allclose(pose.origin.astype(float), [[0, 0, 0.5], *[[0, 0, 1]] * 3, [0.5, 0, 1]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(pose.spin[:, 2].astype(float), [0, math.pi / 2, math.pi / 2, 0, 0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        pose.axes[:, 0, 1].astype(float), [0, 0, -math.sqrt(0.5), -1, -1], rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(pose.velocity[-1].astype(float), [0, -1, 0], rtol=0, atol=1e-15)  # in body axes


def test_a_motion_before_its_start_and_after_its_end_is_at_rest():
    made = chain({"amplitude": [0.1, 0, 0], "frequency": 1, "start": 2, "until": 2.25})
    pose = made.pose(np.array([0.0, 1.9, 2.25, 100.0]))
    np.testing.assert_allclose(pose.origin[:, 0].astype(float), [0, 0, 0.1, 0.1], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(pose.velocity, 0.0)
    np.testing.assert_array_equal(pose.acceleration, 0.0)


def test_a_translation_may_rest():
    still = chain({"velocity": [0, 0, 0]})
    assert not still.moves
    assert not chain({"amplitude": [0, 0, 0], "frequency": 1}).moves
    assert chain({"velocity": [0, 0, 1e-9]}).moves
    assert not chain({"velocity": [0, 0, 1e-9]}).rotates


# --- chains ----------------------------------------------------------------------------------------------------------

MILL = (
    {"axis": [0, 0, 1], "origin": [0.1, -0.2, 0.3], "rate": 12},
    {"axis": [0.2, 0.1, 1], "origin": [0.5, 0, 0], "sinusoid": {"mean": -30, "amplitude": 5, "frequency": 3}},
)
SHAKEN = (
    {"velocity": [0.1, 0, 0.2], "amplitude": [0.01, 0.02, 0], "frequency": 5, "phase": 1},
    {"axis": [0, 1, 1], "origin": [0, 0.3, 0], "table": [[0, 2], [1, 20], [2, -4]]},
    {"axis": [1, 0, 0], "rate": 3},
)
GATE = (
    {"schedule": [{"until": 0.5, "velocity": [[0, 0, 0], [1, 0, -2]]}, {"until": 1.7, "velocity": [1, 0, -2]}]},
    {"table": [[0.2, 0, 0, 0], [1.1, 0, 3, 0], [1.9, 0.5, -1, 0]], "amplitude": [0, 0, 0.1], "frequency": 2},
)
SCREW = ({"axis": [1, 2, 0], "origin": [0, 0, 0.3], "schedule": [{"until": 3, "rate": [2, 8]}], "pitch": -0.4},)
SEQUENCE = (
    {"velocity": [0, 0, 2], "until": 0.5},
    {"axis": [0, 1, 0], "origin": [0.1, 0, 0], "rate": 3, "start": 0.5, "until": 1.2, "elapsed": 0.2},
    {"amplitude": [0.1, 0, 0], "frequency": 3, "phase": 1, "start": 1.2},
)
CHAINS = {
    "mill": MILL, "shaken": SHAKEN, "inside": (SHAKEN[1], SHAKEN[0]), "shaker": SHAKEN[:1], "gate": GATE, "screw": SCREW,
    "sequence": SEQUENCE,
}  # fmt: skip


@pytest.mark.parametrize("motions", CHAINS.values(), ids=CHAINS)
def test_velocities_and_accelerations_are_the_derivatives_of_the_pose(motions):
    """Central differences of order 4 of body points in the laboratory; rounding and order leave 1e-9 and 1e-5."""
    made, h = chain(*motions), 1e-3
    body = np.array([[0.3, 0.4, -0.2], [0.0, 0.0, 0.0], [-1.0, 2.0, 0.5]])
    for time in (0.4, 0.731, 1.63):
        around = made.pose(time + h * np.arange(-2, 3))
        path = np.einsum("kij,nj->kni", around.axes, body) + around.origin[:, None]
        pose = made.pose(np.array([time]))
        spin, velocity, spin_rate, acceleration = (
            getattr(pose, name)[0].astype(float) for name in ("spin", "velocity", "spin_rate", "acceleration")
        )
        first = (path[0] - 8 * path[1] + 8 * path[3] - path[4]) / (12 * h)
        second = (-path[0] + 16 * path[1] - 30 * path[2] + 16 * path[3] - path[4]) / (12 * h * h)
        turned = np.cross(spin, body)
        np.testing.assert_allclose(velocity + turned, (first @ pose.axes[0]).astype(float), rtol=0, atol=3e-6)
        own = acceleration + np.cross(spin_rate, body) + np.cross(spin, turned)
        np.testing.assert_allclose(own, (second @ pose.axes[0]).astype(float), rtol=0, atol=5e-4)


@pytest.mark.parametrize("motions", CHAINS.values(), ids=CHAINS)
def test_increments_lead_from_pose_to_pose(motions):
    """A point at rest in the laboratory goes from x to x + D x, to where the next pose sees it; small steps keep digits."""
    made = chain(*motions)
    for step in (0.05, 1e-7):
        times = 0.4 + step * np.arange(6)
        pose, drift = made.pose(times), made.increments(times)
        point = np.array([0.3, -0.7, 0.2], dtype=np.longdouble)
        seen = np.einsum("kji,kj->ki", pose.axes, point - pose.origin)
        moved = np.einsum("kij,kj->ki", drift.rotation, seen[:-1]) + drift.shift
        scale = np.abs(moved).max()
        # the differences of poses lose digits, the increments do not
        np.testing.assert_allclose(moved.astype(float), np.diff(seen, axis=0).astype(float), rtol=0, atol=1e-17 + 1e-15 * scale)


def test_nested_rotations_follow_scipy():
    made = chain(*MILL)
    time = 0.37
    outer = Turn.from_rotvec([0, 0, 12 * time])
    axis = np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0])
    inner = Turn.from_rotvec(axis * Rotation(**MILL[1]).angle(time))
    x, c1, c2 = np.array([0.3, 0.4, 0.5]), np.array([0.1, -0.2, 0.3]), np.array([0.5, 0, 0])
    expected = outer.apply(inner.apply(x - c2) + c2 - c1) + c1
    pose = made.pose(np.array([time]))
    np.testing.assert_allclose((pose.axes[0] @ x + pose.origin[0]).astype(float), expected, rtol=0, atol=1e-14)
    assert made.max_rate == 12 + 35


def test_either_side_of_a_jump_may_be_asked_for():
    made = chain({"axis": [0, 0, 1], "schedule": [{"until": 1, "rate": 5}, {"until": 2, "rate": [1, 3]}, {"rate": -2}]})
    at = np.array([1.0, 2.0])
    np.testing.assert_allclose(made.pose(at, at - 1e-3).spin[:, 2].astype(float), [5, 3])
    np.testing.assert_allclose(made.pose(at, at + 1e-3).spin[:, 2].astype(float), [1, -2])
    np.testing.assert_allclose(made.pose(at).spin[:, 2].astype(float), [1, -2])
    np.testing.assert_allclose(made.pose(at, at - 1e-3).spin_rate[:, 2].astype(float), [0, 2])


@pytest.mark.parametrize("motions", CHAINS.values(), ids=CHAINS)
def test_no_point_is_faster_than_the_bound(motions):
    made = chain(*motions)
    cloud = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    pose = made.pose(np.linspace(0.0, 2.0, 4001))
    speed = np.linalg.norm((pose.velocity[:, None] + np.cross(pose.spin[:, None], cloud)).astype(float), axis=2).max()
    bound = made.speed_bound(cloud, 2.0)
    assert 0.3 * bound < speed <= bound


# --- in a scene ------------------------------------------------------------------------------------------------------


def scene(frame, **wall):
    return scene_from_dict(
        {
            "materials": {"glass": {"density": 2500, "young_modulus": 1e7, "poisson_ratio": 0.3}},
            "pairs": [{"materials": ["glass", "glass"], "restitution": 0.5}],
            "grains": [{"material": "glass", "positions": [[0, 0, 0]], "radius": 1e-3}],
            "walls": [{"name": "w", "material": "glass", "plane": {"point": [0, 0, -1], "normal": [0, 0, 1]}, **wall}],
            "frame": frame,
            "time": {"end": 1},
        }
    )


def test_one_motion_and_a_list_of_one_are_the_same():
    one = {"axis": [0, 0, 1], "rate": 2}
    alone = scene(one, motion=one)
    assert alone == scene([one], motion=[one])
    assert isinstance(alone.frame, tuple)
    assert isinstance(alone.frame[0], Rotation)
    assert alone.walls[0].motion == alone.frame


@pytest.mark.filterwarnings("error")
def test_kinds_are_told_by_their_keys_and_survive_a_dump():
    made = scene([*SHAKEN, MILL[1]], motion=SHAKEN[0])
    assert [type(motion) for motion in made.frame] == [Translation, Rotation, Rotation, Rotation]
    again = type(made).model_validate(json.loads(made.model_dump_json()) | {"base": made.base, "source": made.source})
    assert again == made
    assert isinstance(MOTIONS.validate_python({"usd": "a.usda", "prim": "/A"})[0], Sampled)


WRONG = [
    ({"axis": [0, 0, 0], "rate": 1}, ["frame.axis", "zero vector"]),
    ([{"axis": [0, 0, 1], "rate": 1}, {"axis": [0, 0, 0], "rate": 1}], ["frame[1].axis", "zero vector"]),
    ([{"axis": [0, 0, 1], "rat": 1}], ["frame[0].rat = 1", 'did you mean "rate"']),
    ({"axsi": [0, 0, 1], "rate": 1}, ["frame.axsi", 'did you mean "axis"', "frame.axis", "missing: Direction"]),
    ([], ["frame", "1 or more"]),
    (3, ["frame = 3", "table"]),
    ({"axis": [0, 0, 1]}, ["frame", "exactly one of rate, schedule, sinusoid, table", "none"]),
    ({"axis": [0, 0, 1], "rate": "30 Hz"}, ["frame.rate", "rpm or rad/s"]),
    ({"axis": [0, 0, 1], "sinusoid": {"amplitude": 1}}, ["frame.sinusoid.frequency", "missing: Frequency [1/s]"]),
    (
        {"axis": [0, 0, 1], "sinusoid": {"amplitude": 1, "frequency": "30 rpm"}},
        ["frame.sinusoid.frequency", '"rpm" is not a frequency', "[1/s]"],
    ),
    ({"axis": [0, 0, 1], "sinusoid": {"amplitude": 1, "frequency": 0}}, ["frame.sinusoid.frequency = 0", "> 0"]),
    ({"axis": [0, 0, 1], "table": [[0, 1], [0, 2]]}, ["frame.table[1][0] = 0", "later than 0 s"]),
    ({"axis": [0, 0, 1], "table": [[0, 1, 2]]}, ["frame.table[0]", "list of 2 numbers, [time in [s], rate in [rad/s]]"]),
    ({"axis": [0, 0, 1], "table": [[0, "1 Hz"]]}, ["frame.table[0][1]", "rpm or rad/s"]),
    ({"axis": [0, 0, 1], "table": [["1 mm", 1]]}, ["frame.table[0][0]", "a time"]),
    ({"axis": [0, 0, 1], "table": []}, ["frame.table", "1 or more"]),
    ({"velocity": [0, 0, "1 rpm"]}, ["frame.velocity[2]", "a speed"]),
    ({"velocity": [0, 0]}, ["frame.velocity", "list of 3"]),
    ({"frequency": 3}, ["frame.frequency = 3", "amplitude"]),
    ({"velocity": [1, 0, 0], "phase": 3}, ["frame.phase = 3", "amplitude"]),
    ({"schedule": [{"velocity": [1, 0, 0]}, {"until": 1, "velocity": [0, 0, 0]}]}, ["frame.schedule[0].until", "missing"]),
    ({"schedule": [{"velocity": [[0, 0, 0], [1, 0, 0]]}]}, ["frame.schedule[0].until", "a ramp must end"]),
    ({"schedule": [{"until": 1, "velocity": [1, 0]}]}, ["frame.schedule[0].velocity", "list of 3"]),
    ({"schedule": [{"until": 1, "velocity": ["1 rpm", 0, 0]}]}, ["frame.schedule[0].velocity[0]", "a speed"]),
    ({"table": [[0, 1, 0, 0], [0, 1, 0, 0]]}, ["frame.table[1][0] = 0", "later than 0 s"]),
    ({"table": [[0, 1, 0, 0], [1, 2]]}, ["frame.table[1]", "list of 4 numbers"]),
    ({"velocity": [1, 0, 0], "table": [[0, 1, 0, 0]]}, ["frame", "one of velocity, schedule and table"]),
    ({"axis": [0, 0, 1], "schedule": [{"velocity": [1, 0, 0]}]}, ["frame.schedule[0].velocity", "of its own", "pitch"]),
    ({"axis": [0, 0, 1], "rate": 1, "pitch": "2 s"}, ["frame.pitch", "a length"]),
    ({"velocity": [1, 0, 0], "start": 2, "until": 2}, ["frame.until = 2", "later than start = 2 s"]),
    ({"axis": [0, 0, 1], "rate": 1, "start": -1}, ["frame.start = -1", ">= 0"]),
    ({"amplitude": [1, 0, 0]}, ["frame.frequency", "missing: an amplitude needs a frequency"]),
    ({"amplitude": [1, 0, 0], "frequency": "3 rpm"}, ["frame.frequency", "not a frequency"]),
    ([{"velocity": [1, 0, 0]}, {"amplitude": [1, 0, 0], "frequncy": 3}], ["frame[1].frequncy", 'did you mean "frequency"']),
    ({"usd": "a.usda"}, ["frame.prim", "missing: Path of the prim"]),
    ({"usd": "a.usda", "prim": "World"}, ["frame.prim", "World"]),
    ({"usd": "none.usda", "prim": "/World"}, ["frame.usd", "no such file"]),
    ([{"velocity": [1, 0, 0]}, {"usd": "none.usda", "prim": "/World"}], ["frame[1].usd", "no such file"]),
]


@pytest.mark.parametrize(("frame", "words"), WRONG, ids=[str(k) for k in range(len(WRONG))])
def test_wrong_motion_is_answered_by_its_key(frame, words):
    with pytest.raises(SceneError) as error:
        scene(frame)
    for word in words:
        assert word in str(error.value), str(error.value)


def test_wrong_motion_of_a_wall_is_answered_by_its_key():
    with pytest.raises(SceneError, match=r"walls\[0\]\.motion\[1\]\.rate") as error:
        scene(None, motion=[{"velocity": [1, 0, 0]}, {"axis": [0, 0, 1], "rate": "1 m"}])
    assert "angular rate" in str(error.value)
    with pytest.raises(SceneError, match=r"walls\[0\]\.rotation"):
        scene(None, rotation={"axis": [0, 0, 1], "rate": 1})


# --- a time of their own, and fixed places ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "motion",
    [
        {"axis": [1, 2, 3], "origin": [0.1, 0, 0], "schedule": [{"until": 0.7, "rate": [1, 4]}, {"rate": 4}]},
        {"axis": [0, 0, 1], "sinusoid": {"amplitude": 3, "frequency": 2, "phase": 0.3}},
        {"velocity": [1, 0, 0], "amplitude": [0, 0.01, 0], "frequency": 5},
    ],
)
def test_elapsed_motion_is_the_motion_later(motion):
    time, ahead = np.linspace(0.0, 1.0, 9), 0.6
    now, later = chain(motion), chain(motion | {"elapsed": ahead})
    for field in ("axes", "origin", "spin", "velocity", "spin_rate", "acceleration"):
        found, wanted = getattr(later.pose(time), field), getattr(now.pose(time + ahead), field)
        scale = max(1.0, float(np.abs(wanted).max()))
        np.testing.assert_allclose(found.astype(float), wanted.astype(float), rtol=0, atol=1e-14 * scale, err_msg=field)
    found, wanted = later.increments(time), now.increments(time + ahead)
    np.testing.assert_allclose(found.rotation.astype(float), wanted.rotation.astype(float), rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.shift.astype(float), wanted.shift.astype(float), rtol=0, atol=1e-15)
    points = np.array([[0.2, 0.1, 0.0]])
    assert later.speed_bound(points, 1.0) >= now.speed_bound(points, 1.0)
    assert repr(later.parts(0.4)) == repr(now.parts(1.0))


def test_standing_axes_are_turned_then_shifted():
    quarter = {"quaternion": [1, 0, 0, 1], "shift": [1, 2, 3]}
    place = chain(quarter)
    pose = place.pose(np.array([0.0, 5.0]))
    wanted = Turn.from_euler("z", 90, degrees=True).as_matrix()
    np.testing.assert_allclose(pose.axes.astype(float), [wanted] * 2, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(pose.origin.astype(float), [[1, 2, 3]] * 2)
    assert not np.any(place.increments(np.array([0.0, 1.0])).rotation)
    assert (place.moves, place.rotates, place.displaces, place.speed_bound(np.ones((2, 3)), 1.0)) == (False, False, True, 0.0)
    assert not chain({"shift": [0, 0, 0]}).displaces
    standing = FixedPlacement(**quarter)
    np.testing.assert_allclose(standing.inverse(np.array([1.0, 3.0, 3.0])), [1.0, 0.0, 0.0], rtol=0, atol=1e-15)
    assert FixedPlacement(**json.loads(standing.model_dump_json())) == standing
    # innermost in a chain: the body turns about the outer axis from there
    turning = chain({"axis": [0, 0, 1], "rate": 1.0}, quarter).pose(np.array([math.pi / 2]))
    np.testing.assert_allclose(turning.origin[0].astype(float), [-2, 1, 3], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ({"quaternion": [0, 0, 0, 0]}, "zero vector"),
        ({"quaternion": [1, 0, 0]}, "a list of 4"),
        ({"axis": [0, 0, 1], "rate": 1, "elapsed": -1}, ">= 0"),
    ],
)
def test_wrong_places_and_times_are_refused(motion, words):
    with pytest.raises(ValidationError, match=words):
        MOTIONS.validate_python(motion)
