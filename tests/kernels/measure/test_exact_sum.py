"""Exact sums: what ``math.fsum`` gives, whoever adds which number, and a count of what is no number."""

import math

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.measure import readings
from warpdem.kernels.measure.exact_sum import WIDTH


def total(numbers, rows: int = 3, device: str = "cpu") -> float:
    """Sum of ``numbers``, a part of them added to each of so many rows."""
    values = wp.array(np.array(numbers, dtype=float).reshape(-1, 1), dtype=wp.float64, device=device)
    sums = wp.zeros((rows, 1, WIDTH), dtype=wp.int64, device=device)
    nothing, out = wp.zeros((0, 0), dtype=wp.float64, device=device), wp.zeros(1, dtype=wp.float64, device=device)
    for row in range(rows):
        first, last = len(values) * row // rows, len(values) * (row + 1) // rows
        if last > first:
            inputs = [first, row, 1, values, nothing, 0, sums]
            wp.launch(readings.column_sums, last - first, inputs=inputs, device=device)
    parts = wp.zeros((2, 1, WIDTH), dtype=wp.int64, device=device)  # as of two processes, the rows of which are added up
    for part in range(2):
        joined = [part * (rows // 2), rows // 2 if part == 0 else rows - rows // 2]
        wp.launch(readings.joined_sums, 1, inputs=[joined[1], sums[joined[0] :], parts[part]], device=device)
    wp.launch(readings.rounded_sums, 1, inputs=[2, parts, out], device=device)
    assert not sums.numpy().any(), "the sums must be zero for those who come next"
    return float(out.numpy()[0])


@pytest.mark.parametrize("seed", range(30))
def test_a_sum_is_that_of_fsum(device, seed):
    """Numbers of one size, of all sizes, that nearly cancel, and subnormal ones."""
    rng = np.random.default_rng(seed)
    for kind in range(4):
        n = int(rng.integers(1, 60))
        numbers = rng.normal(size=n)
        if kind == 1:
            numbers *= 10.0 ** rng.integers(-300, 300, n)
        if kind == 2:
            numbers = np.concatenate([numbers, -numbers[::-1] * (1.0 + 1e-15)])
        if kind == 3:
            numbers *= 1e-310
        assert total(numbers, device=device) == math.fsum(numbers), kind


def test_neither_order_nor_rows_change_a_bit(device):
    rng = np.random.default_rng(3)
    numbers = rng.normal(size=5000) * 10.0 ** rng.integers(-8, 8, 5000)
    found = {total(rng.permutation(numbers), rows, device) for rows in (1, 2, 7, 64)}
    assert found == {math.fsum(numbers)}
    assert len({np.sum(rng.permutation(numbers)) for _ in range(20)}) > 1, "else this proves nothing"


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ([1.0, 2.0**-53], 1.0),  # in the middle: to even
        ([1.0 + 2.0**-52, 2.0**-53], 1.0 + 2.0**-51),
        ([1.0, 2.0**-53, 2.0**-1000], 1.0 + 2.0**-52),  # above it, by a digit far below
        ([1.0, 2.0**-53, -(2.0**-1000)], 1.0),
        ([-1.0, -(2.0**-53), -(2.0**-1000)], -1.0 - 2.0**-52),
        ([1.7e308, 1.7e308, -1.7e308], 1.7e308),
        ([5e-324] * 3, 1.5e-323),
        ([0.0, -0.0], 0.0),
        ([1.7e308, 1.7e308], math.inf),
    ],
)
def test_it_is_rounded_once(device, numbers, expected):
    assert total(numbers, device=device) == expected


@pytest.mark.parametrize("strange", [math.nan, math.inf, -math.inf])
def test_with_a_number_that_is_not_finite_a_sum_is_no_number(device, strange):
    assert math.isnan(total([1.0, strange, 2.0], device=device))
