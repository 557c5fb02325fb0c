import numpy as np
import pytest
import warp as wp
from warpdem.kernels.step import border

PERIOD, LOWER = (2.0, 0.0, 3.0), (-1.0, 0.0, 0.5)


@pytest.fixture(scope="module")
def made():
    return border.build(PERIOD, LOWER)


@pytest.mark.parametrize(
    ("difference", "expected"),
    [
        ((0.9, 1.4, 1.4), (0.9, 1.4, 1.4)),
        ((1.1, 9.0, 1.6), (-0.9, 9.0, -1.4)),  # y is not periodic
        ((-1.1, -9.0, -1.6), (0.9, -9.0, 1.4)),
        ((-0.9, 0.0, -1.4), (-0.9, 0.0, -1.4)),
    ],
)
def test_the_nearest_image_is_the_shortest_difference(made, difference, expected):
    np.testing.assert_allclose(np.array(made.nearest(wp.vec3d(*difference))), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((-1.0, 5.0, 0.5), (-1.0, 5.0, 0.5)),  # the lower border belongs to the domain
        ((1.0, 5.0, 3.5), (-1.0, 5.0, 0.5)),  # the upper one is the lower one
        ((-1.5, 5.0, 0.25), (0.5, 5.0, 3.25)),
        ((1.5, -5.0, 3.75), (-0.5, -5.0, 0.75)),
        ((0.9, 0.0, 3.4), (0.9, 0.0, 3.4)),
    ],
)
def test_a_place_is_wrapped_into_the_domain(made, place, expected):
    np.testing.assert_allclose(np.array(made.wrapped(wp.vec3d(*place))), expected, rtol=0, atol=1e-15)


def test_images_are_the_place_shifted_by_whole_periods(made):
    found = {tuple(np.round(np.array(made.image(wp.vec3d(0.1, 0.2, 0.7), k)), 12)) for k in range(made.images)}
    shifts = [(x, 0.0, z) for x in (0.0, 2.0, -2.0) for z in (0.0, 3.0, -3.0)]
    assert found == {(round(0.1 + x, 12), 0.2, round(0.7 + z, 12)) for x, _, z in shifts}
    assert np.array(made.image(wp.vec3d(0.1, 0.2, 0.7), 0)).tolist() == [0.1, 0.2, 0.7]


@pytest.mark.parametrize(
    ("place", "within"),
    [((-1.09, 99.0, 3.59), True), ((-1.11, 0.0, 2.0), False), ((1.09, 0.0, 0.41), True), ((0.0, 0.0, 0.39), False)],
)
def test_a_place_is_within_reach_of_the_domain(made, place, within):
    assert bool(made.within(wp.vec3d(*place), wp.float64(0.1))) is within
