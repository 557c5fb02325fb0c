"""Volumes of balls and shares of lines in spheres and cylinders: closed forms, random points, halves that add up."""

import numpy as np
import pytest

from warpdem.measure.ball_in_box import ball_in_box
from warpdem.measure.round_share import RoundShare
from warpdem.scene.regions import CylinderRegion, SphereRegion

NONE = (0.0, 0.0, 0.0)
BALL = 4.0 / 3.0 * np.pi


def sphere(radius=2.0, centre=(0.1, 0.2, 0.3)):
    return SphereRegion(centre=centre, radius=radius)


def cylinder(radius=2.0, length=3.0, axis=(1, 2, 2), point=(0.1, 0.2, 0.3)):
    return CylinderRegion(point=point, axis=axis, radius=radius, length=length)


def of_one(shape, place, radius=1.0, period=NONE):
    return RoundShare(shape, period).of_balls(np.array([place], float), np.array([radius]))


def test_balls_in_a_sphere():
    """Inside, around it, beside it, and the lens of two unit spheres one apart: 5 pi/12."""
    unit = sphere(1.0, (0, 0, 0))
    for place, radius, volume in (
        ((0.2, 0, 0), 0.5, BALL / 8), ((0.2, 0, 0), 3.0, BALL), ((2.1, 0, 0), 1.0, 0.0), ((0, 0.6, 0.8), 1.0, 5 * np.pi / 12),
    ):  # fmt: skip
        assert of_one(unit, place, radius) == pytest.approx(volume, rel=1e-14, abs=1e-14)


def test_balls_in_a_cylinder():
    """Inside; caps at an end; a half where the wall is flat; around a thin one: pi s^2 h + 2 caps (napkin ring)."""
    wide = cylinder(1e5, 3.0, (0, 0, 1), (0, 0, 0))
    assert of_one(cylinder(), np.array([0.1, 0.2, 0.3]) + np.array([1, 2, 2]) / 2) == pytest.approx(BALL, rel=1e-9)
    assert of_one(wide, (0, 0, -0.3)) == pytest.approx(np.pi / 3 * 0.7**2 * 2.3, rel=1e-9)
    assert of_one(wide, (1e5, 0, 1.5)) == pytest.approx(BALL / 2, rel=1e-4)
    ring = 2.0 * np.sqrt(1.0 - 0.6**2)  # what a bore of 0.6 leaves: pi ring^3 / 6
    assert of_one(cylinder(0.6, 9.0, (0, 0, 1), (0, 0, -4)), (0, 0, 0)) == pytest.approx(BALL - np.pi / 6 * ring**3, rel=1e-9)
    assert of_one(cylinder(0.3, 9.0, (0, 0, 1), (0, 0, -4)), (1.4, 0, 0)) == 0.0


def test_balls_cut_by_side_and_end_add_up():
    """A cylinder cut in two holds as much, and one in a tall box as the ball less what is beyond its side, by random points."""
    rng = np.random.default_rng(0)
    places, radii = rng.uniform(-3, 3, (200, 3)), rng.uniform(0.1, 1.5, 200)
    axis = np.array([1, 2, 2]) / 3
    whole = RoundShare(cylinder(), NONE).of_balls(places, radii)
    parts = [cylinder(length=1.2), cylinder(length=1.8, point=tuple(np.array([0.1, 0.2, 0.3]) + 1.2 * axis))]
    assert sum(RoundShare(part, NONE).of_balls(places, radii) for part in parts) == pytest.approx(whole, rel=1e-9)
    points = rng.uniform(-1, 1, (400_000, 3))
    points = points[(points**2).sum(axis=1) <= 1.0]
    for place in ([1.7, 0.5, 1.0], [0.3, 1.5, -0.5]):
        share = cylinder().holds(points + place).mean()
        assert 0.05 < share < 0.95
        assert of_one(cylinder(), place) / BALL == pytest.approx(share, abs=4e-3)
    # a wide cylinder is as flat as a box
    box = ball_in_box(places[:1], radii[:1], np.array([-np.inf, -np.inf, -np.inf]), np.array([np.inf, np.inf, 0.0]))
    flat = cylinder(1e4, 1e4, (0, 0, -1), (0, 0, 0))
    assert of_one(flat, places[0], radii[0]) == pytest.approx(box[0], rel=1e-9)


@pytest.mark.parametrize("shape", [sphere(), cylinder()], ids=["sphere", "cylinder"])
def test_shares_of_lines_are_those_of_their_points(shape):
    rng = np.random.default_rng(1)
    start, end = rng.uniform(-4, 4, (2, 100, 3))
    t = (np.arange(4000) + 0.5) / 4000
    share = [shape.holds(a + t[:, None] * (b - a)).mean() for a, b in zip(start, end, strict=True)]
    assert np.count_nonzero(share) > 20
    np.testing.assert_allclose(RoundShare(shape, NONE).of_lines(start, end), share, rtol=0, atol=6e-4)


def test_lines_along_and_beside_an_axis():
    tube = cylinder(1.0, 2.0, (0, 0, 1), (0, 0, 0))
    start = np.array([[0.5, 0, -1], [1.5, 0, -1], [-2, 0, 1], [-2, 0, 3], [0, 0, 1]], float)
    end = np.array([[0.5, 0, 3], [1.5, 0, 3], [2, 0, 1], [2, 0, 3], [0, 0, 1]], float)
    np.testing.assert_allclose(RoundShare(tube, NONE).of_lines(start, end), [0.5, 0, 0.5, 0, 1], rtol=0, atol=1e-15)


def test_images_come_round_a_border():
    """A sphere over the border holds what is at the other end."""
    shape, period = sphere(1.0, (0.2, 0, 0)), (10.0, 0.0, 0.0)
    assert of_one(shape, (9.9, 0, 0), 0.3, period) == pytest.approx(BALL * 0.027, rel=1e-12)
    share = RoundShare(shape, period).of_lines(np.array([[9.0, 0, 0]]), np.array([[11.0, 0, 0]]))
    assert share == pytest.approx((11.0 - 9.2) / 2.0, rel=1e-12)
