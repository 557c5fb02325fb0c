"""``warpdem`` over ranks of which one fails: ``mpiexec -n N python rank_failures.py HOW RANK run SCENE ...``.

When it makes lists for the second time, by HOW: "disk", none of its files grows any more; "bug", "memory" or "list", an error.
"""

import resource
import sys

from mpi4py import MPI

from warpdem.__main__ import main
from warpdem.errors import StabilityError
from warpdem.ranks.rank import Rank

ERRORS = {
    "bug": ZeroDivisionError("a bug on one rank"), "memory": MemoryError("no more on one rank"),
    "list": StabilityError("too long a list on one rank"),
}  # fmt: skip


def fail(how: str) -> None:
    """Let this rank fail."""
    settle = Rank._settle

    def broken(self, *arguments, **options):
        if self.counts.rebuilds and how == "disk":
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
        elif self.counts.rebuilds:
            raise ERRORS[how]
        settle(self, *arguments, **options)

    Rank._settle = broken


if __name__ == "__main__":
    how, number = sys.argv[1], int(sys.argv[2])
    if MPI.COMM_WORLD.rank == number:
        fail(how)
    sys.argv = ["warpdem", *sys.argv[3:]]
    main()
