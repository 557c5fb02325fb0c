"""One rank: its grains, lists and steps. Every method is called on all ranks together."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpdem.core.threads import Threads
from warpdem.core.timers import Timers
from warpdem.engine.engine import Engine
from warpdem.engine.host_build import morton_order
from warpdem.errors import StabilityError
from warpdem.filling.clump_grains import no_clumps
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.size_grids import finest_cell, size_classes
from warpdem.guards.travel import TravelGuard
from warpdem.guards.verdict import Verdict
from warpdem.kernels import grain
from warpdem.kernels.step.exchange import TOO_DEEP, WALL_LOADS
from warpdem.kernels.step.motion import BEYOND, LEFT
from warpdem.model.model import Model
from warpdem.ranks import halo, transfer
from warpdem.ranks.answers import shared_slots
from warpdem.ranks.cuts import Cuts
from warpdem.ranks.device_exchange import DeviceExchange
from warpdem.ranks.lists import RankLists
from warpdem.ranks.portion import OF_GHOSTS, Portion, Table, numbered, with_ghosts
from warpdem.ranks.reading import RankReadings
from warpdem.ranks.ways import way_of
from warpdem.ranks.world import World
from warpdem.state import contact_history
from warpdem.state.clock import Clock
from warpdem.state.particles import State
from warpdem.state.view import RunView

SAMPLE = 20_000
"""Grains of all ranks together that cuts are made for."""
IMBALANCE = 1.1
"""Load of the busiest rank over the mean [-] from which on cuts are shifted."""
WAIT = 8
"""Outer lists until cuts are tried again that shifting did not help."""


@dataclass
class Counts:
    """What a rank has done since its start."""

    migrated: int = 0
    """Grains that went to another rank."""
    rebuilds: int = 0
    """Outer lists."""
    cuts: int = 0
    """How often cuts were shifted."""


class Rank(RankReadings):
    """One rank of a run.

    Args:
        world: the ranks.
        model: what is run.
        threads: CPU threads of this rank.

    Attributes:
        clock: where the run is in time.
        state: own grains, then ghosts.
        engine: steps them.
        exchange: keeps ghosts up to date.
        counts: what was done.
        notice: takes a guard's verdict, on rank 0.
        count_left: takes the grains that leave, and the number of the outlet of each as ``way_out`` of them, on rank 0.
        before_leaving: takes the grains that leave with those they touch, and the ids of the former, on rank 0, where budgets
            ask for it.
        take_liquid: takes the liquid of grains that have left, columns as of ``State.film``, on rank 0.
    """

    def __init__(self, world: World, model: Model, threads: Threads) -> None:
        super().__init__()
        self.world, self._model, features = world, model, model.features
        self.clock, self._timers = Clock(model.dt), Timers()
        self.state = State.of(model, nobody(features.contact.clumps))
        self.way = way_of(world, model)
        self.engine = Engine(model, self.state, self.clock, threads, self._timers, RankLists, self.way.executor)
        lists = self.engine.lists
        assert isinstance(lists, RankLists)
        self.lists = lists
        lists.world, lists.move_grains, lists.fast_found = world, self._move_grains, self._notice_travel
        lists.leave, lists.rebuilt = self._leave, self._connect_answers
        self.exchange = self.way.exchange(world, self.engine)
        self.engine.batch.control.removes_in_step.zero_()  # ranks count what leaves together
        self.view = RunView(model, self.state, self.clock, self.engine, None, lists.view, threads=threads)
        self.engine.read_ghosts = self.read_ghosts
        self._guard = TravelGuard(model)
        self.notice: Callable[[Verdict], None] = lambda verdict: None
        self.count_left: Callable[[Portion], None] = lambda leaving: None
        self.before_leaving: Callable[[Portion, np.ndarray], None] = lambda near, ids: None
        self.take_liquid: Callable[[np.ndarray], None] = lambda counts: None
        self._new: Portion | None = None  # inserted, and in no list yet
        self.counts, self._tried = Counts(), -WAIT
        self._cuts = Cuts(np.zeros(world.size - 1, dtype=np.int64), np.zeros(world.size - 1))

    # -- grains ---------------------------------------------------------------------------------

    def deal(
        self, step: int, next_id: int, walls: list[dict[str, Any]], cuts: Cuts, whole: Portion | None = None,
        owner: np.ndarray | None = None, digits: Mapping[str, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        """Take over the state of a run, whose forces are known.

        Args:
            step: its step.
            walls: state of those that move by the load on them.
            next_id: least id that no grain has had so far.
            cuts: who owns which part of space.
            whole: all grains, on rank 0.
            owner: rank of each, on rank 0.
            digits: of ``StepReader.digits`` so far, on rank 0: the others add to none.
        """
        mine = transfer.deal(self.world, whole, owner)
        self.clock.step_number, self.state.next_id, self._cuts = step, next_id, cuts
        for wall, state in zip(self._model.schedule.dynamic, walls, strict=True):
            wall.restore(state)
        none = {name: np.zeros_like(values) for name, values in self.engine.digits.items()}
        self.engine.restore(self.engine.extreme, none if digits is None else digits)
        self._settle(mine, forces=True)
        self.clock.forces_evaluated = True

    def _settle(self, mine: Portion, forces: bool) -> None:
        """Let ``mine`` be the grains of this rank, find their ghosts, and build the lists."""
        own, sends, both, place, receives = self._with_ghosts(mine)
        state, lists = self.state, self.lists
        state.restore({**numbered(both, mine.clumps), "next_id": state.next_id})
        state.ghosts = len(both["id"]) - len(own)
        lists.given_order = place
        data: dict[str, Any] = {**both, **mine.among(both["id"]), **mine.points}
        if not len(state):
            lists.given_order = None
            lists.make()
        elif forces:
            contact_history.restore(lists, data)
        else:
            lists.force_parity = (self.clock.step_number - 1) & 1
            contact_history.remember(lists, data)
            lists.rebuild()
        changing = [state.record, state.inverse] if state.clumps is not None else [state.record]
        self.exchange.connect(changing, state.owned, sends, receives)
        self.sends = sends
        self.rank_of_ghost = np.repeat(np.fromiter(receives, np.int64), np.fromiter(receives.values(), np.int64))
        self._connect_answers()
        self.counts.rebuilds += 1

    def _connect_answers(self) -> None:
        """Exchange what films give to the bridges between grains of different ranks."""
        films, lists = self._model.kernels.films, self.lists
        if films is not None:
            contacts = shared_slots(lists.view(), self.rank_of_ghost)
            self.exchange.connect_answers(lists.slot_force[:, films.wish] if contacts else None, contacts)

    def _with_ghosts(self, mine: Portion) -> tuple[np.ndarray, dict[int, np.ndarray], Table, np.ndarray, dict[int, int]]:
        """Order of own grains in memory; slots that each rank sees; all by id; their places; number of ghosts by rank.

        The grains that others see come last: the contacts of those before are evaluated while ghosts are under way.
        """
        record = mine.grains["record"]
        position, radius = record[:, grain.POSITION], record[:, grain.RADIUS]
        beyond = self._model.features.contact.gap + self.lists.skin
        boxes = self.world.everyone(halo.boxes(position, radius))
        boxes[self.world.rank] = boxes[self.world.rank][:0]
        seen, by_any = [], np.zeros(len(radius), dtype=bool)
        for there in boxes:
            near = halo.seen(position, radius, there, beyond, self._model.domain.period)
            seen.append(np.flatnonzero(near))
            by_any |= near
        order = np.zeros(0, dtype=np.int64)
        if len(radius):
            order = morton_order(mine.places, finest_cell(radius, size_classes(radius), beyond), self._model.device)
            order = order[np.argsort(mine.bodies_of(by_any)[order], kind="stable")]
        own = {name: values[order] for name, values in mine.grains.items()}
        slot = np.empty_like(order)
        slot[order] = np.arange(len(order))
        sends = {rank: np.sort(slot[near]) for rank, near in enumerate(seen) if len(near)}
        out: list[Table | None] = [None] * self.world.size
        for rank, rows in sends.items():
            out[rank] = {name: own[name][rows] for name in OF_GHOSTS}
        ghosts = {rank: found for rank, found in enumerate(self.world.swapped(out)) if found is not None}
        both, place = with_ghosts(own, list(ghosts.values()))
        return order, sends, both, place, {rank: len(found["id"]) for rank, found in ghosts.items()}

    @property
    def _before(self) -> RunView:
        """The rank one step ago, when the last forces were evaluated."""
        return replace(self.view, clock=Clock(self.clock.dt, self.clock.step_number - 1))

    def _move_grains(self) -> None:
        """Deal the grains out again, and build both lists."""
        world, mine = self.world, self.own(self._before, forces=False)
        if self._new is not None:
            mine = mine.with_grains(self._new)
            self._new = None
        position = mine.places
        loads = np.ones(len(position))
        loads[: self.state.owned_count] = self._loads()  # those that were inserted have the highest ids
        self._shift_cuts(position, loads)
        owner = self._cuts.owner(position)
        moved = int((owner != world.rank).sum())
        self.counts.migrated += moved
        if world.any_of(int(moved > 0)):
            mine = Portion.joined(world.swapped(mine.split(owner, world.size)))
        self._settle(mine, forces=False)

    def _loads(self) -> np.ndarray:
        """Work of each own grain [-], in order of id, shape (n,): one for itself, and one for each contact that is listed."""
        state, lists = self.state, self.lists
        if not (state.slots and lists.built):
            return np.ones(self.state.owned_count)
        slots = state.rank[state.rank < state.owned]
        listed: np.ndarray = np.diff(lists.slot_start.numpy())[slots]
        return 1.0 + listed

    def _shift_cuts(self, position: np.ndarray, load: np.ndarray) -> None:
        """Shift the cuts where the ranks' loads are too different."""
        world = self.world
        loads = np.array(world.everyone(float(load.sum())))
        due = self.counts.rebuilds - self._tried >= WAIT and loads.max() > IMBALANCE * loads.mean()
        if not due:
            return
        self._tried = self.counts.rebuilds
        every = max(1, int(world.total(len(position))) // SAMPLE)
        found = world.gathered((position[::every], load[::every]))
        cuts = None
        if found:
            points, weights = (np.concatenate([one[k] for one in found]) for k in (0, 1))
            cuts = shifted(points, weights, self._cuts)
        self._cuts = world.comm.bcast(cuts)
        self.counts.cuts += 1

    def report(self) -> list[dict[str, Any]]:
        """What each rank has done, on rank 0."""
        state, exchange = self.state, self.exchange
        return self.world.gathered({
            "device": self._model.device.alias, "grains": state.owned, "ghosts": state.ghosts,
            "migrated": self.counts.migrated, "rebuilds": self.counts.rebuilds, "cuts": self.counts.cuts,
            "share_inside": self.share_inside, "way": self.way.text, "exchanges": exchange.calls,
            "bytes": exchange.bytes, "waiting": exchange.seconds, "gathers": self.gathers,
            "seconds": dict(self._timers.seconds),
        })  # fmt: skip

    @property
    def share_inside(self) -> float:
        """Fraction of the contact batches that are evaluated while ghosts are under way [-]; 0 on GPUs."""
        return self.lists.batches_inside * self._model.features.backend.lanes / max(self.lists.totals[0], 1)

    # -- steps ----------------------------------------------------------------------------------

    def insert(self, boxes: list[tuple[np.ndarray, np.ndarray]], draw: Callable[[np.ndarray], Portion] | None = None) -> None:
        """Insert what streams bring at the present step.

        Args:
            boxes: of ``Streams.boxes``.
            draw: gives the new grains from center and radius of those beside the boxes, shape (m, 4), on rank 0.
        """
        state = self.state
        record = state.record.numpy()[: state.owned]
        here = state.here[: state.owned].copy()
        if not self._model.features.measures.sums:  # else what is in an outlet leaves only when lists are looked at
            here &= ~self.lists.in_outlets()
        record, beside = record[here][:, : grain.RADIUS + 1], np.zeros(int(here.sum()), dtype=bool)
        for middle, half in boxes:
            apart = np.abs(self._model.domain.nearest(record[:, grain.POSITION] - middle))
            beside |= (apart < half + record[:, grain.RADIUS, None]).all(axis=1)
        found = self.world.gathered(record[beside])
        new: Portion = self.world.comm.bcast(draw(np.concatenate(found)) if draw is not None else None)
        if len(new):
            self._new = new.split(self._cuts.owner(new.places), self.world.size)[self.world.rank]
            self.clock.forces_evaluated = False

    def _leave(self) -> None:
        """Count and remove the own grains that are in an outlet."""
        gone, where = self.lists.leaving
        state, world = self.state, self.world
        self.engine.settle_losses()
        every = np.concatenate(world.everyone(state.id.numpy()[gone]))
        if self._model.features.measures.sums:
            near = self.own(self._before).around(every)
            near.keep_owned_pairs()
            found = transfer.gather(world, near)
            if found is not None:
                self.before_leaving(found, every)
        by_id = np.argsort(state.id.numpy()[gone])
        mine = Portion.of(self.arrays_of(state, gone[by_id])).made()
        mine.grains["way_out"] = where[by_id]
        leaving, error = world.gathered(mine), None
        if leaving:
            try:
                self.count_left(Portion.joined(leaving))
            except StabilityError as stop:
                error = stop
        world.raise_first(error)
        self.lists.remove(gone, state.owned + np.flatnonzero(np.isin(state.id.numpy()[state.owned :], every)))
        if state.film is not None:
            for counts in world.gathered(state.film.numpy()[gone].sum(axis=0)):
                self.take_liquid(counts)

    def advance(self, count: int, max_overlap: float, hold: bool) -> int:
        """Run up to ``count`` steps; returns how many were done: fewer where an overlap exceeds ``max_overlap`` [-].

        Args:
            count: steps.
            max_overlap: largest allowed overlap over the radius [-].
            hold: leave the forces after the last step: grains are inserted there.

        Raises:
            StabilityError: the run cannot go on.
        """
        self.engine.batch.control.max_overlap.fill_(max_overlap)
        first, clock = self.clock.step_number, self.clock
        while clock.step_number < first + count:
            left = first + count - clock.step_number
            batch = self.world.least(min(left, self.engine.steps_ahead))
            if self._steps(batch, hold=hold and batch == left) & TOO_DEEP:
                break
        return clock.step_number - first

    def evaluate(self) -> None:
        """Evaluate the forces of the present time if they are not."""
        if not self.clock.forces_evaluated:
            self._steps(0)

    def _steps(self, count: int, hold: bool = False) -> int:
        """Make the lists valid and run up to ``count`` steps; returns what stopped them, by bits."""
        clock, lists = self.clock, self.lists
        if not clock.forces_evaluated:
            lists.update(grown=self._new is not None)
        if self.state.slots or isinstance(self.exchange, DeviceExchange):
            with self._timers.measure("steps"):
                done, found = self.engine.advance(count, not clock.forces_evaluated, hold)
        else:
            done, found = self._steps_without_grains(count)
        self.exchange.finish()
        clock.step_number += done
        self.engine.read_walls()
        lists.pending |= found & (BEYOND | LEFT)
        clock.forces_evaluated = not found and not hold
        return found

    def _steps_without_grains(self, count: int) -> tuple[int, int]:
        """Agree with the others on each of up to ``count`` steps."""
        assert not isinstance(self.exchange, DeviceExchange)
        for step in range(1, count + 1):
            if self.engine.moves_walls:
                self.exchange.call(step, WALL_LOADS, 0)
                self.engine.advance_walls(1, step - 1)
            for stage in range(self.engine.batch.stages):
                found = self.exchange.call(step, stage, 0)
            if found:
                return step, found
        return count, 0

    def _notice_travel(self, here: bool) -> None:
        """Let the guard of travel look where a grain is fast beside a mesh."""
        verdicts: list[Verdict] = []
        if here:
            placements = self.engine.batch.placements_ahead()[0]
            verdicts = self._guard.look(self.state.record.numpy(), placements, self.state, self.clock)
        error = None
        try:
            for verdict in [one for found in self.world.gathered(verdicts) for one in found]:
                self.notice(verdict)
        except StabilityError as stop:
            error = stop
        self.world.raise_first(error)


def shifted(position: np.ndarray, weight: np.ndarray, cuts: Cuts) -> Cuts:
    """``cuts``, shifted for equal weights."""
    return Cuts.of(position, weight, cuts.parts, like=cuts)


def nobody(clumps: bool) -> InitialGrains:
    """No grains, in a run of clumps or not."""
    numbers, rows, none = np.zeros(0, dtype=np.int32), np.zeros((0, 3)), no_clumps(0) if clumps else None
    return InitialGrains(numbers.astype(np.int64), numbers, numbers, np.zeros(0), rows, rows, rows, clumps=none)
