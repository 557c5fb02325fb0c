"""How long grains were in a run: of those that left, from their insertion, or the start of the run, to their last step."""

from dataclasses import dataclass

import numpy as np

from warpdem.measure.selection import selected
from warpdem.model.model import Model
from warpdem.scene.measures import Residence
from warpdem.state.view import RunView


@dataclass(frozen=True)
class Departed:
    """The grains that have left a run, in the order in which they did; shapes (m,)."""

    id: np.ndarray
    """Grain ids."""
    group: np.ndarray
    """Number of the group, of those of ``Scene.groups``."""
    type: np.ndarray
    """Material index in the order of the scene."""
    radius: np.ndarray
    """Radius [m]."""
    way_out: np.ndarray
    """Name of the border or outlet."""
    came: np.ndarray
    """Time of insertion [s]; 0 for grains of the start."""
    left: np.ndarray
    """Time at which they left [s]."""

    @property
    def residence(self) -> np.ndarray:
        """Residence time [s]."""
        return self.left - self.came


def read_departed(view: RunView) -> Departed:
    """The grains that have left up to the time of the view.

    Raises:
        ValueError: the scene has no ``measures.residence``: who left is not kept then.
    """
    if view.departures is None:
        raise ValueError("which grains have left is kept where the scene has measures.residence; it has none")
    table, model, dt = view.departures.table(), view.model, view.clock.dt
    names = np.array(model.domain.names, dtype=str)
    times = {name: table[name] * dt for name in ("came", "left")}
    return Departed(**{**table, **times, "way_out": names[table["way_out"]]})


def residence_times(asked: Residence, model: Model, departed: Departed) -> np.ndarray:
    """Residence times that a measure takes [s], shape (k,)."""
    counts = selected(asked.of, model.scene, departed)
    if asked.outlet is not None:
        counts &= departed.way_out == asked.outlet
    return departed.residence[counts]
