"""What a run tells at its end, and what ``check`` tells before it."""

import hashlib
import json
import time

from rich.console import Console
from rich.table import Table

from warpdem.dimensionless import Turning
from warpdem.plan import coefficient_table
from warpdem.timestep import contact_time, damped_contact_factor

PROBE_SECONDS = 2.0  # wall time of the short run that ``check`` estimates the whole from


def scene_hash(scene) -> str:
    """SHA-256 of the validated scene in SI units: two files that say the same have the same hash."""
    return hashlib.sha256(json.dumps(scene.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()


def steps_per_contact(sim) -> float:
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
            base = table[kind * len(names) + other, 0]
            if speed > 0 and base == base:
                pair = sim.scene.pair(names[kind], names[other])
                duration = contact_time(sim.scene, base, share * lightest, share * smallest, speed)
                found.append(duration * damped_contact_factor(pair.restitution) / sim.dt)
    return min(found)


def turning_line(turning: Turning) -> str:
    """Rossby and Froude number with what they are made of; see ``warpdem.dimensionless``."""
    numbers = [("Rossby", turning.rossby), ("Froude", turning.froude)]
    told = ", ".join(f"{name} number {value:.3g}" for name, value in numbers if value is not None)
    return (f"{told or 'neither Rossby nor Froude number'}: {turning.axes} at {turning.angular_velocity:.3g} rad/s, "
            f"grains at {turning.speed:.3g} m/s in it, up to {turning.radius:.3g} m from the axis")  # fmt: skip


def print_summary(sim, console: Console, wall_seconds: float, folder, turning: Turning | None) -> None:
    """Time per stage, speed, lists, extremes, what was left out, and the numbers of the turning if something turned."""
    table = Table(title="summary", show_header=False, title_justify="left")
    n, steps = len(sim.state), sim.steps_done
    stepping = sum(sim.seconds.get(k, 0.0) for k in ("steps", "lists", "refresh", "schedule"))
    table.add_row("simulated", f"{sim.time:.6g} s in {sim.step_number} steps of {sim.dt:.4g} s, {n} grains")
    if n and steps:
        table.add_row("speed", f"{stepping / steps / n * 1e9:.1f} ns per grain and step on {sim.threads.count} threads")
    stages = ", ".join(f"{k} {v:.2f} s" for k, v in sorted(sim.seconds.items(), key=lambda i: -i[1]) if v >= 0.005)
    table.add_row("wall time", f"{wall_seconds:.1f} s: {stages}")
    table.add_row("lists", f"{sim.lists.rebuilds} rebuilds, {sim.lists.refreshes} refreshes, skin {sim.lists.skin:.3g} m")
    met = sim.extremes
    table.add_row("largest overlap", f"{met['pair_overlap_share']:.3%} of the radius between grains, "
                                     f"{met['wall_overlap_share']:.3%} at walls")  # fmt: skip
    table.add_row("largest approach speed", f"{met['pair_approach_speed']:.3g} m/s between grains, "
                                            f"{met['wall_approach_speed']:.3g} m/s at walls")  # fmt: skip
    table.add_row("steps per contact", f"{steps_per_contact(sim):.1f} at these speeds (damped contact, lightest grain)")
    if turning is not None:
        table.add_row("turning", turning_line(turning))
    for packing in sim.expected.packings:
        table.add_row("packing", f"{packing.grains} grains without overlap in {packing.seconds:.1f} s: {packing.steps} steps, "
                                 f"{packing.rebuilds} neighbour searches, shaken {packing.shakes} times")  # fmt: skip
    for feeder in sim.feeders:
        waits = "; the next waits for room" if feeder.blocked else ""
        table.add_row("came in", f"{feeder.count} grains, {feeder.mass:.4g} kg, of {feeder.stream.material}{waits}")
    for name, (count, mass) in sim.left.items():
        table.add_row("left", f"{count} grains, {mass:.4g} kg, through {name}")
    for guard, message in sim.noticed.items():
        table.add_row("[bold red]noticed[/]", f"{guard}: {message}")
    for name, why in sim.plan.left_out.items():
        table.add_row("left out", f"{name}: {why}")
    table.add_row("state hash", sim.state_hash())
    table.add_row("results", str(folder))
    console.print(table)


def describe(sim, probe: bool = True) -> dict:
    """What ``check`` says: plan, time step with its limits, memory, and a run time estimated from a short probe."""
    steps = sim.steps_until(sim.scene.time.end)
    out = {
        "scene": sim.scene.source,
        "grains": len(sim.state),
        "device": str(sim.device),
        "threads": sim.threads.count,
        "plan": sim.plan.explain(),
        "notes": sim.notes,
        "time_step": sim.dt,
        "time_step_from": "time.step" if sim.scene.time.step != "auto" else sim.limits.binding,
        "limits": {**sim.limits.candidates, "stability limit of one impact": sim.limits.stable},
        "max_speed": sim.limits.max_speed,
        "steps": steps,
        "memory_bytes": sim.plan.bytes_per_grain * len(sim.state),
        "bytes_per_grain": sim.plan.bytes_per_grain,
    }
    if probe and len(sim.state):
        sim.step(1)  # compiles
        begin, first = time.perf_counter(), sim.step_number
        while time.perf_counter() - begin < PROBE_SECONDS and sim.step_number - first < steps:
            sim.step(16)
        per_step = (time.perf_counter() - begin) / (sim.step_number - first)
        out["seconds_per_step"] = per_step
        out["estimated_seconds"] = per_step * steps
    return out


def print_description(data: dict, console: Console) -> None:
    """``describe`` for people."""
    console.print(f"[bold]{data['scene']}[/]: {data['grains']} grains on {data['device']}, {data['threads']} threads")
    for line in data["plan"]:
        console.print("  " + line)
    for note in data["notes"]:
        console.print(f"  note: {note}", markup=False)
    console.print(f"time step {data['time_step']:.4g} s, from {data['time_step_from']}; {data['steps']} steps")
    for name, value in data["limits"].items():
        mark = " <- binds" if name == data["time_step_from"] else ""
        console.print(f"  {value:.4g} s  {name}{mark}")
    console.print(f"memory {data['memory_bytes'] / 1e6:.1f} MB ({data['bytes_per_grain']} B per grain)")
    if "estimated_seconds" in data:
        console.print(f"run time about {data['estimated_seconds']:.0f} s ({data['seconds_per_step'] * 1e3:.3g} ms per step, "
                      f"measured from the start; output not counted)")  # fmt: skip
