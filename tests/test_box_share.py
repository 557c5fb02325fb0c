"""Volumes of balls and shares of lines in a box: closed forms, slices, boxes side by side, boxes over periodic borders."""

import itertools

import numpy as np
import pytest

from warpdem.measure.ball_in_box import ball_in_box
from warpdem.measure.box_share import BoxShare

ALL = np.full(3, np.inf)
ROUND = (1.0, 0.0, 2.0)  # periodic along x and z


def unit_ball(low, high):
    return ball_in_box(np.zeros((1, 3)), np.ones(1), np.array(low, float), np.array(high, float))[0]


def by_slices(low, high, nodes=160):
    """Volume of a unit ball in a box, by Gauss's rule over x = sin t and over y in each slice."""
    x, weight = np.polynomial.legendre.leggauss(nodes)
    begin, end = np.arcsin(np.clip([low[0], high[0]], -1.0, 1.0))
    t = 0.5 * (begin + end) + 0.5 * (end - begin) * x
    r = np.cos(t)
    below, above = (np.arcsin(np.clip(side / r, -1.0, 1.0)) for side in (low[1], high[1]))
    u = 0.5 * (below + above)[:, None] + 0.5 * (above - below)[:, None] * x
    z = r[:, None] * np.cos(u)
    height = np.maximum(np.minimum(high[2], z) - np.maximum(low[2], -z), 0.0)
    areas = 0.5 * (above - below) * ((height * z) @ weight)
    return 0.5 * (end - begin) * float((areas * r) @ weight)


def cut_up(ends, rng, parts=4):
    """Boxes side by side that fill the space between two corners."""
    places = [np.sort(np.r_[a, rng.uniform(a, b, parts - 1), b]) for a, b in zip(*ends, strict=True)]
    for i in itertools.product(range(parts), repeat=3):
        yield [places[k][i[k]] for k in range(3)], [places[k][i[k] + 1] for k in range(3)]


@pytest.mark.parametrize(
    ("low", "high", "volume"),
    [
        ([-2, -2, -2], [2, 2, 2], 4 / 3 * np.pi),
        ([-1, -1, 0.3], ALL, np.pi / 3 * 0.7**2 * 2.3),  # a cap
        ([-1, -1, -0.3], ALL, 4 / 3 * np.pi - np.pi / 3 * 0.7**2 * 2.3),
        ([0, 0, 0], ALL, np.pi / 6),
        ([0, -1, 0], ALL, np.pi / 3),
        ([-1, 0.0, -0.2], [1, 1, 0.2], 0.5 * np.pi * (0.4 - 2 * 0.2**3 / 3)),  # half of a slice
        ([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5], 1.0),  # in the ball
        ([0.6, 0.6, 0.6], [2, 2, 2], 0.0),  # beyond it, inside its cube
        ([1, -1, -1], [2, 1, 1], 0.0),
    ],
)
def test_volumes_with_closed_forms(low, high, volume):
    assert unit_ball(low, high) == pytest.approx(volume, rel=1e-14, abs=1e-14)


def test_volumes_are_those_of_slices():
    rng = np.random.default_rng(0)
    for _ in range(60):
        low = rng.uniform(-1.2, 0.8, 3)
        high = low + rng.uniform(0.1, 2.0, 3)
        assert unit_ball(low, high) == pytest.approx(by_slices(low, high), abs=3e-6)


def test_boxes_side_by_side_hold_the_whole_ball_and_the_whole_line():
    rng = np.random.default_rng(1)
    centre, radius = rng.uniform(0.3, 0.7, (50, 3)), rng.uniform(0.05, 0.3, 50)
    end = centre + rng.uniform(-0.3, 0.3, (50, 3))
    volume, share = 0.0, np.zeros(50)
    for low, high in cut_up(([0] * 3, [1] * 3), rng):
        box = BoxShare(low, high, (0, 0, 0))
        volume += box.of_balls(centre, radius)
        share += box.of_lines(centre, end)
    assert volume == pytest.approx((4 / 3 * np.pi * radius**3).sum(), rel=1e-13)
    np.testing.assert_allclose(share, 1.0, rtol=1e-13)


def test_shares_of_lines_are_lengths_inside():
    box = BoxShare([0, 0, 0], [1, 2, 3], (0, 0, 0))
    start = [[-1, 1, 1], [0.5, 1, 1], [0.5, -1, 1], [0.5, 1, 4], [2, 2, 1], [0.25, 0.5, 0.75], [-1, 1, 1]]
    end = [[3, 1, 1], [1.5, 1, 1], [0.5, -3, 1], [0.5, 1, 0], [0, 0, 1], [0.5, 0.5, 0.5], [0.5, 4, 1]]
    found = box.of_lines(np.array(start, float), np.array(end, float))
    np.testing.assert_allclose(found, [0.25, 0.5, 0.0, 0.75, 0.5, 1.0, 0.0], rtol=0, atol=1e-15)


def test_a_line_in_a_face_counts_for_one_of_two_boxes():
    start, end = np.array([[0.2, 0.5, 0.5]]), np.array([[0.8, 0.5, 0.5]])
    lower, upper = BoxShare([0] * 3, [1, 0.5, 1], (0, 0, 0)), BoxShare([0, 0.5, 0], [1] * 3, (0, 0, 0))
    assert (lower.of_lines(start, end)[0], upper.of_lines(start, end)[0]) == (0.0, 1.0)
    assert (lower.holds(start)[0], upper.holds(start)[0]) == (False, True)


def test_boxes_over_periodic_borders_are_their_parts():
    """From -0.1 to 0.3 along x is 0.9 to 1 and 0 to 0.3; the images of the domain are all the same."""
    rng = np.random.default_rng(2)
    start = rng.uniform([0, -1, 0], [1, 1, 2], (200, 3))
    end, radius = start + rng.uniform(-0.3, 0.3, (200, 3)), rng.uniform(0.01, 0.12, 200)
    across = BoxShare([-0.1, -0.5, 1.6], [0.3, 0.5, 2.5], ROUND)
    far = BoxShare([6.9, -0.5, -6.4], [7.3, 0.5, -5.5], ROUND)
    parts = [
        BoxShare([x[0], -0.5, z[0]], [x[1], 0.5, z[1]], ROUND) for x in ((0, 0.3), (0.9, 1.0)) for z in ((0, 0.5), (1.6, 2.0))
    ]
    assert across.volume == pytest.approx(sum(part.volume for part in parts), rel=1e-14)
    for box in (across, far):
        np.testing.assert_array_equal(box.holds(start), np.sum([part.holds(start) for part in parts], axis=0))
        np.testing.assert_allclose(
            box.of_lines(start, end), sum(part.of_lines(start, end) for part in parts), rtol=0, atol=1e-13
        )
        whole = sum(part.of_balls(start, radius) for part in parts)
        assert box.of_balls(start, radius) == pytest.approx(whole, rel=1e-12)
    assert across.of_lines(start, end).sum() > 5


@pytest.mark.parametrize("longer", [0.0, 0.7])
def test_a_box_of_a_period_or_more_holds_everything_once(longer):
    rng = np.random.default_rng(3)
    start = rng.uniform([0, -1, 0], [1, 1, 2], (100, 3))
    box = BoxShare([0.3 - longer, -3, 0.1], [1.3 + longer, 3, 2.1 + longer], ROUND)
    assert box.volume == pytest.approx(12.0)
    assert box.holds(start).all()
    np.testing.assert_array_equal(box.of_lines(start, start + 0.2), 1.0)
    assert box.of_balls(start, np.full(100, 0.1)) == pytest.approx(100 * 4 / 3 * np.pi * 1e-3, rel=1e-13)
