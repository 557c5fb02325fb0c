"""What changes of the ghosts, from their owners, after every stage of every step; what all ranks agree on; loads on walls.

Called by the kernel of the step (``kernels.step.exchange``) on one thread. Ghosts are received where they stand in memory.
"""

import ctypes
import sys
import time
import traceback
from typing import Any

import numpy as np

from warpdem.kernels.step.exchange import WALL_LOADS
from warpdem.ranks.world import World

TAG = 19
"""Of the messages with the first of the arrays; the next one has the next number."""


class Exchange:
    """What a rank sends and receives at every step.

    Args:
        world: the ranks.
        stages: of the integrator; after the last one ranks agree.

    Attributes:
        address: of the C function that the kernel calls.
        loads: exact sums of the loads on walls that move by them, one row per thread, shape (threads, columns, digits), on the
            device; None without such walls.
        calls: how often all ranks have agreed.
        seconds: wall time of the calls [s].
        bytes: bytes sent.
        bytes_per_call: of which at every call.
    """

    def __init__(self, world: World, stages: int) -> None:
        from mpi4py import MPI

        self._mpi, self._world, self._last = MPI, world, stages - 1
        self._requests: list[Any] = []
        self._sends: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._mine, self._all = np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32)
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int32, ctypes.c_int32, ctypes.c_int32)(self.call)
        self.address = ctypes.cast(self._function, ctypes.c_void_p).value or 0
        world.at_end.append(self.disconnect)
        self.loads: np.ndarray | None = None
        self.calls, self.seconds, self.bytes, self.bytes_per_call = 0, 0.0, 0, 0

    def connect(
        self, changing: list[np.ndarray], owned: int, sends: dict[int, np.ndarray], receives: dict[int, int]
    ) -> None:
        """Exchange the state of other ghosts from now on.

        Args:
            changing: memory of what changes at every step, each of shape (slots, numbers).
            owned: slots of own grains; ghosts stand behind them.
            sends: by rank, the slots of the grains that it sees.
            receives: by rank, how many ghosts come from it, in the order in which they stand.
        """
        self.disconnect()
        comm = self._world.comm
        for tag, values in enumerate(changing, TAG):
            at = owned
            for rank, count in receives.items():
                self._requests.append(comm.Recv_init([values[at : at + count], self._mpi.DOUBLE], source=rank, tag=tag))
                at += count
            for rank, slots in sends.items():
                buffer = np.empty((len(slots), values.shape[1]))
                self._sends.append((values, slots, buffer))
                self._requests.append(comm.Send_init([buffer, self._mpi.DOUBLE], dest=rank, tag=tag))
        self.bytes_per_call = sum(buffer.nbytes for _, _, buffer in self._sends)

    def disconnect(self) -> None:
        """Let go of the memory that was exchanged."""
        for request in self._requests:
            request.Free()
        self._requests, self._sends = [], []

    def call(self, step: int, stage: int, found: int) -> int:
        """As ``kernels.step.exchange.exchange``; an error, which a kernel cannot raise, ends all ranks."""
        try:
            began = time.perf_counter()
            if stage == WALL_LOADS:
                self._add_loads()
                self.seconds += time.perf_counter() - began
                return found
            for values, slots, buffer in self._sends:
                np.take(values, slots, axis=0, out=buffer, mode="clip")  # "raise" would copy once more
            if self._requests:
                self._mpi.Prequest.Startall(self._requests)
                self._mpi.Request.Waitall(self._requests)
            self.bytes += self.bytes_per_call
            if stage == self._last:
                self._mine[0] = found
                self._world.comm.Allreduce(self._mine, self._all, op=self._mpi.BOR)
                found = int(self._all[0])
                self.calls += 1
            self.seconds += time.perf_counter() - began
            return found
        except BaseException:
            sys.stderr.write(f"error: rank {self._world.rank}: {traceback.format_exc()}")
            sys.stderr.flush()
            self._world.abort(1)
            return found

    def _add_loads(self) -> None:
        """Add up the loads on walls over threads and ranks: whole numbers, so that no order matters."""
        assert self.loads is not None
        mine = self.loads.sum(axis=0)
        self.loads[1:] = 0
        self._world.comm.Allreduce(mine, self.loads[0], op=self._mpi.SUM)
        self.bytes += mine.nbytes
