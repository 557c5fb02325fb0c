"""Which grains a measure counts, by the selections of the scene."""

from typing import Protocol

import numpy as np

from warpdem.kernels import grain
from warpdem.scene.model import Scene
from warpdem.scene.selection import Selection
from warpdem.state.particles import State


class Named(Protocol):
    """Grains with what a selection goes by, in any order."""

    @property
    def group(self) -> np.ndarray:
        """Number of the group, of those of ``Scene.groups``, shape (n,)."""

    @property
    def type(self) -> np.ndarray:
        """Material index in the order of the scene, shape (n,)."""

    @property
    def radius(self) -> np.ndarray:
        """Radius [m], shape (n,)."""


def selected(of: Selection | None, scene: Scene, grains: Named) -> np.ndarray:
    """Whether each grain fulfils every condition of a selection, shape (n,), bool; all do without one.

    The smallest diameter of a range belongs to it, the largest does not, so that ranges side by side share no grain.
    """
    out = np.ones(len(grains.radius), dtype=bool)
    if of is None:
        return out
    if of.group is not None:
        out &= grains.group == scene.groups.index(of.group)
    if of.material is not None:
        out &= grains.type == list(scene.materials).index(of.material)
    if of.diameter is not None:
        diameter = 2.0 * grains.radius
        out &= (diameter >= of.diameter[0]) & (diameter < of.diameter[1])
    return out


class Slots:
    """The grains in memory slots, as a selection sees them.

    Args:
        state: the grains.
        slots: their memory slots; those of all by default.
    """

    def __init__(self, state: State, slots: np.ndarray | slice = slice(None)) -> None:
        self.group = state.group[slots]
        self.type = state.material.numpy()[slots]
        self.radius = state.record.numpy()[slots, grain.RADIUS]


def selected_flow(scene: Scene, grains: Named, flow: np.ndarray) -> np.ndarray:
    """What grains carried through each plane, shape (n, 2 planes), zero where the plane does not count the grain."""
    if all(plane.of is None for plane in scene.measures.flow):
        return flow
    counts = [selected(plane.of, scene, grains) for plane in scene.measures.flow]
    return flow * np.repeat(np.stack(counts, axis=1), 2, axis=1)
