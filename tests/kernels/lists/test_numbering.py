"""Numbering equals that by prefix sums in NumPy."""

import numpy as np
import pytest
import warp as wp
from warpdem.kernels.lists import numbering
from warpdem.kernels.lists.numbering import BLOCK, starts


def class_starts(touching: np.ndarray, near: np.ndarray, lanes: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Number of the first contact of either class of each grain, and the contact batches in all.

    Within a block of grains the contacts that touch come first and fill whole batches, then the others do.
    """
    first, block = np.arange(0, len(touching), BLOCK), np.arange(len(touching)) // BLOCK
    sums = [np.add.reduceat(count, first) for count in (touching, near)]
    padded = [-(-s // lanes) * lanes for s in sums]
    begin = np.concatenate([[0], np.cumsum(padded[0] + padded[1])])
    inside = [np.cumsum(count) - count - (np.cumsum(s) - s)[block] for count, s in zip((touching, near), sums, strict=True)]
    return begin[block] + inside[0], begin[block] + padded[0][block] + inside[1], int(begin[-1]) // lanes


@pytest.mark.parametrize("n", [1, BLOCK, 3 * BLOCK + 17])
def test_numbers_are_prefix_sums(n, device):
    rng, lanes = np.random.default_rng(n), 32
    touching, near, shares = (rng.integers(0, 7, n).astype(np.int32) for _ in range(3))
    candidates = rng.integers(0, 2, n).astype(np.int32)
    blocks = -(-n // BLOCK)
    counts, begin = numbering.Counts(), numbering.Starts()
    for name, values in (("touching", touching), ("near", near), ("slots", shares), ("candidates", candidates)):
        setattr(counts, name, wp.array(values, dtype=wp.int32, device=device))
    sums, total = wp.zeros(blocks, dtype=numbering.Sums, device=device), wp.zeros(3, dtype=wp.int32, device=device)
    out = [wp.zeros(size, dtype=wp.int32, device=device) for size in (n, n, n + 1, n)]
    begin.touching, begin.near, begin.slot, begin.wall_grain = out
    wp.launch(numbering.sum_blocks, dim=blocks, inputs=[0, lanes, counts, sums], device=device)
    wp.launch(numbering.start_blocks, dim=1, inputs=[sums, total], device=device)
    wp.launch(numbering.start_grains, dim=blocks, inputs=[0, lanes, counts, sums, begin], device=device)

    touching_start, near_start, packs = class_starts(touching, near, lanes)
    slot_start, beside = starts(shares), np.flatnonzero(candidates)
    np.testing.assert_array_equal(total.numpy(), [packs * lanes, slot_start[-1], len(beside)])
    for found, expected in zip(out, (touching_start, near_start, slot_start), strict=False):
        np.testing.assert_array_equal(found.numpy(), expected)
    np.testing.assert_array_equal(out[3].numpy()[: len(beside)], beside)


def test_sums_beyond_32_bits_stay_at_the_largest(device):
    """Grains within each other have so many neighbours: what wrapped around would seem to fit."""
    n, most = 6 * BLOCK, 2**31 - 1
    counts = numbering.Counts()
    counts.slots = wp.full(n, most // (2 * BLOCK), dtype=wp.int32, device=device)
    sums, total = wp.zeros(6, dtype=numbering.Sums, device=device), wp.zeros(3, dtype=wp.int32, device=device)
    wp.launch(numbering.sum_blocks, dim=6, inputs=[0, 32, counts, sums], device=device)
    wp.launch(numbering.start_blocks, dim=1, inputs=[sums, total], device=device)
    assert total.numpy()[1] == most
