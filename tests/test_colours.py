"""Ranges of scale bars: of all frames together, without what single grains do; and colours of what is no number."""

import numpy as np
import pytest

from warpdem.drawing.colours import Field, Scale


def scale(*frames, name="speed", array="v", component="", given=None):
    made = Scale(Field(name, array, component), None, given)
    for values in frames:
        made.include(np.array(values))
    return made


def speeds(count=400, seed=0):
    return np.random.default_rng(seed).uniform(0.0, 1.0, count)


@pytest.mark.parametrize("count", [20, 50, 400, 20000])
def test_one_fast_grain_does_not_set_the_range_of_a_film(count):
    frames = [speeds(count, seed) for seed in range(8)]
    for values in frames:
        values[3] = 300.0
    made = scale(*frames)
    assert made.limits[0] == 0.0
    assert 0.9 <= made.limits[1] <= 1.0
    assert made.beyond == "max"


def test_a_frame_of_fast_grains_counts_as_its_share():
    """One of 200 frames, in which all grains are thrown about, is half a percent of what is shown."""
    made = scale(*[speeds(100, seed) for seed in range(200)], 50.0 * speeds(100))
    assert made.limits[1] == pytest.approx(1.0, abs=0.05)
    assert scale(*[speeds(100, seed) for seed in range(9)], 50.0 * speeds(100)).limits[1] > 40.0


def test_ends_that_lie_near_the_others_are_in_the_range():
    values = speeds()
    values[0] = 1.3
    made = scale(values)
    assert made.limits == (0.0, 1.3)
    assert made.beyond == "neither"


def test_all_values_of_few_grains_count():
    made = scale([0.1, 0.2, 30.0], [0.1, 0.2, 40.0])
    assert made.limits == (0.0, 40.0)
    assert made.beyond == "neither"


@pytest.mark.parametrize(
    ("values", "wanted"),
    [
        (np.full(500, 0.25), (0.0, 0.25)),
        (np.zeros(500), (0.0, 1.0)),
        (np.full(500, -3.0), (-3.0, 0.0)),
        ([], (0.0, 1.0)),
        (np.full(30, np.nan), (0.0, 1.0)),
        (np.r_[np.zeros(5000), [4.0, 5.0]], (0.0, 5.0)),  # a wall that bears load on two triangles
        (np.full(50, 5e-324), (0.0, 5e-324)),
    ],
)
def test_ranges_of_plain_values(values, wanted):
    made = scale(values)
    assert made.limits == wanted
    assert made.beyond == "neither"


def test_huge_ranges_and_no_numbers_have_colours():
    made = scale(np.r_[1e-300, 1e300, np.nan, np.inf, -np.inf, np.zeros(100)])
    assert np.isfinite(made.limits).all()
    colours = made.colours(np.array([0.0, 1e300, np.nan]))
    assert colours[0].tolist() != colours[1].tolist()
    assert colours[2].tolist() == [107, 111, 115]


def test_a_given_range_stays_and_sizes_keep_their_ends():
    assert scale(speeds(), given=(0.2, 0.4)).limits == (0.2, 0.4)
    assert scale(speeds(), given=(0.2, 0.4)).beyond == "both"
    radii = np.r_[np.full(1000, 1e-3), 9e-3]
    assert scale(radii, name="size", array="radius").limits[1] == pytest.approx(9e-3)


def test_components_have_the_same_reach_both_ways():
    values = speeds() - 0.5
    values[0] = -80.0
    low, high = scale(values, name="v.x", component="x").limits
    assert low == -high
    assert 0.45 < high < 0.55
