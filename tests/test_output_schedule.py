"""When frames and rows are due: at the steps they always were, each frame with its row, as many as are foretold."""

import math
from fractions import Fraction

import numpy as np
import pytest

from warpdem.core.output_schedule import OutputSchedule

CASES = [
    # interval [s], of rows [s], step [s]
    (0.01, None, 1e-3),  # 10 steps a frame do not divide by 4
    (0.02, None, 8.3719e-6),
    (0.02, 0.005, 7.77e-6),
    (0.02, 0.02 / 3, 7.77e-6),
    (0.02, 0.02, 7.77e-6),
    (0.02, 0.06, 7.77e-6),
    (0.02, 0.003, 7.77e-6),
    (0.02, 0.05, 7.77e-6),
    (0.01, 1e-4, 9e-4),  # more rows than steps
    (1e-5, 1.0, 9e-4),
]


def due(cadence, steps):
    """Steps at which frames and rows are due, from one to the next as a run goes."""
    frames, rows, step = [0], [0], 0
    while (step := cadence.next(step)) < steps:
        frames += [step] if cadence.is_frame(step) else []
        rows += [step] if cadence.is_row(step) else []
        assert cadence.is_frame(step) or cadence.is_row(step)
    return [*frames, steps], [*rows, steps]


@pytest.mark.parametrize(("interval", "history", "dt"), CASES)
@pytest.mark.parametrize("steps", [1, 7, 5000, 12345])
def test_every_frame_has_its_row_and_all_are_foretold(interval, history, dt, steps):
    cadence = OutputSchedule.of(interval, history, dt)
    frames, rows = due(cadence, steps)
    assert frames == [*range(0, steps, max(1, round(interval / dt))), steps]
    assert set(frames) <= set(rows)
    assert (len(frames), len(rows)) == (cadence.frames(steps), cadence.rows(steps))
    assert rows == [0, *(step for step in range(1, steps) if cadence.is_row(step)), steps]


@pytest.mark.parametrize("share", [1, 2, 3, 4, 7, 100])
def test_rows_divide_the_frames_evenly(share):
    """The interval of rows is written in decimals, as in a scene file."""
    interval = 0.02
    cadence = OutputSchedule.of(interval, float(f"{interval / share:.9g}"), 7.77e-6)
    every = round(interval / 7.77e-6)
    _, rows = due(cadence, 20 * every)
    assert len(rows) == 20 * share + 1
    np.testing.assert_array_equal(rows[::share], every * np.arange(21))
    assert np.abs(np.diff(rows) - every / share).max() < 1.0


def test_a_rate_of_rows_of_its_own_is_kept():
    cadence = OutputSchedule.of(0.02, 0.003, 1e-5)
    assert cadence == OutputSchedule(2000, Fraction(300))
    _, rows = due(cadence, 6000)
    assert sorted({*range(0, 6001, 300), *range(0, 6001, 2000)}) == rows
    assert cadence.rows(6000) == len(rows) == 21 + 2  # they meet at 0 and 6000
    assert math.lcm(300, 2000) == 6000


def test_rows_rarer_than_frames_are_rows_at_frames():
    assert OutputSchedule.of(0.02, 0.06, 7.77e-6) == OutputSchedule(2574, Fraction(2574))
