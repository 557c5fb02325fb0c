"""Rows of neighbors: tested several at a time they are those of one candidate after the other, and those of brute force."""

import functools

import numpy as np
import pytest
import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels.lists import cells, near_runs, neighbors
from warpdem.kernels.step import border

from warpdem.filling.size_grids import grids_for, size_classes

GAP, MOST, SIDE = 0.01, 0.2, 6.0
OWNED = 500  # grains of this process where there are several


def cloud(rng) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, radii and allowances.

    A large grain has more partners than are found at once; pairs are as far apart as a listed pair may be, to the last digit.
    """
    n = 900
    position, radius, allowance = rng.uniform(0.0, SIDE, (n, 3)), rng.uniform(0.2, 0.4, n), rng.uniform(0.02, MOST, n)
    position[:2], radius[:2] = [[3.0, 3.0, 3.0], [0.5, 5.5, 3.0]], 1.3
    for k in range(100, 300, 2):
        far = radius[k] + radius[k + 1] + GAP + (allowance[k] + allowance[k + 1])
        position[k + 1] = position[k] + [far * (1.0 + (k % 5 - 2) * 2.0**-53), 0.0, 0.0]
    return position, radius, allowance


def search(kernels: KernelSet, many: bool, position, radius, allowance, ids, room: int, **of) -> list[list[int]]:
    """The rows, as indices of grains; where a row is too short, its length alone."""
    n, classes = len(radius), size_classes(radius)
    new = functools.partial(wp.array, device="cpu")
    grids = grids_for(position, radius + 0.02, classes, GAP, wp.get_device("cpu"), radius.max() + MOST)
    record = np.zeros((n, grain.WIDTH[True]))
    record[:, grain.POSITION], record[:, grain.RADIUS] = position, radius
    grains = kernels.ListedGrains()
    grains.record, grains.id = new(record, dtype=grain.build(True).Record), new(ids, dtype=wp.int64)
    grains.material, grains.through = new(of["material"], dtype=wp.int32), new([[0, 1], [1, 0]], dtype=wp.int32)
    grains.owned, grains.clumps.of_grain = OWNED, new(of["clump"], dtype=wp.int32)
    allowed = new(allowance, dtype=wp.float64)
    if many:
        grids.copies = wp.full((cells.COPIED, n + cells.SPARE), np.nan, dtype=wp.float64, device="cpu")
    wp.launch(kernels.count_in_cells, n, [0, grids, grains.record, allowed], device="cpu")
    wp.launch(cells.start_lines, grids.lines, [0, grids], device="cpu")
    wp.launch(kernels.sort_by_cell, n, [0, grids, grains.record, allowed], device="cpu")
    np.testing.assert_array_equal(np.sort(grids.grain.numpy()[:n]), np.arange(n))
    start = np.arange(n + 1) * room
    count, slot = wp.zeros(n, dtype=wp.int32, device="cpu"), wp.full(n * room, -1, dtype=wp.int32, device="cpu")
    wp.launch(kernels.find_neighbors, n, [0, grids, grains, allowed, new(start, dtype=wp.int32), count, slot], device="cpu")
    rows, lengths = slot.numpy().reshape(n, room), count.numpy()
    return [row[:length].tolist() if length <= room else [length] for row, length in zip(rows, lengths, strict=True)]


@functools.cache
def built(periodic: bool, features: bool, many: bool) -> KernelSet:
    sides = (SIDE, 0.0, SIDE) if periodic else (0.0, 0.0, 0.0)
    what = dict.fromkeys(("clumps", "apart", "ranks"), features)
    return neighbors.build.__wrapped__(
        border.build(sides, (0.0, 0.0, 0.0)), spins=True, gap=GAP, **what, side_by_side=many
    )


@pytest.mark.parametrize("features", [False, True])
@pytest.mark.parametrize("periodic", [False, True])
def test_rows_are_those_of_brute_force_and_of_one_by_one(periodic, features, monkeypatch):
    rng = np.random.default_rng(4)
    position, radius, allowance = cloud(rng)
    if periodic:
        position = position % SIDE
    n = len(radius)
    of = {"material": rng.integers(0, 2, n), "clump": np.where(rng.random(n) < 0.5, rng.integers(0, 40, n), -1)}
    ids = rng.permutation(n) * 3 + 2**33
    given = position, radius, allowance, ids, 150
    several = search(built(periodic, features, True), True, *given, **of)
    assert several == search(built(periodic, features, False), False, *given, **of)
    monkeypatch.setattr(near_runs, "build", functools.partial(near_runs.build, packed=False))
    built.cache_clear()
    assert several == search(built(periodic, features, True), True, *given, **of), "without the instruction that packs"
    built.cache_clear()
    way = position[:, None] - position[None]
    if periodic:
        way -= np.array([SIDE, 0.0, SIDE]) * np.round(way / SIDE)
    distance, far = np.sqrt(np.einsum("ijk,ijk->ij", way, way)), np.add.outer(radius, radius) + GAP
    far += np.add.outer(allowance, allowance)
    may = ~np.eye(n, dtype=bool)
    if features:
        may &= ~np.equal.outer(of["clump"], of["clump"]) | (of["clump"] == -1)
        may &= np.equal.outer(of["material"], of["material"])
        may &= np.less.outer(np.arange(n), np.full(n, OWNED)) | (np.arange(n) < OWNED)
    sure, possible = (may & (distance < far * scale) for scale in (1.0 - 1e-12, 1.0 + 1e-12))
    for i, row in enumerate(several):
        assert set(np.flatnonzero(sure[i])) <= set(row) <= set(np.flatnonzero(possible[i]))
        assert np.all(np.diff(ids[row]) > 0)
    longest = max(map(len, several))
    assert (longest > near_runs.ROOM + near_runs.LANES) or features, "more than are found at once"
    assert np.count_nonzero(possible & ~sure) > 20, "pairs at the limit"


def test_a_row_that_is_too_short_leaves_the_next_alone():
    rng = np.random.default_rng(5)
    position, radius, allowance = cloud(rng)
    of = {"material": np.zeros(len(radius)), "clump": np.full(len(radius), -1)}
    ids = rng.permutation(len(radius))
    whole = search(built(False, False, True), True, position, radius, allowance, ids, 150, **of)
    short = search(built(False, False, True), True, position, radius, allowance, ids, 6, **of)
    fits = [len(row) <= 6 for row in whole]
    assert 50 < sum(fits) < len(fits) - 50
    for row, cut, is_whole in zip(whole, short, fits, strict=True):
        assert cut == (row if is_whole else [len(row)])
