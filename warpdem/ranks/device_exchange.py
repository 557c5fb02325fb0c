"""The exchange of ranks whose messages go from device to device, within the graphs of ``engine.graph_of_steps``.

After a stage the rows that other ranks see are put side by side on the device and sent from there; ghosts are received where
they stand, the answers of films beside them and put into their places. What is found in a step is agreed on by the largest of
the ranks' flags, loads on walls by exact sums: whole numbers, so that no order matters.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.kernels.step import messages as kernels
from warpdem.kernels.step.exchange import FLAGS
from warpdem.ranks.device_messages import DeviceMessages


def words(values: wp.array) -> wp.array:
    """Rows of an array, shape (n,), which may be a column of a table, as words of four bytes, shape (n, words)."""
    count = wp.types.type_size_in_bytes(values.dtype) // 4
    return array_view(values, (len(values), count), wp.uint32, strides=(values.strides[0], 4))


class Rows:
    """Rows of an array beside each other.

    Args:
        array: shape (n,).
        numbers: of the rows.

    Attributes:
        values: the rows, shape (len(numbers),).
        memory: all arrays.
    """

    def __init__(self, array: wp.array, numbers: np.ndarray) -> None:
        self._rows: wp.array = wp.array(numbers.astype(np.int32), dtype=wp.int32, device=array.device)
        self.values = wp.empty(len(numbers), dtype=array.dtype, device=array.device)
        self._there, self._here = words(array), words(self.values)
        self.memory = [array, self._rows, self.values]

    def take(self) -> None:
        """Read them from the array."""
        inputs = [self._there, self._rows, self._here]
        wp.launch(kernels.take_rows, dim=self._here.shape, inputs=inputs, device=self.values.device)

    def put(self) -> None:
        """Write them to the array."""
        inputs = [self._here, self._rows, self._there]
        wp.launch(kernels.put_rows, dim=self._here.shape, inputs=inputs, device=self.values.device)


class MessageGroup:
    """Messages that are under way together.

    Attributes:
        bytes: that are sent each time.
        memory: arrays that are sent or received.
    """

    def __init__(self, messages: DeviceMessages) -> None:
        self._messages, self.bytes = messages, 0
        self.memory: list[wp.array] = []
        self._before: list[Callable[[], None]] = []
        self._calls: list[Callable[[], None]] = []
        self._after: list[Callable[[], None]] = []

    def send_rows(self, array: wp.array, slots: dict[int, np.ndarray]) -> None:
        """Send the rows ``slots`` of ``array`` to each rank."""
        if slots:
            rows = Rows(array, np.concatenate(list(slots.values())))
            self._before.append(rows.take)
            self._add(rows.values, {rank: len(numbers) for rank, numbers in slots.items()}, self._messages.send)
            self.memory += rows.memory
            self.bytes += rows.values.size * wp.types.type_size_in_bytes(array.dtype)

    def receive(self, values: wp.array, counts: dict[int, int], first: int = 0) -> None:
        """Receive ``values`` from ``first`` on, so many from each rank, in their order."""
        self._add(values, counts, self._messages.receive, first)
        self.memory.append(values)

    def receive_rows(self, array: wp.array, slots: dict[int, np.ndarray]) -> None:
        """Receive the rows ``slots`` of ``array`` from each rank."""
        if slots:
            rows = Rows(array, np.concatenate(list(slots.values())))
            self.receive(rows.values, {rank: len(numbers) for rank, numbers in slots.items()})
            self._after.append(rows.put)
            self.memory += rows.memory

    def _add(self, values: wp.array, counts: dict[int, int], message: Callable[[Any, int], None], at: int = 0) -> None:
        for rank, count in counts.items():
            if count:
                self._calls.append(partial(message, values[at : at + count], rank))
            at += count

    def join(self, other: "MessageGroup") -> None:
        """Let those of ``other`` be under way with these."""
        self.bytes += other.bytes
        self.memory += other.memory
        self._before += other._before
        self._calls += other._calls
        self._after += other._after

    def __call__(self) -> None:
        """Send and receive all."""
        for take in self._before:
            take()
        if self._calls:
            with self._messages.group():
                for call in self._calls:
                    call()
        for put in self._after:
            put()


class DeviceExchange:
    """What a rank sends and receives at every step: the messages of ``engine.graph_of_steps``, named there.

    Args:
        messages: what carries them.
        moved: of ``Report``, in which ``found`` sets the flags.
        stages: of the integrator.

    Attributes:
        loads, calls, bytes: as of ``Exchange``.
        seconds: None: the messages are in the graphs, and nobody looks at the time they take.
    """

    seconds: float | None = None

    def __init__(self, messages: DeviceMessages, moved: wp.array, stages: int) -> None:
        self._messages, self._flags, self._stages = messages, moved[FLAGS], stages
        self._ghosts, self._answers = MessageGroup(messages), MessageGroup(messages)
        self._all = MessageGroup(messages)
        self.loads: wp.array | None = None
        self.version = self.calls = self.bytes = 0

    def connect(
        self, changing: list[wp.array], owned: int, sends: dict[int, np.ndarray], receives: dict[int, int]
    ) -> None:
        """As ``Exchange``; the ranks are connected by messages that change nothing, before others are captured."""
        self._ghosts, self._answers = MessageGroup(self._messages), MessageGroup(self._messages)
        for array in changing:
            self._ghosts.send_rows(array, sends)
            self._ghosts.receive(array, receives, owned)
        self._ghosts()
        self._join()

    def connect_answers(self, answer: wp.array | None, contacts: dict[int, tuple[np.ndarray, np.ndarray]]) -> None:
        """As ``Exchange``."""
        self._answers = MessageGroup(self._messages)
        if answer is not None:
            self._answers.send_rows(answer, {rank: own for rank, (own, _) in contacts.items()})
            self._answers.receive_rows(answer, {rank: others for rank, (_, others) in contacts.items()})
        self._join()

    def _join(self) -> None:
        self._all = MessageGroup(self._messages)
        self._all.join(self._ghosts)
        self._all.join(self._answers)
        self.version += 1

    def finish(self) -> None:
        """As ``Exchange``: nothing is under way where the host looks."""

    # -- of a step ------------------------------------------------------------------------------

    def after_stage(self) -> None:
        """As ``engine.graph_of_steps.StepMessages``."""
        self._all()

    def add_loads(self) -> None:
        """As ``engine.graph_of_steps.StepMessages``."""
        assert self.loads is not None
        self._messages.add(self.loads)

    def agree(self) -> None:
        """As ``engine.graph_of_steps.StepMessages``."""
        self._messages.largest(self._flags)

    def arrays(self) -> list[wp.array]:
        """As ``engine.graph_of_steps.StepMessages``."""
        return [*self._all.memory, self._flags, *([self.loads] if self.loads is not None else [])]

    def repeated(self, steps: int) -> None:
        """As ``engine.graph_of_steps.StepMessages``."""
        loads = self.loads.size * 8 if self.loads is not None else 0
        self.calls += steps
        self.bytes += steps * (self._stages * self._all.bytes + loads)
