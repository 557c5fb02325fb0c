"""The search for the best values: rounds of runs, each where the surfaces of the rounds before say that the targets are met.

The first round fills the ranges. Then the box that surfaces describe moves to the best values, and shrinks, by half a round at
most, to what their errors leave open: a parameter that the targets do not tell keeps its range. Runs end when the chance in
them adds nothing to the errors, or their number is spent; the last ones are at the best values. What a round asks for depends
on the results of those before and on nothing else, so a search that is begun again takes the same course.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpdem.calibration.estimate import Estimate, Goal, drawn_fits, estimate, interval
from warpdem.calibration.surface import SPARE, Box, Surface, fit, terms
from warpdem.errors import WarpdemError
from warpdem.sweep.table import latin_hypercube

LEAST = 0.02
"""Least half width of the box, as a fraction of the ranges."""
REACH = 2.5
"""Half width of the box in standard errors."""
SHRINK = 0.5
"""Least factor by which the box shrinks in a round."""
ENOUGH = 0.1
"""Fraction of the variances that the chance in the runs may make at the end [-]."""
TRIED = 40
"""Random hypercubes of which a round takes the one that keeps farthest from the points that there are."""

Run = Callable[[np.ndarray], np.ndarray]
"""Runs points of shape (n, p), fractions of the ranges, and gives the targets' measures, shape (n, targets); nan for none."""


class NoFit(WarpdemError):
    """Too few runs have the measures that the targets need."""

    exit_code = 3


@dataclass(frozen=True)
class Request:
    """What is searched for, and how far."""

    parameters: int
    """Number of parameters p."""
    goal: Goal
    runs: int
    """Most runs of each experiment."""
    repeats: int
    """Runs at each point, with other seeds."""
    chance: bool = True
    """Whether runs at one point differ."""

    @property
    def first(self) -> int:
        """Points of the first round: as many as a quadratic surface needs."""
        return terms(self.parameters, True) + SPARE

    @property
    def more(self) -> int:
        """Points of each later round."""
        return max(4, 2 * self.parameters)

    @property
    def last(self) -> int:
        """Runs at the best values."""
        return max(4, 2 * self.repeats) if self.chance else 1

    @property
    def default_runs(self) -> int:
        """Runs of three rounds after the first."""
        return self.repeats * (self.first + 3 * self.more) + self.last


@dataclass(frozen=True)
class Found:
    """What a search has found."""

    x: np.ndarray
    """Parameters of all runs, shape (n, p)."""
    y: np.ndarray
    """Their measures, shape (n, targets)."""
    rounds: list[int]
    """Runs of each round; those of the last are at the best values as they were known before."""
    estimate: Estimate
    surfaces: list[Surface]
    fits: np.ndarray
    """Best values for targets and surfaces drawn anew from their uncertainties, shape (draws, p)."""
    intervals: np.ndarray
    """Least and greatest value of each parameter that hold all with the confidence asked for, shape (p, 2)."""


def search(request: Request, run: Run, tell: Callable[[str], None] = lambda words: None) -> Found:
    """Search for the values that meet the targets.

    Args:
        request: what is searched for.
        run: runs points.
        tell: called with a line after each round.

    Raises:
        NoFit: too few runs have a measure that a target needs.
    """
    p = request.parameters
    box = Box(np.full(p, 0.5), np.full(p, 0.5))
    x, y, rounds = np.zeros((0, p)), np.zeros((0, len(request.goal.targets))), list[int]()
    points, ended = _spread(request, box, x, request.first, 0), False
    while True:
        x, y = np.concatenate([x, points]), np.concatenate([y, run(points)])
        rounds.append(len(points))
        surfaces = _surfaces(x, y, box)
        now = estimate(surfaces, request.goal)
        if ended:
            fits = drawn_fits(surfaces, request.goal, now)
            return Found(x, y, rounds, now, surfaces, fits, interval(fits, now, request.goal.confidence))
        half = np.clip(np.minimum(box.half, REACH * now.error), np.maximum(SHRINK * box.half, LEAST), None)
        settled = len(rounds) > 1 and bool((half > 0.9 * box.half).all())
        box = Box(now.best, half)
        spent = len(x) + request.repeats * request.more + request.last > request.runs
        tell(f"round {len(rounds)}: {len(x)} runs, errors {_list(now.error)} of the ranges")
        ended = spent or (settled and bool((now.simulated < ENOUGH).all()))
        if ended:
            points = np.tile(now.best, (max(1, min(request.last, request.runs - len(x))), 1))
        else:
            points = _spread(request, box, x, request.more, len(rounds))


def _surfaces(x: np.ndarray, y: np.ndarray, box: Box) -> list[Surface]:
    made = [fit(x, column, box) for column in y.T]
    for number, one in enumerate(made):
        if one is None:
            there = int(np.isfinite(y[:, number]).sum())
            raise NoFit(f"target {number + 1}: {there} of {len(x)} runs have its measure, too few for a fit")
    return [one for one in made if one is not None]


def _spread(request: Request, box: Box, x: np.ndarray, count: int, number: int) -> np.ndarray:
    """Points within the box and the ranges, far from those that there are, each ``repeats`` times, shape (n, p)."""
    random = np.random.default_rng([request.goal.seed, number])
    low, high = np.clip(box.centre - box.half, 0.0, 1.0), np.clip(box.centre + box.half, 0.0, 1.0)
    best, farthest = np.zeros((0, 0)), -1.0
    for _ in range(TRIED):
        points = low + (high - low) * latin_hypercube(random, count, request.parameters)
        everyone = np.concatenate([points, x]) / box.half
        away = np.linalg.norm(everyone[:count, None] - everyone[None], axis=2)
        away[np.arange(count), np.arange(count)] = np.inf
        if (least := float(away.min())) > farthest:
            best, farthest = points, least
    return np.repeat(best, request.repeats, axis=0)


def _list(numbers: np.ndarray) -> str:
    return ", ".join(f"{100.0 * number:.2g} %" for number in numbers)
