"""What the ranks of a run tell each other; all of it is collective: every rank calls the same in the same order."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from warpdem.core.cpu_cores import available_cores
from warpdem.errors import WarpdemError

LONGEST_NAP = 2.0e-3
"""Longest time between two looks of a rank that has nothing to do [s]: one that waits for MPI burns a core."""


class World:
    """The ranks of a run.

    Args:
        comm: communicator of mpi4py.

    Attributes:
        size: number of ranks.
        rank: number of this one, from 0.
        busy: this rank does something together with the others, or they have ended: they do not answer.
        agreed: the error that all ranks have raised last; any other is of this rank alone.
        at_end: what lets go of what MPI holds, called when all ranks end.
    """

    def __init__(self, comm: Any) -> None:
        from mpi4py import MPI

        self._mpi, self.comm = MPI, comm
        self.rank, self.size = int(comm.rank), int(comm.size)
        self._node = comm.Split_type(MPI.COMM_TYPE_SHARED)
        self._one, self._all = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
        self.busy = False
        self.agreed: WarpdemError | None = None
        self.at_end: list[Callable[[], None]] = []

    @property
    def local_rank(self) -> int:
        """Number of this rank among those on this machine."""
        return int(self._node.rank)

    @property
    def cores(self) -> int:
        """Cores of this machine for each of the ranks on it."""
        return max(1, available_cores() // int(self._node.size))

    @contextmanager
    def together(self) -> Iterator[None]:
        """What all ranks do together: an error that is not that of all ranks leaves the others waiting, see ``busy``."""
        self.busy = True
        try:
            yield
        except WarpdemError as error:
            self.busy = error is not self.agreed
            raise
        self.busy = False

    # -- numbers --------------------------------------------------------------------------------

    def any_of(self, bits: int) -> int:
        """Bits that are set on some rank."""
        return self._reduced(bits, self._mpi.BOR)

    def least(self, number: int) -> int:
        """The least of the ranks' numbers."""
        return self._reduced(number, self._mpi.MIN)

    def total(self, number: int) -> int:
        """The sum of the ranks' numbers."""
        return self._reduced(number, self._mpi.SUM)

    def _reduced(self, number: int, operation: Any) -> int:
        self._one[0] = number
        self.comm.Allreduce(self._one, self._all, op=operation)
        return int(self._all[0])

    def largest(self, values: np.ndarray) -> np.ndarray:
        """The largest of the ranks' values, element by element."""
        out = np.empty_like(values)
        self.comm.Allreduce(np.ascontiguousarray(values), out, op=self._mpi.MAX)
        return out

    # -- objects --------------------------------------------------------------------------------

    def everyone(self, mine: Any) -> list[Any]:
        """What each rank gives, on all of them."""
        found: list[Any] = self.comm.allgather(mine)
        return found

    def gathered(self, mine: Any) -> list[Any]:
        """What each rank gives, on rank 0; empty on the others."""
        found: list[Any] | None = self.comm.gather(mine)
        return found or []

    def dealt(self, parts: list[Any] | None) -> Any:
        """The part of this rank, of those that rank 0 gives."""
        return self.comm.scatter(parts)

    def collected(self, mine: np.ndarray, counts: np.ndarray | None) -> np.ndarray | None:
        """The rows of all ranks, one rank after the other, on rank 0.

        Args:
            mine: of this rank; on all of the same type and width.
            counts: rows of each rank, on rank 0.
        """
        if counts is None:
            self.comm.Gatherv([np.ascontiguousarray(mine), self._mpi.BYTE], None)
            return None
        out = np.empty((int(counts.sum()), *mine.shape[1:]), dtype=mine.dtype)
        self.comm.Gatherv([np.ascontiguousarray(mine), self._mpi.BYTE], [out, counts * _row(out), None, self._mpi.BYTE])
        return out

    def spread(self, rows: np.ndarray | None, counts: np.ndarray | None, mine: np.ndarray) -> None:
        """Give each rank some rows of rank 0.

        Args:
            rows: of all ranks, one rank after the other, on rank 0.
            counts: rows of each, on rank 0.
            mine: takes those of this rank; its memory is contiguous.
        """
        send = None
        if rows is not None and counts is not None:
            send = [np.ascontiguousarray(rows), counts * _row(rows), None, self._mpi.BYTE]
        self.comm.Scatterv(send, [mine, self._mpi.BYTE])

    def swapped(self, parts: list[Any]) -> list[Any]:
        """What each rank gives to this one; ``parts``: what this one gives to each."""
        found: list[Any] = self.comm.alltoall(parts)
        return found

    def from_first(self, what: Any = None) -> Any:
        """What rank 0 broadcasts; the others sleep until it does."""
        ready, nap = self.comm.Ibarrier(), 0.0
        while not ready.Test():
            time.sleep(nap)
            nap = min(nap + 2.0e-5, LONGEST_NAP)
        return self.comm.bcast(what)

    # -- errors ---------------------------------------------------------------------------------

    def raise_first(self, error: WarpdemError | None) -> None:
        """Raise on all ranks the error of the lowest rank that has one.

        Raises:
            WarpdemError: one has.
        """
        if self.any_of(int(error is not None)):
            self.agreed = next(found for found in self.everyone(error) if found is not None)
            raise self.agreed

    def close(self) -> None:
        """Let go of what MPI holds; the other ranks do not answer any more."""
        for let_go in self.at_end:
            let_go()
        self.busy = True

    def abort(self, code: int) -> None:
        """End all ranks at once: the last resort, where they cannot agree any more."""
        self.comm.Abort(code)

    # -- of the exchange ------------------------------------------------------------------------

    def all_node_leaders_first(self) -> Iterator[bool]:
        """Twice: on the first rank of each machine at once, then, when those are done, on the others."""
        yield self._node.rank == 0
        self._node.Barrier()
        yield self._node.rank != 0


def _row(values: np.ndarray) -> int:
    """Size of a row [B]."""
    return values.dtype.itemsize * int(np.prod(values.shape[1:]))
