"""What the camera frames: equipment and the bulk of the grains, not what flies off; planes no wider than that."""

import numpy as np
import pytest

from warpdem.drawing.framing import Framing
from warpdem.mesh.tessellation import drawings
from warpdem.scene.file import scene_from_dict

DRUM = np.stack(np.meshgrid([-1.0, 1.0], [0.0, 0.5], [-1.0, 1.0], indexing="ij"), axis=-1).reshape(-1, 3)


def bed(count=400, seed=0):
    return np.random.default_rng(seed).uniform([-0.8, 0.05, -0.8], [0.8, 0.45, 0.0], (count, 3))


def box_of(*frames, walls=(DRUM,), planes=(), radius=0.02, start=None):
    framing = Framing(np.eye(3))
    begun = frames[0] if start is None else start
    framing.include_start(begun, np.full(len(begun), radius))
    for grains in frames:
        framing.include_grains(grains, np.full(len(grains), radius))
        for points, infinite in [*((wall, False) for wall in walls), *((plane, True) for plane in planes)]:
            framing.include_wall(points, infinite)
    box = framing.box()
    return box.low, box.high


def flown(grains, share, far=300.0):
    """The last of the grains gone far away upwards."""
    gone = grains.copy()
    count = max(1, round(share * len(grains)))
    gone[-count:, 2] += np.linspace(0.5 * far, far, count)
    return gone


def test_equipment_with_its_grains_is_framed_as_it_stands():
    low, high = box_of(bed(), bed(seed=1))
    np.testing.assert_array_equal([low, high], [DRUM.min(axis=0), DRUM.max(axis=0)])


@pytest.mark.parametrize("share", [0.0025, 0.05, 0.2])
def test_grains_that_fly_off_leave_the_picture(share):
    low, high = box_of(bed(), flown(bed(), share))
    np.testing.assert_array_equal([low, high], [DRUM.min(axis=0), DRUM.max(axis=0)])


def test_one_of_a_dozen_grains_that_flies_off_leaves_the_picture():
    low, high = box_of(bed(12), flown(bed(12), 0.08))
    np.testing.assert_array_equal([low, high], [DRUM.min(axis=0), DRUM.max(axis=0)])


def test_equipment_stays_in_sight_when_all_grains_fly_off():
    low, high = box_of(bed(), bed() + np.array([0, 0, 300.0]))
    assert (low <= DRUM.min(axis=0)).all()
    assert (high - low).max() < 3.5 * np.ptp(DRUM, axis=0).max()


def test_without_walls_all_grains_are_framed_but_for_what_flies_off():
    grains = bed()
    low, high = box_of(grains, walls=())
    np.testing.assert_allclose([low, high], [grains.min(axis=0) - 0.02, grains.max(axis=0) + 0.02])
    again = box_of(grains, flown(grains, 0.0025), walls=())
    np.testing.assert_allclose(again, [low, high], rtol=0, atol=0.05)


def test_few_grains_that_part_are_all_framed():
    low, high = box_of(np.zeros((2, 3)), np.array([[-5.0, 0, 0], [5.0, 0, 0]]), walls=())
    np.testing.assert_allclose([low[0], high[0]], [-5.02, 5.02])


def test_a_stream_that_leaves_its_pipe_is_in_the_picture():
    """A tenth of the grains, up to one length of the pipe before its mouth: still part of what is shown."""
    grains = bed()
    grains[:40, 0] = np.linspace(1.0, 2.9, 40)
    assert box_of(grains)[1][0] == pytest.approx(2.92)


def test_without_grains_or_walls_there_is_a_picture_all_the_same():
    np.testing.assert_array_equal(box_of(np.zeros((0, 3)), walls=()), [[-1.0] * 3, [1.0] * 3])
    plane = np.array([[-0.1, -0.1, 0.0], [0.1, 0.1, 0.0]])
    np.testing.assert_array_equal(box_of(np.zeros((0, 3)), walls=(), planes=(plane,)), plane)


def test_end_planes_of_a_drum_are_as_wide_as_the_drum():
    """In the files, too: what ParaView shows."""
    wall = {"material": "m"}
    data = {
        "materials": {"m": {"density": 2500, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "pairs": [{"materials": ["m", "m"], "restitution": 0.5, "friction": 0.4}],
        "walls": [
            {**wall, "name": "drum", "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.05, "length": 0.03}},
            {**wall, "name": "back", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
            {**wall, "name": "front", "plane": {"point": [0, 0, 0.03], "normal": [0, 0, -1]}},
        ],
        "grains": [{"material": "m", "radius": 1e-3, "positions": [[0, 0, 0.01]]}],
        "time": {"end": 1},
    }
    drawn = {mesh.name: mesh for mesh in drawings(scene_from_dict(data, source="a.toml").walls, {}, np.zeros((1, 3)))}
    for name in ("back", "front"):
        np.testing.assert_allclose(np.ptp(drawn[name].vertices[:, :2], axis=0), 0.1 * 1.04, rtol=1e-3)
