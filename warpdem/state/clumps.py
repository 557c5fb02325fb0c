"""The clumps of a run on the device: their moving state, and which grains are their members.

Clumps are in memory in the order of their first members, and the members of each follow each other there, in the order of the
template: whatever puts grains into another order keeps them together (``State.places_to_sort_by``).
"""

import copy
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import warp as wp

from warpdem.core.huge_pages import in_huge_pages
from warpdem.core.rigid_motion import quaternion_rotation_increment
from warpdem.filling.clump_grains import NONE, InitialClumps
from warpdem.kernels import clump, grain
from warpdem.kernels.clump import Reading

OF_CLUMPS = {"record": None, "turn": wp.vec4d, "rate": wp.vec4d, "first": wp.int32, "count": wp.int32}
"""Arrays with a row per clump, with their types, that a checkpoint holds but for ``first``."""
CLUMP_ARRAYS = {**OF_CLUMPS, "shape": wp.int32}
"""The same and ``shape``, which follows from what a checkpoint holds."""
MEMBER_ARRAYS = {"of_grain": wp.int32, "arm": wp.vec4d}
"""Arrays with a row per grain, and per member of each shape."""
OF_STEP = {"drive": clump.vec6, "rotation": wp.vec4d, "reading": Reading}
"""Arrays with a row per clump that a step or a reading writes before anything reads them."""


def member_inverse(inverse: np.ndarray, clumps: InitialClumps, radius: np.ndarray) -> np.ndarray:
    """``inverse`` of all grains, whose first two numbers those of spheres have: 1/m, 1/I, and B of ``kernels.clump``.

    Members have their share of the mass of their clump, and the mean of its inverse moments.

    Args:
        inverse: 1/m [1/kg] and 1/I [1/(kg m2)] of spheres, shape (n, 2).
        clumps: the clumps.
        radius: radii of the grains [m], shape (n,).
    """
    out = np.zeros((len(inverse), clump.WIDTH[True]))
    out[:, :2] = inverse
    out[:, [2, 5, 7]] = inverse[:, :1]
    member = clumps.of_grain != NONE
    of, axes, r = clumps.of_grain[member], clumps.matrices, clumps.arms()
    out[member, 0] = 1.0 / clumps.member_mass(radius)
    out[member, 1] = (1.0 / clumps.moments).mean(axis=1)[of]
    spread = np.einsum("nij,nj,nkj->nik", axes, 1.0 / clumps.moments, axes)[of]
    across = np.cross(r[:, None], np.eye(3)[None])  # r x e_k
    response = np.einsum("nki,nij,nlj->nkl", across, spread, across) + np.eye(3) / clumps.mass[of, None, None]
    out[member, 2:] = response[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return out


def shapes(arm: np.ndarray, first: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the members of clumps that are alike to the bit, once; and where in them those of each clump begin.

    Clumps of one template and size share them, so that a step finds them in its caches.

    Args:
        arm: place and radius of the members of all clumps, shape (n, 4).
        first, count: of each clump, its first row of ``arm`` and how many it has, shape (c,).
    """
    rows: list[np.ndarray] = [np.zeros((0, 4))]
    begin, at = np.zeros(len(first), np.int32), 0
    for members in np.unique(count):
        of = np.flatnonzero(count == members)
        found = np.ascontiguousarray(arm[first[of][:, None] + np.arange(members)], dtype=np.float64).reshape(len(of), -1)
        _, chosen, number = np.unique(found.view(f"V{found.itemsize * found.shape[1]}"), return_index=True, return_inverse=True)
        rows.append(found[chosen].reshape(-1, 4))
        begin[of] = at + members * number.ravel()
        at += len(rows[-1])
    return np.concatenate(rows), begin


def from_checkpoint(data: dict[str, Any], spin: np.ndarray, velocity: np.ndarray) -> InitialClumps:
    """Clumps of a checkpoint, grains in order of id, their motion relative to a frame.

    Args:
        data: the checkpoint.
        spin: angular velocity of the frame [rad/s], shape (3,).
        velocity: velocity of its origin [m/s], shape (3,).
    """
    of, record, rate = data["clump_of_grain"], data["clump_record"], data["clump_rate"]
    position, reading = record[:, grain.POSITION], data["clump_reading"]
    first = np.flatnonzero((of != NONE) & (np.concatenate([[NONE], of[:-1]]) != of))
    return InitialClumps(
        first=first[np.argsort(of[first])], count=data["clump_count"], template=data["clump_template"], position=position,
        velocity=reading[:, :3] - velocity - np.cross(spin, position), spin=reading[:, 3:6] - spin, turn=data["clump_turn"],
        mass=1.0 / rate[:, 0], moments=1.0 / rate[:, 1:], axes=data["clump_axes"], radius=record[:, grain.RADIUS],
        of_grain=of, arm=data["clump_arm"],
    )  # fmt: skip


class ClumpState:
    """Device arrays of the clumps, as ``kernels.clump`` has them.

    Attributes:
        record, turn, rate, first, count: of each clump.
        of_grain: of each grain.
        arm: of each member of clumps that are alike, once.
        drive, rotation: what acts on each clump in a step, and how it turns in it.
        reading: motion of each clump at the time of the last reading.
        template: number of each clump in the order of ``Scene.clumps``, on the host.
        axes: quaternion of each from the principal axes to those of the clump in the scene, on the host.
    """

    record: wp.array
    turn: wp.array
    rate: wp.array
    first: wp.array
    count: wp.array
    shape: wp.array
    of_grain: wp.array
    arm: wp.array
    drive: wp.array
    rotation: wp.array
    reading: wp.array

    def __init__(self, start: InitialClumps, radius: np.ndarray, device: wp.Device) -> None:
        record = np.zeros((len(start), grain.WIDTH[True]))
        record[:, grain.POSITION] = start.position
        record[:, grain.RADIUS] = start.radius
        record[:, grain.VELOCITY] = start.velocity
        record[:, grain.SPIN] = start.angular_momentum()
        rate = np.column_stack([1.0 / start.mass, 1.0 / start.moments])
        values = {"record": record, "turn": start.turn, "rate": rate, "first": start.first, "count": start.count}
        self.device = device
        arm, values["shape"] = shapes(np.column_stack([start.arm, radius]), start.first, start.count)
        self._take(values, {"of_grain": start.of_grain, "arm": arm}, start.template, start.axes)

    def __len__(self) -> int:
        return len(self.template)

    def _take(
        self, of_clumps: dict[str, np.ndarray], of_members: dict[str, np.ndarray], template: np.ndarray, axes: np.ndarray
    ) -> None:
        for name, dtype in {**CLUMP_ARRAYS, **MEMBER_ARRAYS}.items():
            value = np.ascontiguousarray({**of_clumps, **of_members}[name])
            kind = grain.build(True).Record if dtype is None else dtype
            value = value.astype(np.int32 if kind is wp.int32 else np.float64)
            setattr(self, name, in_huge_pages(wp.array(value, dtype=kind, device=self.device)))
        self.template, self.axes = np.asarray(template, dtype=np.int32), np.asarray(axes, dtype=np.float64)
        for name, dtype in OF_STEP.items():
            setattr(self, name, in_huge_pages(wp.zeros(len(template), dtype=dtype, device=self.device)))
        self._struct: Any = None

    def struct(self, kind: type) -> Any:
        """The struct ``kind`` of ``kernels.clump`` over the present arrays, made once for them."""
        if self._struct is None:
            self._struct = kind()
            for name in (*CLUMP_ARRAYS, *MEMBER_ARRAYS, *OF_STEP):
                setattr(self._struct, name, getattr(self, name))
            self._struct.spheres = int((self.of_grain.numpy() == NONE).sum())
        return self._struct

    def lead(self) -> np.ndarray:
        """Slot of the first member of the clump of each grain, its own for a grain of its own, shape (n,)."""
        of = self.of_grain.numpy()
        return np.where(of == NONE, np.arange(len(of)), self.first.numpy()[of])

    def leave(self, gone: np.ndarray) -> None:
        """Take clumps whose members are in slots ``gone`` out of the way, as ``State.leave`` does with the members."""
        first = self.first.numpy()
        slots = np.flatnonzero(np.isin(first, gone))
        record = self.record.numpy().copy()
        radius = record[slots, grain.RADIUS]
        record[slots] = 0.0
        record[slots, 0], record[slots, 1] = grain.REMOVED_X, grain.REMOVED_SPACING * first[slots]
        record[slots, grain.RADIUS] = radius
        self.record.assign(record)

    def moving(self, clumps: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Record, mass [kg], spin [rad/s] and angular momentum [N m s] of the clumps of these numbers, at mid-step."""
        record, rate = self.record.numpy()[clumps], self.rate.numpy()[clumps]
        axes, momentum = np.eye(3) + quaternion_rotation_increment(self.turn.numpy()[clumps]), record[:, grain.SPIN]
        return record, 1.0 / rate[:, 0], np.einsum("nij,nj,nkj,nk->ni", axes, rate[:, 1:], axes, momentum), momentum

    def _values(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        of_clumps = {name: getattr(self, name).numpy() for name in CLUMP_ARRAYS}
        return of_clumps, {name: getattr(self, name).numpy() for name in MEMBER_ARRAYS}

    def add(self, more: "ClumpState", slots: int) -> None:
        """Append the clumps ``more``, whose grains come after those in the first ``slots`` slots."""
        (own, of_own), (new, of_new) = self._values(), more._values()
        of_clumps = {name: np.concatenate([own[name], new[name]]) for name in CLUMP_ARRAYS}
        of_clumps["first"] = np.concatenate([own["first"], slots + new["first"]])
        of_clumps["shape"][len(self) :] += len(of_own["arm"])
        arm = np.concatenate([of_own["arm"], of_new["arm"]])
        arm, of_clumps["shape"] = shapes(arm, of_clumps["shape"], of_clumps["count"])
        number = np.where(of_new["of_grain"] == NONE, NONE, of_new["of_grain"] + len(self))
        of_grain = np.concatenate([of_own["of_grain"], number])
        template, axes = np.concatenate([self.template, more.template]), np.concatenate([self.axes, more.axes])
        self._take(of_clumps, {"of_grain": of_grain, "arm": arm}, template, axes)

    def reorder(self, order: np.ndarray) -> None:
        """Follow the grains, where slot s gets what was in slot order[s]; members of a clump stay together."""
        of_clumps, of_members = self._values()
        self._number(of_clumps, of_members["of_grain"][order], of_members["arm"])

    def _number(self, of_clumps: dict[str, np.ndarray], of: np.ndarray, arm: np.ndarray) -> None:
        """Take the arrays over, with the clumps in the order of their members."""
        begins = np.flatnonzero((of != NONE) & (np.concatenate([[NONE], of[:-1]]) != of))
        clumps = of[begins]
        new = np.full(len(self.template) + 1, NONE)
        new[clumps] = np.arange(len(clumps))
        of_clumps = {name: values[clumps] for name, values in of_clumps.items()} | {"first": begins}
        self._take(of_clumps, {"of_grain": new[of], "arm": arm}, self.template[clumps], self.axes[clumps])

    def in_order(self, rank: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slots of the clumps in order of the id of their first member, shape (c,), and that member's slot."""
        of, first = self.of_grain.numpy()[rank], self.first.numpy()
        lead = (of != NONE) & (first[of] == rank)
        return of[lead], rank[lead]

    def bytes_in_order(self, rank: np.ndarray) -> bytes:
        """Moving state of all clumps in order of id; ``rank``: slots of the grains in order of id."""
        slots, _ = self.in_order(rank)
        return self.record.numpy()[slots].tobytes() + self.turn.numpy()[slots].tobytes()

    def arrays(self, rank: np.ndarray) -> dict[str, np.ndarray]:
        """What a checkpoint holds: arrays by name, clumps and grains in order of id; motion at the present time, just read."""
        slots, _ = self.in_order(rank)
        of_clumps, of_members = self._values()
        out = {name: values[slots] for name, values in of_clumps.items() if name not in ("first", "shape")}
        number = np.full(len(self) + 1, NONE)
        number[slots] = np.arange(len(slots))
        of = of_members["of_grain"]
        arm = np.zeros((len(of), 3))
        member = np.flatnonzero(of != NONE)
        row = of_clumps["shape"][of[member]] + member - of_clumps["first"][of[member]]
        arm[member] = of_members["arm"][row, :3]
        out |= {"of_grain": number[of[rank]], "arm": arm[rank]}
        out |= {"template": self.template[slots], "axes": self.axes[slots], "reading": self.reading.numpy()[slots]}
        return {f"clump_{name}": values for name, values in out.items()}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over what ``arrays`` gave."""
        of_clumps = {name: data[f"clump_{name}"] for name in OF_CLUMPS if name != "first"}
        self.template, self.axes, of = data["clump_template"], data["clump_axes"], data["clump_of_grain"]
        arm = np.column_stack([data["clump_arm"], data["record"][:, grain.RADIUS]])
        member = np.flatnonzero(of != NONE)
        _, at = np.unique(of[member], return_index=True)  # the first member of each
        arm, of_clumps["shape"] = shapes(arm, member[at], of_clumps["count"])
        self._number(of_clumps, of, arm)

    def copied(self, take: Callable[[str, wp.array], wp.array]) -> "ClumpState":
        """As ``State.copied``."""
        out = copy.copy(self)
        out._struct = None
        for name in (*CLUMP_ARRAYS, *MEMBER_ARRAYS, *OF_STEP):
            setattr(out, name, take(f"clumps {name}", getattr(self, name)))
        return out
