"""The experiments of a calibration as sweeps: one for each, whose rows are added at its end round by round."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.calibration.file import Calibration, Experiment
from warpdem.errors import SceneError
from warpdem.scene.file import load_scene
from warpdem.scene.model import Scene
from warpdem.sweep.executors import Factory
from warpdem.sweep.row import FINAL
from warpdem.sweep.sweep import Outcome, RowsFailed, Sweep, run_sweep
from warpdem.sweep.table import Row

SEEDS = 1_000_000
"""Distance of the seeds of runs between two seeds of a calibration."""

Watch = Callable[[str, Sequence[Outcome]], None]


@dataclass(frozen=True)
class How:
    """How rows are run: as ``run_sweep``."""

    on: str | Factory = "local"
    workers: int = 1
    threads: int = 1
    device: str | None = None
    precision: str | None = None
    plugins: Sequence[Path] = ()
    allow_paths: Sequence[Path] = ()

    @property
    def of_rows(self) -> dict[str, Any]:
        """Arguments of ``run_sweep``."""
        names = ("on", "workers", "threads", "device", "precision")
        return {name: getattr(self, name) for name in names}


@dataclass
class Experiments:
    """All experiments of a calibration, and what their rows gave so far."""

    calibration: Calibration
    source: Path
    """The calibration file."""
    folder: Path
    """Folder of the calibration, with that of each experiment below."""
    how: How
    watch: Watch = lambda name, outcomes: None
    outcomes: list[list[Outcome]] = field(default_factory=list)
    """Of each experiment, in the order of the points."""

    def scene(self, experiment: Experiment, row: Row | None = None) -> Scene:
        """The scene of an experiment, or of a row of it."""
        changes = self.changes(experiment, row or {})
        path = experiment.path(self.source.parent)
        return load_scene(path, changes, allow_paths=self.how.allow_paths, plugins=self.how.plugins)

    def changes(self, experiment: Experiment, row: Row) -> list[str]:
        """Changes of the scene file that make a row's scene."""
        return [*experiment.set, *(f"{key}={value}" for key, value in row.items())]

    def seeds(self, experiment: Experiment) -> list[str]:
        """Keys of the seeds of an experiment's scene."""
        if experiment.seeds is not None:
            return experiment.seeds
        scene = self.scene(experiment)
        fills = [f"grains.{k}.fill.seed" for k, one in enumerate(scene.grains) if one.fill is not None]
        return [*fills, *(f"streams.{k}.seed" for k in range(len(scene.streams)))]

    def check(self) -> None:
        """Read every scene and measure before anything is run.

        Raises:
            SceneError: names the experiment.
        """
        middle = np.full((1, len(self.calibration.parameters)), 0.5)
        for number, experiment in enumerate(self.calibration.experiments):
            try:
                self._sweep(number, middle).check()
            except SceneError as error:
                raise SceneError(f"{self.source}: experiment {experiment.name!r}: {error}") from error

    def run(self, points: np.ndarray) -> np.ndarray:
        """Run all points so far, those that are done excepted.

        Args:
            points: fractions of the ranges, shape (n, p).

        Returns:
            Measures of all targets, one experiment after the other, shape (n, targets); nan for none.

        Raises:
            RowsFailed: rows have not ended, and another attempt may change that.
        """
        columns, self.outcomes = [], []
        for number, experiment in enumerate(self.calibration.experiments):
            sweep = self._sweep(number, points)
            named = experiment.name
            found = run_sweep(sweep, **self.how.of_rows, skip_wrong=True, watch=partial(self.watch, named))
            if lost := [one for one in found if one.status not in FINAL]:
                raise RowsFailed(
                    f"experiment {named!r}: {len(lost)} of {len(found)} runs are not done; the same command tries again:\n"
                    + "\n".join(f"run {one.number}: {one.status}: {one.why}" for one in lost[:5])
                )
            self.outcomes.append(found)
            columns += [[one.results.get(quantity.text, math.nan) for one in found] for quantity in sweep.quantities]
        return np.array(columns).T

    def _sweep(self, number: int, points: np.ndarray) -> Sweep:
        experiment = self.calibration.experiments[number]
        seeds = self.seeds(experiment)
        rows = []
        for k, point in enumerate(points, 1):
            row: Row = {}
            for change in experiment.set:
                key, _, value = change.partition("=")
                row[key.strip()] = value.strip()
            row |= self.values(experiment, point)
            row |= dict.fromkeys(seeds, str(SEEDS * self.calibration.seed + k))
            rows.append(row)
        return Sweep(experiment.path(self.source.parent), self.folder / experiment.name, rows, experiment.quantities,
                     self.how.plugins, self.how.allow_paths)  # fmt: skip

    def values(self, experiment: Experiment, point: np.ndarray) -> Row:
        """Values of the parameters at a point, by the keys of the experiment's scene."""
        made = self.calibration
        return {key: parameter.limits.value(x) for parameter, x in zip(made.parameters, point.tolist(), strict=True)
                for key in made.keys(parameter, experiment)}  # fmt: skip
