"""Shadows by their pixels: where a ball casts its shadow, how dark and large it is, what casts none and what gets none."""

import numpy as np
import pytest

from pictures import FRONT, PANE, SCALE, SIZE, coloured, draw, snapshot, write
from warpdem.core.snapshot import WallMesh
from warpdem.drawing.shadows import AZIMUTH, DARKEST, ELEVATION

RADIUS, BEHIND = 0.05, 0.3
HIGH, ASIDE = np.radians(ELEVATION), np.radians(AZIMUTH)
TOWARDS = np.array([np.cos(HIGH) * np.sin(ASIDE), -np.cos(HIGH) * np.cos(ASIDE), np.sin(HIGH)])
"""Direction of the light for a camera that looks along y."""
FAR = [[0.4, 0.25, 0.4], [-0.4, 0.25, -0.4]]
"""Grains that make the plane behind them large."""


def upright(name, y, towards):
    """A plane across the line of sight on whose side -y (-1) or y (1) grains are."""
    corners = np.array([[-0.1, y, -0.1], [0.1, y, -0.1], [0.1, y, 0.1], [-0.1, y, 0.1]])
    order = [[0, 1, 2], [0, 2, 3]] if towards < 0 else [[0, 2, 1], [0, 3, 2]]
    return WallMesh(name, corners, np.array(order, dtype=np.int32), infinite=True)


def brightness(folder, tmp_path, **options):
    """Brightness with shadows over that without them, and which pixels show grains, both beside the scale bar, shape (h, w)."""
    plain, shaded = (draw(folder, tmp_path / "a.png", **{**FRONT, **options}, shadows=on) for on in (False, True))
    bright = shaded[..., :3].astype(float).sum(axis=2) / plain[..., :3].astype(float).sum(axis=2)
    return bright[:, :PANE], coloured(plain)


def around(image, x, z, half):
    """Pixels around a point of the picture, and how far each is from it to the right and up [m]."""
    column, row = np.meshgrid(np.arange(image.shape[1]), np.arange(image.shape[0]))
    right, up = (column + 0.5 - 0.5 * PANE) / SCALE - x, (0.5 * SIZE[1] - row - 0.5) / SCALE - z
    inside = (np.abs(right) < half) & (np.abs(up) < half)
    return image[inside], right[inside], up[inside]


def test_a_ball_casts_an_ellipse_along_the_light_on_a_plane(tmp_path):
    ball = np.array([0.1, 0.0, 0.1])
    folder = write(tmp_path, snapshot([ball, *FAR], RADIUS), walls=[upright("box", BEHIND, -1)])
    bright, _ = brightness(folder, tmp_path)
    cosine = -TOWARDS[1]
    place = ball - BEHIND / cosine * TOWARDS
    seen, right, up = around(bright, place[0], place[2], 0.1)
    weight = (1.0 - seen) / DARKEST
    middle = (weight * right).sum() / weight.sum(), (weight * up).sum() / weight.sum()
    np.testing.assert_allclose(middle, 0.0, rtol=0, atol=1.0 / SCALE)  # a pixel
    np.testing.assert_allclose(weight.sum() / SCALE**2, np.pi * RADIUS**2 / cosine, rtol=0.04)
    np.testing.assert_allclose(seen[np.hypot(right, up) < 0.3 * RADIUS], 1.0 - DARKEST, rtol=0, atol=0.01)


@pytest.mark.parametrize("walls", [[], [upright("box", -0.2, 1)]], ids=["open", "behind a plane seen from its back"])
def test_a_ball_shades_another_one_and_none_itself(tmp_path, walls):
    lower = np.array([-0.1, 0.0, -0.1])
    upper = lower + 3.0 * RADIUS * TOWARDS
    bright, _ = brightness(write(tmp_path, snapshot([lower, upper], RADIUS), walls=walls), tmp_path)
    # the edge of the shadow of an equal ball lies on the edge of the disk that the light sees; near its own dark side, up to
    # 70 degrees from the light, a ball is darkened a little
    for centre, least, ratio, within in ((lower, 0.75, 1.0 - DARKEST, 0.04), (upper, 0.35, 1.0, 0.07)):
        seen, right, up = around(bright, centre[0], centre[2], RADIUS)
        x, z = right / RADIUS, up / RADIUS
        flat = x * x + z * z
        facing = np.stack([x, -np.sqrt(np.maximum(1.0 - flat, 0.0)), z], axis=-1) @ TOWARDS
        lit = seen[(facing > least) & (flat < 0.9)]
        assert len(lit) > 200
        np.testing.assert_allclose(lit, ratio, rtol=0, atol=within)


@pytest.mark.parametrize(("opacity", "dark"), [(1.0, True), (0.16, False)])
def test_opaque_walls_cast_shadows_and_others_none(tmp_path, opacity, dark):
    """A small plate between the light and a ball."""
    ball = np.array([-0.1, 0.0, -0.1])
    at = ball + 4.0 * RADIUS * TOWARDS
    side = np.cross(TOWARDS, [0.0, 0.0, 1.0])
    above = np.cross(side, TOWARDS)
    corners = np.array([at + 1.5 * RADIUS * (a * side + b * above) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    plate = WallMesh("box", corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32))
    bright, _ = brightness(write(tmp_path, snapshot([ball], RADIUS), walls=[plate]), tmp_path, opacity=opacity)
    lit = ball + 0.4 * RADIUS * TOWARDS
    seen, _, _ = around(bright, lit[0], lit[2], 0.3 * RADIUS)
    np.testing.assert_allclose(seen, 1.0 - DARKEST * dark, rtol=0, atol=0.02)


def test_a_perspective_camera_gives_the_same_shadow(tmp_path):
    ball = np.array([0.1, 0.0, 0.1])
    folder = write(tmp_path, snapshot([ball, *FAR], RADIUS), walls=[upright("box", BEHIND, -1)])
    bright, grains = brightness(folder, tmp_path, position=(0.0, -5.0, 0.0), height=None)
    place = ball + BEHIND / TOWARDS[1] * TOWARDS
    scale = 0.5 / (5.0 + BEHIND) / np.tan(np.radians(10.0))  # metres of the picture over those at the plane
    seen, right, up = around(np.where(grains, 1.0, bright), scale * place[0], scale * place[2], 0.08)
    np.testing.assert_allclose(seen[np.hypot(right, up) < 0.3 * RADIUS], 1.0 - DARKEST, rtol=0, atol=0.01)
    weight = 1.0 - seen
    np.testing.assert_allclose([(weight * right).sum(), (weight * up).sum()] / weight.sum(), 0.0, rtol=0, atol=1.5 / SCALE)
