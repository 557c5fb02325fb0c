"""Grains that streams insert while a run goes on."""

from dataclasses import replace
from typing import Any

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.inlet import Inlet
from warpdem.filling.inlet_walls import InletWalls
from warpdem.kernels import grain
from warpdem.model.model import Model
from warpdem.model.prepare import absolute
from warpdem.state.clock import Clock
from warpdem.state.particles import State


class Streams:
    """The streams of a run.

    Args:
        model: what is run.
        state: the grains, to which others are added.
        clock: where the run is in time.

    Attributes:
        inlets: one of each stream, in the order of the scene.
    """

    def __init__(self, model: Model, state: State, clock: Clock) -> None:
        self._model, self._state, self._clock = model, state, clock
        streams = range(len(model.scene.streams))
        self.inlets = [Inlet(number, model.scene, model.dt, self._walls(number)) for number in streams]

    @property
    def notes(self) -> list[str]:
        """What is to be known of the boxes of the streams, for people."""
        return [note for inlet in self.inlets if inlet.walls is not None for note in inlet.walls.notes]

    def next_step(self) -> int | None:
        """The next step at which grains may be inserted; None if there is none."""
        events = [inlet.next_event(self._clock.step_number) for inlet in self.inlets]
        return min((event for event in events if event is not None), default=None)

    def insert(self) -> list[np.ndarray]:
        """Add what the streams bring at the present step, before its forces are evaluated.

        Returns:
            Memory slots of the new grains, shape (k,), of each stream that brought some.
        """
        state, step, inserted = self._state, self._clock.step_number, []
        for inlet in self.inlets:
            if not inlet.is_event(step):
                continue
            record = state.record.numpy()[state.here]
            there = record[:, grain.POSITION], record[:, grain.RADIUS]
            position, radius = inlet.insert(step, *there, self._model.domain.nearest)
            if len(radius):
                state.add(self._grains(inlet, position, radius), self._model.density, step)
                inserted.append(np.arange(state.slots - len(radius), state.slots))
        return inserted

    def _grains(self, inlet: Inlet, position: np.ndarray, radius: np.ndarray) -> InitialGrains:
        """Grains of a stream, moving as the integrator holds them."""
        model, clock, n = self._model, self._clock, len(radius)
        velocity = np.tile(np.array(inlet.stream.velocity, dtype=float), (n, 1))
        ids = np.arange(self._state.next_id, self._state.next_id + n)
        material, group = (np.full(n, number, np.int32) for number in (inlet.type, inlet.group))
        new = InitialGrains(ids, material, group, radius, position, velocity, np.zeros((n, 3)))
        if model.features.backend.scheme.RELATIVE:
            return new
        new = absolute(model.schedule, new, clock.time)
        if clock.step_number == 0:
            return new
        # the record holds the velocity of mid-step, and the next kick is a whole one
        kick = 0.5 * clock.dt * model.schedule.rows(clock.step_number, 0)[0, 2:5]
        return replace(new, velocity=new.velocity - kick)

    def _walls(self, number: int) -> InletWalls:
        """The walls beside the box of a stream."""
        model = self._model

        def places(time: float) -> list[tuple[np.ndarray, np.ndarray]]:
            return [(body[:9].reshape(3, 3), body[9:12]) for body in model.schedule.bodies(time)]

        moves = (model.schedule.wall_motion < model.schedule.moving).tolist()
        return InletWalls(number, model.scene, model.meshes, places, moves)

    def state(self) -> list[dict[str, Any]]:
        """What a checkpoint holds of the streams, as JSON."""
        return [inlet.state() for inlet in self.inlets]

    def restore(self, states: list[dict[str, Any]]) -> None:
        """Take over what ``state`` gave."""
        for inlet, state in zip(self.inlets, states, strict=True):
            inlet.restore(state)

    def take_over(self, states: dict[int, dict[str, Any]]) -> None:
        """Go on with the random numbers of streams of another run, by number; what they inserted there does not count."""
        for number, state in states.items():
            self.inlets[number].restore({**state, "count": 0, "mass": 0.0})
