"""A rank other than 0: it does what rank 0 says, until that ends."""

import sys
import traceback

from warpdem.core import interrupts
from warpdem.core.device import pick_device
from warpdem.core.threads import run_threads
from warpdem.errors import WarpdemError
from warpdem.model.decisions import Decisions
from warpdem.model.prepare import without_grains
from warpdem.ranks.devices import device_name
from warpdem.ranks.front import END
from warpdem.ranks.rank import Rank
from warpdem.ranks.world import World


def serve(world: World) -> int:
    """Follow rank 0 to its end; returns the exit code that it says."""
    interrupts.ignore()  # Ctrl-C comes to all processes: rank 0 decides
    rank: Rank | None = None
    try:
        while True:
            name, arguments = world.from_first()
            if name == END:
                world.close()
                return int(arguments[0])
            try:
                if name == "model":
                    rank = _new_rank(world, *arguments)
                else:
                    getattr(rank, name)(*arguments)
            except WarpdemError as error:
                if error is not world.agreed:  # else rank 0 reports it
                    _end_all(world, str(error), error.exit_code)
    except MemoryError as error:
        _end_all(world, f"out of memory ({error or 'no more is available'})", 3)
    except BaseException:
        _end_all(world, traceback.format_exc(), 1)
    return 1


def _end_all(world: World, message: str, code: int) -> None:
    sys.stderr.write(f"error: rank {world.rank}: {message}\n")
    sys.stderr.flush()
    world.abort(code)


def _new_rank(world: World, decided: Decisions, threads: int, asked: str | None) -> Rank:
    """The rank of another run, whose grains rank 0 has read or packed: it deals them out."""
    try:
        device = pick_device(device_name(asked, world.local_rank))
        rank = Rank(world, without_grains(decided, device), run_threads(threads, 0, grows=False, cpu=device.is_cpu))
    except WarpdemError as error:
        if error is not world.agreed:
            world.raise_first(error)
        raise
    world.raise_first(None)
    return rank
