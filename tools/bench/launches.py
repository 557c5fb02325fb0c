"""Where the time of a step goes on a device: each launch of the captured graph by itself, against the bandwidth of a copy.

Within a graph no launch can be timed, so those of a step are repeated alone at one instant; all that is launched outside (the
graph as a whole, the making of near lists, copies) Warp times in the run itself.
"""

import time

import numpy as np
import warp as wp
from warpdem.kernels.contact.pairs import pair_force_width
from warpdem.kernels.step.clock import RUN, STEPS_LEFT, TOTALS

import warpdem
from warpdem.engine.graph import Captured

COPY = 1 << 28  # numbers of the array that is copied on a GPU: far beyond its caches


def seconds_of(launch, repeats: int, device) -> float:
    """Least time of one launch [s]; on a GPU of many in a row, so that the host's part does not count."""
    launch()
    wp.synchronize_device(device)
    many, best = (20 if device.is_cuda else 1), np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        for _ in range(many):
            launch()
        wp.synchronize_device(device)
        best = min(best, (time.perf_counter() - begin) / many)
    return best


def copy_bandwidth(device, repeats: int = 5) -> float:
    """Bytes read and written per second by a plain copy [B/s]."""
    size = COPY if device.is_cuda else COPY >> 5
    a, b = (wp.zeros(size, dtype=wp.float64, device=device) for _ in range(2))
    return 16.0 * size / seconds_of(lambda: wp.copy(b, a), repeats, device)


def least_bytes(sim: warpdem.Simulation) -> dict[str, float]:
    """Bytes that each launch must move at least: every number once, as if what neighbours share stayed in the cache."""
    plan, n, contacts = sim.plan, len(sim.state), sim.lists.contact_count
    number = 4 if plan.backend.precision == "mixed" else 8
    record = 8 * (16 if plan.contact.spins else 10)
    shares = 2 * pair_force_width(plan.contact.spins) * number * contacts
    per_contact = 16 + number * 2 * plan.memory + 4 * plan.contact.table
    return {
        "pair_forces": n * (record + 16) + contacts * per_contact + shares,
        "move": shares + n * (2 * record + 16 + 24 * (1 + plan.walls.moving) + 4),
    }


def activities(sim: warpdem.Simulation, steps: int) -> dict[str, dict[str, float]]:
    """Time [ms] and number of all that ``steps`` steps do on a GPU, by name; empty on a CPU, which Warp does not time."""
    if not sim.device.is_cuda:
        return {}
    wp.timing_begin(cuda_filter=wp.TIMING_ALL)
    sim.step(steps)
    found: dict[str, dict[str, float]] = {}
    for result in wp.timing_end():
        entry = found.setdefault(result.name, {"ms": 0.0, "count": 0})
        entry["ms"] += result.elapsed
        entry["count"] += 1
    return dict(sorted(found.items(), key=lambda item: -item[1]["ms"]))


def measured(sim: warpdem.Simulation, steps: int, repeats: int = 5) -> dict:
    """Time of each launch [us], its share of their sum, the bytes per second it moves over those of a copy, and ``activities``.

    The launches repeat one instant and spoil the run: measure at its end.
    """
    run = activities(sim, steps)
    sim.prepare()
    engine, executor, device = sim.engine, sim.engine.executor, sim.device
    step = Captured(sim.model, sim.state, engine.lists, engine.structs, engine.batch, executor.storage).step
    engine.batch.set_time()
    clock = engine.batch.clock.numpy().copy()
    clock[[STEPS_LEFT, RUN]] = max(engine.steps_ahead, 1), 1
    clock[TOTALS] = sim.lists.totals
    engine.batch.clock.assign(clock)
    calls = {"pair_forces": step.pair_forces, "wall_forces": step.wall_forces, "move": step.move}
    if not sim.plan.walls.present:
        del calls["wall_forces"]
    seconds = {name: seconds_of(lambda call=call: call(0), repeats, device) for name, call in calls.items()}
    copy, total = copy_bandwidth(device), sum(seconds.values())
    moved = least_bytes(sim)
    return {
        "launch_us": {name: 1e6 * s for name, s in seconds.items()},
        "launch_share": {name: s / total for name, s in seconds.items()},
        "copy_bytes_per_s": copy,
        "of_copy": {name: b / seconds[name] / copy for name, b in moved.items()},
        "least_bytes_per_grain": {name: b / len(sim.state) for name, b in moved.items()},
        "run": run,
        "captures": executor.captures,
        "refreshes_on_device": executor.inner_builds,
    }
