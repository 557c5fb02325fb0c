"""The executor of a GPU in a run over several processes (ranks) whose messages go from GPU to GPU: graphs of several steps.

The messages are captured with the launches, so every rank sends and receives the same number of times: a graph has a fixed
number of steps, without a branch. What ends the steps (a grain beyond the lists, one that left, an overlap too deep, the end of
the batch) is agreed on the device after each step; the steps that follow in the graph then do nothing, and their messages carry
what is there already. The host looks at the clock after each graph, and builds the lists, on all ranks together.
"""

from typing import Protocol

import warp as wp

from warpdem.engine.batch import Batch
from warpdem.engine.graph import Captured, GraphExecutor, GraphLaunch
from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.structs import Structs
from warpdem.kernels.step import messages as rows
from warpdem.kernels.step.clock import CHECK_LISTS, STEPS_DONE
from warpdem.model.model import Model

STEPS = 8
"""Steps of a graph. A look at the clock holds up the device once in so many steps; when steps end, half as many on average are
launched without effect. A guess: no GPU has run it."""


class StepMessages(Protocol):
    """The messages of a step, each a call within a capture.

    Attributes:
        version: another number when other memory is sent or received than before.
    """

    version: int

    def after_stage(self) -> None:
        """Ghosts get the state that their owners have."""

    def add_loads(self) -> None:
        """The loads on walls that move by them are added up over the ranks."""

    def agree(self) -> None:
        """The flags of ``kernels.step.graph``'s ``found`` become the largest of all ranks."""

    def arrays(self) -> list[wp.array]:
        """Arrays that are sent or received, other than those of the step."""

    def repeated(self, steps: int) -> None:
        """The messages of ``steps`` steps were launched."""


class StepsExecutor(GraphExecutor):
    """Runs steps ``STEPS`` at a time, on all ranks together, with those that have no grains.

    Attributes:
        messages: of the steps.
    """

    messages: StepMessages

    def advance(
        self, count: int, forces_first: bool, hold: bool, lists: NeighborLists, structs: Structs, batch: Batch
    ) -> tuple[int, int]:
        """As ``Engine.advance``, on all ranks together."""
        captured = None
        if self._state.slots:
            captured = Captured(self._model, self._state, lists, structs, batch, self.storage)
            self._begin(captured, count, forces_first, hold)
        else:
            self._set_clock(lists, batch, count, hold)
        steps = Steps(self._model, batch, captured, self.messages)
        graphs = self._graphs_of(steps, [steps.launch]) if count else []
        if captured is not None:
            del captured.build  # it refers back: without it old arrays are freed at once
        for _ in range(0, count, STEPS):
            wp.capture_launch(graphs[0])
            self.messages.repeated(STEPS)
            clock = batch.clock.numpy()
            if clock[CHECK_LISTS]:
                return int(clock[STEPS_DONE]), int(batch.report.moved.numpy()[0])
        return count, 0


class Steps:
    """The launches and messages of ``STEPS`` steps; ``captured`` None: of a rank without grains, what it shares with others."""

    def __init__(self, model: Model, batch: Batch, captured: Captured | None, messages: StepMessages) -> None:
        self._model, self._batch, self._captured, self._messages = model, batch, captured, messages
        self._once = GraphLaunch(model.device).once

    def launch(self) -> None:
        """All launches and messages, in their order."""
        kernels, b = self._model.kernels.graph, self._batch
        for ahead in range(STEPS):
            self._step(ahead)
        self._once(kernels.advance_clock, STEPS, len(self._model.schedule.motions), b.control, b.clock, b.placements)

    def _step(self, ahead: int) -> None:
        step = self._captured.step if self._captured is not None else None
        kernels, b = self._model.kernels.graph, self._batch
        if self._model.schedule.dynamic:
            if step is not None:
                step.add_wall_loads(ahead)
            self._messages.add_loads()
            self._once(kernels.advance_walls, ahead, b.model, b.control, b.report, b.clock)
        for stage in range(b.stages):
            if step is not None:
                if stage > 0:
                    step.forces(ahead, stage)
                step.move(ahead, stage)
            self._messages.after_stage()
        self._once(kernels.found, ahead, b.control, b.report, b.clock)
        self._messages.agree()
        self._once(kernels.agreed, ahead, b.report, b.clock)
        if step is not None:
            step.forces(ahead + 1)

    # -- what was captured ------------------------------------------------------------------------

    def key(self) -> tuple:
        """As ``graph.Launches``."""
        return self._messages.version, *(self._captured.key() if self._captured is not None else ())

    def load(self) -> None:
        """As ``graph.Launches``."""
        device = self._model.device
        wp.load_module(rows, device=device)
        if self._captured is not None:
            self._captured.load()
            return
        for kernel in vars(self._model.kernels.graph).values():
            if isinstance(kernel, wp.Kernel):
                wp.load_module(kernel.module, device=device)

    def arrays(self) -> list[wp.array]:
        """As ``graph.Launches``."""
        own = self._captured.arrays() if self._captured is not None else []
        return [*own, *self._messages.arrays()]
