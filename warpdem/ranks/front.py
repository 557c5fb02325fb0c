"""The run as rank 0 shows it: it tells the other ranks what to do, and adds up or gathers what is read of them.

Sums and largest values of rows, guards and frames in pieces come from each rank's own grains (``measure.part``). Whoever reads
grains one by one sees all of them on rank 0, as in a run of one process, and so gives the same bytes: checkpoints, frames in
one piece, columns of ``history.csv`` that are no sums (``Column.whole``), and some guards.
"""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import warp as wp

from warpdem.core.threads import Threads, run_threads, threads_for
from warpdem.core.timers import Timers
from warpdem.engine.engine import Engine
from warpdem.engine.run_loop import RunLoop
from warpdem.errors import WarpdemError
from warpdem.kernels.measure import window_sum
from warpdem.model.decisions import Decisions
from warpdem.model.model import Model
from warpdem.ranks.cuts import Cuts
from warpdem.ranks.portion import Portion
from warpdem.ranks.rank import Rank, nobody
from warpdem.ranks.world import World
from warpdem.state import contact_history
from warpdem.state.checkpoint_file import Contents
from warpdem.state.clock import Clock
from warpdem.state.particles import State
from warpdem.state.streams import Streams
from warpdem.state.view import RunView

END = "end"
Thing = TypeVar("Thing")
_led: list[World] = []


def led() -> World | None:
    """The ranks that this process leads; None in a run of one process."""
    return _led[-1] if _led else None


@contextmanager
def leading(world: World | None) -> Iterator[None]:
    """Lead the other ranks in the block, if there are any; with its end they end too, with its exit code."""
    if world is None:
        yield
        return
    code = 1
    _led.append(world)
    try:
        yield
        code = 0
    except WarpdemError as error:
        code = error.exit_code
        raise
    except KeyboardInterrupt:
        code = 130
        raise
    except (OSError, MemoryError):
        code = 3
        raise
    finally:
        _led.pop()
        if world.busy:  # the others wait for what this rank did not do
            raised = sys.exception()
            sys.stderr.write(f"error: rank 0: {raised if isinstance(raised, WarpdemError) else repr(raised)}\n")
            sys.stderr.flush()
            world.abort(code)
        world.from_first((END, (code,)))
        world.close()


class Front(RunLoop):
    """The loop of a run over ranks, on rank 0.

    Args:
        world: the ranks.
        model: what is run.
        view: the whole run as readers see it.
        engine: of the whole: it holds the lists that readers see, and steps nothing.
        streams, timers: of the run.
        threads: CPU threads per rank.
        device: what the user asks for, of ``devices.device_name``.

    Attributes:
        rank: what rank 0 itself moves.
    """

    def __init__(
        self, world: World, model: Model, state: State, clock: Clock, engine: Engine, streams: Streams, timers: Timers,
        threads: Threads, device: str | None,
    ) -> None:  # fmt: skip
        super().__init__(state, clock, engine, streams, timers)
        self._world, self._model = world, model
        self._is_dealt, self._is_evaluated, self._is_gathered, self._has_stopped = False, True, True, False
        with world.together():
            decided = Decisions.of(model)
            self._tell("model", decided, threads.count, device)
            self.rank = Rank(world, replace(model, expected=decided.expected), threads)  # the skins are those of all ranks
            self.rank.count_left, self.rank.before_leaving = self._count_left, self._before_leaving
            self.rank.take_liquid = self._take_liquid
            world.raise_first(None)

    def _tell(self, name: str, *arguments: Any) -> None:
        self._world.from_first((name, arguments))

    def on_all(self, name: str, *arguments: Any) -> Any:
        """Call a method of ``Rank`` on all ranks together; returns what it gives on rank 0."""
        with self._world.together():
            self._tell(name, *arguments)
            return getattr(self.rank, name)(*arguments)

    # -- what is read ---------------------------------------------------------------------------

    @property
    def all_here(self) -> bool:
        """As ``Parts``: the others have nothing yet, or cannot answer: then there is here what was gathered last."""
        return not self._is_dealt or self._has_stopped or self._world.busy

    def each(self, read: Callable[..., Thing]) -> list[Thing]:
        """As ``Parts``; the forces are evaluated."""
        with self._timers.measure("sums"):
            found: list[Thing] = self.on_all("read", read)
        return found

    def evaluate(self) -> None:
        """As ``RunLoop``, on all ranks."""
        if not self._is_dealt:
            if not self._clock.forces_evaluated:  # of the whole at the start, on this rank alone
                super().advance(0)
        elif not (self.all_here or self._is_evaluated):
            with self._shown_where_it_stops():
                self.on_all("evaluate")
            self._take_extremes(self.on_all("extremes"))
            self._is_evaluated = True

    def gather(self) -> bool:
        """As ``Parts``: gather the whole of the present time, if it is not here."""
        self.evaluate()
        if not (self.all_here or self._is_gathered):
            self._gather()
        return not self._is_dealt or self._has_stopped or self._is_gathered

    # -- steps ----------------------------------------------------------------------------------

    def advance(self, count: int) -> None:
        """As ``RunLoop``, on all ranks."""
        self._deal_first()
        if count == 0:
            self.evaluate()
            return
        clock = self._clock
        before, insertion = clock.step_number, self._streams.next_step()
        hold = insertion is not None and insertion - before <= count
        count = insertion - before if hold and insertion is not None else count
        max_overlap = float(self._engine.batch.control.max_overlap.numpy()[0])
        self._is_evaluated = self._is_gathered = False  # also where the steps end with an error
        try:
            with self._timers.measure("steps"), self._shown_where_it_stops():
                self.on_all("advance", count, max_overlap, hold)
        finally:
            clock.step_number = self.rank.clock.step_number
        clock.forces_evaluated = False
        self.steps_done += clock.step_number - before
        self._take_extremes(self.on_all("extremes"))
        if clock.step_number == insertion:
            self.insert()

    def _deal_first(self) -> None:
        """Deal the grains out as they are at the start, unless that is done."""
        if not self._is_dealt:
            self.evaluate()
            view = RunView(self._model, self._state, self._clock, self._engine, None, self._engine.lists.view)
            self._deal(Portion.of({**contact_history.read(view), **Rank.arrays_of(self._state, self._state.rank)}))

    def write_pieces(self) -> list[list[Any]]:
        """Let each rank write its piece of the frame of the present time; returns what joins them, for each rank and format."""
        self._deal_first()
        found: list[list[Any]] = self.on_all("write_pieces")
        return found

    def insert(self) -> None:
        """As ``RunLoop``."""
        if not self._is_dealt:
            super().insert()
            return
        boxes = self._streams.boxes()
        with self._world.together():
            self._tell("insert", boxes)
            self.rank.insert(boxes, self._draw)

    def _draw(self, others: np.ndarray) -> Portion:
        """The grains that streams bring at the present step, beside ``others``."""
        inserted = self._streams.insert(others)
        for slots in inserted:
            self.after_insertion(slots)
        slots = np.concatenate([np.zeros(0, dtype=np.int64), *inserted])
        return Portion.of(Rank.arrays_of(self._state, slots)).made()

    def _count_left(self, leaving: Portion) -> None:
        """Count grains that leave by their ``way_out``."""
        self._clock.step_number = self.rank.clock.step_number  # which an error names
        state, where = State.of(self._model, nobody(self._model.features.contact.clumps)), leaving.grains["way_out"]
        state.restore({**leaving.data, "next_id": 0})
        self._engine.leavers.count(state, np.arange(len(where)), where, self.rank.clock.step_number)

    def _take_liquid(self, counts: np.ndarray) -> None:
        """Count the liquid that grains have taken along."""
        self._state.liquid_left = self._state.liquid_left + counts

    def _before_leaving(self, near: Portion, ids: np.ndarray) -> None:
        """Let the budgets count the grains ``ids`` that are about to leave; ``near``: these and those they touch."""
        self._clock.step_number = self.rank.clock.step_number
        self._state.restore({**near.data, "next_id": self._state.next_id})
        self._engine.restore(self._engine.extreme, {})
        contact_history.restore(self._engine.lists, near.data, since=1)
        self._engine.leavers.before_leaving(np.flatnonzero(np.isin(self._state.id.numpy(), ids)))

    def _take_extremes(self, found: np.ndarray) -> None:
        report = self._engine.batch.report.extreme
        values = report.numpy()
        values[:4] = np.maximum(self._engine.extreme, found)
        report.assign(values)

    def report(self) -> list[dict[str, Any]]:
        """What each rank has done: grains, ghosts, grains that went to another rank, bytes, time in exchanges [s] ..."""
        if self._world.busy:  # the others cannot answer
            return []
        found: list[dict[str, Any]] = self.on_all("report")
        return found

    # -- the whole ------------------------------------------------------------------------------

    def restore_contacts(self, data: Mapping[str, Any]) -> None:
        """As ``RunLoop``: grains and contacts go to the ranks block by block as they are read, and to no list here."""
        self._deal(Portion.of(data.rows if isinstance(data, Contents) else data))
        self._clock.forces_evaluated = self._is_gathered = False
        self._is_evaluated = True

    def _deal(self, whole: Portion) -> None:
        """Deal all grains out to the ranks."""
        state, clock, world = self._state, self._clock, self._world
        position = whole.places
        cuts = Cuts.of(position, np.ones(len(position)), world.size)
        with world.together():
            dealt = clock.step_number, state.next_id, [wall.saved() for wall in self._model.schedule.dynamic], cuts
            self._tell("deal", *dealt)
            self.rank.deal(*dealt, whole, cuts.owner(position), self._engine.digits)
        self._is_dealt = True

    def _gather(self) -> None:
        """Let the whole be that of the present time, its forces evaluated."""
        with self._timers.measure("gather"):
            found = self.on_all("gather")
        assert found is not None
        portion, digits = found
        with self._timers.measure("gather"):
            state, engine, clock = self._state, self._engine, self._clock
            state.restore({**portion.data, "next_id": state.next_id})
            names = engine.digits
            engine.restore(engine.extreme, {name: window_sum.joined(np.stack([one[name] for one in digits])) for name in names})
            if len(state):
                contact_history.restore(engine.lists, portion.data)
            else:
                self._forget_contacts()
            clock.forces_evaluated = self._is_gathered = True

    @contextmanager
    def _shown_where_it_stops(self) -> Iterator[None]:
        """Where the run stops in the block, let the whole hold the grains as they are, without contacts and forces."""
        try:
            yield
        except WarpdemError:
            if not self._world.busy:  # else the others cannot answer
                whole = self.on_all("gather_grains")
                assert whole is not None
                self._state.restore({**whole.data, "next_id": self._state.next_id})
                self._forget_contacts()
                self._has_stopped = True
            raise

    def _forget_contacts(self) -> None:
        lists, n = self._engine.lists, len(self._state)
        lists.forget_outer()
        lists.set_totals([0, 0, 0])
        if lists.wall_contacts is not None:
            lists.wall_contacts = lists.new_wall_contacts(n, 0)


def rank_threads(world: World, asked: int | None, grains: int, device: wp.Device) -> Threads:
    """The threads of a rank: as many as asked for, or as pay for its part of ``grains``, within its part of the cores."""
    count = min(threads_for(grains // world.size), world.cores) if asked is None else asked
    return run_threads(count, grains, grows=False, cpu=device.is_cpu)
