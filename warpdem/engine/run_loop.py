"""Brings a run forward: valid lists, forces, batches of steps, and grains that streams insert between them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from warpdem.core.timers import Timers
from warpdem.engine.engine import Engine
from warpdem.errors import WarpdemError
from warpdem.state import contact_history
from warpdem.state.clock import Clock
from warpdem.state.particles import State
from warpdem.state.streams import Streams


class RunLoop:
    """The order of list builds, steps and insertions.

    Args:
        state: the grains.
        clock: where the run is in time.
        engine: runs batches of steps.
        streams: insert grains.
        timers: add up the time of the steps.

    Attributes:
        steps_done: steps since this was made, those before a resume not counted.
        after_insertion: called with the memory slots of grains that were just inserted.
    """

    def __init__(self, state: State, clock: Clock, engine: Engine, streams: Streams, timers: Timers) -> None:
        self._state, self._clock, self._engine, self._streams, self._timers = state, clock, engine, streams, timers
        self._interrupted = False  # between the first step of a batch and its count
        self.steps_done = 0
        self.after_insertion: Callable[[np.ndarray], None] = lambda slots: None

    def evaluate(self) -> None:
        """Evaluate the forces of the present time if they are not."""
        if not self._clock.forces_evaluated:
            self.advance(0)

    def advance(self, count: int) -> None:
        """Make the lists valid, evaluate the forces if they are not, and run up to ``count`` steps.

        Raises:
            StabilityError: the engine cannot go on from this state.
            WarpdemError: an interrupt has left the state at a step that was not counted.
        """
        clock, lists = self._clock, self._engine.lists
        if self._interrupted:
            raise WarpdemError("the simulation was interrupted in the middle of its steps: go on from a checkpoint")
        if len(self._state) and not clock.forces_evaluated:
            lists.update(grown=self._state.slots > lists.known or not lists.rebuilds)
        insertion = self._streams.next_step()
        steps_to_insertion = count + 1 if insertion is None else insertion - clock.step_number
        batch = min(count, steps_to_insertion)
        if len(self._state) == 0:
            if self._engine.moves_walls:
                batch = min(batch, self._engine.steps_ahead)
                self._engine.advance_walls(batch)
            done, moved = batch, 0
        else:
            batch = min(batch, self._engine.steps_ahead)
            with self._timers.measure("steps"):
                self._interrupted = True
                done, moved = self._engine.advance(batch, not clock.forces_evaluated, hold=batch == steps_to_insertion)
        clock.step_number += done
        if self._engine.moves_walls:
            self._engine.read_walls()
        self._interrupted = False
        self.steps_done += done
        lists.pending |= moved
        clock.forces_evaluated = not moved and done < steps_to_insertion
        if done == steps_to_insertion:
            self.insert()

    def restore_contacts(self, data: Mapping[str, Any]) -> None:
        """Take over contact history and forces of a checkpoint, whose grains were taken over."""
        contact_history.restore(self._engine.lists, contact_history.within(data))
        self._clock.forces_evaluated = True

    def insert(self) -> None:
        """Insert what the streams bring at the present step."""
        for slots in self._streams.insert():
            self.after_insertion(slots)
            self._clock.forces_evaluated = False
