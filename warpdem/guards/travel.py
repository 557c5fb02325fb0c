"""Watches the travel of the grains beside mesh walls (``model.travel``).

It is checked when a list check finds a grain that is fast beside a mesh, before any list is built. A grain that moves further
in a step than the walls allow always causes a list check.
"""

import numpy as np

from warpdem.guards.verdict import Verdict, at_time
from warpdem.kernels import grain
from warpdem.model.model import Model
from warpdem.model.travel import max_travel
from warpdem.state.clock import Clock
from warpdem.state.particles import State


class TravelGuard:
    """Watches the grains beside the mesh walls of a model."""

    NAME = "travel"

    def __init__(self, model: Model) -> None:
        self._model = model
        self._motion = model.schedule.wall_motion
        self._meshes = [
            (number, wall, model.meshes[wall.name].vertices.min(axis=0), model.meshes[wall.name].vertices.max(axis=0))
            for number, wall in enumerate(model.scene.walls)
            if wall.mesh is not None
        ]

    def look(self, record: np.ndarray, placements: np.ndarray, state: State, clock: Clock) -> list[Verdict]:
        """Which grains moved further in the last step than the walls allow, the worst beside each.

        Only grains count that are within their travel of a mesh's bounding box, in its body axes.

        Args:
            record: the record of the state on the host, shape (slots, numbers).
            placements: placements of the wall motions at present, shape (motions, 24).
            state: the grains.
            clock: where the run is in time.
        """
        found: list[Verdict] = []
        if not self._meshes or not len(record):
            return found
        position, velocity, radius = record[:, grain.POSITION], record[:, grain.VELOCITY], record[:, grain.RADIUS]
        for number, wall, low, high in self._meshes:
            p = placements[self._motion[number]]
            relative = velocity - p[15:18] - np.cross(p[12:15], position)
            travel = np.sqrt(np.einsum("ij,ij->i", relative, relative)) * clock.dt
            allowed = max_travel(wall) * radius
            fast = np.flatnonzero((travel > allowed) & self._model.scene.touched(state.material.numpy(), number))
            if not len(fast):
                continue
            room = (radius[fast] + travel[fast])[:, None]
            beside = np.zeros(len(fast), bool)
            for shift in self._model.domain.images:
                body = (position[fast] + shift - p[9:12]) @ p[:9].reshape(3, 3)
                beside |= ((body > low - room) & (body < high + room)).all(axis=1)
            fast = fast[beside]
            if not len(fast):
                continue
            worst = fast[np.argmax(travel[fast] / radius[fast])]
            place = ", ".join(f"{x:.4g}" for x in position[worst])
            message = (
                f"{at_time(clock)}: grain {state.id.numpy()[worst]} at ({place}) m went "
                f"{travel[worst] / radius[worst]:.3g} of its radius in one step beside the wall {wall.name!r}; allowed is "
                f"{max_travel(wall):g} ({'open' if wall.open else 'closed'} mesh), beyond which it could pass through. Speed "
                f"{travel[worst] / clock.dt:.4g} m/s, time step {clock.dt:.3g} s. Take a time.step below "
                f"{max_travel(wall) * radius[worst] * clock.dt / travel[worst]:.2g} s."
            )
            found.append(Verdict(self.NAME, message))
        return found
