"""What a calibration found, in the units of the file and in words: values, errors, and what the targets do not tell."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from warpdem.calibration.file import Calibration
from warpdem.calibration.search import Found, Request

LEVEL = 0.01
"""Probability below which no values of the parameters meet the targets."""
EDGE = 0.01
"""Distance from an end of its range, as a fraction of it, at which a value is said to lie there."""
PART = 0.3
"""Least component of a combination that is named [-]."""
LIKE = 0.95
"""Correlation of two parameters from which on it is said."""


@dataclass(frozen=True)
class Fitted:
    """A parameter; numbers in the unit of its range."""

    name: str
    value: float
    low: float
    """Least value of the interval."""
    high: float
    error: float
    """Standard error, half the width of the interval that holds the value with probability 0.683."""
    unit: str
    known: bool
    """Whether the targets tell it."""
    simulated: float
    """Part of its variance that comes from the chance in the runs [-]."""


@dataclass(frozen=True)
class Met:
    """A target and what the runs give for the best values; numbers in its unit."""

    name: str
    target: float
    uncertainty: float
    fitted: float
    """By the surface at the best values."""
    error: float
    """Standard error of that, by the chance in the runs."""
    off: float
    """(fitted - target) over the uncertainty of both [-]."""
    scatter: float
    """Standard deviation of a run [unit of the target]."""
    checked: float | None
    """Mean of the runs of the last round; None where they have none."""
    checks: int
    """Number of these runs."""


@dataclass(frozen=True)
class Verdict:
    """What was found."""

    parameters: list[Fitted]
    targets: list[Met]
    notes: list[str]
    """What is to be known beside the numbers."""
    confidence: float
    runs: int
    """Runs of each experiment."""
    failed: int
    """Runs that have a target without a measure."""
    chance: float | None
    """Probability that a model which meets the targets is off by so much [-]."""
    correlation: list[list[float]]

    def as_data(self) -> dict[str, Any]:
        """What JSON can hold."""
        return asdict(self)


def verdict(calibration: Calibration, request: Request, found: Found) -> Verdict:
    """What was found, in the units of the file."""
    now, names = found.estimate, [one.name for one in calibration.parameters]
    p = len(names)
    lost = {k for vector in now.unknown for k in _parts(vector)}
    middle = np.quantile(found.fits, [0.1587, 0.8413], axis=0)
    parameters = []
    for k, one in enumerate(calibration.parameters):
        of = one.limits.number
        low, high = found.intervals[k].tolist()
        error = 0.5 * (of(float(middle[1, k])) - of(float(middle[0, k])))
        parameters.append(Fitted(one.name, of(float(now.best[k])), of(low), of(high), error, one.limits.unit, k not in lost,
                                 float(now.simulated[k])))  # fmt: skip
    last = found.y[-found.rounds[-1] :]
    targets = []
    titles = [f"{one.name}: {target.title}" for one in calibration.experiments for target in one.targets]
    for k, title in enumerate(titles):
        checked = last[np.isfinite(last[:, k]), k]
        mean = float(checked.mean()) if len(checked) else None
        of_goal = float(request.goal.targets[k]), float(request.goal.uncertainties[k])
        of_fit = float(now.values[k]), float(now.deviations[k]), float(now.off[k])
        targets.append(Met(title, *of_goal, *of_fit, found.surfaces[k].scatter, mean, len(checked)))
    failed = int((~np.isfinite(found.y)).any(axis=1).sum())
    spread = np.sqrt(np.diag(now.covariance))
    correlation = now.covariance / np.outer(spread, spread)
    chance = None if math.isnan(now.chance) else now.chance
    notes = [*_unknown(calibration, found), *_alike(names, correlation, lost), *_ends(calibration, found, lost)]
    if chance is not None and chance < LEVEL:
        worst = max(targets, key=lambda one: abs(one.off))
        notes.append(
            f"no values within the ranges meet the targets (probability {chance:.2g}): {worst.name!r} is off by "
            f"{worst.off:+.1f} of its uncertainty; look for a model or a range that is wrong, or an uncertainty too small"
        )
    if failed:
        notes.append(f"{failed} of {len(found.x)} runs have no measure for a target and were left out")
    noisy = [names[k] for k in range(p) if now.simulated[k] > 0.5 and k not in lost]
    if noisy:
        notes.append(f"more than half of the error of {', '.join(noisy)} is the chance in the runs: more runs make it smaller")
    return Verdict(parameters, targets, notes, calibration.confidence, len(found.x), failed, chance, correlation.tolist())


def _unknown(calibration: Calibration, found: Found) -> list[str]:
    """What the targets do not tell."""
    notes = []
    for vector in found.estimate.unknown:
        parts = _parts(vector)
        names = [calibration.parameters[k].name for k in parts]
        if len(parts) == 1:
            notes.append(f"the targets do not tell {names[0]}: they change too little with it for their uncertainty")
            continue
        step = 0.5 * vector * np.sign(vector[parts[0]])
        moves = []
        for k in parts:
            x = found.estimate.best[k]
            of = calibration.parameters[k].limits.number
            begin, end = (of(float(np.clip(x + sign * step[k], 0.0, 1.0))) for sign in (-1.0, 1.0))
            moves.append(f"{calibration.parameters[k].name} from {begin:.3g} to {end:.3g}")
        notes.append(
            f"the targets do not tell {' and '.join(names)} apart: {' with '.join(moves)} changes the "
            "measures by no more than they are uncertain; fix one of them, or add a target that depends on them in another way"
        )
    return notes


def _parts(vector: np.ndarray) -> list[int]:
    """Parameters that a combination is made of, the greatest part first."""
    unit = np.abs(vector) / np.linalg.norm(vector)
    return [int(k) for k in np.argsort(-unit) if unit[k] >= PART]


def _alike(names: list[str], correlation: np.ndarray, lost: set[int]) -> list[str]:
    """Pairs that the targets tell, but hardly apart."""
    p = len(names)
    return [f"{names[a]} and {names[b]} are hard to tell apart: their errors correlate by {correlation[a, b]:+.2f}"
            for a in range(p) for b in range(a + 1, p) if abs(correlation[a, b]) > LIKE and not {a, b} <= lost]  # fmt: skip


def _ends(calibration: Calibration, found: Found, lost: set[int]) -> list[str]:
    """Values at an end of their range."""
    notes = []
    for k, one in enumerate(calibration.parameters):
        x = found.estimate.best[k]
        if k not in lost and min(x, 1.0 - x) < EDGE:
            which = "least" if x < 0.5 else "greatest"
            notes.append(f"{one.name} lies at the {which} value of its range: widen it")
    return notes
