"""States of a scene of ``rank_scenes`` after some steps: ``mpiexec -n N python rank_states.py NAME STEPS,STEPS,...``.

Prints, as JSON, what run.json would say of each: step, state hash and number of grains.
"""

import json
import sys

from mpi4py import MPI

from rank_scenes import SCENES
from warpdem import Simulation
from warpdem.app.run_record import record
from warpdem.ranks.follower import serve
from warpdem.ranks.front import leading
from warpdem.ranks.world import World


def main() -> None:
    name, steps = sys.argv[1], map(int, sys.argv[2].split(","))
    world = World(MPI.COMM_WORLD) if MPI.COMM_WORLD.size > 1 else None
    if world is not None and world.rank:
        sys.exit(serve(world))
    found = []
    with leading(world):
        sim = Simulation(SCENES[name](), threads=1, world=world)
        for count in steps:
            sim.step(count)
            whole = record(sim, "failed", 0.0, None)
            found.append([whole["steps"], whole["state_hash"], whole["grains"]])
    print(json.dumps(found))


if __name__ == "__main__":
    main()
