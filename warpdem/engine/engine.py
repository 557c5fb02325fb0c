"""The engine: owns the lists, the arrays of a batch of steps and the executor; knows nothing of guards, readers and writers."""

from collections.abc import Callable, Mapping

import numpy as np
import warp as wp

from warpdem.core.recorded_launch import RecordedLaunch
from warpdem.core.threads import Threads
from warpdem.core.timers import Timers
from warpdem.engine.batch import Batch
from warpdem.engine.cpu import CpuExecutor
from warpdem.engine.graph import GraphExecutor
from warpdem.engine.graph_of_stages import StageExecutor
from warpdem.engine.leavers import Leavers
from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.structs import Structs, packed
from warpdem.kernels.measure import window_sum
from warpdem.kernels.measure.budget import Momenta
from warpdem.kernels.step.structs import SPAN
from warpdem.model.model import Model
from warpdem.state.clock import Clock
from warpdem.state.particles import State


def executor_of(model: Model) -> type[CpuExecutor] | type[GraphExecutor]:
    """What runs the steps of a model."""
    backend = model.features.backend
    if not backend.resident:
        return CpuExecutor
    return StageExecutor if backend.ranks else GraphExecutor


class Engine:
    """Steps the grains of a model.

    Args:
        model: what is run.
        state: the grains.
        clock: where the run is in time.
        threads: CPU threads.
        timers: add up the time by stage.
        lists: what decides when lists are built.
        executor: how steps are run; None for what ``executor_of`` says.

    Attributes:
        lists: neighbor lists and contacts.
        leavers: grains that left the domain.
        executor: how steps are run; the only place where a CPU and a GPU part.
        read_ghosts: called with what ``read`` gave, velocity and spin: fills in those of grains of other processes.
    """

    def __init__(
        self, model: Model, state: State, clock: Clock, threads: Threads, timers: Timers,
        lists: type[NeighborLists] = NeighborLists, executor: type[CpuExecutor] | type[GraphExecutor] | None = None,
    ) -> None:  # fmt: skip
        self._model, self._state, self._clock, self._timers = model, state, clock, timers
        self._read: tuple[wp.array, wp.array, wp.array] | None = None
        self._reading: RecordedLaunch | None = None
        self.executor: CpuExecutor | GraphExecutor
        self.executor = (executor or executor_of(model))(model, state, clock, threads)
        self.batch = Batch(model, clock, timers, self.executor.threads, self.executor.steps_ahead)
        self.leavers = Leavers(model.domain, state, clock)
        pool, list_build = self.executor.storage.pool, self.executor.list_build
        self.lists = lists(model, state, clock, self.batch, timers, pool, list_build, self.leavers)
        self.structs = Structs(model, state, self.lists)
        self.read_ghosts: Callable[[wp.array, wp.array], None] = lambda velocity, spin: None
        self.lists.before_build, self.lists.fastest = self._forget, lambda: float(self.extreme[[1, 3]].max())

    def _forget(self) -> None:
        """Let go of the arrays of the lists, before others are made."""
        self.structs.forget()
        self.executor.forget()
        self._reading = None

    def load_kernels(self) -> None:
        """Load the kernels of the steps and the lists, compiled where Warp's cache lacks them; else the first step does."""
        self.executor.load_kernels()

    # -- advancing ------------------------------------------------------------------------------

    @property
    def steps_ahead(self) -> int:
        """Steps that a batch may have at most: the schedule on the device ends there."""
        return self.batch.row()[1]

    def advance(self, count: int, forces_first: bool, hold: bool = False) -> tuple[int, int]:
        """Run up to ``count`` steps; return how many were done, and the work pending before the last forces.

        That is a sum of ``kernels.step.motion``'s BEYOND, the lists are out of date, and LEFT, grains have left the domain.

        Args:
            count: steps.
            forces_first: evaluate the forces of the present positions first.
            hold: leave the forces after the last step to the next call: grains are inserted there.
        """
        done = self.executor.advance(count, forces_first, hold, self.lists, self.structs, self.batch)
        if self._model.features.domain.outlets and self.batch.report.removed.numpy()[0]:
            self._count_removed()
        return done

    @property
    def moves_walls(self) -> bool:
        """Whether some walls move by the load on them."""
        return bool(self._model.schedule.dynamic)

    def advance_walls(self, count: int, first: int = 0) -> None:
        """Run ``count`` steps of a run without grains, in which only such walls move, from ``first`` steps from now on."""
        base = self.batch.row()[0] + first
        control = self.batch.control
        inputs = [base, count, control.row, control.placement, self._model.dt, control.dynamic]
        wp.launch(self._model.kernels.dynamic.advance_alone, dim=1, inputs=inputs, device=self._model.device)

    def read_walls(self) -> None:
        """Take over where steps have moved the walls that move by the load on them; the clock has gone on."""
        self.batch.read_dynamic()

    def _count_removed(self) -> None:
        """Count the grains that the steps have removed from the domain, in the order in which they left."""
        exit = self.structs.arguments()[0].exit
        outlet, step = exit.numpy().T
        gone = np.flatnonzero(outlet)
        gone = gone[np.argsort(step[gone], kind="stable")]
        self.leavers.count_by_step(gone, outlet[gone] - 1, step[gone])
        self._state.mark_left(gone)
        self.lists.flights.leave(gone)
        exit.zero_()
        self.batch.report.removed.zero_()

    # -- extremes -------------------------------------------------------------------------------

    @property
    def extreme(self) -> np.ndarray:
        """Largest overlap over radius [-] and approach speed [m/s] of pairs, then of walls, since the start; shape (4,)."""
        return self.batch.report.extreme.numpy().reshape(-1, SPAN)[:, :4].max(axis=0)

    def ignore_overlaps(self) -> None:
        """Let batches go on whatever the overlaps."""
        self.batch.control.max_overlap.fill_(np.inf)

    def motion_changed(self) -> None:
        """A wall moves otherwise than the schedule said, from the present step on."""
        self.batch.forget_schedule()
        self.lists.flights.end_paths()

    def restore(self, extreme: np.ndarray, digits: Mapping[str, np.ndarray]) -> None:
        """Take over the extremes of a checkpoint and of its ``digits`` those that are there; all else is made again."""
        for name in self._digits & digits.keys():
            there = getattr(self.batch.report, name)
            rows = np.zeros(there.shape, dtype=np.int64)
            rows[0] = digits[name]
            there.assign(rows)
        values = self.batch.report.extreme.numpy()
        values[:4] = extreme
        self.batch.report.extreme.assign(values)
        self.batch.forget_schedule()
        self.structs.forget()

    # -- reading --------------------------------------------------------------------------------

    def read(self) -> tuple[wp.array, wp.array, wp.array]:
        """Contact force [N] and torque [N m] together, velocity [m/s], spin [rad/s] of each slot at the present time.

        Velocity and spin in frame axes, absolute or relative to the frame as the integrator holds them. The arrays are those of
        the reading before, if there are as many grains.
        """
        model, n = self._model, self._state.slots
        if self._read is None or len(self._read[0]) != n:
            types = wp.types.vector(6, wp.float64), wp.vec3d, wp.vec3d
            load, velocity, spin = (wp.zeros(n, dtype=dtype, device=model.device) for dtype in types)
            self._read = load, velocity, spin
        load, velocity, spin = self._read
        if n:
            base, _ = self.batch.row()
            grains, _, wall_contacts = self.structs.arguments()
            inputs = [base, self.batch.model, self.batch.control, grains, wall_contacts, load, velocity, spin]
            if self._reading is None:
                self._reading = RecordedLaunch(model.kernels.read.read, n, inputs, model.device)
            else:
                self._reading.prepare(n, inputs)
            self._reading.launch()
        return load, velocity, spin

    @property
    def _digits(self) -> set[str]:
        """Arrays of the report that are sums of ``kernels.measure.window_sum``."""
        measures = self._model.features.measures
        return {name for name, there in (("wear", measures.wear), ("losses", measures.energy)) if there}

    @property
    def digits(self) -> dict[str, np.ndarray]:
        """As ``StepReader.digits``."""
        return {name: window_sum.joined(getattr(self.batch.report, name).numpy()) for name in sorted(self._digits)}

    def settle_losses(self) -> None:
        """Before grains leave: what the last forces between grains take over their whole step is added up."""
        if self._model.features.measures.energy and self.lists.contact_count:
            self._of_contacts("settle_losses", self.batch.report.losses)

    def read_losses(self) -> np.ndarray:
        """As ``StepReader.read_losses``."""
        there = self.batch.report.losses.numpy()
        _, velocity, spin = self.read()
        self.read_ghosts(velocity, spin)
        if not (self._state.slots and self.lists.contact_count):
            return there
        half = wp.zeros_like(self.batch.report.losses)
        self._of_contacts("read_losses", velocity, spin, half)
        return np.concatenate([there, half.numpy()])

    def _of_contacts(self, kernel: str, *arrays: wp.array) -> None:
        """Launch a kernel of ``model.kernels.read`` over the contacts between grains."""
        model, (base, _), (grains, contacts, _walls) = self._model, self.batch.row(), self.structs.arguments()
        lanes = self.lists.totals[0]
        inputs = [lanes // model.features.backend.lanes, base, self.batch.model, self.batch.control, grains, contacts, *arrays]
        wp.launch(getattr(model.kernels.read, kernel), dim=lanes, inputs=inputs, device=model.device)

    def read_sums(self) -> dict[str, np.ndarray]:
        """What the budgets have added up per grain up to the present time, in memory order."""
        model, measures, n = self._model, self._model.features.measures, self._state.slots
        out = {name: wp.zeros((n, width), dtype=wp.float64, device=model.device) for name, width in measures.sums.items()}
        if "flow" in out:
            out["flow"] = getattr(self._state, "flow")  # noqa: B009  arrays of the budgets go by name
        if n and (measures.energy or measures.momentum):
            base, _ = self.batch.row()
            grains, _, wall_contacts = self.structs.arguments()
            none = wp.zeros((0, 1), dtype=wp.float64, device=model.device)
            types = ("energies", model.kernels.structs.Energies), ("momenta", Momenta)
            energies, momenta = (packed(out.get(k, none), t) for k, t in types)
            read = base, self.batch.model, self.batch.control, grains, wall_contacts
            inputs = [*read, energies, momenta, out.get("wall_work", none)]
            wp.launch(model.kernels.read.read_budget, dim=n, inputs=inputs, device=model.device)
        return {name: array.numpy() for name, array in out.items()}
