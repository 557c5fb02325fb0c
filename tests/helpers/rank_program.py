"""Runs the scenes of ``rank_scenes`` over several ranks: ``mpiexec -n N python rank_program.py FOLDER SIZES NAMES``.

For each of SIZES, N at most, so many of the processes share each scene; results go to FOLDER/NAME-SIZE. Cuts are moved at
random at every outer list, so that many grains change hands.
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from rank_scenes import SCENES
from warpdem.ranks import rank
from warpdem.ranks.cuts import Cuts
from warpdem.ranks.follower import serve
from warpdem.ranks.front import leading
from warpdem.ranks.world import World
from warpdem.runner import run_scene


def main() -> None:
    folder, sizes, names = Path(sys.argv[1]), map(int, sys.argv[2].split(",")), sys.argv[3].split(",")
    draw = np.random.default_rng(1)

    def thrown(position, weight, cuts):
        kept = draw.random(len(position)) < np.where(position[:, 0] > np.median(position[:, 0]), draw.random(), 1.0)
        return Cuts.of(position[kept], weight[kept], cuts.parts)

    rank.shifted, rank.IMBALANCE, rank.WAIT = thrown, 0.0, 0
    for size in sizes:
        part = MPI.COMM_WORLD.Split(int(MPI.COMM_WORLD.rank >= size))
        if MPI.COMM_WORLD.rank >= size:
            continue
        world = World(part)
        if world.rank:
            serve(world)
            continue
        with leading(world):
            for name in names:
                run_scene(SCENES[name](), folder / f"{name}-{size}", quiet=True, picture=False, threads=1)


if __name__ == "__main__":
    main()
