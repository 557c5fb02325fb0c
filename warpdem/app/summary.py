"""What a run reports before it begins and at its end."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Column, Table
from rich.text import Text

from warpdem.core.timers import speed_text, stepping
from warpdem.measure.dimensionless import Turning
from warpdem.model.coefficients import coefficient_table
from warpdem.model.impact import damped_time
from warpdem.model.time_step import contact_time
from warpdem.ranks.front import Front
from warpdem.runs.history import TIME
from warpdem.scene.servo import Servo
from warpdem.simulation import Simulation

CARRIED = 0.5
"""Part of the load of a servo [-] below which it is not carried: vibrating grains carry more than that at times."""
STAGES = {"set-up": "set-up with packing and its kernels", "compile": "kernels of the steps"}
"""Names of `Simulation.seconds` that do not say by themselves what they hold."""


def steps_per_contact(sim: Simulation) -> float:
    """Time steps in the damped contact of the lightest grains at the largest approach speed met [-]; inf without contact."""
    met, table = sim.extremes, coefficient_table(sim.scene)
    names = list(sim.scene.materials)
    found = [float("inf")]
    kinds, radius, mass = sim.particles.type, sim.particles.radius, sim.particles.mass
    for kind in sorted(set(kinds.tolist())):
        lightest = mass[kinds == kind].min()
        smallest = radius[kinds == kind].min()
        cases = [(kind, 0.5, met["pair_approach_speed"])]
        cases += [(names.index(w.material), 1.0, met["wall_approach_speed"]) for w in sim.scene.walls]
        for other, share, speed in cases:
            row = table[kind * len(names) + other]
            if speed > 0 and np.isfinite(row).all():
                pair = sim.scene.pair(names[kind], names[other])
                duration = contact_time(sim.scene, row, share * lightest, share * smallest, speed)
                found.append(duration * damped_time(sim.plan.contact.normal, pair.restitution) / sim.dt)
    return min(found)


def rates_line(rates: dict[str, float]) -> str:
    """``largest_rates`` of a scene in both units, so that a number meant in the other one is seen before the run."""
    keys: dict[float, list[str]] = {}
    for key, rate in rates.items():
        keys.setdefault(rate, []).append(key)
    lines = []
    for rate, same in keys.items():
        others = f" and {len(same) - 2} others" if len(same) > 3 else ""
        named = ", ".join(same[:2] if others else same) + others
        lines.append(f"{named} at up to {rate:.4g} rad/s = {rate * 30.0 / math.pi:.4g} rpm")
    return f"turns: {'; '.join(lines)}"


def ranks_text(ranks: list[dict[str, Any]]) -> str:
    """What the ranks of a run did, from ``Front.report``: share of work, ghosts, bytes and time of the exchanges."""
    grains, ghosts = (sum(rank[name] for rank in ranks) for name in ("grains", "ghosts"))
    if not grains or not ranks[0]["exchanges"]:
        return f"{len(ranks)}"
    timed = [rank for rank in ranks if rank["waiting"] is not None]
    waiting = [rank["waiting"] / max(rank["seconds"].get("steps", 0.0), 1e-9) for rank in timed]
    time = f"{min(waiting):.0%} to {max(waiting):.0%} of the steps' time in exchanges; " if timed else ""
    sent = max(rank["bytes"] / rank["exchanges"] for rank in ranks)
    most = max(rank["grains"] for rank in ranks) * len(ranks) / grains
    devices = ", ".join(sorted({rank["device"] for rank in ranks}))
    return (
        f"{len(ranks)} on {devices}, the largest with {most:.2f} of the mean of grains; {ghosts / grains:.1%} ghosts; up to "
        f"{sent / 1e3:.3g} kB sent per step by {ranks[0]['way']}; {time}"
        f"{sum(rank['migrated'] for rank in ranks)} grains went to another rank"
    )


def turning_line(turning: Turning) -> str:
    """Rossby and Froude number with what they are made of; see ``warpdem.measure.dimensionless``."""
    numbers = [("Rossby", turning.rossby), ("Froude", turning.froude)]
    numbers_text = ", ".join(f"{name} number {value:.3g}" for name, value in numbers if value is not None)
    return (f"{numbers_text or 'neither Rossby nor Froude number'}: {turning.axes} at {turning.angular_velocity:.3g} rad/s, "
            f"grains at {turning.speed:.3g} m/s in it, up to {turning.radius:.3g} m from the axis")  # fmt: skip


def warning_text(message: str) -> Text:
    """A warning as check and a run print it."""
    return Text.assemble(("warning", "bold red"), f" {message}")


def shortfalls(sim: Simulation) -> list[str]:
    """Messages on streams that inserted less so far than their rate demands, and on servos that never carried their load."""
    found = [inlet.shortfall(sim.step_number) for inlet in sim.inlets]
    return [*(message for message in found if message is not None), *_idle_servos(sim)]


def _idle_servos(sim: Simulation) -> Iterator[str]:
    """Servos whose load came to no `CARRIED` of that asked for in any row of the history."""
    history = sim.history
    for one in sim.schedule.dynamic:
        if not isinstance(one.given, Servo) or not history.rows:
            continue
        unit, per = ("N m", 1.0) if one.given.rotates else ("N", 1.0)
        load = history[f"{one.wall.name} load [{unit}]"]
        if one.given.pressure is not None:
            unit, per = "Pa", one.area
        asked = one.drive(history[TIME])
        acting = np.isfinite(asked) & (asked != 0.0)
        if acting.any() and (load[acting] / asked[acting]).max() < CARRIED:
            mean, target = (float(values[acting].mean()) / per for values in (load, asked))
            yield (
                f"{one.wall.name} never carried its load: mean {mean:.3g} of {target:.3g} {unit} asked: did it come to the "
                "grains? Look at the sign of the load, the axis, max_speed and time.end"
            )


def print_summary(sim: Simulation, console: Console, wall_seconds: float, folder: Path, turning: Turning | None) -> None:
    """Time per stage, speed, lists, extremes, and the numbers of the turning if something turned."""
    table = Table("", Column(overflow="fold"), title="summary", show_header=False, title_justify="left")
    n, steps = len(sim.state), sim.loop.steps_done
    of_steps = stepping(sim.seconds)
    table.add_row("simulated", f"{sim.time:.6g} s in {sim.step_number} steps of {sim.dt:.4g} s, {n} grains")
    if n and steps:
        table.add_row("speed", f"{speed_text(of_steps / steps, n)} on {sim.threads.count} threads")
    longest = sorted(sim.seconds.items(), key=lambda i: -i[1])
    stages = "; ".join(f"{STAGES.get(k, k)} {v:.2f} s" for k, v in longest if v >= 0.005)
    table.add_row("wall time", f"{wall_seconds:.1f} s: {stages}")
    table.add_row("lists", f"{sim.lists.rebuilds} builds of the outer neighbor list, {sim.lists.inner_rebuilds} of the "
                           f"inner, skin {sim.lists.skin:.3g} m")  # fmt: skip
    met = sim.extremes
    if isinstance(sim.loop, Front):
        table.add_row("ranks", ranks_text(sim.loop.report()))
    table.add_row("largest overlap", f"{met['pair_overlap_share']:.3%} of the radius between grains, "
                                     f"{met['wall_overlap_share']:.3%} at walls")  # fmt: skip
    table.add_row("largest approach speed", f"{met['pair_approach_speed']:.3g} m/s between grains, "
                                            f"{met['wall_approach_speed']:.3g} m/s at walls")  # fmt: skip
    table.add_row("steps per contact", f"{steps_per_contact(sim):.1f} at these speeds (damped contact, lightest grain)")
    if over := sim.guards.stability.excess:
        table.add_row("time step", over)
    if turning is not None:
        table.add_row("turning", turning_line(turning))
    for packing in sim.expected.packings:
        table.add_row("packing", f"{packing.grains} grains without overlap in {packing.seconds:.1f} s: {packing.steps} steps, "
                                 f"{packing.rebuilds} neighbour searches, shaken {packing.shakes} times")  # fmt: skip
    for inlet in sim.inlets:
        waits = "; the next one waits for space" if inlet.blocked else ""
        materials = ", ".join(dict.fromkeys(portion.material for portion in inlet.stream.portions))
        table.add_row("inserted", f"{inlet.count} grains, {inlet.mass:.4g} kg, of {escape(materials)}{waits}")
    for message in shortfalls(sim):
        table.add_row("[bold red]warning[/]", escape(message))
    for name, (count, mass) in sim.left.items():
        table.add_row("left", f"{count} grains, {mass:.4g} kg, through {name}")
    for guard, message in sim.noticed.items():
        table.add_row("[bold red]noticed[/]", escape(f"{guard}: {message}"))
    console.print(table)
    for name, what in (("state hash", sim.state_hash()), ("results", folder)):  # whole, to be copied
        console.print(f"{name:10} {what}", markup=False, soft_wrap=True)
