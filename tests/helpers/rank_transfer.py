"""Dealt out block by block and gathered again, beside the same at once: ``mpiexec -n 3 python rank_transfer.py``.

The last rank gets no grains; tables of rank 0 are rows that are made when they are sent.
"""

import traceback

import numpy as np
from mpi4py import MPI

from warpdem.ranks import transfer
from warpdem.ranks.portion import Portion
from warpdem.ranks.world import World
from warpdem.state.blocks import Rows

SIZES = {"grains": 500, "pairs": 900, "points": 130, "clumps": 20}


def whole() -> Portion:
    """Grains of which some are members of clumps, contacts of any two, several points of a grain."""
    rng = np.random.default_rng(7)
    ids = np.sort(rng.choice(10**6, SIZES["grains"], replace=False))
    pair = np.unique(np.sort(rng.choice(ids, (SIZES["pairs"], 2)), axis=1), axis=0)
    pair = pair[pair[:, 0] < pair[:, 1]]
    clumps = np.sort(rng.choice(ids, SIZES["clumps"], replace=False))
    grains = {"id": ids, "record": rng.normal(size=(len(ids), 16)), "group": rng.integers(0, 9, len(ids), dtype=np.int32)}
    points = np.sort(rng.choice(ids, SIZES["points"]))
    return Portion(
        {**grains, "clump": np.where(np.isin(ids, clumps), ids, -1)},
        {"pair": pair, "pair_history": rng.normal(size=(len(pair), 3)).astype(np.float32)},
        {"wall_contact_grain": points, "wall_contact_wall": rng.integers(0, 4, len(points), dtype=np.int32)},
        {"id": clumps, "clump_record": rng.normal(size=(len(clumps), 8))},
    )


def unmade(values: np.ndarray) -> Rows:
    """The same, made when it is asked for."""
    return Rows(values.shape, values.dtype, lambda part: values[part])


def equal(one: Portion, other: Portion) -> bool:
    """The same numbers of the same types."""
    tables = [(getattr(one, name), getattr(other, name)) for name in transfer.TABLES]
    return all(
        a.keys() == b.keys() and all(a[name].dtype == b[name].dtype and np.array_equal(a[name], b[name]) for name in a)
        for a, b in tables
    )


def main() -> None:
    transfer.BLOCK = 4096
    world, there = World(MPI.COMM_WORLD), whole()
    owner = np.random.default_rng(8).integers(0, world.size - 1, len(there))
    given = None
    if world.rank == 0:
        given = Portion(*({name: values if name in ("id", "pair", "wall_contact_grain") else unmade(values)
                           for name, values in getattr(there, table).items()} for table in transfer.TABLES))  # fmt: skip
    mine = transfer.deal(world, given, owner if given is not None else None)
    assert equal(mine, there.split(owner, world.size)[world.rank]), f"rank {world.rank} has another share"
    mine.keep_owned_pairs()
    if not len(mine):
        mine = Portion({"id": mine.grains["id"]}, {}, {})  # as ranks that hold nothing
    found = transfer.gather(world, mine)
    assert (found is None) == (world.rank > 0)
    assert found is None or equal(found, there), "not what was dealt out"
    world.comm.Barrier()
    if world.rank == 0:
        print(f"{len(there)} grains, {len(there.pairs['pair'])} contacts")


if __name__ == "__main__":
    try:
        main()
    except BaseException:
        traceback.print_exc()
        MPI.COMM_WORLD.Abort(1)  # else the others wait
