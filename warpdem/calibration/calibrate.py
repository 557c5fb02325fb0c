"""A calibration as a whole: the search, and what it leaves: tables, and the scenes with the best values.

The folders of the rows are the only state, as of a sweep: the same call goes on, and takes the same course.
"""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.calibration.estimate import Goal, scipy_part
from warpdem.calibration.experiments import Experiments
from warpdem.calibration.file import Calibration
from warpdem.calibration.search import Found, Request, search
from warpdem.calibration.verdict import Verdict, verdict
from warpdem.core.atomic_file import replaced
from warpdem.errors import SceneError
from warpdem.scene.tables import relative_to, scene_tables
from warpdem.scene.write_toml import toml_text

TABLE, RESULT, BEST = "calibration.csv", "calibration.json", "best"
"""Table of all runs, what was found, and folder of the scenes with the best values."""


@dataclass(frozen=True)
class Calibrated:
    """A calibration that has ended."""

    found: Found
    verdict: Verdict
    scenes: list[Path]
    """Scene of each experiment with the best values."""


def request_of(calibration: Calibration, chance: bool) -> Request:
    """What a calibration file asks for.

    Raises:
        SceneError: it allows too few runs.
    """
    targets = [target for one in calibration.experiments for target in one.targets]
    goal = Goal(np.array([one.value for one in targets]), np.array([one.uncertainty for one in targets]),
                calibration.confidence, calibration.seed)  # fmt: skip
    repeats = calibration.repeats if chance else 1
    request = Request(len(calibration.parameters), goal, 0, repeats, chance)
    runs = request.default_runs if calibration.runs is None else calibration.runs
    if runs < (least := repeats * request.first + 1):
        raise SceneError(
            f"runs = {runs}: {len(calibration.parameters)} parameters with {repeats} runs at each point take {least} at least"
        )
    return Request(len(calibration.parameters), goal, runs, repeats, chance)


def calibrate(experiments: Experiments, tell: Any = lambda words: None) -> Calibrated:
    """Calibrate, or go on with it; writes calibration.csv, calibration.json and the best scenes.

    Args:
        experiments: what is run, and where.
        tell: called with a line after each round.

    Raises:
        SceneError: before anything is run.
        RowsFailed: runs have not ended, and another attempt may change that.
        NoFit: too few runs have a measure that a target needs.
        KeyboardInterrupt: after the runs under way have written their checkpoints.
    """
    scipy_part("optimize")
    made = experiments.calibration
    experiments.check()
    request = request_of(made, any(experiments.seeds(one) for one in made.experiments))
    points = np.zeros((0, request.parameters))

    def run(new: np.ndarray) -> np.ndarray:
        nonlocal points
        points = np.concatenate([points, new])
        return experiments.run(points)[len(points) - len(new) :]

    found = search(request, run, tell)
    said = verdict(made, request, found)
    scenes = _write_scenes(experiments, found)
    _write_table(experiments, found)
    data = {"title": made.title, **said.as_data(), "rounds": found.rounds, "scenes": [str(path) for path in scenes]}
    with replaced(experiments.folder / RESULT) as part:
        part.write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return Calibrated(found, said, scenes)


def _write_scenes(experiments: Experiments, found: Found) -> list[Path]:
    folder = experiments.folder / BEST
    folder.mkdir(exist_ok=True)
    paths = []
    for one in experiments.calibration.experiments:
        scene = experiments.scene(one, experiments.values(one, found.estimate.best))
        path = folder / f"{one.name}.toml"
        with replaced(path) as part:
            part.write_text(toml_text(scene_tables(scene, relative_to(folder))), encoding="utf-8")
        paths.append(path)
    return paths


def _write_table(experiments: Experiments, found: Found) -> None:
    """Write calibration.csv: each run's round, parameters and measures."""
    made = experiments.calibration
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    titles = [f"{one.name}: {target.title}" for one in made.experiments for target in one.targets]
    states = [f"{one.name}: status" for one in made.experiments]
    writer.writerow(["run", "round", *(one.name for one in made.parameters), *titles, *states])
    rounds = np.repeat(np.arange(1, len(found.rounds) + 1), found.rounds)
    for k, (x, y) in enumerate(zip(found.x.tolist(), found.y.tolist(), strict=True)):
        values = [one.limits.value(at).strip('"') for one, at in zip(made.parameters, x, strict=True)]
        numbers = ["" if number != number else repr(number) for number in y]
        status = [outcomes[k].status for outcomes in experiments.outcomes]
        writer.writerow([k + 1, int(rounds[k]), *values, *numbers, *status])
    with replaced(experiments.folder / TABLE) as part:
        part.write_text(text.getvalue(), encoding="utf-8")

