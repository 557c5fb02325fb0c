"""Choices of a picture, by its pixels: cuts, colours, hidden and coloured walls, presets, zoom; wrong choices are named."""

from dataclasses import replace

import numpy as np
import pytest

from pictures import BOX, FRONT, HEIGHT, PANE, SCALE, SIZE, coloured, draw, middle, snapshot, write
from warpdem.core.snapshot import WallLoad
from warpdem.drawing.rendering import render
from warpdem.errors import WarpdemError


def test_cut_that_leaves_no_grain_is_told(tmp_path):
    folder = write(tmp_path, *[snapshot([[0, 0, 0.2 - 0.2 * k], [0.1, 0, 0]], 0.1, time=k) for k in range(2)], walls=[BOX])
    with pytest.raises(WarpdemError, match=r"cut 'z > 5' leaves no grain: in lab.* \(0, 0, 0\) to \(0\.1, 0, 0\.2\) m"):
        render(folder, tmp_path / "a.mp4", cut=("z > 5",))
    # a film needs grains in one frame only
    assert render(folder, tmp_path / "a.mp4", cut=("z > 0.1",), size=(64, 64)).exists()


@pytest.mark.parametrize("colour", ["speed", "speed_lab", "spin", "f", "size", "id", "group", "v.x"])
def test_every_colour_is_drawn(tmp_path, colour):
    image = draw(write(tmp_path, snapshot(np.eye(3) * 0.3, 0.1)), tmp_path / "a.png", **FRONT, colour=colour)
    assert coloured(image).sum() > 1000


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
