"""Response surfaces: polynomials come out exactly, scatter and errors as they are, and boxes are as wide as the runs allow."""

import numpy as np
import pytest

from warpdem.calibration.surface import Box, fit, terms

WHOLE = Box(np.full(2, 0.5), np.full(2, 0.5))


def points(count, seed=0):
    return np.random.default_rng(seed).random((count, 2))


def test_a_quadratic_comes_out_exactly():
    x = points(12)
    one = fit(x, 1 + 2 * x[:, 0] - x[:, 1] + 3 * x[:, 0] * x[:, 1] - 0.5 * x[:, 1] ** 2, WHOLE)
    at = np.array([0.3, 0.8])
    assert one.value(at) == pytest.approx(1 + 0.6 - 0.8 + 0.72 - 0.32, rel=1e-10)
    np.testing.assert_allclose(one.slope(at), [2 + 2.4, -1 + 0.9 - 0.8], rtol=1e-9)
    assert one.scatter < 1e-10 and one.freedom == 12 - 6


def test_its_error_is_that_of_many_fits():
    x, at = points(20), np.array([0.4, 0.6])
    random = np.random.default_rng(1)
    made = [fit(x, x[:, 0] + 0.1 * random.standard_normal(20), WHOLE) for _ in range(400)]
    spread = np.std([one.value(at) for one in made])
    expected = np.sqrt(np.mean([one.variance(at) for one in made]))
    assert spread == pytest.approx(expected, rel=0.12)  # a deviation of 400 is known within 4 %: three of them
    assert np.sqrt(np.mean([one.scatter**2 for one in made])) == pytest.approx(0.1, rel=0.05)


def test_a_narrow_box_leaves_out_what_no_polynomial_follows():
    x = np.random.default_rng(2).random((60, 1))
    y = np.exp(6 * x[:, 0])
    small = Box(np.array([0.3]), np.array([0.1]))
    near, far = fit(x, y, small), fit(x, y, Box(np.array([0.5]), np.array([0.5])))
    at = np.array([0.3])
    assert abs(near.value(at) / np.exp(1.8) - 1) < 0.02 < abs(far.value(at) / np.exp(1.8) - 1)
    assert (near.box.half < 0.4).all()


def test_a_narrow_box_takes_all_runs_where_a_polynomial_follows_them():
    x = points(40)
    one = fit(x, x[:, 0] + 0.1 * np.random.default_rng(3).standard_normal(40), Box(np.full(2, 0.5), np.full(2, 0.1)))
    assert (one.box.half > 0.3).all()


@pytest.mark.parametrize("count", [0, 5])
def test_too_few_runs_give_none(count):
    assert fit(points(count), np.zeros(count), WHOLE) is None


def test_few_runs_give_a_plane_and_what_has_no_number_is_left_out():
    x = points(8)
    y = 1 + x @ [2.0, 3.0]
    y[3] = np.nan
    one = fit(x, y, WHOLE)
    assert not one.quadratic and len(one.coefficients) == terms(2, False)
    np.testing.assert_allclose(one.slope(np.full(2, 0.5)), [2, 3], rtol=1e-9)


def test_runs_on_a_line_do_not_tell_a_plane():
    x = np.linspace(0, 1, 30)[:, None] * [1.0, 1.0]
    assert fit(x, x[:, 0], WHOLE) is None
