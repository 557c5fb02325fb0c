"""The present instant of a run, copied aside: what it shows is told and written in another thread while the run goes on.

A GPU copies the arrays into its own memory first and goes on at once; from there they go to page-locked memory of the host
beside the next steps. A CPU copies them to the same place by itself.
"""

import copy
import time
from collections.abc import Sequence
from types import SimpleNamespace

import warp as wp

CONTACT_ARRAYS = ("owner", "partner", "slot_i", "slot_j", "row", "memory")
"""Arrays of the lists that tell about contacts between grains."""
WALL_ARRAYS = ("first", "grain", "place_count", "place", "result")
"""Arrays of the wall rows that tell about contacts with walls."""
POLL = 1.0e-3  # [s] between two looks whether a copy is done


class Room:
    """Host memory for the arrays of one instant, kept for those to come: page-locking it takes longer than a copy.

    Args:
        device: where the arrays come from.
    """

    def __init__(self, device) -> None:
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
        host = wp.array(ptr=kept.ptr, shape=array.shape, dtype=array.dtype, device="cpu")
        host._ref = kept  # as in Warp's own views: it holds the memory
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


class Instant:
    """A simulation as it was when this was made.

    Args:
        sim: the simulation at the instant; it may go on afterwards.
        room: memory of an instant that is not read any more.
        contacts: whether the contacts between grains are asked for.
    """

    def __init__(self, sim, room: Room, contacts: bool = True) -> None:
        sim._prepare()
        room.wait()
        self._room = room
        still = self._still = copy.copy(sim)
        for part in ("state", "lists", "engine", "_clock"):
            setattr(still, part, copy.copy(getattr(sim, part)))
        still.lists.state, still.lists.clock, still.engine.lists = still.state, still._clock, still.lists
        still.engine.batch = SimpleNamespace(control=SimpleNamespace())
        self._hold("state", still.state, sim.state, sim.state.names)
        self._hold("scene", still, sim, ("coefficients",))
        self._hold("step", still.engine.batch.control, sim.engine.batch.control, ("extreme",))
        if sim.walls is not None:
            still.lists.rows, still.walls = SimpleNamespace(), SimpleNamespace(surface=SimpleNamespace())
            self._hold("wall rows", still.lists.rows, sim.lists.rows, WALL_ARRAYS)
            self._hold("walls", still.walls.surface, sim.walls.surface, ("wall", "material"))
        if not contacts:
            vars(still.lists).update(dict.fromkeys(CONTACT_ARRAYS))  # nobody reads the arrays of the run by mistake
        elif sim.lists.contact_count:
            self._hold("contacts", still.lists, sim.lists, CONTACT_ARRAYS)
            constants = room.take("contacts constants", sim.lists.contact_constants())
            still.lists.contact_constants = lambda: constants
        read = [room.take(f"read {number}", array) for number, array in enumerate(sim._read())]
        still._read = lambda: read
        room.send()
        if sim.budget is not None:
            sim.budget.begin()
            sums = {name: values.copy() for name, values in sim.engine.read_sums().items()}
            still.engine.read_sums = lambda: sums
            still.budget = copy.copy(sim.budget)
            still.budget.sim, still.budget.gone = still, copy.deepcopy(sim.budget.gone)

    def _hold(self, group: str, owner, source, names: Sequence[str]) -> None:
        """Give ``owner`` host copies of arrays of ``source``; ``group`` tells them from those of others in the room.

        Before the first grain comes in there are arrays that nobody has made.
        """
        for name in names:
            array = getattr(source, name)
            setattr(owner, name, None if array is None else self._room.take(f"{group} {name}", array))

    def simulation(self):
        """The simulation at the instant, to be read and no more; waits until all of it has arrived."""
        self._room.wait()
        return self._still
