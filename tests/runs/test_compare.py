"""Two histories compared: probabilities against SciPy, verdicts against curves made up, windows, rows at other times."""

import numpy as np
import pytest
from scipy import stats

from warpdem import WarpdemError
from warpdem.runs import History
from warpdem.runs.compare import compare, difference, holm, mean_in_time, student_tail

TIME = np.linspace(0.0, 2.0, 201)


def history(x, time=TIME, **more):
    return History("h", {"time [s]": time, "x [m]": np.asarray(x, float), **more})


def noisy(seed, shift=0.0):
    """A level curve with noise, at another level for each seed."""
    random = np.random.default_rng(seed)
    return history(10.0 + shift + 0.1 * random.standard_normal() + 0.3 * random.standard_normal(len(TIME)))


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 30])
@pytest.mark.parametrize("t", [0.0, 0.3, -1.0, 2.5, 40.0])
def test_student_tail(freedom, t):
    assert student_tail(t, freedom) == pytest.approx(2.0 * stats.t.sf(abs(t), freedom), rel=1e-9, abs=1e-15)


def test_holm():
    assert holm([0.01, None, 0.04, 0.03]) == [0.03, None, 0.06, 0.06]
    assert holm([0.9, 0.8]) == [1.0, 1.0] and holm([]) == []


def test_means_in_time_are_of_the_curve_not_of_the_rows():
    time = np.array([0.0, 1.0, 3.0])
    assert mean_in_time(np.array([0.0, 2.0, 2.0]), time) == pytest.approx((1.0 + 4.0) / 3.0)


def test_t_and_p_are_those_of_a_new_value_beside_a_sample():
    """Against the two-sample t-test with one value in the second sample."""
    a = np.outer([1.0, 1.2, 0.9, 1.1], np.ones(5))
    found = difference("x", a, np.full(5, 1.7), np.arange(5.0))
    t, p = stats.ttest_ind([1.7], [1.0, 1.2, 0.9, 1.1])
    assert (found.t, found.p) == (pytest.approx(t), pytest.approx(p))
    assert (found.first, found.second) == (pytest.approx(1.05), pytest.approx(1.7))
    assert found.scatter == pytest.approx(np.std([1.0, 1.2, 0.9, 1.1], ddof=1))


def test_equal_runs_are_told_to_differ_no_more_often_than_said():
    wrong = [
        compare(noisy(10 * k), noisy(10 * k + 9), [noisy(10 * k + j) for j in (1, 2, 3, 4)]).verdict for k in range(1, 301)
    ]
    assert wrong.count("differs") <= 9  # 3 expected at 1 %; more than 9 in 1 of 900


def test_another_level_and_another_course_differ():
    twins = [noisy(k) for k in (1, 2, 3, 4)]
    found = compare(noisy(0), noisy(5, shift=2.0), twins)
    assert found.verdict == "differs" and found.differences[0].p < 0.01
    # the mean is the same, the course is not
    wave = history(noisy(5)["x"] + 4.0 * np.sin(np.pi * TIME))
    [one] = compare(noisy(0), wave, twins).differences
    assert one.p > 0.01 and one.curve > 3.0 * one.twins and one.verdict == "differs"


def test_without_twins_nothing_is_known_but_that_equal_is_equal():
    assert compare(noisy(0), noisy(1)).verdict == "unknown"
    assert compare(noisy(0), noisy(0)).verdict == "same"


def test_what_does_not_scatter_differs_if_it_is_another():
    level = history(np.full(201, 5.0))
    assert compare(level, level, [level, level]).verdict == "same"
    [one] = compare(level, history(np.full(201, 5.0001)), [level, level]).differences
    assert one.verdict == "differs" and one.t == np.inf and one.p == 0.0


def test_rows_at_other_times_and_windows():
    fine, coarse = history(2.0 * TIME), history(2.0 * TIME[::20], TIME[::20])
    found = compare(fine, coarse, start=0.5, end=1.5)
    assert found.verdict == "same" and (found.time[0], found.time[-1]) == (0.5, 1.5)
    assert found.differences[0].first == pytest.approx(2.0)
    shorter = history(2.0 * TIME[:101], TIME[:101])
    assert compare(fine, shorter).time[-1] == 1.0
    with pytest.raises(WarpdemError, match="0 rows from 3 to 2 s, at least 3 are needed"):
        compare(fine, coarse, start=3.0)


def test_columns_of_one_run_alone_are_named_and_angles_of_the_frame_left_out():
    one = history(TIME, **{"a [J]": TIME, "frame_angle [rad]": TIME})
    other = history(TIME, **{"b [J]": TIME, "frame_angle [rad]": 2.0 * TIME})
    found = compare(one, other)
    assert [d.column for d in found.differences] == ["x [m]"]
    assert (found.only_first, found.only_second) == (["a [J]"], ["b [J]"])
    assert compare(one, other, columns=["frame_angle"]).differences[0].column == "frame_angle [rad]"
    with pytest.raises(WarpdemError, match="has no column 'a "):
        compare(one, other, columns=["a"])


def test_what_decided_is_told():
    twins = [noisy(k) for k in (1, 2, 3, 4)]
    wave = history(noisy(5)["x"] + 4.0 * np.sin(np.pi * TIME))
    [one] = compare(noisy(0), wave, twins).differences
    assert one.reasons == [f"curve > {3.0 * max(one.twins, 1.0):.3g}"]
    [one] = compare(noisy(0), noisy(5, shift=2.0), twins).differences
    assert one.reasons[0] == "p < 0.01"
    [one] = compare(noisy(0), noisy(9), twins).differences
    assert one.verdict == "same" and one.reasons == []


def test_rows_in_which_a_run_has_no_number_do_not_count():
    twins = [noisy(k) for k in (1, 2, 3, 4)]

    def from_half(one):
        return history(np.where(TIME < 1.0, np.nan, one["x"]))

    late = TIME >= 1.0
    found = compare(from_half(noisy(0)), noisy(5, shift=2.0), twins)
    assert found.verdict == "differs"
    assert found.differences[0].second == pytest.approx(mean_in_time(noisy(5, shift=2.0)["x"][late], TIME[late]))
    assert compare(from_half(noisy(0)), from_half(noisy(9)), twins).verdict == "same"
    [none] = compare(noisy(0), history(np.full(len(TIME), np.nan)), twins).differences
    assert none.verdict == "unknown" and none.p is None
