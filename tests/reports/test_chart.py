"""Charts: where curves are drawn, which rows are kept of many, ticks, gaps, and the numbers that a page's script reads."""

import json

import numpy as np
import pytest

from warpdem.reports.chart import (
    BOTTOM,
    HEIGHT,
    LEFT,
    POINTS,
    RIGHT,
    TOP,
    WIDTH,
    Chart,
    kept_rows,
    summary,
    ticks,
    widened,
)


def parts(chart):
    figure = chart.figure("c")
    return figure, [node.get("d") for node in figure.iter("path")], json.loads(figure[-1].text)


def test_a_curve_is_drawn_at_its_values():
    chart = Chart("t", "J", np.array([0.0, 1.0, 2.0]), {"a": np.array([-1.0, 0.0, 1.0])})
    figure, [path], data = parts(chart)
    points = np.array([pair.split() for pair in path[1:].split("L")], float)
    np.testing.assert_allclose(points[:, 0], [LEFT, (LEFT + WIDTH - RIGHT) / 2, WIDTH - RIGHT])
    top, bottom = TOP, HEIGHT - BOTTOM
    # the range is widened by 5 % of it at either end
    np.testing.assert_allclose(points[:, 1], bottom - (bottom - top) * np.array([0.1, 1.1, 2.1]) / 2.2, rtol=0, atol=0.06)
    assert data["x"] == [0, 1, 2] and data["curves"] == [["a", [-1, 0, 1]]]
    assert figure.find("figcaption")[0].text == "t" and figure.get("id") == "c"


def test_a_value_that_is_none_breaks_the_curve():
    _, [path], data = parts(Chart("t", "-", np.arange(4.0), {"a": np.array([1.0, np.nan, 2.0, np.inf])}))
    assert path.count("M") == 2 and "L" not in path
    assert data["curves"][0][1] == [1, None, 2, None]


@pytest.mark.parametrize("values", [[], [np.nan, np.nan], [3.0], [0.0, 0.0], [-2.0, -2.0], [1e300, -1e300], [5e-324, 0.0]])
def test_whatever_the_values_are_there_is_a_chart(values):
    _, [path], _ = parts(Chart("t", "J", np.arange(float(len(values))), {"a": np.array(values, float)}))
    assert "nan" not in path and "inf" not in path


def test_of_many_rows_the_peaks_are_kept():
    values = np.sin(np.arange(50_000) * 0.01)
    values[31_234], values[7] = 9.0, -8.0
    other = np.zeros(50_000)
    other[44_444] = 1.0
    rows = kept_rows([values, other])
    assert {0, 7, 31_234, 44_444, 49_999} <= set(rows) and len(rows) <= 2 * POINTS
    assert np.all(np.diff(rows) > 0)
    np.testing.assert_array_equal(kept_rows([values[:POINTS]]), np.arange(POINTS))


@pytest.mark.parametrize(
    ("low", "high", "most", "found"),
    [(0.0, 1.0, 5, [0, 0.2, 0.4, 0.6, 0.8, 1.0]), (-0.03, 0.004, 5, [-0.03, -0.02, -0.01, 0]), (3.0, 3.0, 5, [3.0]),
     (0.0, 1e6, 4, [0, 5e5, 1e6]), (17.0, 93.0, 8, [20, 30, 40, 50, 60, 70, 80, 90])],
)  # fmt: skip
def test_ticks_are_round(low, high, most, found):
    np.testing.assert_allclose(ticks(low, high, most), found, rtol=0, atol=1e-12)


def test_the_vertical_axis_shows_zero_where_it_is_near():
    assert widened(1.0, 10.0)[0] == 0.0 and widened(9.0, 10.0)[0] == pytest.approx(8.95)
    assert widened(-10.0, -1.0)[1] == 0.0
    low, high = widened(2.0, 2.0 + 1e-15)
    assert high - low > 0.5


def test_summaries():
    assert summary(np.array([np.nan, 1.0, 5.0])) == pytest.approx([np.nan, 1, 5, 3, 5], nan_ok=True)
    assert np.isnan(summary(np.array([np.nan]))).all()
