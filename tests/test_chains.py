"""Force chains by their pixels: where lines lie, how wide they are, what pulls, what is cut; and results without contacts."""

from dataclasses import replace

import numpy as np
import pytest

from pictures import FRONT, PANE, SCALE, draw, snapshot, write
from warpdem.core.snapshot import ContactNetwork
from warpdem.drawing.chains import WIDEST
from warpdem.errors import WarpdemError
from warpdem.output.write_vtk import VtkWriter
from warpdem.output.write_vtkhdf import VtkhdfWriter

RADIUS = 0.08
ROW = [[-0.3, 0, 0], [-0.15, 0, 0], [0.0, 0, 0], [0.15, 0, 0]]


def row_of_grains(forces=(1.0, 0.5, -0.5)):
    """Four grains in a row, pressed together by two forces and held by a third, with a floor below the first one [N]."""
    state, count = snapshot(ROW, RADIUS), len(forces)
    place = np.array(ROW)
    start, end = place[[0, 1, 2, 0]][: count + 1], np.vstack([place[1:], place[:1] - [[0, 0, RADIUS]]])
    force = np.array([*forces, 0.25])
    empty = np.zeros((count + 1, 3))
    network = ContactNetwork(
        i=np.array([0, 1, 2, 0]), j=np.array([1, 2, 3, -1]), wall=np.array([-1, -1, -1, 0], np.int32), start=start, end=end,
        force=empty, normal_force=force, friction_force=empty, overlap=np.zeros(4), sliding=np.zeros(4, np.int8),
        damping_force=empty,
    )  # fmt: skip
    return replace(state, contacts=network)


def written(folder, state=None):
    VtkWriter(folder, [], contacts=True).write(state or row_of_grains())
    return folder


def column(image, x, z=0.0, half=0.1):
    """Pixels above each other, as float, at x and around z [m]."""
    at = round(0.5 * PANE + x * SCALE)
    rows = slice(*(round(200 - (z + side * half) * SCALE) for side in (1, -1)))
    return image[rows, at, :3].astype(float)


def width(pixels):
    """Height of the line that crosses pixels of one column [pixel]; faded grains have at least 190 of each colour."""
    return (pixels.min(axis=1) < 150).sum()


def test_lines_are_as_wide_as_their_forces_are_large(tmp_path):
    image = draw(written(tmp_path), tmp_path / "a.png", **FRONT, chains=True)
    full = 2.0 * WIDEST * RADIUS * SCALE
    # whole pixels, and the shading of either edge
    np.testing.assert_allclose(width(column(image, -0.225)), full, rtol=0, atol=1.6)
    np.testing.assert_allclose(width(column(image, -0.075)), 0.5 * full, rtol=0, atol=1.6)
    assert width(column(image, 0.25)) == 0  # beyond the last grain there is none


def test_what_pulls_is_blue_and_what_presses_is_red(tmp_path):
    image = draw(written(tmp_path), tmp_path / "a.png", **FRONT, chains=True)
    red, _, blue = column(image, -0.225, half=0.01).mean(axis=0)
    assert red > blue + 60
    red, _, blue = column(image, 0.075, half=0.005).mean(axis=0)
    assert blue > red + 60


def test_grains_are_faded_behind_the_lines(tmp_path):
    folder = written(tmp_path)
    plain, faded = (draw(folder, tmp_path / "a.png", **FRONT, chains=on) for on in (False, True))
    x, z = -0.15, 0.05  # on a grain, beside all lines
    spread = [np.ptp(column(image, x, z, half=0.01), axis=1).mean() for image in (plain, faded)]
    assert spread[1] == pytest.approx(0.25 * spread[0], abs=3.0) and spread[0] > 40  # of 255 steps, each picture rounded


def test_a_line_goes_to_the_contact_point_of_a_wall_and_no_further(tmp_path):
    image = draw(written(tmp_path), tmp_path / "a.png", **FRONT, chains=True)
    line = column(image, -0.3, z=-0.06, half=0.05)
    there = np.flatnonzero(line.min(axis=1) < 150)
    lowest = 200 - round((-0.06 - 0.05) * SCALE) - (len(line) - 1 - there.max())
    np.testing.assert_allclose(lowest, 200 + RADIUS * SCALE, rtol=0, atol=2)  # pixels: rounded at both ends


def test_a_cut_takes_the_lines_of_its_grains(tmp_path):
    image = draw(written(tmp_path), tmp_path / "a.png", **FRONT, chains=True, cut=("x < -0.1",))
    assert width(column(image, -0.225)) > 10  # of two grains that are shown
    assert width(column(image, -0.075)) == 0  # one of them is cut away


def test_one_file_for_all_frames_gives_the_same_lines(tmp_path):
    state = row_of_grains()
    writer = VtkhdfWriter(tmp_path / "hdf", [], contacts=True)
    writer.write(state)
    folders = written(tmp_path / "vtk", state), tmp_path / "hdf"
    pictures = [draw(folder, tmp_path / "a.png", **FRONT, chains=True) for folder in folders]
    np.testing.assert_array_equal(*pictures)


def test_contacts_that_nobody_asks_for_change_no_pixel(tmp_path):
    state = row_of_grains()
    pictures = [
        draw(folder, tmp_path / "a.png", **FRONT)
        for folder in (written(tmp_path / "with", state), write(tmp_path / "without", state))
    ]
    np.testing.assert_array_equal(*pictures)


def test_results_without_contacts_are_refused(tmp_path):
    folder = write(tmp_path, snapshot([0, 0, 0], 0.1))
    with pytest.raises(WarpdemError, match=r"chains show the contacts, which .* does not hold: .* output\.contacts = true"):
        draw(folder, tmp_path / "a.png", **FRONT, chains=True)
    assert not list(tmp_path.glob("*.png"))


def test_no_contact_is_no_line(tmp_path):
    empty = row_of_grains().contacts
    state = replace(row_of_grains(), contacts=replace(empty, **{k: v[:0] for k, v in vars(empty).items() if v is not None}))
    image = draw(written(tmp_path, state), tmp_path / "a.png", **FRONT, chains=True)
    assert width(column(image, -0.225)) == 0
