"""What readers see of a run at one time: a live run provides it, and so does a copy that is read while the run goes on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np
import warp as wp

from warpdem.core.threads import Threads
from warpdem.model.model import Model
from warpdem.state.budget_totals import BudgetTotals
from warpdem.state.clock import Clock
from warpdem.state.departures import Departures
from warpdem.state.listed_contacts import ListedContacts
from warpdem.state.particles import State

Thing = TypeVar("Thing")


class Parts(Protocol):
    """The processes of a run that share its grains."""

    @property
    def all_here(self) -> bool:
        """Whether this process holds all there is: before the grains are dealt out, and where the others cannot answer."""

    def each(self, read: Callable[..., Thing]) -> list[Thing]:
        """What ``read`` gives of the part of each process, a ``measure.part.Part``."""

    def gather(self) -> bool:
        """Let this process have a copy of all grains and contacts of the present time; false if the others cannot answer."""


class StepReader(Protocol):
    """What kernels read off the state at the present time, whose forces are evaluated."""

    @property
    def extreme(self) -> np.ndarray:
        """Largest overlap over radius [-] and approach speed [m/s] of pairs, then of walls, since the start; shape (4,)."""

    def read(self) -> tuple[wp.array, wp.array, wp.array]:
        """Contact force [N] and torque [N m] together, velocity [m/s], spin [rad/s], by memory slot.

        Velocity and spin in frame axes, absolute or relative to the frame as the integrator holds them.
        """

    @property
    def digits(self) -> dict[str, np.ndarray]:
        """Digits of the sums that the scene asks for (``kernels.measure.window_sum``), by name, shapes (sums, 5).

        Of ``wear`` of walls up to the last kick, of ``losses`` of contacts between grains up to the one before.
        """

    def read_losses(self) -> np.ndarray:
        """Digits of what contacts between grains have lost up to the present time, in rows to be added up.

        As of ``MeasureFeatures.of_contacts``, shape (rows, losses, 5).
        """

    def read_sums(self) -> dict[str, np.ndarray]:
        """What the budgets have added up per grain, by the names of ``MeasureFeatures.sums``, shapes (slots, width)."""


@dataclass(frozen=True)
class RunView:
    """Model, grains, contacts and time of a run; what is read belongs to its clock's time once its forces are evaluated."""

    model: Model
    state: State
    clock: Clock
    reader: StepReader
    totals: BudgetTotals | None
    """Of the budgets; None where nothing is added up."""
    listed: Callable[[], ListedContacts]
    """Gives the contacts of the present lists."""
    left: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Number and mass [kg] of the grains that each border or outlet took so far, by its name."""
    departures: Departures | None = None
    """The grains that have left, one by one; None where the scene does not ask for them."""
    threads: Threads | None = None
    """CPU threads that may read side by side; None: the reader's own alone."""
    parts: Parts | None = None
    """The processes of the run, the grains of which the view holds once they are gathered; None: one, which holds all."""
    kept: dict[str, Any] = field(default_factory=dict, compare=False)
    """What readers keep from one reading to the next, by a name of theirs."""

    @property
    def contacts(self) -> ListedContacts:
        """The contacts of the present lists."""
        return self.listed()

    def gather(self) -> bool:
        """Let the view hold all grains and contacts of the run, whose forces are evaluated; false where it cannot."""
        return self.parts is None or self.parts.gather()

    def still(self, name: str, moves: bool, read: Callable[[], Thing]) -> Thing:
        """What ``read`` gives, once for all times if it never moves; kept under ``name``."""
        if moves:
            return read()
        if name not in self.kept:
            self.kept[name] = read()
        kept: Thing = self.kept[name]
        return kept

    def readings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Contact force [N], torque [N m], velocity [m/s] and spin [rad/s] of each grain, by id, shapes (n, 3).

        Velocity and spin in frame axes, absolute or relative to the frame as the integrator holds them.
        """
        load, velocity, spin = (array.numpy()[self.state.rank] for array in self.reader.read())
        return load[:, :3].copy(), load[:, 3:].copy(), velocity, spin

    @property
    def extremes(self) -> dict[str, float]:
        """Largest values met so far: overlap over radius [-] and approach speed [m/s], of pairs and of walls."""
        names = ("pair_overlap_share", "pair_approach_speed", "wall_overlap_share", "wall_approach_speed")
        return dict(zip(names, (float(value) for value in self.reader.extreme), strict=True))
