"""What a run can be asked for at its present time."""

import numpy as np

from warpdem.core.snapshot import ClumpShots, Snapshot, WallLoad
from warpdem.measure import measures, observation, observers, wall_loads, wall_wear
from warpdem.measure.budget import Budget
from warpdem.measure.clumps import read_clumps
from warpdem.measure.liquid import LiquidTotals
from warpdem.measure.residence import Departed, read_departed
from warpdem.measure.snapshot import take_snapshot
from warpdem.measure.totals import Totals
from warpdem.state.view import RunView


class RunReadings:
    """The readings of a run; whoever inherits them provides ``live``, and ``evaluate`` if forces may not be evaluated.

    Attributes:
        live: the run as readers see it, whether its forces are evaluated or not.
    """

    live: RunView

    def evaluate(self) -> None:
        """Evaluate the forces of the present time if they are not: what every reader asks for first."""

    @property
    def evaluated(self) -> RunView:
        """The run as readers of sums see it, the forces of the present time evaluated; over ranks its grains are not here."""
        self.evaluate()
        return self.live

    @property
    def view(self) -> RunView:
        """The run as readers see it, the forces of the present time evaluated; over ranks all grains are gathered."""
        view = self.evaluated
        view.gather()
        return view

    @property
    def count(self) -> int:
        """Number of grains; over ranks they are not gathered for it."""
        return Totals(self.live).count

    @property
    def particles(self) -> observers.Particles:
        """The grains at the present time, ordered by id."""
        return observers.Particles(self.view)

    @property
    def clumps(self) -> ClumpShots | None:
        """The clumps at the present time, ordered by id; None in a run without any."""
        return read_clumps(self.view) if self.live.state.clumps is not None else None

    def contacts(self) -> observers.Contacts:
        """All grain-grain and grain-wall contacts at the present time."""
        return observers.read_contacts(self.view)

    def energy(self) -> dict[str, float]:
        """Kinetic, rotational, elastic and potential energy in the laboratory [J]."""
        return observers.energy(self.evaluated)

    @property
    def budget(self) -> Budget | None:
        """Budgets of energy, momentum and flow; None where the scene's ``measures`` name none of them."""
        return Budget(self.evaluated) if self.live.totals is not None else None

    def measure(self) -> dict[str, float]:
        """What the scene's ``measures`` give at the present time, by the names of their columns in history.csv."""
        return measures.measured(self.view)

    def observe(self, name: str) -> np.ndarray:
        """What an observer of the scene reads off each grain at the present time, in its unit, by id, shape (n,).

        Args:
            name: its name in the scene's ``observers``.

        Raises:
            SceneError: the scene has no observer of that name.
        """
        return observation.observe(self.view, name)

    def liquid(self) -> LiquidTotals:
        """Where the liquid is at the present time, in whole counts.

        Raises:
            SceneError: the scene has no law of liquid bridges.
        """
        return Totals(self.evaluated).liquid

    def loads(self) -> tuple[np.ndarray, np.ndarray]:
        """Contact force [N] and torque [N m] on each grain, by id, shapes (n, 3)."""
        return self.readings()[:2]

    def wall_loads(self, lab: bool = False) -> dict[str, WallLoad]:
        """What the grains do to each wall at the present time, by wall name; vectors in frame axes or in the laboratory."""
        return wall_loads.read_loads(self.evaluated, lab)

    def departed(self) -> Departed:
        """The grains that have left, one by one, where the scene has ``measures.residence``.

        Raises:
            ValueError: it has none.
        """
        return read_departed(self.evaluated)

    def wall_wear(self) -> dict[str, wall_wear.WallWear]:
        """What wore each wall from ``measures.wear.start`` to the last step, by wall name; empty if it is not asked for."""
        return wall_wear.read_wear(self.evaluated)

    def readings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Contact force [N], torque [N m], velocity [m/s] and spin [rad/s] of each grain, by id, shapes (n, 3).

        Velocity and spin in frame axes, absolute or relative to the frame as the integrator holds them.
        """
        return self.view.readings()

    def snapshot(self) -> Snapshot:
        """Everything a writer needs, at the present time."""
        return take_snapshot(self.view)

    @property
    def extremes(self) -> dict[str, float]:
        """Largest values met so far: overlap over radius [-] and approach speed [m/s], of pairs and of walls."""
        return self.live.extremes
