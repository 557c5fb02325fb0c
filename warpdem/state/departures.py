"""The grains that have left a run, one by one: which, through what, and how long they were in it.

A clump is one of them: the id of its first member, the radius of a sphere of its volume.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from warpdem.kernels import grain
from warpdem.kernels.clump import NONE
from warpdem.state.particles import State

COLUMNS = {
    "id": np.int64, "group": np.int32, "type": np.int32, "radius": np.float64, "way_out": np.int32, "came": np.int64,
    "left": np.int64,
}  # fmt: skip
"""Numbers of a grain that has left: group and material as of the scene, radius [m], number of the border or outlet, steps at
which it was inserted (0: it was there at the start) and at which it left."""


def radii_of_bodies(state: State, slots: np.ndarray) -> np.ndarray:
    """Radii of grains, or of spheres of the volume of the clumps whose first members are in memory slots ``slots`` [m]."""
    radius = state.record.numpy()[slots, grain.RADIUS]
    if state.clumps is not None:
        of = state.clumps.of_grain.numpy()[slots]
        radius = np.where(of == NONE, radius, state.clumps.record.numpy()[of, grain.RADIUS])
    return radius


class Departures:
    """A table of the grains that have left, in the order in which they did, those of one step by border, then id."""

    def __init__(self) -> None:
        self._parts: list[dict[str, np.ndarray]] = []

    def add(self, state: State, slots: np.ndarray, way_out: int, step: int) -> None:
        """Append the grains in memory slots ``slots``, which leave at ``step`` through border or outlet ``way_out``."""
        assert state.came is not None
        count = len(slots)
        found = {
            "id": state.id.numpy()[slots], "group": state.group[slots], "type": state.material.numpy()[slots],
            "radius": radii_of_bodies(state, slots), "way_out": np.full(count, way_out),
            "came": state.came[slots], "left": np.full(count, step),
        }  # fmt: skip
        self._parts.append({name: found[name].astype(dtype) for name, dtype in COLUMNS.items()})

    def table(self) -> dict[str, np.ndarray]:
        """The columns by name, shapes (m,); see ``COLUMNS``."""
        if len(self._parts) != 1:  # one part from now on: joined once
            empty = {name: np.zeros(0, dtype=dtype) for name, dtype in COLUMNS.items()}
            parts = [empty, *self._parts]
            self._parts = [{name: np.concatenate([part[name] for part in parts]) for name in COLUMNS}]
        return self._parts[0]

    def arrays(self) -> dict[str, np.ndarray]:
        """What a checkpoint holds of them."""
        return {f"departure_{name}": values for name, values in self.table().items()}

    def restore(self, data: Mapping[str, Any]) -> None:
        """Take over what ``arrays`` gave."""
        self._parts = [{name: np.asarray(data[f"departure_{name}"], dtype=dtype) for name, dtype in COLUMNS.items()}]

    def copied(self) -> "Departures":
        """A copy that does not grow with the run."""
        out = Departures()
        out._parts = [self.table()]
        return out
