"""Pictures measured by their pixels: balls, views, cuts, walls, bars, comparisons, films; and clear errors."""

import subprocess
import sys
from dataclasses import replace

import imageio.v2 as imageio
import numpy as np
import pytest

from warpdem.core.pose import FramePose, Placement, TranslationPart
from warpdem.core.snapshot import Snapshot, WallLoad, WallMesh
from warpdem.drawing.legend import bar_width, font_size, heading
from warpdem.drawing.rendering import render
from warpdem.drawing.visibility import visible
from warpdem.errors import WarpdemError
from warpdem.mesh.plane_patch import patch
from warpdem.mesh.tessellation import tessellated
from warpdem.output.write_vtk import VtkWriter
from warpdem.output.write_vtkhdf import VtkhdfWriter
from warpdem.scene.wall_shapes import Cylinder

SIZE = (400, 400)
HEIGHT = 1.0  # [m] shown by the parallel camera, so 400 pixels per metre
FRONT = {"position": (0.0, -5.0, 0.0), "focus": (0.0, 0.0, 0.0), "height": HEIGHT}
PANE = SIZE[0] - bar_width(SIZE[1])  # pixels beside the scale bar
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
        frame=FramePose.rotated(np.array([0.0, 1.0, 0.0]), np.zeros(3), angle, 1.0),
        id=np.arange(count),
        type=np.arange(count, dtype=np.int32) % 2,
        group=np.arange(count, dtype=np.int32) % 2,
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
    """Pixels of grains: walls and text are grey; the scale bar at the right and the axes in the corner are left out."""
    pixels = image[:, : image.shape[1] - bar_width(image.shape[0]), :3].astype(int)
    mask = pixels.max(axis=2) - pixels.min(axis=2) > 40
    mask[-60:, :60] = False
    return mask


def middle(mask):
    """Middle of the marked pixels from the middle of a picture of SIZE, to the right and up [m]."""
    row, column = np.nonzero(mask)
    return np.array([column.mean() + 0.5 - 0.5 * PANE, 0.5 * SIZE[1] - row.mean() - 0.5]) / SCALE


def draw(folder, out, **options):
    return imageio.imread(render(folder, out, **{"size": SIZE, **options}))


@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_ball_has_its_true_size(tmp_path, radius):
    image = draw(write(tmp_path, snapshot([0, 0, 0], radius)), tmp_path / "a.png", **FRONT)
    assert image.shape == (400, 400, 3)
    np.testing.assert_allclose(coloured(image).sum(), np.pi * (radius * SCALE) ** 2, rtol=0.05)


def test_balls_of_two_sizes_keep_theirs(tmp_path):
    state = snapshot([[-0.25, 0, 0], [0.1, 0, 0]], 0.05)
    state.radius[1] = 0.15
    mask = coloured(draw(write(tmp_path, state), tmp_path / "a.png", **FRONT))
    middle_column = PANE // 2 - 40
    np.testing.assert_allclose(mask[:, :middle_column].sum(), np.pi * (0.05 * SCALE) ** 2, rtol=0.05)
    np.testing.assert_allclose(mask[:, middle_column:].sum(), np.pi * (0.15 * SCALE) ** 2, rtol=0.05)


def test_nearer_ball_hides_the_farther_one(tmp_path):
    folder = write(tmp_path, snapshot([[0, -0.3, 0], [0, 0.3, 0]], 0.1))
    front = draw(folder, tmp_path / "a.png", **FRONT, colour="type")
    back = draw(folder, tmp_path / "b.png", **{**FRONT, "position": (0.0, 5.0, 0.0)}, colour="type")
    blue, red = front[200, PANE // 2].astype(int), back[200, PANE // 2].astype(int)
    assert blue[2] > blue[0] + 40
    assert red[0] > red[2] + 40


def test_laboratory_view_is_the_frame_view_turned(tmp_path):
    # a quarter turn about y takes x to -z
    folder = write(tmp_path, snapshot([0.2, 0, 0], 0.1, angle=0.5 * np.pi))
    in_frame = coloured(draw(folder, tmp_path / "a.png", **FRONT, view="frame"))
    in_laboratory = coloured(draw(folder, tmp_path / "b.png", **FRONT, view="laboratory"))
    np.testing.assert_allclose(middle(in_frame), [0.2, 0.0], rtol=0, atol=0.005)
    np.testing.assert_allclose(middle(in_laboratory), [0.0, -0.2], rtol=0, atol=0.005)


def test_laboratory_view_follows_a_frame_that_shifts(tmp_path):
    shift = np.array([0.1, 0.0, 0.25])
    frame = FramePose(np.eye(3), shift, np.zeros(3), np.zeros(3), (TranslationPart(shift),))
    folder = write(tmp_path, replace(snapshot([-0.2, 0, 0], 0.1), frame=frame))
    in_frame = coloured(draw(folder, tmp_path / "a.png", **FRONT, view="frame"))
    in_laboratory = coloured(draw(folder, tmp_path / "b.png", **FRONT, view="laboratory"))
    np.testing.assert_allclose(middle(in_frame), [-0.2, 0.0], rtol=0, atol=0.005)
    np.testing.assert_allclose(middle(in_laboratory), [-0.1, 0.25], rtol=0, atol=0.005)


def test_own_camera_looks_along_the_axis_with_z_up(tmp_path):
    folder = write(tmp_path, snapshot([[0.0, 0, 0.2], [0.1, 0.0, -0.2]], 0.1), walls=[BOX])
    image = draw(folder, tmp_path / "a.png", colour="type")
    mask = coloured(image)
    blue = mask & (image[:, :PANE, 2] > image[:, :PANE, 0])
    red = mask & ~blue
    (right_blue, up_blue), (right_red, up_red) = middle(blue), middle(red)
    assert up_blue > 0.05 > -0.05 > up_red
    assert right_red > right_blue + 0.05


def equipment(radius=0.3, length=0.2):
    """A drum about z between two planes, as results hold them."""
    shape = Cylinder.model_validate({"point": [0, 0, -length / 2], "axis": [0, 0, 1], "radius": radius, "length": length})
    planes = {"back": (np.array([0, 0, 1.0]), -length / 2), "front": (np.array([0, 0, -1.0]), -length / 2)}
    wide = 3.0 * radius * np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])  # a patch wider than the drum
    walls = [tessellated("drum", shape, np.zeros((0, 3))), *(patch(name, half, [], wide) for name, half in planes.items())]
    return walls, {wall.name: Placement(np.eye(3), np.zeros(3)) for wall in walls}


def test_own_camera_stands_against_gravity_and_the_machine_fills_the_picture(tmp_path):
    walls, places = equipment()
    rest = FramePose(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))
    state = replace(snapshot([[0.0, 0.2, 0], [0.1, -0.2, 0]], 0.05), walls=places, frame=rest)
    for gravity, up in (([0, -9.81, 0], 1.0), ([0, 9.81, 0], -1.0)):
        folder = write(tmp_path / str(up), replace(state, gravity=np.array(gravity, dtype=float)), walls=walls)
        image = draw(folder, tmp_path / "a.png", colour="type")
        mask = coloured(image)
        blue = mask & (image[:, :PANE, 2] > image[:, :PANE, 0])
        (right_blue, up_blue), (right_red, up_red) = middle(blue), middle(mask & ~blue)
        assert up * up_blue > 0.1 > -0.1 > up * up_red
        assert right_red > right_blue + 0.05
        drawn = (image[60:, 60:PANE] < 252).any(axis=2)  # but for the words and the axes
        assert drawn.any(axis=0).sum() > 0.75 * (PANE - 60)
        row, column = np.nonzero(blue)
        # a ball of a sixth of the drum: the planes do not make the picture wider
        assert np.ptp(column) == pytest.approx(PANE / 1.06 / 1.04 / 6 * 0.87, rel=0.1)


def test_a_picture_in_turning_axes_has_the_way_up_of_their_first_frame(tmp_path):
    angles = (0.0, 0.5 * np.pi)
    places, gravity = [[0, 0, 0.2], [0, 0, -0.1]], np.array([0, 0, -9.81])
    states = [replace(snapshot(places, 0.1, time=angle, angle=angle), gravity=gravity) for angle in angles]
    folder = write(tmp_path, *states, walls=[BOX])
    last = draw(folder, tmp_path / "a.png", view="frame", colour="type")
    first = draw(folder, tmp_path / "b.png", view="frame", colour="type", time=0.0)
    np.testing.assert_array_equal(coloured(last), coloured(first))


def test_grains_that_fly_off_and_places_that_are_none_leave_the_picture_alone(tmp_path):
    places = np.random.default_rng(4).uniform(-0.25, 0.25, (60, 3))
    state = snapshot(places, 0.03)
    state.velocity[:, 0] = np.linspace(0.1, 1.0, 60)
    calm = draw(write(tmp_path / "calm", state, walls=[BOX]), tmp_path / "a.png")
    wild = snapshot(np.concatenate([places, [[0, 300.0, 0], [np.nan, 0, 0]]]), 0.03)
    wild.velocity[:60, 0] = state.velocity[:, 0]
    wild.velocity[60:] = [[300.0, 0, 0], [np.nan, 0, 0]]
    image = draw(write(tmp_path / "wild", wild, walls=[BOX]), tmp_path / "b.png")
    assert np.mean(np.abs(image[:, :PANE].astype(int) - calm[:, :PANE]).max(axis=2) > 8) < 0.01


def test_names_of_panes_fit_them():
    name = "a_very_long_name_of_a_series_of_runs_number_17"
    title = heading(name, "t = 0.10 s", 200, 360)
    assert title.startswith("a_v")
    assert title.endswith("17   t = 0.10 s")
    assert len(title) * 0.68 * font_size(360) < 200
    assert heading("short", "t = 0.10 s", 200, 360) == "short   t = 0.10 s"
    assert heading("", "t = 0.10 s", 200, 360) == "t = 0.10 s"


def test_last_frame_is_drawn_unless_a_time_is_given(tmp_path):
    places = [[-0.2, 0, 0], [0, 0, 0], [0.2, 0, 0]]
    folder = write(tmp_path, *[snapshot(place, 0.1, time=k) for k, place in enumerate(places)])
    for time, x in [(None, 0.2), (0.0, -0.2), (1.4, 0.0)]:
        mask = coloured(draw(folder, tmp_path / "a.png", **FRONT, time=time))
        np.testing.assert_allclose(middle(mask), [x, 0.0], rtol=0, atol=0.005)


def test_walls_are_outlined_and_see_through(tmp_path):
    bare = draw(write(tmp_path / "bare", snapshot([0, 0, 0], 0.1)), tmp_path / "a.png", **FRONT)
    boxed = draw(write(tmp_path / "boxed", snapshot([0, 0, 0], 0.1), walls=[BOX]), tmp_path / "b.png", **FRONT)
    np.testing.assert_allclose(coloured(boxed).sum(), coloured(bare).sum(), rtol=0.1)
    edge = int(0.5 * PANE - 0.3 * SCALE)
    assert bare[200, edge - 3 : edge + 4].min() == 255
    assert boxed[200, edge - 3 : edge + 4].min() < 140  # the outline
    assert 200 < boxed[200, edge + 20].min() < 255  # the tint of the wall


def test_film_of_the_turn_keeps_everything_in_the_picture(tmp_path):
    angles = np.linspace(0.0, np.pi, 5)
    frames = [snapshot([0.0, 0, 0.6], 0.1, time=float(a), angle=float(a)) for a in angles]
    folder = write(tmp_path, *frames, walls=[BOX])
    told = []
    out = render(folder, tmp_path / "m.mp4", size=(401, 301), watch=lambda *count: told.append(count))
    assert told == [(k, 5) for k in range(6)]
    with imageio.get_reader(out) as movie:
        assert movie.get_meta_data()["size"] == (400, 300)
        assert movie.get_meta_data()["fps"] == 2.5  # so that it lasts 2 s
        pictures = list(movie.iter_data())
    assert len(pictures) == 5
    masks = [coloured(picture) for picture in pictures]
    np.testing.assert_allclose([mask.sum() for mask in masks], masks[0].sum(), rtol=0.2)
    rows = [np.nonzero(mask)[0].mean() for mask in masks]
    assert all(np.diff(rows) > 10)  # from the top down to the bottom


@pytest.mark.parametrize(("choice", "wanted"), [({"fps": 25.0}, 25.0), ({"speed": 1.0}, 25.0), ({}, 25.0)])
def test_film_has_25_pictures_a_second_where_that_is_asked_or_lasts(tmp_path, choice, wanted):
    count = 5 if choice else 51
    folder = write(tmp_path, *[snapshot([0, 0, 0], 0.1, time=0.1 * k) for k in range(count)])
    with imageio.get_reader(render(folder, tmp_path / "m.mp4", size=(64, 64), **choice)) as movie:
        assert movie.get_meta_data()["fps"] == wanted


def test_film_shows_the_stretch_and_the_speed_asked_for(tmp_path):
    times = np.linspace(0.0, 1.0, 5)
    folder = write(tmp_path, *[snapshot([0.2 * t - 0.1, 0, 0], 0.1, time=float(t)) for t in times])
    out = render(folder, tmp_path / "m.mp4", size=(128, 128), start=0.4, end=0.8, speed=0.5, fps=10.0)
    with imageio.get_reader(out) as movie:
        # frames at 0.5 and 0.75 s, a picture every 0.05 s
        assert len(list(movie.iter_data())) == 6
    for start, end in [(0.4, 0.3), (1.2, None), (None, -0.2)]:
        with pytest.raises(WarpdemError, match="start .* s to end .* s: holds no frame.*from 0 to 1 s"):
            render(folder, tmp_path / "n.mp4", start=start, end=end)
    for fps in (-1.0, 0.0):
        with pytest.raises(WarpdemError, match=f"fps {fps}"):
            render(folder, tmp_path / "n.mp4", fps=fps)


def test_stretch_of_a_film_has_the_frames_nearest_to_its_ends(tmp_path):
    times = np.array([0.0, 0.020001, 0.040002, 0.060003])  # whole steps
    folder = write(tmp_path, *[snapshot([0, 0, 0], 0.1, time=float(t)) for t in times])
    for choice, count in [({"end": 0.06}, 4), ({"start": 0.04}, 2), ({"start": 0.0200012, "end": 0.04}, 2)]:
        told = []
        render(folder, tmp_path / "m.mp4", size=(64, 64), watch=lambda *given, told=told: told.append(given), **choice)
        assert told[-1] == (count, count)


@pytest.mark.parametrize(
    ("name", "choice", "message"),
    [
        ("a.png", {"start": 0.0}, r"start is not a choice of a picture \(a\.png\), which has time"),
        ("a.png", {"speed": 1.0}, "speed is not a choice of a picture"),
        ("a.mp4", {"time": 0.0}, r"time is not a choice of a film \(a\.mp4\), which has start and end"),
    ],
)
def test_choices_of_the_other_kind_are_refused(tmp_path, name, choice, message):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    with pytest.raises(WarpdemError, match=message):
        render(folder, tmp_path / name, **choice)


def test_cut_that_leaves_no_grain_is_told(tmp_path):
    folder = write(tmp_path, *[snapshot([[0, 0, 0.2 - 0.2 * k], [0.1, 0, 0]], 0.1, time=k) for k in range(2)], walls=[BOX])
    with pytest.raises(WarpdemError, match=r"cut 'z > 5' leaves no grain: in lab.* \(0, 0, 0\) to \(0\.1, 0, 0\.2\) m"):
        render(folder, tmp_path / "a.mp4", cut=("z > 5",))
    # a film needs grains in one frame only
    assert render(folder, tmp_path / "a.mp4", cut=("z > 0.1",), size=(64, 64)).exists()


@pytest.mark.parametrize("count", [0, 1])
def test_picture_without_walls_or_grains_is_drawn(tmp_path, count):
    image = draw(write(tmp_path, snapshot(np.zeros((count, 3)), 0.1)), tmp_path / "a.png")
    assert bool(coloured(image).any()) == bool(count)


@pytest.mark.parametrize("colour", ["speed", "speed_lab", "spin", "f", "size", "id", "group", "v.x"])
def test_every_colour_is_drawn(tmp_path, colour):
    image = draw(write(tmp_path, snapshot(np.eye(3) * 0.3, 0.1)), tmp_path / "a.png", **FRONT, colour=colour)
    assert coloured(image).sum() > 1000


def test_render_goes_by_the_suffix(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    assert render(folder, tmp_path / "new" / "a.png", size=(64, 64)).stat().st_size > 100
    assert render(folder, tmp_path / "a.MP4", size=(64, 64)).stat().st_size > 100
    with pytest.raises(WarpdemError, match=r"a\.gif: suffix '\.gif'.*\.png.*\.mp4"):
        render(folder, tmp_path / "a.gif")


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"view": "lab"}, "view 'lab' is unknown; allowed are frame, laboratory"),
        ({"camera": "side"}, "camera 'side' is unknown; allowed are auto, front, back"),
        ({"colour": "sped"}, "colour 'sped' is unknown; the grains in .* have speed, spin, force, size, speed_lab, id, type"),
        ({"colour": "id.x"}, r"colour 'id.x': only a vector has components, and they are \.x, \.y and \.z"),
        ({"colour": "v.w"}, "colour 'v.w': only a vector"),
        ({"colour_map": "virid"}, "colour_map 'virid' is unknown; Matplotlib has viridis"),
        ({"colour_range": (1.0, 1.0)}, r"colour_range \(1.0, 1.0\) must be two numbers, the lesser one first"),
        ({"wall_colour": "presure"}, "wall_colour 'presure' is unknown; the walls in .* have no field"),
        ({"zoom": 0.0}, "zoom 0.0 must be a finite number above 0"),
        ({"opacity": 1.5}, "opacity 1.5 must be from 0 to 1"),
        ({"size": (10, 10)}, r"size \(10, 10\) must be a width and a height from 64 to 8192 pixels"),
        ({"size": (64, 640)}, r"size \(64, 640\) is too narrow for the panes"),
        ({"cut": ("w > 0",)}, "cut 'w > 0' cannot be read; give a side"),
        ({"cut": ("0,0,0,0,0,0",)}, "cut '0,0,0,0,0,0' cannot be read"),
        ({"hide": ("bx",)}, "hide 'bx': there is no such wall in .*; there are box"),
        ({"background": "whiet"}, "background 'whiet' is not a colour"),
        ({"camera": "front", "up": (0, 1, 0)}, r"up \(0, 1, 0\) must not be zero or lie along the direction"),
        ({"position": (1, 1, 1), "focus": (1, 1, 1)}, "position and focus of the camera are one point"),
        ({"time": 0.5}, r"time 0\.5 s: the results in .* go from 0 to 0 s"),
        ({"colur": "speed"}, "'colur' is not a choice of a picture; there are view, colour, "),
    ],
    ids=str,
)
def test_wrong_choices_are_named(tmp_path, choice, message):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1), walls=[BOX])
    with pytest.raises(WarpdemError, match=message):
        render(folder, tmp_path / "a.png", **choice)
    assert not list(tmp_path.glob("*.png"))


def test_broken_and_missing_results_are_named(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    with pytest.raises(WarpdemError, match="nowhere"):
        render(tmp_path / "nowhere", tmp_path / "a.png")
    with pytest.raises(WarpdemError, match="no folder of results is given"):
        render([], tmp_path / "a.png")
    (folder / "grains_000000.vtp").write_bytes((folder / "grains_000000.vtp").read_bytes()[:3000])
    with pytest.raises(WarpdemError, match=r"grains_000000\.vtp"):
        render(folder, tmp_path / "a.png")
    assert not list(tmp_path.glob("*.png"))


def test_film_without_ffmpeg_is_told_what_to_install(tmp_path, monkeypatch):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))

    def gone():
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", gone)
    with pytest.raises(WarpdemError, match="ffmpeg and none was found: pip install imageio-ffmpeg"):
        render(folder, tmp_path / "a.mp4", size=(64, 64))
    assert not list(tmp_path.glob("*.mp4"))


@pytest.mark.parametrize(
    ("cut", "angle", "left"),
    [
        ("x < 0", 0.0, [-0.2]),
        ("x >= -0.1", 0.0, [0.2]),
        ("0.1,0,0,-1,0,0", 0.0, [-0.2]),
        ("frame: x < 0", np.pi, [0.2]),
        ("laboratory: x < 0", np.pi, [-0.2]),
        ("x < 0", np.pi, [-0.2]),  # the view's axes, here those of the laboratory
        ("z < 1", 0.0, [-0.2, 0.2]),
    ],
)
def test_cut_leaves_what_is_on_its_side(tmp_path, cut, angle, left):
    folder = write(tmp_path, snapshot([[-0.2, 0, 0], [0.2, 0, 0]], 0.1, angle=angle), walls=[BOX])
    mask = coloured(draw(folder, tmp_path / "a.png", **FRONT, cut=(cut,), hide=("box",)))
    np.testing.assert_allclose(mask.sum(), len(left) * np.pi * (0.1 * SCALE) ** 2, rtol=0.05)
    np.testing.assert_allclose(middle(mask)[0], np.mean(left), rtol=0, atol=0.005)


def test_cut_goes_through_walls(tmp_path):
    folder = write(tmp_path, snapshot(np.zeros((0, 3)), 0.1), walls=[BOX])
    image = draw(folder, tmp_path / "a.png", **FRONT, cut=("x < 0.1",))
    shown = np.nonzero((image[100, :PANE] < 252).any(axis=1))[0]
    ends = (shown[[0, -1]] + 0.5 - 0.5 * PANE) / SCALE
    np.testing.assert_allclose(ends, [-0.3, 0.1], rtol=0, atol=0.01)


def test_hidden_wall_is_gone_and_opaque_wall_hides_grains(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1), walls=[BOX])
    hidden = draw(folder, tmp_path / "a.png", **FRONT, hide=("box",))
    assert (hidden[200, int(0.5 * PANE - 0.3 * SCALE) - 5 : PANE // 2 - 50] == 255).all()
    opaque = draw(folder, tmp_path / "b.png", **FRONT, opacity=1.0)
    assert coloured(opaque).sum() < 0.1 * coloured(hidden).sum()


def test_walls_take_the_colours_of_their_field(tmp_path):
    pressure = np.where(np.arange(12) < 4, 1000.0, 0.0)  # high on the left and right sides
    load = WallLoad(np.zeros(3), np.zeros(3), np.zeros(3), 0.0, np.zeros((12, 3)), pressure)
    state = replace(snapshot(np.zeros((0, 3)), 0.1), loads={"box": load})
    image = draw(write(tmp_path, state, walls=[BOX]), tmp_path / "a.png", wall_colour="pressure", opacity=1.0, camera="iso")
    red = (image[:, :PANE, 0].astype(int) - image[:, :PANE, 2] > 60) & (image[:, :PANE, 0] > 80)
    assert 0.15 < red.sum() / (image[:, :PANE].min(axis=2) < 250).sum() < 0.6  # one side in sight is high, two are low
    bars = image[:, PANE:].astype(int)
    assert (bars.max(axis=2) - bars.min(axis=2) > 40)[: SIZE[1] // 2].any()  # the grains'
    assert (bars.max(axis=2) - bars.min(axis=2) > 40)[SIZE[1] // 2 :].any()  # the walls'


def test_range_and_map_decide_the_colour(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))  # all at 0.173 m/s
    seen = {}
    for high in (0.2, 2.0):
        image = draw(folder, tmp_path / "a.png", **FRONT, colour_range=(0.0, high), colour_map="gray")
        seen[high] = image[190:210, PANE // 2 - 10 : PANE // 2 + 10].mean()
    assert seen[0.2] > 3.0 * seen[2.0]


@pytest.mark.slow
def test_presets_look_from_their_sides(tmp_path):
    folder = write(tmp_path, snapshot([[0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3], [0, 0, 0]], 0.1))
    spread = {}
    for camera in ("front", "back", "left", "right", "top", "bottom"):
        shown = draw(folder, tmp_path / "a.png", camera=camera, colour="id", colour_map="prism", height=1.0)
        row, column = np.nonzero(coloured(shown))
        far = np.abs([[column.min() - column.mean(), column.max() - column.mean()],
                      [row.min() - row.mean(), row.max() - row.mean()]])  # fmt: skip
        spread[camera] = ["left" if far[0, 0] > far[0, 1] else "right", "up" if far[1, 0] > far[1, 1] else "down"]
    # where the grains at +x, +y or +z stand out to
    assert spread == {
        "front": ["right", "up"], "back": ["left", "up"], "left": ["left", "up"], "right": ["right", "up"],
        "top": ["right", "up"], "bottom": ["left", "up"],
    }  # fmt: skip


def test_zoom_makes_things_larger(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    for given in ({"height": HEIGHT}, {}):
        once, twice = (
            coloured(draw(folder, tmp_path / "a.png", **{**FRONT, "height": None, **given}, zoom=zoom)).sum()
            for zoom in (1.0, 2.0)
        )
        np.testing.assert_allclose(twice / once, 4.0, rtol=0.05)


def test_comparison_shows_both_runs_at_one_instant_and_one_scale(tmp_path):
    slow = [snapshot([0, 0, 0.2 - 0.2 * t], 0.1, time=t) for t in (0.0, 1.0, 2.0)]
    fast = [replace(snapshot([0, 0, 0.2 - 0.4 * t], 0.1, time=t), velocity=np.full((1, 3), 1.0)) for t in (0.0, 0.5, 1.0)]
    folders = [write(tmp_path / "slow", *slow), write(tmp_path / "fast", *fast)]
    image = draw(folders, tmp_path / "a.png", time=1.0, size=(600, 400), **FRONT)
    pane = (600 - bar_width(400)) // 2
    mask = coloured(image)
    heights = [200 - np.nonzero(half)[0].mean() for half in (mask[:, :pane], mask[:, pane:])]
    np.testing.assert_allclose(np.array(heights) / SCALE, [0.0, -0.2], rtol=0, atol=0.01)
    # the fast one is at the upper end of the common scale (yellow), the slow one at its lower end (blue)
    slow_colour, fast_colour = image[200, pane // 2].astype(int), image[280, pane + pane // 2].astype(int)
    assert slow_colour[2] > slow_colour[0]
    assert fast_colour[0] > fast_colour[2] + 60
    with pytest.raises(WarpdemError, match=r"too narrow for the panes \(9\)"):
        render(folders[:1] * 9, tmp_path / "b.png", size=(128, 128))


def test_plane_is_drawn_around_the_grains_wherever_they_go(tmp_path):
    normal = np.array([0.0, 0.0, 1.0])
    made = patch("floor", (normal, -0.1), [], np.zeros((1, 3)))
    state = replace(snapshot([1.5, 0, 0], 0.1), walls={"floor": Placement(np.eye(3), np.zeros(3))})
    image = draw(write(tmp_path, state, walls=[made]), tmp_path / "a.png", position=(1.5, -3, 2), focus=(1.5, 0, 0))
    below = image[240:, :PANE][coloured(image)[240:] == 0]
    assert (below < 250).any(axis=1).sum() > 300  # a tint under the grain, far from where the patch was at the start


def test_hidden_grains_are_left_out_and_no_pixel_changes(tmp_path, monkeypatch):
    rng = np.random.default_rng(3)
    place = np.stack(np.meshgrid(*[np.arange(16)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    state = snapshot(0.02 * (place + rng.uniform(-0.2, 0.2, place.shape)), 0.012)
    state.radius[:] = rng.uniform(0.008, 0.014, len(state.radius))
    folder = write(tmp_path, state)
    counts = []

    def counted(*given):
        counts.append(visible(*given))
        return counts[-1]

    for camera in ("iso", "front"):
        monkeypatch.setattr("warpdem.drawing.vtk_renderer.visible", counted)
        lean = draw(folder, tmp_path / "a.png", camera=camera, colour="id")
        monkeypatch.setattr("warpdem.drawing.vtk_renderer.visible", lambda position, *_: np.ones(len(position), dtype=bool))
        np.testing.assert_array_equal(lean, draw(folder, tmp_path / "b.png", camera=camera, colour="id"))
    assert max(shown.mean() for shown in counts) < 0.6


def test_edges_take_no_shade_from_the_opposite_edge(tmp_path):
    bed = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 40), [0.0, 0.02, 0.04], [-0.52, -0.5, -0.48], indexing="ij"), axis=-1)
    image = draw(write(tmp_path, snapshot(bed.reshape(-1, 3), 0.02)), tmp_path / "a.png", **FRONT)
    assert coloured(image)[-3:].any()
    assert (image[:3, 150:PANE] == 255).all()


def test_pictures_are_the_same_each_time(tmp_path):
    folder = write(tmp_path, snapshot(np.eye(3) * 0.3, 0.2), walls=[BOX])
    first, second = (render(folder, tmp_path / name, size=SIZE).read_bytes() for name in ("a.png", "b.png"))
    assert first == second


def test_results_in_one_file_give_the_same_picture(tmp_path):
    states = [snapshot([0.1 * t, 0, 0], 0.1, time=t) for t in (0.0, 1.0)]
    writer = VtkhdfWriter(tmp_path / "one", [BOX])
    for state in states:
        writer.write(state)
    writer.close()
    for time in (0.0, 1.0):
        many = draw(write(tmp_path / f"many{time}", *states, walls=[BOX]), tmp_path / "a.png", time=time)
        np.testing.assert_array_equal(draw(tmp_path / "one", tmp_path / "b.png", time=time), many)


def test_machine_without_opengl_gets_an_error_and_no_crash(tmp_path, monkeypatch):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")  # VTK's last resort
    monkeypatch.setattr("ctypes.util.find_library", lambda name: None)
    with pytest.raises(WarpdemError, match="OpenGL"):
        render(folder, tmp_path / "a.png")


def test_drawing_says_nothing(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1), walls=[BOX])
    # a process of its own: VTK tells only once that it found no screen
    code = f"from warpdem import render; render({str(folder)!r}, {str(tmp_path / 'a.png')!r}, size=(64, 64))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
