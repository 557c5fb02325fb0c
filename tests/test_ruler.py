"""The ruler of a picture: a round length, as long as a ball of that diameter is wide."""

import numpy as np
import pytest

from pictures import BOX, FRONT, HEIGHT, PANE, SCALE, coloured, draw, snapshot, write
from warpdem.drawing.camera import VIEW_ANGLE, Camera
from warpdem.drawing.ruler import LONGEST, ruler_of


def camera(distance, height=None, angle=VIEW_ANGLE):
    return Camera(np.array([0.0, -distance, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]), angle, height)


@pytest.mark.parametrize(
    ("height", "words"),
    [(1.0, "200 mm"), (4.0, "1 m"), (0.0123, "2 mm"), (2.5e-6, "500 nm"), (1.9e-3, "200 µm"), (9e3, "2 km"), (9e-9, "2 nm")],
)
def test_the_length_is_round_and_the_longest_that_fits(height, words):
    ruler = ruler_of(camera(5.0, height), 400.0, 400.0)
    assert ruler.words == words
    assert LONGEST / 2.5 * 400.0 < ruler.pixels <= LONGEST * 400.0 * (1 + 1e-9)


def bar(image):
    """Least and greatest column of the bar of a picture, by its longest dark line in the lower right."""
    dark = (image[300:, :PANE, :3].astype(int).max(axis=2) < 110).astype(int)
    dark[:, : PANE // 3] = 0
    row = dark.sum(axis=1).argmax()
    columns = np.flatnonzero(dark[row])
    assert (np.diff(columns) == 1).all()
    return columns[0], columns[-1]


def test_the_bar_has_the_scale_of_a_parallel_picture(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0.2], 0.1))
    left, right = bar(draw(folder, tmp_path / "a.png", **FRONT, ruler=True))
    np.testing.assert_allclose(right - left, 0.2 * SCALE, rtol=0, atol=2.5)  # 200 mm
    assert right < PANE


@pytest.mark.parametrize("zoom", [1.0, 2.0])
def test_the_bar_has_the_scale_of_a_perspective_picture_at_its_focus(tmp_path, zoom):
    """A ball of 100 mm at the focus beside the bar."""
    folder = write(tmp_path, snapshot([0, 0, 0], 0.05))
    look = {"position": (0.0, -6.0, 0.0), "focus": (0.0, 0.0, 0.0), "zoom": zoom}
    image = draw(folder, tmp_path / "a.png", **look, ruler=True)
    columns = np.flatnonzero(coloured(image).any(axis=0))
    left, right = bar(image)
    wide = columns[-1] - columns[0] + 1
    seen = 2.0 * 6.0 * np.tan(np.radians(0.5 * VIEW_ANGLE)) / zoom  # height of the picture at the focus [m]
    length = max(x for x in (0.1, 0.2, 0.5, 1.0) if x <= LONGEST * seen * PANE / 400)
    np.testing.assert_allclose((right - left) / wide, length / 0.1, rtol=0.06)


def test_without_it_no_pixel_is_dark_there(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0.2], 0.1), walls=[BOX])
    image = draw(folder, tmp_path / "a.png", **FRONT)
    assert HEIGHT == 1.0 and (image[360:, PANE // 2 : PANE] > 200).all()
