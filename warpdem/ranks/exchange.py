"""What changes of the ghosts, from their owners, after every stage of every step; what all ranks agree on; loads on walls.

Called by the kernel of the step (``kernels.step.exchange``) on one thread. Ghosts are received where they stand in memory.
Beside them come the answers of their films to the wishes of bridges (``kernels.contact.films``): only the rank of a grain knows
all its wishes.
"""

import ctypes
import sys
import time
import traceback
from typing import Any

import numpy as np
import warp as wp

from warpdem.kernels.step.exchange import ARRIVED, WALL_LOADS
from warpdem.ranks.world import World
from warpdem.state.particles import changed

TAG = 19
"""Of the messages with the first of the arrays; the next one has the next number."""
OF_ANSWERS = 29
"""Tag of the messages with what films give to bridges."""


class Links:
    """Messages to and from other ranks that are sent again and again, from and to the same memory.

    Attributes:
        bytes: that are sent each time.
    """

    def __init__(self, comm: Any) -> None:
        from mpi4py import MPI

        self._mpi, self._comm = MPI, comm
        self._requests: list[Any] = []
        self._under_way = False
        self.bytes = 0
        self._sends: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._receives: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def send(self, values: np.ndarray, rank: int, tag: int) -> None:
        """Send all of ``values``, whose memory is contiguous, to ``rank``."""
        self.bytes += values.nbytes
        self._requests.append(self._comm.Send_init(values, dest=rank, tag=tag))

    def send_rows(self, values: np.ndarray, rows: np.ndarray, rank: int, tag: int) -> None:
        """Send the ``rows`` of ``values`` to ``rank``."""
        buffer = np.empty((len(rows), *values.shape[1:]), dtype=values.dtype)
        self._sends.append((values, rows, buffer))
        self.send(buffer, rank, tag)

    def receive(self, values: np.ndarray, rank: int, tag: int) -> None:
        """Receive all of ``values``, whose memory is contiguous, from ``rank``."""
        self._requests.append(self._comm.Recv_init(values, source=rank, tag=tag))

    def receive_rows(self, values: np.ndarray, rows: np.ndarray, rank: int, tag: int) -> None:
        """Receive the ``rows`` of ``values`` from ``rank``."""
        buffer = np.empty((len(rows), *values.shape[1:]), dtype=values.dtype)
        self._receives.append((values, rows, buffer))
        self.receive(buffer, rank, tag)

    def start(self) -> None:
        """Begin to send and receive all."""
        for values, rows, buffer in self._sends:
            np.take(values, rows, axis=0, out=buffer, mode="clip")  # "raise" would copy once more
        if self._requests:
            self._mpi.Prequest.Startall(self._requests)
            self._under_way = True

    def finish(self) -> None:
        """Wait until all is sent and received that was begun."""
        if self._under_way:
            self._mpi.Request.Waitall(self._requests)
            self._under_way = False
            for values, rows, buffer in self._receives:
                values[rows] = buffer

    def free(self) -> None:
        """Let go of the memory."""
        self.finish()
        for request in self._requests:
            request.Free()
        self._requests, self._sends, self._receives, self.bytes = [], [], [], 0


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
        self._ghosts, self._answers = Links(world.comm), Links(world.comm)
        self._mine, self._all = np.zeros(1, dtype=np.int32), np.zeros(1, dtype=np.int32)
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_int32, ctypes.c_int32, ctypes.c_int32)(self.call)
        self.address = ctypes.cast(self._function, ctypes.c_void_p).value or 0
        world.at_end.append(self.disconnect)
        self.loads: wp.array | None = None
        self.calls, self.seconds, self.bytes, self.bytes_per_call = 0, 0.0, 0, 0

    def connect(
        self, changing: list[wp.array], owned: int, sends: dict[int, np.ndarray], receives: dict[int, int]
    ) -> None:
        """Exchange the state of other ghosts from now on.

        Args:
            changing: what changes at every step, each of shape (slots,).
            owned: slots of own grains; ghosts stand behind them.
            sends: by rank, the slots of the grains that it sees.
            receives: by rank, how many ghosts come from it, in the order in which they stand.
        """
        self._ghosts.free()
        for tag, array in enumerate(changing, TAG):
            values, at = array.numpy(), owned
            for rank, count in receives.items():
                self._ghosts.receive(values[at : at + count], rank, tag)
                at += count
            for rank, slots in sends.items():
                self._ghosts.send_rows(values, slots, rank, tag)
        self.bytes_per_call = self._ghosts.bytes + self._answers.bytes

    def connect_answers(self, answer: wp.array | None, contacts: dict[int, tuple[np.ndarray, np.ndarray]]) -> None:
        """Exchange the answers of films from now on.

        Args:
            answer: the answer in each force slot, shape (force slots,); None without such contacts.
            contacts: by rank, the force slots of own grains in contacts with its grains, in order of the own id, then the
                other; and those of its grains, in order of its id, then the own.
        """
        self._answers.free()
        for rank, (own, others) in contacts.items():
            assert answer is not None
            self._answers.send_rows(answer.numpy(), own, rank, OF_ANSWERS)
            self._answers.receive_rows(answer.numpy(), others, rank, OF_ANSWERS)
        self.bytes_per_call = self._ghosts.bytes + self._answers.bytes

    def disconnect(self) -> None:
        """Let go of the memory that was exchanged."""
        self._ghosts.free()
        self._answers.free()

    def finish(self) -> None:
        """Wait for ghosts and answers that are under way."""
        self._ghosts.finish()
        self._answers.finish()

    def call(self, step: int, stage: int, found: int) -> int:
        """As ``kernels.step.exchange.exchange``; an error, which a kernel cannot raise, ends all ranks."""
        try:
            began = time.perf_counter()
            if stage == WALL_LOADS:
                self._add_loads()
                self.seconds += time.perf_counter() - began
                return found
            self.finish()
            if stage != ARRIVED:
                self._ghosts.start()
                self._answers.start()
                self.bytes += self.bytes_per_call
            if stage == self._last:
                self._mine[0] = found
                self._world.comm.Allreduce(self._mine, self._all, op=self._mpi.BOR)
                found = int(self._all[0])
                self.calls += 1
            if found:  # no force call follows
                self.finish()
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
        with changed(self.loads) as loads:
            mine = loads.sum(axis=0)
            loads[1:] = 0
            self._world.comm.Allreduce(mine, loads[0], op=self._mpi.SUM)
        self.bytes += mine.nbytes
