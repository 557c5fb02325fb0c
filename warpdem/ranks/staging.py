"""The exchange of ranks whose steps are launches on a GPU: what is sent and received passes through memory of the host.

After a stage the rows that other ranks see are gathered on the device, copied to page-locked memory of the host and sent from
there; what comes goes the same way back, to the rows of the ghosts. Nothing here asks MPI for memory of a device. Where the
device is a CPU the same copies are made, so that they can be tried without a GPU.
"""

from typing import Any

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.kernels.step.exchange import ARRIVED, WALL_LOADS
from warpdem.ranks.exchange import OF_ANSWERS, TAG, Exchange, Links
from warpdem.ranks.world import World


class HostMemory:
    """Memory of the host by name, kept from one list to the next: page-locking it takes longer than a copy."""

    def __init__(self) -> None:
        self._kept: dict[str, wp.array] = {}

    def rows(self, name: str, count: int, like: wp.array) -> wp.array:
        """An array of ``count`` rows of the type of ``like``, for copies to and from its device."""
        size = count * wp.types.type_size_in_bytes(like.dtype)
        kept = self._kept.get(name)
        if kept is None or kept.size < size:
            assert like.device is not None
            kept = wp.empty(size + size // 4 + 64, dtype=wp.uint8, device="cpu", pinned=like.device.is_cuda)
            self._kept[name] = kept
        return array_view(kept, (count,), like.dtype)


class Mirror:
    """Some rows of an array of the device, on the host: those that are sent, then those that are received.

    Args:
        array: of shape (n,).
        sent: numbers of the rows that are sent.
        received: of those that are received.
        memory: where they are on the host, under ``name``.

    Attributes:
        values: the rows on the host.
    """

    def __init__(self, array: wp.array, sent: np.ndarray, received: np.ndarray, memory: HostMemory, name: str) -> None:
        count, device = len(sent) + len(received), array.device
        host, here = memory.rows(name, count, array), wp.empty(count, dtype=array.dtype, device=device)
        there: list[Any] = [
            wp.indexedarray(array, [wp.array(rows.astype(np.int32), device=device)]) for rows in (sent, received)
        ]
        part = slice(0, len(sent)), slice(len(sent), count)
        self._out = [(here[part[0]], there[0]), (host[part[0]], here[part[0]])] if len(sent) else []
        self._back = [(here[part[1]], host[part[1]]), (there[1], here[part[1]])] if len(received) else []
        self.values: np.ndarray = host.numpy()

    def link(self, links: Links, tag: int, sends: dict[int, int], receives: dict[int, int]) -> None:
        """Send and receive the rows by ``links``; ``sends``, ``receives``: how many, by rank, in their order."""
        at = 0
        for counts, message in ((sends, links.send), (receives, links.receive)):
            for rank, count in counts.items():
                message(self.values[at : at + count], rank, tag)
                at += count

    def fetch(self) -> None:
        """Copy what is sent to the host, after what has been launched."""
        for target, source in self._out:
            wp.copy(target, source)

    def give(self) -> None:
        """Copy what was received to the device, before what will be launched."""
        for target, source in self._back:
            wp.copy(target, source)


class StagedExchange(Exchange):
    """As ``Exchange``, called between the launches of two stages.

    Args:
        world, stages: as of ``Exchange``.
        found: what was found in the step, on the device.
    """

    def __init__(self, world: World, stages: int, found: wp.array) -> None:
        super().__init__(world, stages)
        self._found, self._memory = found, HostMemory()
        self._of_ghosts: list[Mirror] = []
        self._of_answers: list[Mirror] = []

    def connect(
        self, changing: list[wp.array], owned: int, sends: dict[int, np.ndarray], receives: dict[int, int]
    ) -> None:
        """As ``Exchange``."""
        self._ghosts.free()
        sent, ghosts = _joined(list(sends.values())), owned + np.arange(sum(receives.values()))
        self._of_ghosts = [Mirror(array, sent, ghosts, self._memory, f"ghosts {k}") for k, array in enumerate(changing)]
        for tag, mirror in enumerate(self._of_ghosts, TAG):
            mirror.link(self._ghosts, tag, {rank: len(slots) for rank, slots in sends.items()}, receives)
        self.bytes_per_call = self._ghosts.bytes + self._answers.bytes

    def connect_answers(self, answer: wp.array | None, contacts: dict[int, tuple[np.ndarray, np.ndarray]]) -> None:
        """As ``Exchange``."""
        self._answers.free()
        sent, received = (_joined([slots[k] for slots in contacts.values()]) for k in (0, 1))
        self._of_answers = []
        if answer is not None:
            self._of_answers = [mirror := Mirror(answer, sent, received, self._memory, "answers")]
            sends, receives = ({rank: len(slots[k]) for rank, slots in contacts.items()} for k in (0, 1))
            mirror.link(self._answers, OF_ANSWERS, sends, receives)
        self.bytes_per_call = self._ghosts.bytes + self._answers.bytes

    def after_stage(self, step: int, stage: int) -> int:
        """As ``call``, once the launches of a stage have been given to the device."""
        mirrors = [*self._of_ghosts, *self._of_answers] if stage != WALL_LOADS else []
        for mirror in mirrors:
            mirror.fetch()
        wp.synchronize_device(self._found.device)
        found = self.call(step, stage, int(self._found.numpy()[0]) if stage == self._last else 0)
        self.call(step, ARRIVED, 0)  # nothing is launched meanwhile
        for mirror in mirrors:
            mirror.give()
        return found


def _joined(rows: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *rows])
