"""Pictures measured by their pixels: size and place of balls, both views, walls, movies, and clear errors."""

import subprocess
import sys
from dataclasses import replace

import imageio.v2 as imageio
import numpy as np
import pytest

from warpdem.errors import WarpdemError
from warpdem.render import Camera, render, render_movie, render_picture
from warpdem.snapshot import FramePose, Placement, Snapshot, TranslationPart, WallMesh
from warpdem.write_vtk import VtkWriter

SIZE = (400, 400)
HEIGHT = 1.0  # [m] shown by the parallel camera, so 400 pixels per metre
FRONT = Camera(position=(0.0, -5.0, 0.0), focus=(0.0, 0.0, 0.0), height=HEIGHT)
SCALE = SIZE[1] / HEIGHT
BOX = WallMesh(
    "box",
    0.3 * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]),
    np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ],
        dtype=np.int32,
    ),
)


def snapshot(position, radius, *, time=0.0, angle=0.0):
    position = np.array(position, dtype=float).reshape(-1, 3)
    count = len(position)
    return Snapshot(
        step=0,
        time=time,
        frame=FramePose.turned(np.array([0.0, 1.0, 0.0]), np.zeros(3), angle, 1.0),
        id=np.arange(count),
        type=np.arange(count, dtype=np.int32) % 2,
        radius=np.full(count, radius),
        mass=np.ones(count),
        position=position,
        velocity=np.full((count, 3), 0.1),
        spin=np.zeros((count, 3)),
        force=np.zeros((count, 3)),
        walls={"box": Placement(np.eye(3), np.zeros(3))},
    )


def write(folder, *snapshots, walls=()):
    writer = VtkWriter(folder, list(walls))
    for item in snapshots:
        writer.write(item)
    return folder


def coloured(image):
    """Pixels of grains: walls and text are grey, the scale bar stands in the right fifth."""
    pixels = image[:, : int(0.8 * image.shape[1]), :3].astype(int)
    return pixels.max(axis=2) - pixels.min(axis=2) > 40


def middle(mask):
    """Middle of the marked pixels from the middle of a picture of SIZE, to the right and up [m]."""
    row, column = np.nonzero(mask)
    return np.array([column.mean() - 0.5 * SIZE[0], 0.5 * SIZE[1] - row.mean()]) / SCALE


def draw(folder, out, **options):
    return imageio.imread(render_picture(folder, out, size=SIZE, **options))


@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_ball_has_its_true_size(tmp_path, radius):
    image = draw(write(tmp_path, snapshot([0, 0, 0], radius)), tmp_path / "a.png", camera=FRONT)
    assert image.shape == (400, 400, 3)
    np.testing.assert_allclose(coloured(image).sum(), np.pi * (radius * SCALE) ** 2, rtol=0.05)


def test_balls_of_two_sizes_keep_theirs(tmp_path):
    state = snapshot([[-0.25, 0, 0], [0.1, 0, 0]], 0.05)
    state.radius[1] = 0.15
    mask = coloured(draw(write(tmp_path, state), tmp_path / "a.png", camera=FRONT))
    np.testing.assert_allclose(mask[:, :160].sum(), np.pi * (0.05 * SCALE) ** 2, rtol=0.05)
    np.testing.assert_allclose(mask[:, 160:].sum(), np.pi * (0.15 * SCALE) ** 2, rtol=0.05)


def test_nearer_ball_hides_the_farther_one(tmp_path):
    folder = write(tmp_path, snapshot([[0, -0.3, 0], [0, 0.3, 0]], 0.1))
    front = draw(folder, tmp_path / "a.png", camera=FRONT, colour="type")
    behind = Camera(position=(0.0, 5.0, 0.0), focus=(0.0, 0.0, 0.0), height=HEIGHT)
    back = draw(folder, tmp_path / "b.png", camera=behind, colour="type")
    blue, orange = front[200, 200].astype(int), back[200, 200].astype(int)
    assert blue[2] > blue[0] + 40
    assert orange[0] > orange[2] + 40


def test_laboratory_view_is_the_frame_view_turned(tmp_path):
    # a quarter turn about y takes x to -z
    folder = write(tmp_path, snapshot([0.2, 0, 0], 0.1, angle=0.5 * np.pi))
    in_frame = coloured(draw(folder, tmp_path / "a.png", camera=FRONT, view="frame"))
    in_laboratory = coloured(draw(folder, tmp_path / "b.png", camera=FRONT, view="laboratory"))
    np.testing.assert_allclose(middle(in_frame), [0.2, 0.0], atol=0.005)
    np.testing.assert_allclose(middle(in_laboratory), [0.0, -0.2], atol=0.005)


def test_laboratory_view_follows_a_frame_that_shifts(tmp_path):
    shift = np.array([0.1, 0.0, 0.25])
    frame = FramePose(np.eye(3), shift, np.zeros(3), np.zeros(3), (TranslationPart(shift),))
    folder = write(tmp_path, replace(snapshot([-0.2, 0, 0], 0.1), frame=frame))
    in_frame = coloured(draw(folder, tmp_path / "a.png", camera=FRONT, view="frame"))
    in_laboratory = coloured(draw(folder, tmp_path / "b.png", camera=FRONT, view="laboratory"))
    np.testing.assert_allclose(middle(in_frame), [-0.2, 0.0], atol=0.005)
    np.testing.assert_allclose(middle(in_laboratory), [-0.1, 0.25], atol=0.005)


def test_own_camera_looks_along_the_axis_with_z_up(tmp_path):
    folder = write(tmp_path, snapshot([[0.0, 0, 0.2], [0.1, 0.0, -0.2]], 0.1), walls=[BOX])
    image = draw(folder, tmp_path / "a.png", colour="type")
    mask = coloured(image)
    blue = mask & (image[:, :320, 2] > image[:, :320, 0])
    orange = mask & ~blue
    (right_blue, up_blue), (right_orange, up_orange) = middle(blue), middle(orange)
    assert up_blue > 0.05 > -0.05 > up_orange
    assert right_orange > right_blue + 0.05


def test_last_frame_is_drawn_unless_a_time_is_given(tmp_path):
    places = [[-0.2, 0, 0], [0, 0, 0], [0.2, 0, 0]]
    folder = write(tmp_path, *[snapshot(place, 0.1, time=k) for k, place in enumerate(places)])
    for time, x in [(None, 0.2), (0.0, -0.2), (1.4, 0.0)]:
        mask = coloured(draw(folder, tmp_path / "a.png", camera=FRONT, time=time))
        np.testing.assert_allclose(middle(mask), [x, 0.0], atol=0.005)


def test_walls_are_outlined_and_see_through(tmp_path):
    bare = draw(write(tmp_path / "bare", snapshot([0, 0, 0], 0.1)), tmp_path / "a.png", camera=FRONT)
    boxed = draw(write(tmp_path / "boxed", snapshot([0, 0, 0], 0.1), walls=[BOX]), tmp_path / "b.png", camera=FRONT)
    np.testing.assert_allclose(coloured(boxed).sum(), coloured(bare).sum(), rtol=0.1)
    edge = slice(int(200 - 0.3 * SCALE) - 3, int(200 - 0.3 * SCALE) + 4)
    assert bare[200, edge].min() == 255
    assert boxed[200, edge].min() < 140  # the outline
    assert 200 < boxed[200, 110].min() < 255  # the tint of the wall


def test_movie_of_the_turn_keeps_everything_in_the_picture(tmp_path):
    angles = np.linspace(0.0, np.pi, 5)
    frames = [snapshot([0.0, 0, 0.6], 0.1, time=float(a), angle=float(a)) for a in angles]
    out = render_movie(write(tmp_path, *frames, walls=[BOX]), tmp_path / "m.mp4", view="laboratory", size=(401, 301))
    with imageio.get_reader(out) as movie:
        assert movie.get_meta_data()["size"] == (400, 300)
        assert movie.get_meta_data()["fps"] == 25.0
        pictures = list(movie.iter_data())
    assert len(pictures) == 5
    masks = [coloured(picture) for picture in pictures]
    np.testing.assert_allclose([mask.sum() for mask in masks], masks[0].sum(), rtol=0.2)
    rows = [np.nonzero(mask)[0].mean() for mask in masks]
    assert all(np.diff(rows) > 10)  # from the top down to the bottom


@pytest.mark.parametrize("count", [0, 1])
def test_picture_without_walls_or_grains_is_drawn(tmp_path, count):
    image = draw(write(tmp_path, snapshot(np.zeros((count, 3)), 0.1)), tmp_path / "a.png")
    assert bool(coloured(image).any()) == bool(count)


@pytest.mark.parametrize("colour", ["speed", "spin", "force", "radius", "mass", "id", "type"])
def test_every_colour_is_drawn(tmp_path, colour):
    image = draw(write(tmp_path, snapshot(np.eye(3) * 0.3, 0.1)), tmp_path / "a.png", camera=FRONT, colour=colour)
    assert coloured(image).sum() > 1000


def test_render_goes_by_the_suffix(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    assert render(folder, tmp_path / "new" / "a.png", size=(64, 64)).stat().st_size > 100
    assert render(folder, tmp_path / "a.MP4", size=(64, 64)).stat().st_size > 100
    with pytest.raises(WarpdemError, match=r"a\.gif: suffix '\.gif'.*\.png.*\.mp4"):
        render(folder, tmp_path / "a.gif")


def test_wrong_choices_and_broken_files_are_named(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    with pytest.raises(WarpdemError, match="view 'lab' is unknown; allowed are frame, laboratory"):
        render(folder, tmp_path / "a.png", view="lab")
    with pytest.raises(WarpdemError, match="colour 'sped' is unknown; allowed are speed, "):
        render(folder, tmp_path / "a.mp4", colour="sped")
    with pytest.raises(WarpdemError, match="nowhere"):
        render(tmp_path / "nowhere", tmp_path / "a.png")
    (folder / "grains_000000.vtp").write_bytes((folder / "grains_000000.vtp").read_bytes()[:3000])
    with pytest.raises(WarpdemError, match=r"grains_000000\.vtp"):
        render(folder, tmp_path / "a.png")
    assert not list(tmp_path.glob("*.png")) + list(tmp_path.glob("*.mp4"))


def test_machine_without_opengl_gets_an_error_and_no_crash(tmp_path, monkeypatch):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")  # VTK's last resort
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    with pytest.raises(WarpdemError, match="OpenGL"):
        render(folder, tmp_path / "a.png")


def test_drawing_says_nothing(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1), walls=[BOX])
    # a process of its own: VTK tells only once that it found no screen
    code = f"from warpdem.render import render; render({str(folder)!r}, {str(tmp_path / 'a.png')!r}, size=(64, 64))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
