"""Runs scenes of ``rank_scenes`` over ranks: ``mpiexec -n N python rank_program.py FOLDER NAME-SIZE,NAME-SIZE [HOW ...]``.

Of the N processes SIZE share the scene NAME; results go to FOLDER/NAME-SIZE. With a SIZE of 2+3 two of them share the first
half, and three resume it; 1 is a run without ranks. Cuts are moved at random at every outer list, so that many grains
change hands; every second exchange, at random, begins when it should have ended. HOW ``resident``: ranks step by graphs, as
on GPUs; ``device``: and their messages go from device to device, within graphs of several steps, where batches that were ended
are noted in FOLDER/ends.json; ``pieces``: each writes its own pieces of the frames.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from mpi4py import MPI

from mpi_device import MpiMessages
from rank_scenes import SCENES, in_pieces
from warpdem.app import run as steps_of_run
from warpdem.app.phases import run
from warpdem.assembly import parts
from warpdem.engine.graph_of_steps import StepsExecutor
from warpdem.ranks import rank, ways
from warpdem.ranks.cuts import Cuts
from warpdem.ranks.exchange import Links
from warpdem.ranks.follower import serve
from warpdem.ranks.front import leading
from warpdem.ranks.world import World


def main() -> None:
    folder = Path(sys.argv[1])
    draw = np.random.default_rng(1)

    def jittered(position, weight, cuts):
        kept = draw.random(len(position)) < np.where(position[:, 0] > np.median(position[:, 0]), draw.random(), 1.0)
        return Cuts.of(position[kept], weight[kept], cuts.parts)

    ends = defaultdict(list)
    if "device" in sys.argv[3:]:
        ways.messages_of = lambda world, device: (MpiMessages(world), "")
        advance = StepsExecutor.advance

        def noted(executor, count, *arguments):
            done, found = advance(executor, count, *arguments)
            ends[task].append((count, done, found))
            return done, found

        StepsExecutor.advance = noted
        steps_of_run.SECONDS_PER_CHUNK = 1e3  # batches end where the schedule of the output says, however slow the machine is
    if "resident" in sys.argv[3:] or "device" in sys.argv[3:]:
        prepare = parts.prepare
        parts.prepare = lambda given, device, resident, past, ranks: prepare(given, device, ranks, past, ranks)
    start, finish = Links.start, Links.finish

    def start_late(links):
        links.late = draw.random() < 0.5
        if not links.late:
            start(links)

    def finish_late(links):
        if links.__dict__.pop("late", False):
            start(links)
        finish(links)

    Links.start, Links.finish = start_late, finish_late
    rank.shifted, rank.IMBALANCE, rank.WAIT = jittered, 0.0, 0
    for task in sys.argv[2].split(","):
        name, sizes = task.split("-")
        scene, each = SCENES[name](), list(map(int, sizes.split("+")))
        if "pieces" in sys.argv[3:]:
            scene = in_pieces(scene, "ranks")
        for part, size in enumerate(each):
            here = MPI.COMM_WORLD.rank < size
            some = MPI.COMM_WORLD.Split(int(here))
            if not here:
                continue
            world = World(some) if size > 1 else None
            if world is not None and world.rank:
                if serve(world):
                    sys.exit(1)  # rank 0 has failed, and will not come to the next scene
                continue
            end = sum(scene.phase(k).time.end for k in range(len(scene.phases))) or scene.time.end
            until = end * (part + 1) / len(each)
            with leading(world):
                run(scene, folder / task, quiet=True, picture=False, threads=1 + int(size == 2), until=until, resume=part > 0)
    if MPI.COMM_WORLD.rank == 0:
        (folder / "ends.json").write_text(json.dumps(ends))


if __name__ == "__main__":
    main()
