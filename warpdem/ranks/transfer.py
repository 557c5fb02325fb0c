"""Grains with their contacts between rank 0 and all, block by block: the whole is on rank 0 once, and nowhere else.

What rank 0 gathers it writes, in the order of a checkpoint; what it deals out it need not have made (``state.blocks.Rows``).
"""

from typing import Any

import numpy as np

from warpdem.ranks.portion import Portion, Table
from warpdem.ranks.world import World
from warpdem.state.blocks import Rows

BLOCK = 2**24
"""Size of a block of all ranks together [B]."""
TABLES = ("grains", "pairs", "points", "clumps")
"""Parts of a portion, each with rows of its own."""


def gather(world: World, mine: Portion) -> Portion | None:
    """All grains and contacts, on rank 0.

    Args:
        world: the ranks.
        mine: of this rank; no other one holds a row of it.
    """
    found = [_merged(world, getattr(mine, name), mine.key(name)) for name in TABLES]
    return Portion(*found) if world.rank == 0 else None


def deal(world: World, whole: Portion | None, owner: np.ndarray | None) -> Portion:
    """The share of this rank of what rank 0 has.

    Args:
        world: the ranks.
        whole: all grains and contacts, on rank 0.
        owner: rank of each grain, on rank 0.
    """
    shares = whole.shares(owner, world.size) if whole is not None and owner is not None else [None] * len(TABLES)
    return Portion(*(_share(world, getattr(whole, name, None), rows) for name, rows in zip(TABLES, shares, strict=True)))


def _merged(world: World, mine: Table, key: np.ndarray) -> Table:
    """The rows of all ranks in ascending order of ``key``, shape (rows, numbers), as they are in on each; on rank 0."""
    layout = _layout(world, mine, len(key))
    keys = world.gathered(key)
    source, counts = np.zeros(0, dtype=np.int32), None
    length = _length(layout)
    if keys:
        source = np.repeat(np.arange(len(keys), dtype=np.int32), [len(one) for one in keys])
        source = source[np.lexsort(np.concatenate(keys).T[::-1])]
        blocks = [source[first : first + length] for first in range(0, len(source), length)]
        counts = np.array([np.bincount(block, minlength=len(keys)) for block in blocks]).reshape(-1, len(keys))
    own = world.dealt(list(counts.T) if counts is not None else None)
    out = {name: np.empty((len(source), *shape), dtype=dtype) for name, (dtype, shape) in layout.items()}
    first = 0
    for number, count in enumerate(own):
        part = slice(number * length, (number + 1) * length)
        order = np.argsort(source[part], kind="stable")  # ranks give theirs one after the other
        for name, (dtype, shape) in layout.items():
            rows = _some(mine[name], slice(first, first + count)) if count else np.empty((0, *shape), dtype)
            found = world.collected(rows.astype(dtype, copy=False), counts[number] if counts is not None else None)
            if found is not None:
                out[name][part][order] = found
        first += count
    return out


def _share(world: World, whole: Table | None, rows: list[np.ndarray] | None) -> Table:
    """The rows of this rank of a table on rank 0; ``rows``: ascending numbers of those of each rank, on rank 0."""
    layout: dict[str, Any] = world.comm.bcast(_described(whole) if whole is not None else None)
    length, counts = _length(layout), None
    if whole is not None and rows is not None:
        total = next((values.shape[0] for values in whole.values()), 0)
        edges = np.append(np.arange(0, total, length), total)
        cuts = [np.searchsorted(one, edges) for one in rows]
        counts = np.diff(cuts, axis=1).T
    own = world.dealt(list(counts.T) if counts is not None else None)
    out = {name: np.empty((int(own.sum()), *shape), dtype=dtype) for name, (dtype, shape) in layout.items()}
    first = 0
    for number, count in enumerate(own):
        begin = number * length
        picked = np.zeros(0, dtype=np.int64)
        if rows is not None:
            each = [one[cut[number] : cut[number + 1]] - begin for one, cut in zip(rows, cuts, strict=True)]
            picked = np.concatenate(each)
        for name in layout:
            block = None
            if whole is not None:
                block = _some(whole[name], slice(begin, min(begin + length, whole[name].shape[0])))[picked]
            world.spread(block, counts[number] if counts is not None else None, out[name][first : first + count])
        first += count
    return out


def _described(table: Table) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Type and size of a row of each array."""
    return {name: (values.dtype.str, tuple(values.shape[1:])) for name, values in table.items()}


def _layout(world: World, mine: Table, count: int) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Arrays of a table that ranks have together: where there are no rows, they may be missing, or of another type."""
    each = world.everyone((count, _described(mine)))
    return next((layout for rows, layout in each if rows), each[0][1])


def _length(layout: dict[str, tuple[str, tuple[int, ...]]]) -> int:
    """Rows of a block."""
    widest = max((np.dtype(dtype).itemsize * int(np.prod(shape)) for dtype, shape in layout.values()), default=1)
    return max(BLOCK // max(widest, 1), 1)


def _some(values: Rows | np.ndarray, part: slice) -> np.ndarray:
    return values.part(part) if isinstance(values, Rows) else values[part]
