"""Grains that leave the domain: through which border or outlet, how many, how heavy."""

from collections.abc import Callable

import numpy as np

from warpdem.engine.host_build import Found
from warpdem.engine.stops import beyond_border, crossed_domain
from warpdem.kernels.lists.displacement import CROSSED, IN_OUTLET, OUTLET_NUMBER
from warpdem.model.domain import Domain
from warpdem.state.clock import Clock
from warpdem.state.departures import Departures
from warpdem.state.particles import State


class Leavers:
    """Counts grains that leave.

    Args:
        domain: borders and outlets.
        state: the grains.
        clock: where the run is in time.

    Attributes:
        left: number and mass [kg] of the grains that each border or outlet took, by its name; a clump is one.
        before_leaving: called with the slots of grains that are about to leave.
        departures: takes down each grain that leaves; None where nobody asks for it.
    """

    def __init__(self, domain: Domain, state: State, clock: Clock) -> None:
        self._domain, self._state, self._clock = domain, state, clock
        self.left: dict[str, list] = {name: [0, 0.0] for name in domain.names}
        self.before_leaving: Callable[[np.ndarray], None] = lambda slots: None
        self.departures = Departures() if state.came is not None else None

    def take(self, found: Found) -> np.ndarray:
        """Count the grains that are not in the domain any more.

        Args:
            found: what the check of the lists found.

        Returns:
            Their memory slots, shape (m,).

        Raises:
            StabilityError: one is beyond a border that stops the run, or crossed a whole periodic domain in a step.
        """
        state = self._state
        if found.all & CROSSED:
            raise crossed_domain(state, self._clock, int(np.flatnonzero(found.of_grain & CROSSED)[0]))
        if not found.all & IN_OUTLET:
            return np.zeros(0, dtype=np.int64)
        removed = np.flatnonzero(found.of_grain & IN_OUTLET)
        self.count(state, removed, found.of_grain[removed] >> OUTLET_NUMBER, self._clock.step_number)
        self.before_leaving(removed)
        return removed

    def count_by_step(self, removed: np.ndarray, where: np.ndarray, step: np.ndarray) -> None:
        """Count the grains that the steps of a batch have put out of the domain themselves.

        Sums go step by step, so that their bits do not depend on where a batch ends.

        Args:
            removed: their memory slots in the order of their steps, shape (m,).
            where: number of the outlet of each, shape (m,).
            step: step at which each left, shape (m,).
        """
        for part in np.split(np.arange(len(removed)), np.flatnonzero(np.diff(step)) + 1):
            if len(part):
                self.count(self._state, removed[part], where[part], int(step[part[0]]))

    def count(self, state: State, removed: np.ndarray, where: np.ndarray, step: int) -> None:
        """Count grains that leave at one step.

        Args:
            state: the grains, or those of other processes that leave.
            removed: memory slots there, shape (m,).
            where: number of the outlet of each, shape (m,).
            step: the step.

        Raises:
            StabilityError: one is beyond a border that stops the run.
        """
        ids, mass = state.id.numpy()[removed], 1.0 / state.inverse.numpy()[removed, 0]
        for number in np.unique(where):
            through = np.flatnonzero(where == number)
            through = through[np.argsort(ids[through])]
            name = self._domain.names[number]
            if self._domain.stops[number]:
                raise beyond_border(state, self._clock, int(removed[through[0]]), name)
            bodies = state.bodies(removed[through])
            if self.departures is not None:
                self.departures.add(state, bodies, int(number), step)
            self.left[name][0] += len(bodies)
            self.left[name][1] += float(mass[through].sum())
