"""Films, comparisons and the time of a picture: which frames are drawn, how fast, and in one scale."""

from dataclasses import replace

import imageio.v2 as imageio
import numpy as np
import pytest

from pictures import BOX, FRONT, SCALE, coloured, draw, middle, snapshot, write
from warpdem.drawing.legend import bar_width, font_size, heading
from warpdem.drawing.rendering import render
from warpdem.errors import WarpdemError


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
    # pixels of a box seen from five sides: its edges and their smoothing differ, a part out of the picture would be half of it
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


def test_render_goes_by_the_suffix(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    assert render(folder, tmp_path / "new" / "a.png", size=(64, 64)).stat().st_size > 100
    assert render(folder, tmp_path / "a.MP4", size=(64, 64)).stat().st_size > 100
    with pytest.raises(WarpdemError, match=r"a\.gif: suffix '\.gif'.*\.png.*\.mp4"):
        render(folder, tmp_path / "a.gif")


def test_film_without_ffmpeg_is_told_what_to_install(tmp_path, monkeypatch):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))

    def gone():
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", gone)
    with pytest.raises(WarpdemError, match="ffmpeg and none was found: pip install imageio-ffmpeg"):
        render(folder, tmp_path / "a.mp4", size=(64, 64))
    assert not list(tmp_path.glob("*.mp4"))


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
