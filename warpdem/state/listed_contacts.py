"""The contacts of the lists as the last force call left them: where their arrays are, and how they are read."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from warpdem.kernels.contact.columns import Columns
from warpdem.kernels.wall import record as wall_record
from warpdem.state.particles import State

CONTACT_ARRAYS = ("owner", "partner", "slot_i", "slot_j", "slot_force", "history")
"""Arrays of contacts between grains that a copy holds."""
WALL_ARRAYS = ("first", "grain", "point_count", "point", "result")
"""Arrays of contacts with walls that a copy holds."""


@dataclass(frozen=True)
class ListedContacts:
    """Contacts between grains, in batches of so many lanes, and with walls; on the device of a run or copied to the host.

    Batches may hold lanes that only fill them, and contacts of grains that have left: ``real_lanes`` passes over both.
    """

    state: State
    """The grains, whose memory slots the arrays name."""
    history_columns: Columns
    """Columns of the contact history."""
    contact_count: int
    """Contacts between grains."""
    row_count: int
    """Grains beside a wall."""
    owner: wp.array | None
    """Memory slot of the grain of the lower id, shape (batches, lanes)."""
    partner: wp.array | None
    """Memory slot of the other grain, shape (batches, lanes)."""
    slot_i: wp.array | None
    """Force slot of the owner, shape (batches, lanes)."""
    slot_j: wp.array | None
    """Force slot of the partner, shape (batches, lanes)."""
    slot_force: wp.array | None
    """Pair force on one grain [N], and torque [N m] where grains spin, shape (force slots + 1, 3 or 6)."""
    history: wp.array | None
    """Contact history, and after it what the energy budget keeps (``Features.impulses``), shape (batches, numbers, lanes)."""
    constants: Callable[[], wp.array]
    """Gives what does not change of each contact, shape (batches, numbers, lanes)."""
    walls: Any
    """Contacts with walls, ``WallContacts`` of ``kernels.wall.contact`` or its copied arrays; None without walls."""

    def real_lanes(self) -> np.ndarray:
        """Numbers of the lanes that hold a contact of grains that are present, shape (contacts,)."""
        assert self.slot_i is not None and self.slot_force is not None  # there are contacts
        real = self.slot_i.numpy().ravel() < self.slot_force.shape[0] - 1
        if len(self.state) < self.state.slots:
            for side in (self.owner, self.partner):
                assert side is not None
                real &= self.state.here[side.numpy().ravel()]
        return np.flatnonzero(real)

    @property
    def wall_grains(self) -> np.ndarray:
        """Memory slots of the grains that have wall candidates, shape (row_count,)."""
        return self.walls.grain.numpy()[: self.row_count] if self.row_count else np.zeros(0, dtype=np.int32)

    def point_slots(self, parity: int, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slots of the wall contact points of the grains in memory slots ``g``, and the grain of each.

        Args:
            parity: parity of the step of the force call that found them.
            g: memory slots, shape (k,).
        """
        count = self.walls.point_count.numpy()[parity, g]
        slot = np.repeat(self.walls.first.numpy()[g] - np.cumsum(count) + count, count) + np.arange(count.sum())
        return slot, np.repeat(g, count)

    def contact_points(self, parity: int, slot: np.ndarray) -> dict[str, np.ndarray]:
        """Wall contact points in ``slot``: history and results of the last force call, by the names of ``wall.record``."""
        history, result = self.walls.point.numpy()[parity, slot], self.walls.result.numpy()[slot]
        return wall_record.unpacked(self.history_columns, history, result)

    def copied(self, state: State, take: Callable[[str, wp.array], wp.array], pairs: bool) -> "ListedContacts":
        """A copy that stays as it is while the run goes on.

        Args:
            state: copy of the grains.
            take: copies an array, given a name of its own.
            pairs: whether contacts between grains are copied too; else they cannot be read.
        """
        arrays: dict[str, Any] = dict.fromkeys(CONTACT_ARRAYS)
        constants = self.constants
        if pairs and self.contact_count:
            arrays = {name: take(f"contacts {name}", getattr(self, name)) for name in CONTACT_ARRAYS}
            kept = take("contacts constants", self.constants())
            constants = lambda: kept  # noqa: E731
        walls = None
        if self.walls is not None:  # before the first grain is inserted some arrays do not exist yet
            found = {name: getattr(self.walls, name) for name in WALL_ARRAYS}
            walls = SimpleNamespace(**{k: None if a is None else take(f"wall contacts {k}", a) for k, a in found.items()})
        return replace(self, state=state, **arrays, constants=constants, walls=walls)
