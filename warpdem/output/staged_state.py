"""A run at one time, copied aside: it is read and written in another thread while the run goes on.

A GPU copies the arrays into its own memory first and goes on at once; from there they go to page-locked memory of the host
beside the next steps. A CPU copies them to the same place by itself.
"""

import copy
import time
from dataclasses import dataclass

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.measure.budget import Budget
from warpdem.state.view import RunView

POLL = 1.0e-3  # [s] between two looks whether a copy is done


class StagingBuffer:
    """Host memory for the arrays of one snapshot, kept for those to come: page-locking it takes longer than a copy.

    Args:
        device: where the arrays come from.
    """

    def __init__(self, device: wp.Device) -> None:
        self._stream = wp.Stream(device) if device.is_cuda else None
        self._kept: dict[str, wp.array] = {}
        self._copies: list[tuple[wp.array, wp.array]] = []
        self._done: wp.Event | None = None

    def take(self, name: str, array: wp.array) -> wp.array:
        """Array of the host that will hold what ``array`` holds now, once ``send`` and ``wait`` have been called."""
        size = array.size * wp.types.type_size_in_bytes(array.dtype)
        kept = self._kept.get(name)
        if kept is None or kept.size < size:
            pinned = self._stream is not None
            kept = self._kept[name] = wp.empty(size + size // 4 + 64, dtype=wp.uint8, device="cpu", pinned=pinned)
        host = array_view(kept, array.shape, array.dtype)
        self._copies.append((host, wp.clone(array) if self._stream else array))
        return host

    def send(self) -> None:
        """Copy all arrays taken: on a GPU beside what is launched from now on."""
        if self._stream:
            self._stream.wait_stream(self._stream.device.stream)
        for host, array in self._copies:
            wp.copy(host, array, stream=self._stream)
        if self._stream:
            self._done = self._stream.record_event()

    def wait(self) -> None:
        """Wait until the copies are there."""
        # asked for, not waited for: Warp refuses to wait while the run captures a graph, and it may at any moment
        while self._done is not None and not self._done.is_complete:
            time.sleep(POLL)
        self._copies.clear()


@dataclass(frozen=True)
class CopiedReadings:
    """What kernels read off a state that has gone on since."""

    extreme: np.ndarray
    """As ``StepReader.extreme``, shape (4,)."""
    by_slot: tuple[wp.array, wp.array, wp.array]
    """What ``StepReader.read`` gave."""
    sums: dict[str, np.ndarray]
    """What ``StepReader.read_sums`` gave."""
    losses: np.ndarray
    """What ``StepReader.read_losses`` gave."""
    digits: dict[str, np.ndarray]
    """What ``StepReader.digits`` gave."""

    def read(self) -> tuple[wp.array, wp.array, wp.array]:
        """As ``StepReader.read``."""
        return self.by_slot

    def read_losses(self) -> np.ndarray:
        """As ``StepReader.read_losses``."""
        return self.losses

    def read_sums(self) -> dict[str, np.ndarray]:
        """As ``StepReader.read_sums``."""
        return self.sums


class StagedState:
    """A copy of a run at one time, to be read while it goes on.

    Args:
        live: the run, its forces evaluated.
        room: memory of a copy that is not read any more.
        contacts: whether the contacts between grains are copied too.
    """

    def __init__(self, live: RunView, room: StagingBuffer, contacts: bool = True) -> None:
        room.wait()
        self._room = room
        read = live.reader.read()  # first: the motion of clumps is a part of what is copied
        state = live.state.copied(room.take)
        listed = live.contacts.copied(state, room.take, contacts)
        loads, velocity, spin = (room.take(f"read {k}", array) for k, array in enumerate(read))
        extreme = live.reader.extreme.copy()
        room.send()
        sums: dict[str, np.ndarray] = {}
        losses = np.zeros(0)
        if live.totals is not None:
            Budget(live).begin()
            sums = {name: values.copy() for name, values in live.reader.read_sums().items()}
        if live.model.features.measures.energy:
            losses = live.reader.read_losses()
        reader = CopiedReadings(extreme, (loads, velocity, spin), sums, losses, live.reader.digits)
        totals = copy.deepcopy(live.totals)
        departures = live.departures.copied() if live.departures is not None else None
        model, left = live.model.at_present(), copy.deepcopy(live.left)
        self._view = RunView(model, state, copy.copy(live.clock), reader, totals, lambda: listed, left, departures)

    def view(self) -> RunView:
        """The run at that time; waits until all of it has arrived."""
        self._room.wait()
        return self._view
