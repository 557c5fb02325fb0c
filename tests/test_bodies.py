"""Pictures of clumps: one colour each, cut as a whole, alike from VTK and VTKHDF; spots show how a grain rolls."""

from dataclasses import replace

import numpy as np
import pytest

from pictures import FRONT, PANE, SCALE, SIZE, coloured, draw, middle, snapshot
from warpdem.core.snapshot import ClumpShots
from warpdem.drawing.bodies import ALONE, bodies_of, body_axes, spots
from warpdem.errors import WarpdemError
from warpdem.output.write_vtk import VtkWriter
from warpdem.output.write_vtkhdf import VtkhdfWriter

ARM = np.array([0.1, 0.0, 0.0])


def spinning():
    """A dumbbell that spins about y, so that its ends move by 1 m/s more and less than its centre, and a grain beside it."""
    state = snapshot([-ARM, ARM, [0.0, 0.0, 0.3]], 0.08)
    velocity, spin = np.array([0.0, 0.0, 2.0]), np.array([0.0, 10.0, 0.0])
    state.velocity[:2] = velocity + np.cross(spin, [-ARM, ARM])
    state.velocity[2] = 0.5
    state.force[:] = [[1.0, 0, 0], [2.0, 0, 0], [4.0, 0, 0]]
    clumps = ClumpShots(
        id=np.array([0]), type=np.zeros(1, np.int32), members=np.array([2], np.int32), mass=np.array([7.0]),
        radius=np.array([0.1]), position=np.zeros((1, 3)),
        orientation=np.array([[1.0, 0, 0, 0]]), velocity=velocity[None], spin=spin[None],
        angular_momentum=np.zeros((1, 3)),
    )  # fmt: skip
    return replace(state, clump=np.array([0, 0, -1]), clumps=clumps)


def fields(state):
    motion = {"id": "id", "mass": "mass", "v": "velocity", "omega": "spin"}
    grains, clumps = ({name: getattr(of, key) for name, key in motion.items()} for of in (state, state.clumps))
    return {**grains, "clump": state.clump, "f": state.force}, {**clumps, "position": state.clumps.position}


def test_members_have_what_their_clump_has():
    state = spinning()
    found = bodies_of(state.position, *fields(state))
    np.testing.assert_array_equal(found.fields["v"], [[0, 0, 2], [0, 0, 2], [0.5, 0.5, 0.5]])
    np.testing.assert_array_equal(found.fields["mass"], [7, 7, 1])
    np.testing.assert_array_equal(found.fields["f"][:, 0], [3, 3, 4])
    np.testing.assert_array_equal(found.centre, [[0, 0, 0], [0, 0, 0], [0, 0, 0.3]])
    assert found.fields["clump"][0] == found.fields["clump"][1] != ALONE == found.fields["clump"][2]


def test_colours_tell_neighbouring_clumps_apart():
    for members in (2, 3, 5, 8, 9, 10):
        id_ = np.repeat(members * np.arange(200), members)
        colour = bodies_of(np.zeros((len(id_), 3)), {"id": np.arange(len(id_)), "clump": id_}, {}).fields["clump"]
        count = np.bincount(colour[::members], minlength=ALONE)
        assert len(count) == ALONE
        assert count.min() >= 8  # of 22 each


@pytest.mark.parametrize("writer", [VtkWriter, VtkhdfWriter])
def test_a_clump_has_one_colour_and_is_cut_as_a_whole(tmp_path, writer):
    out = writer(tmp_path, [], clumps=True)
    out.write(spinning())
    out.close()
    image = draw(tmp_path, tmp_path / "a.png", **FRONT, colour="v.z", colour_range=(-3.0, 3.0)).astype(int)
    left, right = (image[SIZE[1] // 2, PANE // 2 + round(side * 0.1 * SCALE)] for side in (-1.0, 1.0))
    assert np.abs(left - right).max() <= 2
    whole = coloured(draw(tmp_path, tmp_path / "b.png", **FRONT, colour="clump", cut=("x < 0.05", "z < 0.2")))
    np.testing.assert_allclose(middle(whole), [0.0, 0.0], rtol=0, atol=0.005)


def test_spots_lie_at_the_ends_of_the_body_axes(tmp_path):
    fields = {"orientation": np.array([[np.cos(0.2), 0.0, np.sin(0.2), 0.0]])}  # about y by 0.4
    axes = body_axes(fields, tmp_path)
    centre, radius, colour = spots(np.ones((1, 3)), np.array([2.0]), np.full((1, 3), 200, np.uint8), axes)
    along = (centre - 1.0) / np.linalg.norm(centre - 1.0, axis=1)[:, None]
    np.testing.assert_allclose(along[0], [np.cos(0.4), 0, -np.sin(0.4)], rtol=0, atol=1e-12)
    np.testing.assert_allclose(along[3:], -along[:3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(centre - 1.0, axis=1) + radius, 2.024, rtol=1e-12)
    assert (colour == 80).all()
    state = replace(snapshot([0, 0, 0], 0.3), orientation=np.array([[1.0, 0, 0, 0]]))
    VtkWriter(tmp_path, []).write(state)
    plain, marked = (draw(tmp_path, tmp_path / "a.png", **FRONT, colour="type", spots=on) for on in (False, True))
    darker = marked.astype(float).sum(axis=2) < 0.7 * plain.astype(float).sum(axis=2)
    inside = np.hypot(*(np.indices(SIZE) + 0.5 - np.array([200, PANE / 2])[:, None, None])) < 0.45 * 0.3 * SCALE
    assert darker[inside].mean() > 0.9  # the spot at -y
    assert not darker[200, PANE // 2 + round(0.2 * SCALE)]


def test_spots_without_orientations_are_refused(tmp_path):
    VtkWriter(tmp_path, []).write(snapshot([0, 0, 0], 0.3))
    with pytest.raises(WarpdemError, match=r"output\.orientation = true"):
        draw(tmp_path, tmp_path / "a.png", **FRONT, spots=True)
