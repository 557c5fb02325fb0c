"""The parts of a run, made in the order in which they need each other."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpdem.core.device import pick_device
from warpdem.core.threads import Threads, run_threads
from warpdem.core.timers import Timers
from warpdem.engine.engine import Engine
from warpdem.engine.run_loop import RunLoop
from warpdem.errors import SceneError
from warpdem.guards.verdict import Verdict
from warpdem.guards.watch import Guards
from warpdem.measure.budget import Budget
from warpdem.model import time_step
from warpdem.model.digests import Given
from warpdem.model.model import Model
from warpdem.model.prepare import prepare, require_scene
from warpdem.ranks.devices import device_name
from warpdem.ranks.front import Front, rank_threads
from warpdem.ranks.world import World
from warpdem.scene.model import Scene
from warpdem.state.budget_totals import BudgetTotals
from warpdem.state.clock import Clock
from warpdem.state.particles import State
from warpdem.state.restart import read as read_start
from warpdem.state.restart import started_from, take_over
from warpdem.state.streams import Streams
from warpdem.state.view import RunView


@dataclass
class Parts:
    """What a run consists of."""

    model: Model
    """What is run."""
    state: State
    """The grains."""
    clock: Clock
    """Where the run is in time."""
    engine: Engine
    """Lists and steps."""
    streams: Streams
    """Grains that come while the run goes on."""
    loop: RunLoop
    """The order of list builds, steps and insertions."""
    view: RunView
    """The run as readers see it."""
    guards: Guards
    """What stops a run that cannot be trusted."""
    threads: Threads
    """CPU threads."""
    timers: Timers
    """Wall time by stage."""
    notes: list[str]
    """What of the scene's file was not taken, and what is odd, for people."""

    @classmethod
    def of(
        cls, scene: Scene, device: str | None, threads: int | None, start: str | Path | None, resident: bool | None,
        world: World | None = None,
    ) -> "Parts":  # fmt: skip
        """The parts of a run at its first step; arguments and errors as of ``Simulation``."""
        require_scene(scene)
        given = Given.of(scene if start is None else started_from(scene, start))
        where = pick_device(device if world is None else device_name(device, world.local_rank))
        if where.is_cuda and resident is False:
            raise SceneError(f"resident = False: device {where.alias} knows no other way of stepping")
        timers = Timers()
        with timers.measure("set-up"):
            past = read_start(given.scene) if given.scene.start is not None else None
            resident = where.is_cuda if resident is None else resident
            model, grains = prepare(given, where, resident, past, ranks=world is not None)
            state, clock = State.of(model, grains), Clock(model.dt)
            if world is None:
                workers = run_threads(threads, len(grains), grows=bool(model.scene.streams), cpu=where.is_cpu)
            else:
                workers = rank_threads(world, threads, len(grains), where)
            engine = Engine(model, state, clock, workers, timers)
        streams = Streams(model, state, clock)
        loop = RunLoop(state, clock, engine, streams, timers)
        if world is not None:
            loop = Front(world, model, state, clock, engine, streams, timers, workers, device)
        sums = model.features.measures.sums
        totals = BudgetTotals.of(sums) if sums else None
        parts = loop if isinstance(loop, Front) else None
        left, departures = engine.leavers.left, engine.leavers.departures
        view = RunView(model, state, clock, engine, totals, engine.lists.view, left, departures, workers, parts)
        guards = Guards(view, loop.evaluate, engine.ignore_overlaps)
        engine.lists.watch_travel = guards.check_travel
        if isinstance(loop, Front):
            loop.rank.notice = guards.notice
        if totals is not None:
            budget = Budget(view)
            loop.after_insertion = budget.inserted

            def before_leaving(slots: np.ndarray) -> None:
                engine.settle_losses()
                budget.left(slots)

            engine.leavers.before_leaving = before_leaving
        if past is not None:
            take_over(past, state, engine.lists, streams)
        loop.insert()
        if over := time_step.over_limit(model.dt, model.limits):
            guards.notice(Verdict("time step", over))
        notes = [*model.notes, *(past.notes if past is not None else ()), *streams.notes]
        return cls(model, state, clock, engine, streams, loop, view, guards, workers, timers, notes)
