"""The executor of a GPU in a run over several processes (ranks): a captured graph for each stage, the host between them.

After each stage the host sends and receives the state of ghosts, and after the last one all ranks agree on whether to stop, as
they do from within the loop of a CPU (``kernels.step.exchange``). Lists are built on all ranks together, by the host.
"""

from collections.abc import Callable
from functools import partial

import warp as wp

from warpdem.engine.batch import Batch
from warpdem.engine.graph import Captured, GraphExecutor
from warpdem.engine.neighbor_list import NeighborLists
from warpdem.engine.structs import Structs
from warpdem.kernels.step.exchange import WALL_LOADS


class StageExecutor(GraphExecutor):
    """Runs steps stage by stage.

    Attributes:
        exchange: called after the launches of a stage, with the steps of this batch so far and the stage, as
            ``kernels.step.exchange``; what was found on this rank is in the report of the batch.
    """

    exchange: Callable[[int, int], int]

    def advance(
        self, count: int, forces_first: bool, hold: bool, lists: NeighborLists, structs: Structs, batch: Batch
    ) -> tuple[int, int]:
        """As ``Engine.advance``, on all ranks together."""
        captured = Captured(self._model, self._state, lists, structs, batch, self.storage)
        self._begin(captured, count, forces_first, hold)
        launches = Stages(captured)
        graphs = self._graphs_of(captured, launches.parts) if count else []
        del captured.build  # it refers back: without it old arrays are freed at once
        for step in range(1, count + 1):
            found = 0
            for stage, graph in zip(launches.numbers, graphs[:-1], strict=True):
                wp.capture_launch(graph)
                found = self.exchange(step, stage)
            if found:
                return step, found
            wp.capture_launch(graphs[-1])
        return count, 0


class Stages:
    """The launches of a step, in parts between which ranks exchange.

    Attributes:
        numbers: of the stages, as of ``kernels.step.exchange``.
        parts: the launches before each of these exchanges, then those that end the step.
    """

    def __init__(self, captured: Captured) -> None:
        self._step, self._batch = captured.step, captured.batch
        self._kernels, self._motions = captured.model.kernels.graph, len(captured.model.schedule.motions)
        self._walls = bool(captured.model.schedule.dynamic)
        stages = range(captured.batch.stages)
        self.numbers = [WALL_LOADS, *stages] if self._walls else [*stages]
        self.parts: list[Callable[[], None]] = [partial(self._step.add_wall_loads, 0)] if self._walls else []
        self.parts += [*(partial(self._stage, stage) for stage in stages), self._end]

    def _stage(self, stage: int) -> None:
        step, b = self._step, self._batch
        if stage == 0 and self._walls:
            step.advance_walls(0)
        if stage > 0:
            step.forces(0, stage)
        step.move(0, stage)
        if stage == b.stages - 1:
            step.launch.once(self._kernels.found, 0, b.control, b.report, b.clock)

    def _end(self) -> None:
        """Forces at the end of the step, if they are wanted here."""
        step, b = self._step, self._batch
        step.forces(1)
        step.launch.once(self._kernels.advance_clock, 1, self._motions, b.control, b.clock, b.placements)
