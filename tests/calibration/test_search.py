"""The search on responses that are known: it comes to the values within its own errors, and says what targets do not tell."""

import numpy as np
import pytest

from warpdem.calibration.estimate import Goal
from warpdem.calibration.search import NoFit, Request, search


def responses(x):
    return np.stack([np.tanh(2 * x[:, 0]) + 0.3 * x[:, 1], 0.5 * x[:, 1] ** 2 + 0.6 * x[:, 1] - 0.4 * x[:, 0]], axis=1)


def product(x):
    both = (0.2 + x[:, 0]) * (0.2 + x[:, 1])
    return np.stack([both, both**2], axis=1)


def trial(respond, seed, scatter=0.02, uncertainty=0.02):
    """A true value, and what is found from targets that are off it by chance."""
    random = np.random.default_rng([7, seed])
    true = random.uniform(0.15, 0.85, 2)
    targets = respond(true[None])[0] + uncertainty * random.standard_normal(2)
    goal = Goal(targets, np.full(2, uncertainty), 0.95, seed)
    request = Request(2, goal, Request(2, goal, 0, 1).default_runs, 1)
    return true, search(request, lambda x: respond(x) + scatter * random.standard_normal((len(x), 2)))


def test_it_comes_to_the_values_within_its_own_errors():
    """Five trials of two parameters, whose seeds are fixed: of their intervals of 95 % one may miss."""
    away, held, said = [], 0, []
    for seed in range(5):
        true, found = trial(responses, seed)
        held += int(((found.intervals[:, 0] <= true) & (true <= found.intervals[:, 1])).sum())
        away.append(found.estimate.best - true)
        said.append(found.estimate.error)
    assert held >= 9
    assert np.median(np.abs(away)) < np.median(said) < 0.04


def test_more_certain_targets_and_less_scatter_make_errors_smaller():
    errors = [trial(responses, 1, scatter, uncertainty)[1].estimate.error.max()
              for scatter, uncertainty in ((0.02, 0.02), (0.02, 0.005), (0.002, 0.002))]  # fmt: skip
    assert errors[0] > 1.5 * errors[1] > 2 * errors[2]


def test_what_the_targets_do_not_tell_is_found():
    """A product: one falls as the other rises, in shares of their ranges as the slopes of the product ask."""
    true, found = trial(product, 3)
    [unknown] = found.estimate.unknown
    x = found.estimate.best + 0.2
    expected = np.array([x[0], -x[1]]) / np.hypot(*x)
    assert abs(unknown @ expected) / np.linalg.norm(unknown) > 0.97
    assert (np.diff(found.intervals, axis=1) > 0.2).all()
    assert product(found.estimate.best[None])[0] == pytest.approx(found.estimate.values, abs=0.05)


def test_the_same_results_take_the_same_course():
    first, second = (trial(responses, 2)[1] for _ in range(2))
    np.testing.assert_array_equal(first.x, second.x)
    np.testing.assert_array_equal(first.intervals, second.intervals)


def test_runs_end_with_the_budget_and_the_last_are_at_the_best_values():
    goal = Goal(np.array([0.5]), np.array([0.001]), 0.95, 0)
    found = search(Request(1, goal, 14, 1), lambda x: np.sin(3 * x) + 0.01 * np.cos(70 * x))
    assert len(found.x) <= 14
    assert len(np.unique(found.x[-found.rounds[-1] :])) == 1


def test_where_nothing_is_left_to_chance_runs_end_early():
    goal = Goal(np.array([0.5]), np.array([0.01]), 0.95, 0)
    found = search(Request(1, goal, 100, 1, chance=False), lambda x: x**2)
    assert found.estimate.best == pytest.approx(np.sqrt(0.5), abs=1e-3)
    assert len(found.x) < 30 and found.rounds[-1] == 1


def test_runs_without_a_measure_are_left_out_and_too_many_are_told():
    goal = Goal(np.array([0.3]), np.array([0.01]), 0.95, 0)
    found = search(Request(1, goal, 30, 1), lambda x: np.where(x > 0.8, np.nan, x))
    assert found.estimate.best == pytest.approx(0.3, abs=0.01)
    with pytest.raises(NoFit, match="target 1: 0 of 6 runs have its measure"):
        search(Request(1, goal, 30, 1), lambda x: np.full(x.shape, np.nan))
