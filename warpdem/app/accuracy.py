"""What ``--accuracy`` does: short runs that say which step and precision a measure needs, and a run that is held to it."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from warpdem.app.twins import make_twins
from warpdem.core.atomic_file import replaced
from warpdem.core.cpu_cores import available_cores
from warpdem.core.timers import stepping
from warpdem.drawing.figure_file import DPI, require_drawable
from warpdem.drawing.work_point import WorkPoint
from warpdem.errors import SceneError
from warpdem.runs import read
from warpdem.runs.step_error import CHANCE, StepError, chosen_step, runs_needed, step_error
from warpdem.scene.file import load_scene
from warpdem.simulation import Simulation
from warpdem.sweep.quantities import Quantity
from warpdem.sweep.row import folder_of
from warpdem.sweep.sweep import Outcome, RowsFailed, Sweep, failed, run_sweep
from warpdem.sweep.table import Row

FILE = "accuracy.json"
STEPS = range(3, 9)
"""Numbers of steps that may be compared: that of the scene, half of it, a quarter of it, and so on."""
TWINS = 3
"""Perturbed twins of the first run."""


@dataclass(frozen=True)
class Wish:
    """What is asked for."""

    share: float
    """Largest error of the measure, as a share of it [-]."""
    measure: str
    """The measure, as a result of a sweep."""

    @classmethod
    def of(cls, accuracy: str, measure: str | None) -> Wish:
        """From what the command was given.

        Raises:
            SceneError: the accuracy is none, or the measure is missing or none.
        """
        text = accuracy.strip()
        try:
            share = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
        except ValueError:
            share = math.nan
        if not 0.0 < share < 1.0:
            raise SceneError(f"--accuracy {accuracy}: must be a share above 0 and below 1, such as 1% or 0.01")
        if measure is None:
            raise SceneError(
                '--accuracy: name what must be so accurate: --measure "COLUMN:HOW@START:END", as --results of a sweep, such as '
                '"kinetic:mean@1:"; "warpdem plot DIR --list" prints the columns of a run, "warpdem demo NAME --about" the '
                "measure of a scene of the gallery"
            )
        Quantity(measure)
        return cls(share, measure)


@dataclass(frozen=True)
class Choice:
    """Step and precision for a measure, and what they were chosen by."""

    wish: Wish
    found: StepError
    mixed: float | None
    """The measure in mixed precision with the first step; None where it was not run."""
    step: float
    """Step that is chosen [s]."""
    precision: str
    """Precision that is chosen."""
    seconds: tuple[float, ...]
    """Wall time of the steps of each run [s], that in mixed precision last."""
    notes: tuple[str, ...]

    @property
    def allowed(self) -> float:
        """Largest error [unit of the measure]."""
        return self.wish.share * abs(self.found.limit)

    @property
    def reached(self) -> bool:
        """Whether one run with the chosen step is as accurate as asked."""
        return not self.chaotic and self.found.error(self.step) <= self.allowed * (1.0 + 1e-9)

    @property
    def chaotic(self) -> bool:
        """Whether single runs scatter by more than the accuracy asked."""
        return self.found.scatter is not None and 1.96 * self.found.scatter > self.allowed

    @property
    def points(self) -> list[WorkPoint]:
        """The runs as a work-precision diagram shows them."""
        found, over = self.found, abs(self.found.limit) or 1.0
        runs = [(step, "double", value) for step, value in zip(found.steps, found.values, strict=True)]
        runs += [(found.steps[0], "mixed", self.mixed)] if self.mixed is not None else []
        return [WorkPoint(step, precision, value, abs(value - found.limit) / over, wall)
                for (step, precision, value), wall in zip(runs, self.seconds, strict=True)]  # fmt: skip

    @property
    def settings(self) -> list[str]:
        """Changes of the scene."""
        return [f"time.step={self.step:.12g}", f"engine.precision={self.precision}"]

    def as_data(self) -> dict[str, Any]:
        """What JSON can hold."""
        return {**asdict(self), "allowed": self.allowed, "reached": self.reached, "chaotic": self.chaotic,
                "error": self.found.error(self.step), "settings": self.settings}  # fmt: skip


@dataclass(frozen=True)
class Source:
    """A scene file and how it is read and run."""

    scene: Path
    changes: Sequence[str] = ()
    plugins: Sequence[Path] = ()
    allow_paths: Sequence[Path] = ()
    device: str | None = None
    threads: int | None = None
    until: float | None = None

    def load(self, *changes: str) -> Any:
        """The scene with further changes."""
        end = [f"time.end={self.until!r}"] if self.until is not None else []
        return load_scene(self.scene, [*self.changes, *end, *changes], allow_paths=self.allow_paths, plugins=self.plugins)

    def row(self, *changes: str) -> Row:
        """The same as a row of a sweep."""
        end = [f"time.end={self.until!r}"] if self.until is not None else []
        return {key.strip(): value.strip() for key, _, value in (c.partition("=") for c in [*self.changes, *end, *changes])}

    def run(self, rows: Sequence[Row], folder: Path, measure: str, workers: int) -> list[Outcome]:
        """Run rows to their end.

        Raises:
            RowsFailed: one has failed.
        """
        sweep = Sweep(self.scene, folder, list(rows), [Quantity(measure)], self.plugins, self.allow_paths)
        threads = self.threads or max(1, available_cores() // workers)
        outcomes = run_sweep(sweep, workers=workers, threads=threads, device=self.device)
        if lost := failed(outcomes):
            raise RowsFailed(f"{folder}: run {lost[0].number} is not done ({lost[0].status}): {lost[0].why}")
        for one in outcomes:
            if not math.isfinite(one.results[measure]):
                raise SceneError(f"--measure {measure!r}: run {one.number} has none: a window that the runs do not reach?")
        return outcomes


def choose(
    source: Source, wish: Wish, folder: Path, console: Console, twins: int = TWINS, count: int = STEPS[0]
) -> Choice:
    """Find step and precision for a measure by runs in a folder; what is there is not run again.

    Args:
        source: the scene.
        wish: what is asked for.
        folder: of the runs.
        console: where to print.
        twins: perturbed twins of the first run.
        count: steps that are compared, see `STEPS`.

    Raises:
        SceneError: the scene, the measure or the number of steps is wrong.
        RowsFailed: a run has failed.
    """
    if count not in STEPS:
        raise SceneError(f"--accuracy-steps {count}: must be from {STEPS[0]} to {STEPS[-1]}")
    scene = source.load()
    if scene.phases:
        raise SceneError(f"{source.scene}: --accuracy: a scene with phases has a step in each; ask for one of them")
    first = float(Simulation(scene, device="cpu", threads=1).dt)
    steps = tuple(first * 0.5**k for k in range(count))
    rows = [source.row(f"time.step={step!r}", "engine.precision=double") for step in steps]
    mixed_there = _can_be_mixed(source, first)
    if mixed_there:  # the second row, so that more steps are more rows at the end
        rows.insert(1, source.row(f"time.step={first!r}", "engine.precision=mixed"))
    workers = min(available_cores(), len(rows))
    named = ", ".join(f"{step:.3g}" for step in steps)
    console.print(f"{wish.measure}: runs with steps of {named} s -> {folder}", markup=False)
    outcomes = source.run(rows, folder, wish.measure, workers)
    if mixed_there:
        outcomes.append(outcomes.pop(1))
    values = tuple(one.results[wish.measure] for one in outcomes)
    scatter, notes = _scatter(source, wish, folder, twins, console)
    found = step_error(steps, values[:count], scatter)
    allowed = wish.share * abs(found.limit)
    step = chosen_step(found, allowed)
    seconds = tuple(stepping(read(folder_of(folder, one.number)).last["seconds"]) for one in outcomes)
    mixed = values[-1] if mixed_there else None
    precision = "double"
    if mixed is not None and seconds[-1] < seconds[0]:
        off = abs(mixed - values[0])
        if (found.chance and off <= found.error(step)) or (not found.chance and off + found.error(step) <= allowed):
            precision = "mixed"
    choice = Choice(wish, found, mixed, step, precision, seconds, tuple(notes))
    _write(folder / FILE, choice.as_data())
    return choice


def _can_be_mixed(source: Source, step: float) -> bool:
    try:
        Simulation(source.load(f"time.step={step!r}", "engine.precision=mixed"), device="cpu", threads=1)
    except SceneError:
        return False
    return True


def _scatter(source: Source, wish: Wish, folder: Path, twins: int, console: Console) -> tuple[float | None, list[str]]:
    """Standard deviation of the measure among the first run and its twins, and why there is none."""
    if not twins:
        return None, ["no twins were run: differences between steps may be chance"]
    run = read(folder_of(folder, 1))
    try:
        made = make_twins(run, twins, console, source.device, source.threads, source.plugins)
    except SceneError as error:
        return None, [f"the scatter of equal runs is not known: {error}"]
    values = [Quantity(wish.measure).of(one) for one in (run, *map(read, made))]
    return float(np.std(values, ddof=1)), []


def verify(source: Source, choice: Choice, folder: Path, console: Console) -> bool:
    """Hold a run that is done to what was asked: another one with half its step, or twice where that is allowed, beside it.

    Args:
        source: the scene as it was run.
        choice: what its step was chosen by.
        folder: of the run; the other one goes to ``verify`` in it.
        console: where to print.

    Returns:
        Whether the run is as accurate as asked; accuracy.json in the folder says by how much.

    Raises:
        SceneError: the run has no such measure.
        RowsFailed: the other run has failed.
    """
    measure = choice.wish.measure
    here = Quantity(measure).of(read(folder))
    if not math.isfinite(here):
        raise SceneError(f"--measure {measure!r}: the run has none: a window that it does not reach?")
    twice = 2.0 * choice.step <= choice.found.steps[0] * (1.0 + 1e-9)
    other = choice.step * (2.0 if twice else 0.5)
    row = source.row(f"time.step={other!r}", f"engine.precision={choice.precision}")
    [one] = source.run([row], folder / "verify", measure, 1)
    there, p = one.results[measure], 2.0**choice.found.order
    factor = 1.0 / (p - 1.0) if twice else p / (p - 1.0)
    by_step = abs(here - there) * factor
    limit = here - (there - here) / (p - 1.0) if twice else there - (here - there) / (p - 1.0)
    found = replace(choice.found, limit=limit if not choice.found.chance else 0.5 * (here + there))
    made = replace(choice, found=found)
    scatter = choice.found.scatter
    chance = scatter is not None and abs(here - there) <= 2.0 * math.sqrt(2.0) * scatter
    error = by_step if not chance else 1.96 * (scatter or 0.0)
    holds = error <= made.allowed
    words = "by chance, as perturbed twins scatter" if chance else "by the step"
    data = {**made.as_data(), "value": here, "other_step": other, "other_value": there, "measured_error": error, "holds": holds}
    _write(folder / FILE, data)
    share = f"{100.0 * error / abs(made.found.limit):.2g} %" if made.found.limit else f"{error:.2g}"
    console.print(f"{measure} = {here:.6g}; with a step of {other:.3g} s {there:.6g}; off by up to {share} {words}: "
                  f"{'as accurate as asked' if holds else 'NOT as accurate as asked'} ({100.0 * made.wish.share:g} %)",
                  markup=False)  # fmt: skip
    return holds


def print_choice(choice: Choice, console: Console) -> None:
    """What was found, for people."""
    found, limit = choice.found, abs(choice.found.limit)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for head in ("step [s]", "precision", choice.wish.measure, "error of the step", "time of the steps [s]"):
        table.add_column(head, no_wrap=True)
    for step, value, wall in zip(found.steps, found.values, choice.seconds, strict=False):
        bound = "below " if found.chance else ""
        share = f"{bound}{100.0 * found.error(step) / limit:.2g} %" if limit else f"{bound}{found.error(step):.2g}"
        table.add_row(f"{step:.3g}", "double", f"{value:.6g}", share, f"{wall:.3g}")
    if choice.mixed is not None:
        table.add_row(f"{found.steps[0]:.3g}", "mixed", f"{choice.mixed:.6g}", "", f"{choice.seconds[-1]:.3g}")
    console.print(table)
    for line in verdict_lines(choice):
        console.print(line, markup=False)


def verdict_lines(choice: Choice) -> list[str]:
    """The verdict in sentences."""
    found, limit = choice.found, abs(choice.found.limit)
    asked = f"{100.0 * choice.wish.share:g} %"
    lines = list(choice.notes)
    if found.scatter is not None:
        lines.append(f"perturbed twins scatter by {100.0 * found.scatter / limit:.2g} % (standard deviation)" if limit
                     else f"perturbed twins scatter by {found.scatter:.2g}")  # fmt: skip
    if found.chance:
        lines.append("the differences between the steps are chance: no larger than those of twins")
    else:
        why = "" if found.known else ", taken since the differences give none"
        lines.append(f"order of the error {found.order:.2g}{why}; without it the measure is {found.limit:.6g}")
    if choice.chaotic and found.scatter is not None:
        lines.append(
            f"no step makes a single run as accurate as {asked}: the measure is chaotic; the mean of "
            f"{runs_needed(found.scatter, choice.allowed)} runs with other seeds would be (a sweep over grains.0.fill.seed), "
            "or a mean over a longer time"
        )
    elif not choice.reached:
        lines.append(
            f"{asked} is out of reach for a single run: by chance equal runs differ by up to "
            f"{_share(found.error(choice.step), limit)}; measure the mean over a longer time, or ask for that"
        )
    else:
        lines.append(f"for {asked}: --set {' '.join(choice.settings)}")
    return lines


def _share(error: float, limit: float) -> str:
    """An error over the measure in per cent, or in its unit where that is zero."""
    return f"{100.0 * error / limit:.2g} %" if limit else f"{error:.2g}"


@dataclass(frozen=True)
class Trial:
    """The choice for a scene, and how it was come by."""

    source: Source
    choice: Choice

    @classmethod
    def of(
        cls, source: Source, wish: Wish, folder: Path, console: Console, twins: int = TWINS, count: int = STEPS[0],
        diagram: Path | None = None
    ) -> Trial:
        """Choose, print what was found, and draw it to ``diagram`` if that is given; raises as `choose`."""
        if diagram is not None:
            require_drawable(diagram, DPI)
        choice = choose(source, wish, folder, console, twins, count)
        print_choice(choice, console)
        if diagram is not None:
            table = write_diagram(choice, diagram)
            console.print(f"wrote {diagram} and {table}", markup=False)
        return cls(source, choice)

    def verify(self, folder: Path, until: float | None, console: Console) -> None:
        """Hold a run that is done to what was asked, as the function of this name."""
        verify(replace(self.source, until=until), self.choice, folder, console)


def write_diagram(choice: Choice, out: Path) -> Path:
    """Draw the work-precision diagram of a choice; returns the table of its numbers, beside it with the suffix .csv."""
    from warpdem.drawing.work_precision import draw_work_precision

    found, over, table = choice.found, abs(choice.found.limit), out.with_suffix(".csv")
    order = "differences of steps are chance" if found.chance else f"order {found.order:.2g}{'' if found.known else ' taken'}"
    scatter = None if found.scatter is None else CHANCE * math.sqrt(2.0) * found.scatter / (over or 1.0)
    asked = choice.wish.share if over else choice.allowed
    draw_work_precision(
        choice.points, out, measure=choice.wish.measure, relative=over > 0.0, asked=asked, scatter=scatter, order=order
    )
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = "step [s]", "precision", choice.wish.measure, "error", "error of the step by its order", "time of the steps [s]"
    writer.writerow(names)
    for one in choice.points:
        numbers = one.error, found.error(one.step) / (over or 1.0), one.seconds
        writer.writerow([repr(one.step), one.precision, repr(one.value), *(f"{number:.4g}" for number in numbers)])
    with replaced(table) as part:
        part.write_text(text.getvalue(), encoding="utf-8")
    return table


def _write(path: Path, data: dict[str, Any]) -> None:
    with replaced(path) as part:
        part.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
