"""Cameras stand upright against gravity, whichever way it points."""

import numpy as np
import pytest

from warpdem.core.pose import FramePose
from warpdem.drawing.camera import camera_of, picture_axes, upright, view_axes
from warpdem.drawing.style import PictureStyle

REST = FramePose(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))
X, Y, Z = np.eye(3)
EARTH, UP_Y = np.array([0.0, 0.0, -9.81]), np.array([0.0, -9.81, 0.0])


def seen(camera, gravity, pose=REST):
    """Right, up and forward direction of a picture."""
    return view_axes(PictureStyle(camera=camera), pose, upright(gravity))


@pytest.mark.parametrize("gravity", [None, np.zeros(3), EARTH, np.array([np.nan, 0.0, 0.0])])
def test_without_another_gravity_z_is_up(gravity):
    np.testing.assert_array_equal(upright(gravity), np.eye(3))


@pytest.mark.parametrize("gravity", [[0, -9, 0], [0, 9, 0], [-1, 0, 0], [0, 0, 9], [3, 0, -9], [1, 2, 3], [1e-9, 0, 1]])
def test_the_turn_is_one_and_points_up(gravity):
    turn = upright(np.array(gravity, dtype=float))
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), rtol=0, atol=1e-7)
    assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-7)
    np.testing.assert_allclose(turn[:, 2], -np.array(gravity) / np.linalg.norm(gravity), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("camera", "gravity", "axes"),
    [
        ("front", EARTH, (X, Z, Y)),
        ("auto", EARTH, (X, Z, Y)),
        ("left", EARTH, (-Y, Z, X)),
        ("top", EARTH, (X, Y, -Z)),
        ("bottom", EARTH, (-X, Y, Z)),
        ("front", UP_Y, (X, Y, -Z)),
        ("auto", UP_Y, (X, Y, -Z)),
        ("back", UP_Y, (-X, Y, Z)),
        ("left", UP_Y, (Z, Y, X)),
        ("right", UP_Y, (-Z, Y, -X)),
        ("top", UP_Y, (X, -Z, -Y)),
        ("bottom", UP_Y, (-X, -Z, Y)),
        ("auto", -EARTH, (X, -Z, -Y)),
    ],
)
def test_presets_follow_the_way_up(camera, gravity, axes):
    np.testing.assert_allclose(seen(camera, gravity), axes, rtol=0, atol=1e-15)


def test_iso_looks_down_from_the_same_height_whichever_way_is_up():
    for gravity in (EARTH, UP_Y, np.array([3.0, -2.0, 1.0])):
        right, up, forward = seen("iso", gravity)
        down = gravity / np.linalg.norm(gravity)
        assert forward @ down == pytest.approx(0.45 / np.linalg.norm([0.60, 0.66, 0.45]))
        assert right @ down == pytest.approx(0.0, abs=1e-12)
        assert up @ down < -0.8


def test_a_chute_is_seen_with_its_slope():
    """Gravity leant by 20 degrees in the plane of a front view: the picture is turned by as much, and looks the same way."""
    lean = np.radians(20.0)
    right, up, forward = seen("auto", np.array([np.sin(lean), 0.0, -np.cos(lean)]))
    np.testing.assert_allclose(forward, Y, rtol=0, atol=1e-15)
    np.testing.assert_allclose(up, [-np.sin(lean), 0.0, np.cos(lean)], rtol=0, atol=1e-15)
    np.testing.assert_allclose(right, [np.cos(lean), 0.0, np.sin(lean)], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("axis", "gravity", "forward"), [(Z, UP_Y, Z), (-X, UP_Y, -X), (Y, UP_Y, -Z), (Y, EARTH, Y), (Z, EARTH, Y), (Z, None, Y)]
)
def test_auto_looks_along_the_axis_of_the_frame_unless_it_is_upright(axis, gravity, forward):
    found = seen("auto", gravity, FramePose.rotated(axis, np.zeros(3), 0.3, 1.0))
    np.testing.assert_allclose(found[2], forward, rtol=0, atol=1e-15)
    assert found[1] @ (Z if gravity is None else -gravity) > 0


def test_a_camera_with_a_place_of_its_own_has_the_way_up():
    style = PictureStyle(position=(0.0, 0.0, 5.0), focus=(0.0, 0.0, 0.0))
    turn = upright(UP_Y)
    axes = view_axes(style, REST, turn)
    camera = camera_of(style, turn, axes, -np.ones(3), np.ones(3), 1.0)
    np.testing.assert_allclose(camera.up, Y, rtol=0, atol=1e-15)
    np.testing.assert_allclose(camera.axes, picture_axes(-Z, Y), rtol=0, atol=1e-15)
