"""What ``warpdem check`` says before a run: plan, time step against its limits, memory, time and size of results, warnings."""

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from warpdem.app import scene_warnings, step_limits, summary
from warpdem.app.clump_rows import clump_lines, clump_rows
from warpdem.app.liquid_lines import bridge_lines
from warpdem.app.outputs import Outputs, output_schedule
from warpdem.app.run import COMPILING, SECONDS_PER_CHUNK
from warpdem.core.progress import duration_text, report_if_long
from warpdem.filling.stream_grains import mean_count
from warpdem.model import needs
from warpdem.model.adhesion import RANGE, adhesions
from warpdem.model.features import LEFT_OUT
from warpdem.model.liquid_numbers import bridges
from warpdem.model.restitution_error import restitution_error
from warpdem.output.formats import FORMATS
from warpdem.scene.motion_chain import largest_rates
from warpdem.simulation import Simulation

PROBE_SECONDS = 2.0  # wall time of the short run that the run time is estimated from
SETTLED = 2.5  # contacts per grain of a bed at rest under friction, walls included
GRAIN_SECONDS = 20e-9  # that a grain without contacts costs per step on one core: 11 to 14 ns with 12 000 to 55 000 of them
FRAME_SECONDS = 3e-6  # that a grain takes in a frame of a format: 55 000 that fly
CONTACT_SECONDS = 50e-9  # that one more contact costs per step on one core: 43 to 55 ns in scenes/box_bed.toml as it settles


def describe(sim: Simulation, probe: bool = True, later: Sequence[str] = (), console: Console | None = None) -> dict[str, Any]:
    """Report on a new simulation: numbers, lists and texts that JSON can hold; times in seconds, sizes in bytes.

    Args:
        sim: simulation that has made no step; the probe advances it.
        probe: whether to run it for `PROBE_SECONDS`, and to write a frame, for the estimates.
        later: names of the phases that follow it, about which nothing is known before it has run.
        console: where a message appears when kernels take long to compile; None for no message.
    """
    scene, found, rates = sim.scene, sim.limits, largest_rates(sim.scene)
    steps = sim.steps_until(scene.time.end)
    coming = needs.grains_to_come(scene)
    most = len(sim.state) + sum(coming)
    error = restitution_error(scene, sim.expected, found.max_speed, sim.dt)
    out = {
        "scene": scene.source,
        "title": scene.title,
        "later_phases": list(later),
        "grains": len(sim.state),
        "streams": [{"key": f"streams[{k}]", "grains": count} for k, count in enumerate(coming)],
        "grains_at_most": most,
        "device": str(sim.device),
        "threads": sim.threads.count,
        "plan": sim.plan.explain(),
        "notes": sim.notes,
        "largest_rates": rates,
        "time_step": sim.dt,
        "time_step_from": found.binding if scene.time.step == "auto" else "time.step",
        "limits": step_limits.limit_rows(sim),
        "max_speed": found.max_speed,
        "steps_per_contact": found.damped_contact / sim.dt if found.max_speed > 0 and len(sim.state) else None,
        "expected_overlap": found.overlap,
        "restitution_error": {**asdict(error), "materials": list(error.materials)} if error is not None else None,
        "clumps": clump_rows(scene),
        "adhesion": [{**asdict(one), "materials": list(one.materials)} for one in adhesions(scene, sim.expected)],
        "bridges": [{**asdict(one), "materials": list(one.materials)} for one in bridges(scene, sim.expected)],
        "steps": steps,
        "bytes_per_grain": sim.plan.bytes_per_grain,
        "memory_bytes": sim.plan.bytes_per_grain * most,
        "warnings": scene_warnings.warnings(sim),
    }
    return {**out, **_probed(sim, steps, console)} if probe and most else out


def _probed(sim: Simulation, steps: int, console: Console | None) -> dict[str, Any]:
    """Estimates from a short run and one frame of its results; the grains that streams bring are added by what one costs."""
    begin = time.perf_counter()
    with report_if_long(COMPILING, console or Console(), quiet=console is None):
        sim.load_kernels()
        sim.step(1)  # which compiles what a GPU runs
    started = sim.seconds["set-up"] + time.perf_counter() - begin  # compiled by now
    begin, empty = time.perf_counter(), len(sim.state) == 0
    while not len(sim.state) and time.perf_counter() - begin < PROBE_SECONDS and sim.step_number < steps:
        sim.step(min(steps - sim.step_number, max(inlet.every for inlet in sim.inlets)))  # steps of nothing cost nothing
    begin, first, chunk = time.perf_counter(), sim.step_number, 16
    while (gone := time.perf_counter() - begin) < PROBE_SECONDS and sim.step_number < steps:
        sim.step(min(chunk, steps - sim.step_number))
        # as long as those of a run: each call costs as much as some steps of a few grains
        chunk *= 2 if time.perf_counter() - begin - gone < SECONDS_PER_CHUNK / 2 else 1
    per_step = (time.perf_counter() - begin) / max(1, sim.step_number - first)
    due = output_schedule(sim, sim.scene.time.end)
    frames, rows = due.frames(steps), due.rows(steps)
    size, frame_seconds, row_seconds = _written(sim)
    contacts, here = len(sim.contacts().i), len(sim.state)
    mean = sum(mean_count(sim.scene, stream, sim.scene.time.end) for stream in sim.scene.streams)
    mean = max(0.0, mean - here) if empty else mean  # those of the probe came by the streams
    settles = any(sim.scene.gravity) and sim.device.is_cpu
    contacts_to_form = max(0.0, SETTLED * (here + mean) - contacts) if settles else 0.0
    of_a_frame = sum(FORMATS[name].grain_bytes for name in sim.scene.output.formats)
    size += int(of_a_frame * mean)
    frame_seconds += FRAME_SECONDS * len(sim.scene.output.formats) * mean
    output = frames * frame_seconds + rows * row_seconds
    estimate = started + (per_step + mean * GRAIN_SECONDS / sim.threads.count) * steps + output
    return {
        "contacts": contacts,
        "probed_grains": here,
        "start_seconds": started,
        "seconds_per_step": per_step,
        "output_seconds": output,
        "estimated_seconds": estimate,
        "settled_seconds": estimate + steps * contacts_to_form * CONTACT_SECONDS / sim.threads.count,
        "frames": frames,
        "rows": rows,
        "output_bytes": frames * size,
    }


def _written(sim: Simulation) -> tuple[int, float, float]:
    """Bytes [B] and time [s] of a frame, and time [s] of a row of the history: of the second, a step after the first."""
    with tempfile.TemporaryDirectory(prefix="warpdem-check-") as folder:
        outputs = Outputs(sim, Path(folder))
        sizes: list[int] = []
        seconds: list[float] = []

        try:
            # the first of each also writes what does not change
            for number, what in enumerate(({"frame": True}, {"row": True}) * 2):
                if number == 2:
                    sim.step(1)  # equal arrays would be written once by some formats
                begin = time.perf_counter()
                outputs.write(**what)
                outputs.settle()
                seconds.append(time.perf_counter() - begin)
                sizes.append(sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file()))
        finally:
            outputs.close()
    return sizes[2] - sizes[1], seconds[2], seconds[3]


def _adhesion_lines(rows: Sequence[dict[str, Any]]) -> Iterator[str]:
    """The adhesion of what may touch, and how it changes with the modulus."""
    for row in rows:
        other = f"a wall of {row['materials'][1]}" if row["wall"] else row["materials"][1]
        weight = "" if row["bond_number"] is None else f", {row['bond_number']:.3g} of its weight (granular Bond number)"
        speed, tabor = row["sticking_speed"], row["tabor_number"]
        sticks = f"undamped impacts stick below {speed:.3g} m/s" if speed else "a touch costs nothing"
        if speed is None:
            sticks = f"after a load of {row['pressed_by']:.3g} N, its weight; more after more"
        yield (
            f"adhesion of {row['materials'][0]} (radius {row['radius']:.3g} m) and {other}: pull-off force "
            f"{row['pull_off_force']:.3g} N{weight}; {sticks}"
            f"{'' if tabor is None else f'; Tabor number {tabor:.3g} (at {RANGE * 1e9:g} nm)'}"
        )
    if any(row["sticking_speed"] for row in rows):
        yield (
            "  grains that are made softer keep the pull-off force and stick at higher speeds, as 1/cbrt(young_modulus): at a "
            "tenth of it 2.15 times; surface_energy x 0.398 with it (power 2/5) keeps the speed instead"
        )


def print_description(data: dict[str, Any], console: Console) -> None:
    """``describe`` for people."""
    console.print(f"{data['scene']}: {data['grains']} grains on {data['device']}, {data['threads']} threads", style="bold",
                  markup=False)  # fmt: skip
    if data["streams"]:
        each = ", ".join(f"{stream['key']} {stream['grains']}" for stream in data["streams"])
        console.print(
            f"streams bring at most {data['grains_at_most'] - data['grains']} grains by the end, "
            f"if there is space for all ({each}): "
            f"memory, run time and results are those with {data['grains_at_most']} grains",
            markup=False,
        )
    without = [line.removeprefix(LEFT_OUT) for line in data["plan"] if line.startswith(LEFT_OUT)]
    for line in data["plan"]:
        if not line.startswith(LEFT_OUT):
            console.print(f"  {line}", markup=False)
    if data["largest_rates"]:
        console.print(f"  {summary.rates_line(data['largest_rates'])}", markup=False)
    for note in data["notes"]:
        console.print(f"  note: {note}", markup=False)
    console.print(f"time step {data['time_step']:.4g} s, from {data['time_step_from']}; {data['steps']} steps")
    table = Table("  limit", r"\[s]", "step / limit", "auto keeps below", box=None, pad_edge=False)
    for row in data["limits"]:
        seconds, share, allowed = (row[key] for key in ("seconds", "share", "auto_share"))
        values = [f"{seconds:.4g}", f"{share:.3g}"] if seconds is not None else ["none", "-"]
        name = f"  {row['name']}{' *' if row['refused'] else ''}"
        table.add_row(name, *values, f"{allowed:g}" if allowed is not None else "-")
    console.print(table)
    console.print("  * a longer step is refused")
    if data["steps_per_contact"] is not None:
        console.print(f"expected at {data['max_speed']:.3g} m/s: {data['steps_per_contact']:.3g} steps per contact, "
                      f"overlaps up to {data['expected_overlap']:.2%} of the radius")  # fmt: skip
    if data["restitution_error"] is not None:
        error = data["restitution_error"]
        console.print(f"error of the restitution there, {error['asked']:g} of {' and '.join(error['materials'])}: "
                      f"{error['mean']:+.2g} in the mean, {error['worst']:+.2g} at worst in a single impact")  # fmt: skip
    for line in (*clump_lines(data["clumps"]), *_adhesion_lines(data["adhesion"]), *bridge_lines(data["bridges"])):
        console.print(line, markup=False)
    console.print(f"memory about {data['memory_bytes'] / 1e6:.1f} MB ({data['bytes_per_grain']} B per grain)")
    if "estimated_seconds" in data:
        console.print(
            f"run time about {duration_text(data['estimated_seconds'])} if it goes on as it starts, with "
            f"{data['contacts'] / max(1, data['probed_grains']):.2g} contacts per grain, "
            f"{duration_text(data['settled_seconds'])} as a settled bed: {data['start_seconds']:.1f} s to start, "
            f"{data['seconds_per_step'] * 1e3:.3g} ms per step, "
            f"{data['output_seconds']:.1f} s for output"
        )
        console.print(f"results about {data['output_bytes'] / 1e6:.3g} MB: {data['frames']} frames, "
                      f"{data['rows']} rows of history")  # fmt: skip
    if data["later_phases"]:
        later = ", ".join(data["later_phases"])
        console.print(f"all this is of the first phase; those after it begin with what it leaves: {later}", markup=False)
    if without:
        console.print(f"left out: {'; '.join(without)}", markup=False)
    for warning in data["warnings"]:
        console.print(summary.warning_text(warning))
