"""Messages as between GPUs, over MPI and memory of the host: what a graph of several steps holds can be replayed on a CPU.

Each is a launch of one thread that calls a function of the host, so that a captured graph makes it whenever it is replayed, as
it does with those of NCCL.
"""

import ctypes
import sys
import traceback
from collections.abc import Callable
from contextlib import contextmanager

import numpy as np
import warp as wp
from mpi4py import MPI
from warpdem.kernels import MODULE_OPTIONS

from warpdem.ranks.world import World

Function = ctypes.CFUNCTYPE(None)


@wp.func_native("    reinterpret_cast<void (*)()>(address)();\n")
def call(address: wp.uint64):
    """Call a C function."""
    ...


@wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
def call_host(address: wp.uint64):
    """One thread."""
    call(address)


class MpiMessages:
    """As ``DeviceMessages``."""

    name = "MPI in place of NCCL"

    def __init__(self, world: World) -> None:
        self._comm = world.comm
        self._kept: list[Callable] = []  # ctypes functions that graphs call
        self._group: list[tuple[Callable, np.ndarray, int]] | None = None

    def _launch(self, function: Callable[[], None]) -> None:
        def guarded() -> None:
            try:
                function()
            except BaseException:
                sys.stderr.write(traceback.format_exc())
                sys.stderr.flush()
                self._comm.Abort(1)

        self._kept.append(Function(guarded))
        address = ctypes.cast(self._kept[-1], ctypes.c_void_p).value
        wp.launch(call_host, dim=1, inputs=[address], device="cpu")

    @contextmanager
    def group(self):
        assert self._group is None
        calls = self._group = []
        yield
        self._group = None
        self._launch(lambda: MPI.Request.Waitall([start(values, rank) for start, values, rank in calls]))

    def send(self, values: wp.array, rank: int) -> None:
        assert values.is_contiguous
        self._group.append((self._comm.Isend, values.numpy().view(np.uint8), rank))

    def receive(self, values: wp.array, rank: int) -> None:
        assert values.is_contiguous
        self._group.append((self._comm.Irecv, values.numpy().view(np.uint8), rank))

    def add(self, values: wp.array) -> None:
        there = values.numpy()
        self._launch(lambda: self._comm.Allreduce(MPI.IN_PLACE, there, op=MPI.SUM))

    def largest(self, values: wp.array) -> None:
        there = values.numpy()
        self._launch(lambda: self._comm.Allreduce(MPI.IN_PLACE, there, op=MPI.MAX))

    def close(self) -> None:
        assert self._group is None
