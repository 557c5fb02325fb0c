"""A run: the public face of model, state, engine, guards and measures; ``step`` and ``run`` advance it, all else reads."""

import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from warpdem.assembly.parts import Parts
from warpdem.assembly.wall_motion import set_motion
from warpdem.core.log import log
from warpdem.core.snapshot import WallMesh
from warpdem.measure.budget import Budget
from warpdem.mesh.tessellation import drawings
from warpdem.ranks.world import World
from warpdem.runs.recorded import RecordedRun, Rows
from warpdem.scene.model import Scene
from warpdem.state import checkpoint, checkpoint_file, same_scene


class Simulation(RecordedRun):
    """A scene on a device, paused between steps with the forces of its present time evaluated.

    Args:
        scene: validated scene.
        device: "cpu" or a CUDA device such as "cuda:0"; None takes a GPU if there is one. With ``world`` as of
            ``warpdem.ranks.devices``.
        threads: CPU threads; None takes as many as pay for the number of grains, up to all available cores.
        start: checkpoint of another run to start from in place of the scene's grains, as the scene's key start.
        resident: many steps as one captured graph on one thread; None takes it on a GPU and not on a CPU, where it shows that
            the GPU's launches give the CPU's bits.
        world: the ranks (MPI processes) that this process leads, which share the work; None: it does all itself.

    Attributes:
        notes: what of the scene's file was not taken, and what is odd or was mended in its meshes, for people.
        seconds: wall time by stage [s].
        left: number and mass [kg] of the grains that each border or outlet took, by its name.

    Raises:
        SceneError: if the scene cannot be run: no such device, a bad mesh, overlapping start, time step over its limit.
        TypeError: if ``scene`` is no Scene.
    """

    def __init__(
        self,
        scene: Scene,
        device: str | None = None,
        threads: int | None = None,
        start: str | Path | None = None,
        *,
        resident: bool | None = None,
        world: World | None = None,
    ) -> None:
        self._parts = parts = Parts.of(scene, device, threads, start, resident, world)
        self.model, self.state, self._clock, self.engine = parts.model, parts.state, parts.clock, parts.engine
        self.streams, self.loop, self.live, self.guards = parts.streams, parts.loop, parts.view, parts.guards
        self.timers, self.seconds, self.rows, self.notes = parts.timers, parts.timers.seconds, Rows(), parts.notes
        self.lists, self.left, self.inlets = parts.engine.lists, parts.engine.leavers.left, parts.streams.inlets
        self.threads, model = parts.threads, parts.model
        self.scene, self.device, self.dt, self.limits = model.scene, model.device, model.dt, model.limits
        self.plan, self.meshes, self.walls, self.domain = model.features, model.meshes, model.walls, model.domain
        self.schedule, self.expected, self.kernels = model.schedule, model.expected, model.kernels
        self.coefficients = model.coefficients
        for note in self.notes:
            log.info("%s: %s", scene.source, note)
        log.info("%s with a time step of %.4g s", repr(self), self.dt)  # as it is now; a record must not keep the run

    def __repr__(self) -> str:
        where = f"t = {self.time:.6g} s (step {self.step_number}) on {self.device.alias}"
        return f"<Simulation of {self.scene.source}: {self.count} grains at {where}>"

    def clock(self, stage: str) -> AbstractContextManager[None]:
        """Add the time spent inside to ``seconds[stage]``."""
        return self.timers.measure(stage)

    # -- advancing ------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]: step number times time step, never a running sum."""
        return self._clock.time

    @property
    def step_number(self) -> int:
        """Steps since the start of the scene."""
        return self._clock.step_number

    def load_kernels(self) -> None:
        """Load the kernels of the steps and the lists, compiled where Warp's cache lacks them; else the first step does."""
        self.engine.load_kernels()

    def step(self, count: int = 1) -> None:
        """Advance by ``count`` time steps.

        Raises:
            StabilityError: when the run became unstable; names grain, time and cause.
            ValueError: if ``count`` is below 0.
        """
        if count < 0:
            raise ValueError(f"step({count}): must be 0 or more; time does not run back")
        if self.live.totals is not None and not self.live.totals.start:
            Budget(self.evaluated).begin()
        last = self.step_number + count
        while self.step_number < last:
            self.loop.advance(min(last, self.guards.next_look) - self.step_number)
            self.guards.steps_done()

    def run(self, until: float, *, record: float | None = None) -> None:
        """Advance to the first step at or after ``until`` [s].

        Args:
            until: end [s].
            record: time between two rows that are added to ``history`` [s], besides those of the present time and the end.

        Raises:
            StabilityError: as ``step``.
            ValueError: if ``until`` is past or no finite time, or ``record`` is not above 0.
        """
        if not math.isfinite(until) or (last := self.steps_until(until)) < self.step_number:
            raise ValueError(f"run(until={until:g}): must be finite and not before the present time, {self.time:.6g} s")
        if record is None:
            self.step(last - self.step_number)
            return
        if not 0.0 < record < math.inf:
            raise ValueError(f"run(record={record:g}): must be finite and above 0 [s]")
        every = max(1, round(record / self.dt))
        self.record()
        while self.step_number < last:
            self.step(min(last, (self.step_number // every + 1) * every) - self.step_number)
            self.record()

    def steps_until(self, time: float) -> int:
        """Number of the first step at or after ``time`` [s]; round-off of the division does not add one."""
        return math.ceil(time / self.dt - 1.0e-9)

    def evaluate(self) -> None:
        """Evaluate the forces of the present time if they are not: what every reader asks for first."""
        self.loop.evaluate()

    def prepare(self) -> None:
        """The same; over ranks all grains and contacts are gathered too."""
        self.evaluate()
        self.live.gather()

    def set_motion(self, wall: str, motion: Any) -> None:
        """Give a wall another motion from the next step on, from where it is now.

        The forces of the present time stay those of the motion before. A checkpoint keeps the motion; ``resume`` of a run in
        Python goes on with it, bit for bit.

        Args:
            wall: name of a wall with ``driven = true`` in the scene.
            motion: one motion or a list of them, as the key ``motion`` of a wall, such as ``{"velocity": [0, 0, 0.1]}``; its
                time begins now; None for rest.

        Raises:
            SceneError: there is no such wall, or it is not driven, or the motion is wrong, or too fast for the time step.
        """
        set_motion(self._parts, wall, motion)

    # -- checkpoint -----------------------------------------------------------------------------

    def save_checkpoint(self, path: str | Path) -> None:
        """Write the whole state to ``path`` (HDF5), so that a resumed run equals this one bit for bit."""
        checkpoint.save(self, path)

    @classmethod
    def from_checkpoint(
        cls, path: str | Path, device: str | None = None, threads: int | None = None, plugins: Sequence[str | Path] = ()
    ) -> "Simulation":
        """The simulation that a checkpoint was saved from, on any device and number of threads.

        Args:
            path: the checkpoint.
            device: as in ``Simulation``.
            threads: as in ``Simulation``.
            plugins: the .py files with models of your own that its scene names: no others are loaded.

        Raises:
            SceneError: if the file is missing, damaged or of another version.
        """
        with checkpoint_file.opened(path) as saved:
            sim = cls(same_scene.scene_of(saved, plugins), device=device, threads=threads)
            checkpoint.restore(sim, saved)
        return sim

    # -- reading --------------------------------------------------------------------------------

    @property
    def noticed(self) -> dict[str, str]:
        """What each guard saw first, by its name; empty but with engine.guards = "record"."""
        return self.guards.noticed

    def wall_meshes(self) -> list[WallMesh]:
        """The walls to draw, in their body axes: meshes as they are, analytic ones cut into triangles, patches of planes."""
        return drawings(self.scene.walls, self.meshes, self.expected.position)

    def state_hash(self) -> str:
        """SHA-256 of step number, ids and moving state in order of id: equal runs have equal hashes."""
        self.live.gather()
        return self.state.digest(self.step_number)
