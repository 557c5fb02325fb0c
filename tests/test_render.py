"""Pictures measured by their pixels: balls, views, cameras, walls, planes; drawing leaves no trace beside its file."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from pictures import BOX, FRONT, PANE, SCALE, SIZE, coloured, draw, middle, snapshot, write
from warpdem.core.pose import FramePose, Placement, TranslationPart
from warpdem.drawing.rendering import render
from warpdem.drawing.visibility import visible
from warpdem.errors import WarpdemError
from warpdem.mesh.plane_patch import patch
from warpdem.mesh.tessellation import tessellated
from warpdem.output.write_vtkhdf import VtkhdfWriter
from warpdem.scene.wall_shapes import Cylinder


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


def test_walls_are_outlined_and_see_through(tmp_path):
    bare = draw(write(tmp_path / "bare", snapshot([0, 0, 0], 0.1)), tmp_path / "a.png", **FRONT)
    boxed = draw(write(tmp_path / "boxed", snapshot([0, 0, 0], 0.1), walls=[BOX]), tmp_path / "b.png", **FRONT)
    np.testing.assert_allclose(coloured(boxed).sum(), coloured(bare).sum(), rtol=0.1)
    edge = int(0.5 * PANE - 0.3 * SCALE)
    assert bare[200, edge - 3 : edge + 4].min() == 255
    assert boxed[200, edge - 3 : edge + 4].min() < 140  # the outline
    assert 200 < boxed[200, edge + 20].min() < 255  # the tint of the wall


@pytest.mark.parametrize("count", [0, 1])
def test_picture_without_walls_or_grains_is_drawn(tmp_path, count):
    image = draw(write(tmp_path, snapshot(np.zeros((count, 3)), 0.1)), tmp_path / "a.png")
    assert bool(coloured(image).any()) == bool(count)


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
        monkeypatch.setattr("warpdem.drawing.balls.visible", counted)
        lean = draw(folder, tmp_path / "a.png", camera=camera, colour="id")
        monkeypatch.setattr("warpdem.drawing.balls.visible", lambda position, *_: np.ones(len(position), dtype=bool))
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
