"""Sampled transforms of a USD prim: places at and between samples, units, parents, and what is refused."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom
from scipy.spatial.transform import Rotation as Turn

from warpdem import SceneError
from warpdem.usd import motion as usd_motion

CODES = (10.0, 20.0, 40.0, 50.0)
ANGLES = (0.0, 90.0, 150.0, 150.0)
PLACES = ((1, 2, 3), (1, 2, 4), (3, 2, 4), (3, 2, 4))


def stage_at(path, metres=1.0, rate=10.0, up="Z"):
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, up)
    stage.SetTimeCodesPerSecond(rate)
    return stage


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A prim that turns about z and shifts, in a parent that is turned and shifted once for all; centimetres."""
    tmp_path = tmp_path_factory.mktemp("usd")
    stage = stage_at(tmp_path / "arm.usda", metres=0.01)
    parent = UsdGeom.Xform.Define(stage, "/World")
    parent.AddTranslateOp().Set(Gf.Vec3d(0, 0, 100))
    parent.AddRotateXOp().Set(90.0)
    arm = UsdGeom.Xform.Define(stage, "/World/Arm")
    shift, turn = arm.AddTranslateOp(), arm.AddRotateZOp()
    for code, angle, place in zip(CODES, ANGLES, PLACES, strict=True):
        shift.Set(Gf.Vec3d(*place), code)
        turn.Set(angle, code)
    stage.Save()
    return tmp_path / "arm.usda"


def place_by_hand(time):
    """Turn and shift of X(t) in metres: samples at 1, 2, 4 and 5 s."""
    seconds = np.array(CODES) / 10.0
    angle = np.interp(time, seconds, ANGLES)
    place = [np.interp(time, seconds, [p[k] for p in PLACES]) for k in range(3)]
    parent = Turn.from_euler("x", 90, degrees=True)
    turn = parent * Turn.from_euler("z", angle, degrees=True)
    return turn.as_matrix(), 0.01 * (parent.apply(place) + np.array([0, 0, 100]))


def test_stage_with_y_upwards_is_turned(file, tmp_path):
    """What is along y on the stage is along z in the laboratory; units and times are as they were."""
    text = file.read_text()
    assert 'upAxis = "Z"' in text
    (tmp_path / "y.usda").write_text(text.replace('upAxis = "Z"', 'upAxis = "Y"'))
    z_up, y_up = (usd_motion.read(f, "/World/Arm", "frame").pose(TIMES, TIMES) for f in (file, tmp_path / "y.usda"))
    up = Turn.from_euler("x", 90, degrees=True).as_matrix()
    for name in ("origin", "velocity"):
        given, turned = (getattr(pose, name).astype(float) for pose in (z_up, y_up))
        np.testing.assert_allclose(turned, given @ up.T, rtol=0, atol=1e-15)
    np.testing.assert_allclose(y_up.axes.astype(float), up @ z_up.axes.astype(float) @ up.T, rtol=0, atol=1e-15)


TIMES = np.array([0.0, 0.99, 1.0, 1.25, 2.0, 3.7, 4.0, 4.5, 5.0, 77.0])


def test_places_are_those_of_the_prim_relative_to_time_0(file):
    motion = usd_motion.read(file, "/World/Arm", "frame")
    pose = motion.pose(TIMES, TIMES)
    first_turn, first_place = place_by_hand(0.0)
    for k, time in enumerate(TIMES):
        turn, place = place_by_hand(time)
        np.testing.assert_allclose(pose.axes[k].astype(float), turn @ first_turn.T, rtol=0, atol=1e-12)
        origin = place - turn @ first_turn.T @ first_place
        np.testing.assert_allclose(pose.origin[k].astype(float), origin, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(pose.axes[0], np.eye(3))
    np.testing.assert_array_equal(pose.origin[0], 0.0)
    assert motion.max_rate == pytest.approx(np.pi / 2, rel=1e-12)
    assert motion.rotates
    assert motion.moves


def test_velocities_and_accelerations_are_the_derivatives(file):
    motion, h = usd_motion.read(file, "/World/Arm", "frame"), 1e-4
    body = np.array([0.3, 0.4, -0.2])
    for time in (1.5, 3.0, 4.5):
        around = motion.pose(time + h * np.arange(-1, 2), np.full(3, time))
        path = (around.axes @ body.astype(np.longdouble)) + around.origin
        back = around.axes[1].T
        first, second = back @ (path[2] - path[0]) / (2 * h), back @ (path[2] - 2 * path[1] + path[0]) / h**2
        spin, velocity, spin_rate, acceleration = (
            getattr(around, name)[1] for name in ("spin", "velocity", "spin_rate", "acceleration")
        )
        np.testing.assert_allclose((velocity + np.cross(spin, body)).astype(float), first.astype(float), rtol=0, atol=1e-8)
        own = acceleration + np.cross(spin_rate, body) + np.cross(spin, np.cross(spin, body))
        np.testing.assert_allclose(own.astype(float), second.astype(float), rtol=0, atol=1e-7)


def test_either_side_of_a_kink_may_be_asked_for(file):
    motion = usd_motion.read(file, "/World/Arm", "frame")
    at = np.array([2.0])
    before, after = (motion.pose(at, at + side) for side in (-0.1, 0.1))
    np.testing.assert_allclose(np.linalg.norm(before.spin.astype(float)), np.pi / 2, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(after.spin.astype(float)), np.pi / 6, rtol=1e-12)
    np.testing.assert_array_equal(before.axes, after.axes)


def test_increments_lead_from_place_to_place(file):
    motion = usd_motion.read(file, "/World/Arm", "frame")
    for times in (np.linspace(0.5, 6.0, 12), 1.5 + 1e-7 * np.arange(5)):
        pose, drift = motion.pose(times, times), motion.increments(times)
        point = np.array([0.3, -0.7, 0.2], dtype=np.longdouble)
        seen = np.einsum("kji,kj->ki", pose.axes, point - pose.origin)
        moved = np.einsum("kij,kj->ki", drift.rotation, seen[:-1]) + drift.shift
        np.testing.assert_allclose(moved.astype(float), np.diff(seen, axis=0).astype(float), rtol=0, atol=1e-16)


def test_bound_of_the_speed_holds(file):
    motion = usd_motion.read(file, "/World/Arm", "frame")
    cloud = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    pose = motion.pose(TIMES, TIMES)
    speed = np.linalg.norm((pose.velocity[:, None] + np.cross(pose.spin[:, None], cloud)).astype(float), axis=2).max()
    assert 0.5 * motion.speed_bound(cloud, 0.0) < speed <= motion.speed_bound(cloud, 0.0)


def test_part_is_the_place(file):
    motion = usd_motion.read(file, "/World/Arm", "frame")
    part, pose = motion.part(3.0), motion.pose(np.array([3.0]), np.array([3.0]))
    w, *v = part.quaternion
    np.testing.assert_allclose(Turn.from_quat([*v, w]).as_matrix(), pose.axes[0].astype(float), rtol=0, atol=1e-14)
    np.testing.assert_allclose(part.shift, pose.origin[0].astype(float), rtol=0, atol=1e-15)


def message(file, prim) -> str:
    with pytest.raises(SceneError) as error:
        usd_motion.read(file, prim, "a.toml: frame[1]")
    assert "a.toml: frame[1]" in str(error.value)
    return str(error.value)


def test_wrong_prims_are_refused_by_name(file, tmp_path):
    assert "frame[1]: arm.usda: prim = '/World/Leg': no such prim" in message(file, "/World/Leg")
    assert "/World, /World/Arm" in message(file, "/World/Leg")
    assert "neither it nor an ancestor has time samples" in message(file, "/World")
    stage = stage_at(tmp_path / "other.usda")
    stage.DefinePrim("/Words", "Scope")
    stage.Save()
    assert "has no transform" in message(tmp_path / "other.usda", "/Words")
    (tmp_path / "broken.usda").write_text("#usda 1.0\n(")
    assert "broken.usda: cannot be read as USD" in message(tmp_path / "broken.usda", "/World")


@pytest.mark.parametrize("factors", [(2, 2, 2), (1, 1, 1.001), (1, 1, -1)])
def test_scale_and_mirroring_are_refused(tmp_path, factors):
    stage = stage_at(tmp_path / "scaled.usda")
    UsdGeom.Xform.Define(stage, "/World").AddScaleOp().Set(Gf.Vec3f(*factors))
    UsdGeom.Xform.Define(stage, "/World/Arm").AddRotateZOp().Set(30.0, 5.0)
    stage.Save()
    text = message(tmp_path / "scaled.usda", "/World/Arm")
    assert "frame[1].prim = '/World/Arm': time code 5" in text
    assert "scale, shear or mirroring" in text


def test_shear_is_refused(tmp_path):
    stage = stage_at(tmp_path / "sheared.usda")
    matrix = Gf.Matrix4d(1, 0.1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)
    UsdGeom.Xform.Define(stage, "/Arm").AddTransformOp().Set(matrix, 0.0)
    stage.Save()
    assert "shear" in message(tmp_path / "sheared.usda", "/Arm")


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_turns_go_the_short_way_from_sample_to_sample(tmp_path, axis):
    """100 degrees a second over several turns: the quaternions of the samples have either sign."""
    stage = stage_at(tmp_path / "turning.usda", rate=1.0)
    turn = getattr(UsdGeom.Xform.Define(stage, "/Arm"), f"AddRotate{axis}Op")(UsdGeom.XformOp.PrecisionDouble)
    for code in range(12):
        turn.Set(100.0 * code, code)
    stage.Save()
    motion = usd_motion.read(tmp_path / "turning.usda", "/Arm", "frame")
    times = np.arange(0.25, 11.0, 0.5)
    pose = motion.pose(times, times)
    wanted = np.radians(100.0) * np.eye(3)["XYZ".index(axis)]
    np.testing.assert_allclose(pose.spin.astype(float), np.tile(wanted, (len(times), 1)), rtol=0, atol=1e-12)
    turned = Turn.from_rotvec(np.outer(times, wanted)).as_matrix()
    np.testing.assert_allclose(pose.axes.astype(float), turned, rtol=0, atol=1e-12)
