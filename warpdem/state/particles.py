"""The grains of a run on the device: moving state, constants, and their order in memory.

A grain that has left the domain keeps its slot until the lists are rebuilt (``kernels.grain``): the slots of the others
stay as they are. ``rank`` leaves it out, and so does all that is read by it.
"""

import copy
import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

import numpy as np
import warp as wp

from warpdem.core.array_view import array_view
from warpdem.core.huge_pages import in_huge_pages
from warpdem.filling.initial_grains import InitialGrains
from warpdem.kernels import clump, grain
from warpdem.kernels.contact.films import FILM_AT
from warpdem.model.liquid import Liquid
from warpdem.model.model import Model
from warpdem.state.clumps import ClumpState, member_inverse


@contextmanager
def changed(array: wp.array) -> Iterator[np.ndarray]:
    """The contents of an array, to be changed in place: on a CPU its memory, else a copy that goes back."""
    values = array.numpy()
    yield values
    assert array.device is not None
    if not array.device.is_cpu:
        array.assign(values)


def unrotated(count: int) -> np.ndarray:
    """Quaternions of grains whose body axes are the frame axes, shape (count, 4)."""
    return np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))


class State:
    """Device arrays per grain, in memory order (neighbours in space are neighbours in memory); ids stay with their grain.

    Attributes:
        record: moving state, shape (n,), see ``kernels.grain``.
        inverse: 1/m [1/kg] and 1/I [1/(kg m2)], shape (n,) of two numbers.
        id: grain ids, shape (n,), int64.
        material: material index, shape (n,), int32.
        group: number of the group, shape (n,), int32, on the host: only results show it.
        came: step at which each grain was inserted, shape (n,), int64, on the host; None where nobody asks for it.
        next_id: least id that no grain has had so far.
        slots: length of the arrays: the grains, and those that have left since the lists were made.
        here: whether the grain in each slot is still there, shape (slots,), on the host.
        ghosts: grains of other processes that stand behind the others; 0 in a run of one process.
        orientation: quaternion (w, x, y, z) from body axes to frame axes, shape (n,); None when it is not requested.
        clumps: the clumps that grains are members of; None in a run without any.
        film: liquid of each grain in counts, shape (n, 3), columns as of ``kernels.contact.films.FILM_AT``; None without a law
            of bridges.
        liquid_left: what grains took along that are in no slot any more, the same columns, on the host.
        energies, momenta, wall_work: what the budgets of the plan add up per grain (``kernels.measure.budget``), shape (n,
            width each).
    """

    def __init__(
        self, start: InitialGrains, density: np.ndarray, spins: bool, orientation: bool, device: wp.Device,
        sums: Mapping[str, int] = MappingProxyType({}), liquid: Liquid | None = None,
    ) -> None:  # fmt: skip
        self.device = device
        self.spins = spins
        self.sums = sums
        n = len(start.id)
        mass = density[start.type] * (4.0 / 3.0) * np.pi * start.radius**3
        record = np.zeros((n, grain.WIDTH[spins]))
        record[:, grain.POSITION] = start.position
        record[:, grain.RADIUS] = start.radius
        record[:, grain.VELOCITY] = start.velocity
        if spins:
            record[:, grain.SPIN] = start.spin
        self._Record = grain.build(spins).Record
        self._Inverse = clump.inverse_type(start.clumps is not None)
        self.record: wp.array = in_huge_pages(wp.array(record, dtype=self._Record, device=device))
        inverse = np.stack([1.0 / mass, 2.5 / (mass * start.radius**2)], axis=1).reshape(n, 2)
        self.clumps: ClumpState | None = None
        if start.clumps is not None:
            self.clumps = ClumpState(start.clumps, start.radius, device)
            inverse = member_inverse(inverse, start.clumps, start.radius)
        self.inverse: wp.array = in_huge_pages(wp.array(inverse, dtype=self._Inverse, device=device))
        self.id: wp.array = wp.array(np.asarray(start.id, dtype=np.int64), dtype=wp.int64, device=device)
        self.material: wp.array = wp.array(np.asarray(start.type, dtype=np.int32), dtype=wp.int32, device=device)
        self.group = np.asarray(start.group, dtype=np.int32)
        self.came: np.ndarray | None = None
        self.orientation: wp.array | None = None
        if orientation:
            self.orientation = wp.array(unrotated(n), dtype=wp.vec4d, device=device)
        for name, width in sums.items():
            setattr(self, name, wp.zeros((n, width), dtype=wp.float64, device=device))
        self.liquid = liquid
        self.film: wp.array | None = None
        if liquid is not None:
            self.film = wp.array(liquid.films(start), dtype=wp.int64, device=device)
        self.liquid_left = np.zeros(FILM_AT.width, dtype=np.int64)
        self.next_id = int(start.id.max(initial=-1)) + 1
        self.ghosts = 0
        self._all_here(n)
        self._room: dict[str, wp.array] = {}  # for grains to come: arrays that those of the same name are the first rows of

    @classmethod
    def of(cls, model: Model, start: InitialGrains) -> "State":
        """The grains of a model at the start, moving as its integrator holds them."""
        contact, measures = model.features.contact, model.features.measures
        out = cls(start, model.density, contact.spins, measures.orientation, model.device, measures.sums, model.liquid)
        if measures.residence:
            out.came = np.zeros(out.slots, dtype=np.int64)
        return out

    def __len__(self) -> int:
        return self._count

    def _all_here(self, slots: int) -> None:
        self.slots = self._count = slots
        self.here = np.ones(slots, dtype=bool)
        self._rank: np.ndarray | None = None

    @property
    def owned(self) -> int:
        """Slots of the grains that this process moves."""
        return self.slots - self.ghosts

    @property
    def owned_count(self) -> int:
        """Grains of this process that are there."""
        return int(self.here[: self.owned].sum()) if self.ghosts else self._count

    @property
    def rank(self) -> np.ndarray:
        """Memory slots of the grains in ascending order of id, shape (n,), on the host."""
        if self._rank is None:
            order = np.argsort(self.id.numpy(), kind="stable")
            self._rank = order if self._count == self.slots else order[self.here[order]]
        return self._rank

    @property
    def ids(self) -> np.ndarray:
        """Ids of the grains that are there, ascending, shape (n,), on the host."""
        return self.id.numpy()[self.rank]

    def leave(self, gone: np.ndarray) -> None:
        """Take the grains in slots ``gone`` out of the domain: out of the way, each to a place of its own."""
        with changed(self.record) as record:
            radius = record[gone, grain.RADIUS]
            record[gone] = 0.0
            record[gone, 0], record[gone, 1], record[gone, grain.RADIUS] = grain.REMOVED_X, grain.REMOVED_SPACING * gone, radius
        if self.clumps is not None:
            self.clumps.leave(gone)
        self.mark_left(gone)

    def mark_left(self, gone: np.ndarray) -> None:
        """Take note that the grains in slots ``gone`` are out of the domain: where a kernel has put them."""
        here = self.here.copy()  # what was copied aside for writers keeps the old one
        here[gone] = False
        self.here, self._count = here, int(here.sum())
        if self._rank is not None:
            self._rank = self._rank[here[self._rank]]

    @property
    def names(self) -> list[str]:
        """Names of the device arrays."""
        kept = [name for name in ("orientation", "film") if getattr(self, name) is not None]
        return ["record", "inverse", "id", "material", *kept, *self.sums]

    def arrays(self) -> dict[str, np.ndarray]:
        """All arrays by name, in memory order: in ascending order of id, as ``rank`` gives it, ``restore`` takes them back."""
        came = {} if self.came is None else {"came": self.came}
        return {name: getattr(self, name).numpy() for name in self.names} | {"group": self.group, **came}

    def add(self, start: InitialGrains, density: np.ndarray, step: int = 0) -> None:
        """Append the grains ``start`` (absolute velocities and spins), inserted at ``step``, after the others."""
        if (start.clumps is None) != (self.clumps is None):
            raise ValueError("the grains that come must know of clumps where those there do")
        more = State(start, density, self.spins, self.orientation is not None, self.device, self.sums, self.liquid)
        there, n = self.slots, self.slots + more.slots
        for name in self.names:
            array, new = getattr(self, name), getattr(more, name)
            room = self._room.get(name)
            if room is None or room.ptr != array.ptr or len(room) < n:
                room = self._room[name] = wp.empty((n + n // 8 + 64, *array.shape[1:]), dtype=array.dtype, device=self.device)
                wp.copy(room, array, count=array.size)
            wp.copy(room, new, dest_offset=there * (new.size // len(new)), count=new.size)
            setattr(self, name, array_view(room, (n, *array.shape[1:]), array.dtype))
        if self.clumps is not None and more.clumps is not None:
            self.clumps.add(more.clumps, there)
        self.next_id = max(self.next_id, more.next_id)
        self.group = np.concatenate([self.group, more.group])
        if self.came is not None:
            self.came = np.concatenate([self.came, np.full(more.slots, step, dtype=np.int64)])
        here = np.concatenate([self.here, more.here])
        self._all_here(len(here))
        self.here, self._count = here, int(here.sum())

    def reorder(self, order: np.ndarray) -> None:
        """Put the grains into ``order``: slot s gets what was in slot order[s]; none of those that have left is among them."""
        if self.film is not None:
            self.liquid_left = self.liquid_left + np.delete(self.film.numpy(), order, axis=0).sum(axis=0)
        index: wp.array = wp.array(order.astype(np.int32), dtype=wp.int32, device=self.device)
        for name in self.names:
            array = getattr(self, name)
            picked = wp.empty((len(order), *array.shape[1:]), dtype=array.dtype, device=self.device)
            # Warp's stubs know neither an axis that is taken whole nor a copy from such an array
            wp.copy(picked, wp.indexedarray(array, [index] + [None] * (array.ndim - 1)))  # type: ignore[arg-type, list-item]
            if picked.shape == array.shape:  # in place: launches that were captured find it there
                wp.copy(array, picked)
            else:
                setattr(self, name, picked)
        self.group = self.group[order]
        if self.clumps is not None:
            self.clumps.reorder(order)
        if self.came is not None:
            self.came = self.came[order]
        self._all_here(len(order))

    def places_to_sort_by(self, slots: np.ndarray) -> np.ndarray:
        """Positions that grains in memory slots are sorted by [m], shape (n, 3): members of a clump stay together."""
        record = self.record.numpy()
        if self.clumps is None:
            return record[slots, grain.POSITION]
        return record[self.clumps.lead()[slots], grain.POSITION]

    def bodies(self, slots: np.ndarray) -> np.ndarray:
        """Those of the memory slots that stand for a body: a grain of its own, or the first member of a clump."""
        return slots if self.clumps is None else slots[self.clumps.lead()[slots] == slots]

    def digest(self, step_number: int) -> str:
        """SHA-256 of step number, ids and moving state in order of id: equal runs have equal ones."""
        digest = hashlib.sha256(str(step_number).encode())
        digest.update(self.ids.tobytes())
        digest.update(np.ascontiguousarray(self.record.numpy()[self.rank]).tobytes())
        if self.film is not None:
            digest.update(np.ascontiguousarray(self.film.numpy()[self.rank]).tobytes())
        if self.clumps is not None:
            digest.update(self.clumps.bytes_in_order(self.rank))
        return digest.hexdigest()

    def by_id(self, columns: slice | int) -> np.ndarray:
        """Columns of the record in ascending order of id, a fresh copy."""
        return self.record.numpy()[self.rank, columns]

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over the arrays of a checkpoint, which are in order of id."""
        n = len(data["id"])
        for name in self.names:
            array = getattr(self, name)
            # a run that kept no orientation, or added nothing up, can start one that does
            values = data.get(name, np.zeros((n, self.sums[name])) if name in self.sums else unrotated(n))
            setattr(self, name, in_huge_pages(wp.array(values, dtype=array.dtype, device=self.device)))
        self.group = np.asarray(data["group"], dtype=np.int32)
        if self.came is not None:
            self.came = np.asarray(data["came"], dtype=np.int64)
        self.next_id = data["next_id"]
        if self.clumps is not None:
            self.clumps.restore(data)
        self._all_here(len(self.group))

    def copied(self, take: Callable[[str, wp.array], wp.array]) -> "State":
        """A copy to be read while the run goes on; ``take`` copies an array, given a name of its own."""
        out = copy.copy(self)
        for name in self.names:
            setattr(out, name, take(f"state {name}", getattr(self, name)))
        if self.clumps is not None:
            out.clumps = self.clumps.copied(take)
        return out
