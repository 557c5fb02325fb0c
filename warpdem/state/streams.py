"""Grains that streams insert while a run goes on."""

from dataclasses import replace
from typing import Any

import numpy as np

from warpdem.filling.clump_grains import of_groups
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.inlet import Inlet, Insertion
from warpdem.filling.inlet_walls import InletWalls
from warpdem.filling.stream_place import StreamPlace
from warpdem.kernels import grain
from warpdem.mesh.solid import face_of, shape_of
from warpdem.model.model import Model
from warpdem.model.prepare import absolute, within
from warpdem.scene.regions import PlaneRegion
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
        streams = model.scene.streams
        self._carriers = [model.schedule.carrier(stream) for stream in streams]
        places = [self._place(number) for number in range(len(streams))]
        self.inlets = [
            Inlet(number, model.scene, model.dt, place, self._walls(number, place)) for number, place in enumerate(places)
        ]

    @property
    def notes(self) -> list[str]:
        """What is to be known of the regions of the streams, for people."""
        return [note for inlet in self.inlets if inlet.walls is not None for note in inlet.walls.notes]

    def next_step(self) -> int | None:
        """The next step at which grains may be inserted; None if there is none."""
        events = [inlet.next_event(self._clock.step_number) for inlet in self.inlets]
        return min((event for event in events if event is not None), default=None)

    def boxes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Middle and half sizes [m] of the boxes beside which the streams that are due at the present step need the grains.

        A grain counts if its center is nearer to the middle than half the size and its radius, along each axis.
        """
        step = self._clock.step_number
        return [inlet.beside(step) for inlet in self.inlets if inlet.is_event(step)]

    def insert(self, others: np.ndarray | None = None) -> list[np.ndarray]:
        """Add what the streams bring at the present step, before its forces are evaluated.

        Args:
            others: center and radius [m] of the grains that are there beside ``boxes``, shape (m, 4), where they are not in the
                state; those that were just inserted are.

        Returns:
            Memory slots of the new grains, shape (k,), of each stream that brought some.
        """
        state, step = self._state, self._clock.step_number
        inserted: list[np.ndarray] = []
        for inlet in self.inlets:
            if not inlet.is_event(step):
                continue
            record = state.record.numpy()[state.here]
            if others is not None:
                record = np.concatenate([others, *(state.record.numpy()[slots, :4] for slots in inserted)])
            there = record[:, grain.POSITION], record[:, grain.RADIUS]
            new = inlet.insert(step, *there, self._model.domain.nearest)
            if len(new.portion):
                before = state.slots
                state.add(self._grains(inlet, new), self._model.density, step)
                inserted.append(np.arange(before, state.slots))
        return inserted

    def _grains(self, inlet: Inlet, added: Insertion) -> InitialGrains:
        """Grains of a stream, moving as the integrator holds them."""
        model, clock = self._model, self._clock
        given = np.array(inlet.stream.velocity, dtype=float)
        velocity, spin = model.schedule.carried(self._carriers[inlet.number], clock.time, added.position, given)
        pieces = []
        for part in np.split(np.arange(len(added.portion)), np.flatnonzero(np.diff(added.portion)) + 1):
            bodies, drawn = inlet.bodies[added.portion[part[0]]], [added.drawn[k] for k in part]
            pieces.append(bodies.moving(drawn, added.position[part], velocity[part], spin[part], added.axes))
        position, radius, velocity, spin = (np.concatenate([members[k] for _, members in pieces]) for k in range(4))
        clumps = of_groups([of for of, _ in pieces], [len(members[1]) for _, members in pieces])
        portion = np.repeat(added.portion, [inlet.bodies[k].members for k in added.portion])
        ids = np.arange(self._state.next_id, self._state.next_id + len(radius))
        material, group = (np.array(of, np.int32)[portion] for of in (inlet.type, inlet.group))
        new = InitialGrains(ids, material, group, radius, position, velocity, spin)
        if model.features.contact.clumps:
            new = within(model.domain, replace(new, clumps=clumps))
        if model.features.backend.scheme.RELATIVE:
            return new
        new = absolute(model.schedule, new, clock.time)
        if clock.step_number == 0:
            return new
        # the record holds the velocity of mid-step, and the next kick is a whole one
        kick = 0.5 * clock.dt * model.schedule.rows(clock.step_number, 0)[0, 2:5]
        if new.clumps is not None:
            new = replace(new, clumps=replace(new.clumps, velocity=new.clumps.velocity - kick))
        return replace(new, velocity=new.velocity - kick)

    def _place(self, number: int) -> StreamPlace:
        """The region of a stream."""
        model, carrier = self._model, self._carriers[number]
        stream = model.scene.streams[number]
        key = f"streams[{number}].{stream.shape_key}"
        face = stream.disk or stream.face
        shape = shape_of(model.scene, stream.shape, key) if face is None else face_of(model.scene, face, key)
        assert not isinstance(shape, PlaneRegion)  # no stream has one
        return StreamPlace(shape, None if carrier is None else lambda time: model.schedule.place(carrier, time))

    def _walls(self, number: int, place: StreamPlace) -> InletWalls:
        """The walls beside the region of a stream."""
        model = self._model

        def places(time: float) -> list[tuple[np.ndarray, np.ndarray]]:
            return [(body[:9].reshape(3, 3), body[9:12]) for body in model.schedule.bodies(time)]

        moves = (model.schedule.wall_motion < model.schedule.moving).tolist()
        return InletWalls(number, model.scene, model.meshes, place, places, moves)

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
            self.inlets[number].go_on(state)
