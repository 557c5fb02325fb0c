"""Richardson's rule: the order and the limit of a known error come out, and chance is not taken for an error of the step."""

import math

import pytest

from warpdem.runs.step_error import chosen_step, runs_needed, step_error

STEPS = (4e-5, 2e-5, 1e-5)


def values(order, c=0.3, limit=2.0):
    return [limit + c * (step / STEPS[0]) ** order for step in STEPS]


@pytest.mark.parametrize("order", [1.0, 2.0, 0.7])
@pytest.mark.parametrize("c", [0.3, -0.3])
def test_order_limit_and_error_of_a_power(order, c):
    found = step_error(STEPS, values(order, c), None)
    assert found.known and found.order == pytest.approx(order)
    assert found.limit == pytest.approx(2.0)
    for step in STEPS:
        assert found.error(step) == pytest.approx(0.3 * (step / STEPS[0]) ** order)
    step = chosen_step(found, 0.02)
    assert 0.85 * 0.02 < 0.3 * (step / STEPS[0]) ** order <= 0.02
    assert chosen_step(found, 0.31) == STEPS[0]


def test_differences_that_grow_or_change_sign_give_no_order_but_an_error():
    for three in ([1.0, 1.1, 1.3], [1.0, 1.1, 1.05]):
        found = step_error(STEPS, three, 1e-3)
        assert not found.known and found.order == 1.0 and not found.chance
        assert found.error(STEPS[0]) >= 2.0 * abs(three[0] - three[1])
    assert step_error(STEPS, [1.0, 1.1, 1.3], None).error(STEPS[0]) == pytest.approx(0.8)  # the larger one counts


def test_differences_within_the_scatter_of_twins_are_chance():
    found = step_error(STEPS, [1.0, 1.02, 0.99], 0.02)
    assert found.chance and found.limit == pytest.approx(1.00333, abs=1e-5)
    assert found.error(1e-9) == found.error(STEPS[0]) == pytest.approx(2 * math.sqrt(2) * 0.02)
    assert chosen_step(found, 1e-9) == STEPS[0]  # a smaller one would not help
    assert not step_error(STEPS, [1.0, 1.2, 0.99], 0.02).chance
    assert runs_needed(0.02, 0.01) == 16 and runs_needed(1e-9, 1.0) == 1


def test_of_more_steps_the_finest_that_are_no_chance_tell_the_order():
    steps = tuple(4e-5 * 0.5**k for k in range(6))
    exact = [2.0 + 0.3 * (step / steps[0]) ** 2 for step in steps]
    noisy = [value + 2e-3 * (-1) ** k * (k > 2) for k, value in enumerate(exact)]  # differences below 0.017 are chance
    found = step_error(steps, noisy, 6e-3)
    assert found.known and found.last_resolved == 1 and found.order == pytest.approx(2.0) and found.limit == pytest.approx(2.0)
    assert found.error(steps[0]) == pytest.approx(0.3)
    assert step_error(steps, exact, None).last_resolved == 4


def test_values_that_do_not_differ_have_no_error():
    found = step_error(STEPS, [3.0, 3.0, 3.0], None)
    assert found.error(STEPS[0]) == 0.0 and found.limit == 3.0
