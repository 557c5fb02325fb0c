"""Messages between GPUs by NCCL, which go from device to device and can be captured in graphs."""

import importlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from typing import Any, Protocol

import warp as wp

from warpdem.core.array_view import array_view
from warpdem.ranks.world import World


class DeviceMessages(Protocol):
    """Messages from and to memory of a device, in the order of its stream; all ranks make the same calls.

    Attributes:
        name: of what carries them.
    """

    name: str

    def group(self) -> AbstractContextManager[None]:
        """The messages in the block are under way together; those between two ranks meet in the order of the calls."""

    def send(self, values: wp.array[Any], rank: int) -> None:
        """Send ``values``, whose memory is contiguous; in a group."""

    def receive(self, values: wp.array[Any], rank: int) -> None:
        """Receive ``values``, whose memory is contiguous; in a group."""

    def add(self, values: wp.array[Any]) -> None:
        """Let ``values``, int64 or int32, be the sum over all ranks."""

    def largest(self, values: wp.array[Any]) -> None:
        """Let ``values``, int64 or int32, be the largest of all ranks."""

    def close(self) -> None:
        """Let go of what carries them, on all ranks together."""


class NcclMessages:
    """As ``DeviceMessages``, by nccl4py; one rank per GPU.

    Args:
        nccl: the module ``nccl.core``.
        world: the ranks.
        device: the GPU of this one.
        unique_id: that rank 0 has got from ``nccl``.
    """

    name = "NCCL"

    def __init__(self, nccl: Any, world: World, device: wp.Device, unique_id: Any) -> None:
        self._nccl, self._device = nccl, device
        with wp.ScopedDevice(device):  # the communicator is of the current device
            self._comm = nccl.Communicator.init(nranks=world.size, rank=world.rank, unique_id=unique_id)

    @contextmanager
    def group(self) -> Iterator[None]:
        """As ``DeviceMessages``."""
        with wp.ScopedDevice(self._device), self._nccl.group():
            yield

    def send(self, values: wp.array[Any], rank: int) -> None:
        """As ``DeviceMessages``."""
        self._comm.send(as_bytes(values), rank, stream=wp.get_stream(self._device))

    def receive(self, values: wp.array[Any], rank: int) -> None:
        """As ``DeviceMessages``."""
        self._comm.recv(as_bytes(values), rank, stream=wp.get_stream(self._device))

    def add(self, values: wp.array[Any]) -> None:
        """As ``DeviceMessages``."""
        self._reduce(values, self._nccl.SUM)

    def largest(self, values: wp.array[Any]) -> None:
        """As ``DeviceMessages``."""
        self._reduce(values, self._nccl.MAX)

    def _reduce(self, values: wp.array[Any], operation: Any) -> None:
        flat = array_view(values, (values.size,), values.dtype)
        with wp.ScopedDevice(self._device):
            self._comm.allreduce(flat, flat, operation, stream=wp.get_stream(self._device))

    def close(self) -> None:
        """As ``DeviceMessages``."""
        self._comm.destroy()

    def abort(self) -> None:
        """Let go on this rank alone: another one has failed to begin."""
        self._comm.abort()


def as_bytes(values: wp.array[Any]) -> wp.array[Any]:
    """The memory of a contiguous array as bytes: messages know no vectors."""
    return array_view(values, (values.size * wp.types.type_size_in_bytes(values.dtype),), wp.uint8)


def nccl_messages(world: World, device: wp.Device) -> tuple[NcclMessages | None, str]:
    """Messages by NCCL; None where some rank cannot have them, and why. Called on all ranks together.

    All that a rank can know by itself is agreed on first: in NCCL's own start a rank waits for one that has failed.
    """
    gpus = world.everyone(device.uuid)
    if None in gpus:
        return None, f"rank {gpus.index(None)} has no GPU"
    for rank, gpu in enumerate(gpus):
        if gpu in gpus[:rank]:
            return None, f"ranks {gpus.index(gpu)} and {rank} share a GPU, which NCCL refuses"
    nccl: Any = None
    problem, unique_id, messages = "", None, None
    try:
        nccl = importlib.import_module("nccl.core")
        unique_id = nccl.get_unique_id() if world.rank == 0 else None
    except Exception as error:  # whatever is wrong with it: the host can do it
        problem = f"nccl4py cannot be used ({error}): pip install 'warpdem[nccl]'"
    if why := _first(world, problem):
        return None, why
    unique_id = world.comm.bcast(unique_id)
    try:
        messages = NcclMessages(nccl, world, device, unique_id)
        problem = _tried(messages, world, device)
    except Exception as error:
        problem = f"NCCL does not start ({error})"
    if why := _first(world, problem):
        if messages is not None:
            with suppress(Exception):  # as whatever it says, the host carries the messages
                messages.abort()
        return None, why
    return messages, ""


def _tried(messages: DeviceMessages, world: World, device: wp.Device) -> str:
    """What is wrong with a first message; so the ranks are connected before a graph is captured."""
    count = wp.ones(1, dtype=wp.int32, device=device)
    messages.add(count)
    found = int(count.numpy()[0])
    return "" if found == world.size else f"NCCL counts {found} of {world.size} ranks"


def _first(world: World, problem: str) -> str:
    """The problem of the lowest rank that has one, on all ranks."""
    return next((f"rank {rank}: {said}" for rank, said in enumerate(world.everyone(problem)) if said), "")
