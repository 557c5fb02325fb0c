"""How far a measure is off by the time step: Richardson's rule on runs with a step, half of it, a quarter of it, and so on.

With Q(h) = Q0 + c h^p, and the differences d1 = Q(h) - Q(h/2), d2 = Q(h/2) - Q(h/4) of the finest three that are no chance,

    p = log2(d1 / d2),    Q0 = Q(h/4) - d2 / (2^p - 1),    error(h) = |c| h^p = |d1| 2^p / (2^p - 1)

(Richardson 1911; Roache 1997). Grains are chaotic: where perturbed twins of a run scatter by as much as the runs differ, the
differences are chance, and tell no more than that the error of the step is below their size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

ORDERS = 0.5, 4.0
"""Orders p that are believed; where the differences give another one, or none, the first order is taken."""
CHANCE = 2.0
"""Differences below so many standard deviations of the twins' are chance."""
SAME = 1e-12
"""Relative difference that counts as none [-]."""
DIGITS = 2
"""Digits of a step that is chosen."""


@dataclass(frozen=True)
class StepError:
    """What runs with several steps tell of a measure."""

    steps: tuple[float, ...]
    """Steps h, h/2, h/4 ... [s], three or more."""
    values: tuple[float, ...]
    """The measure with each."""
    scatter: float | None
    """Standard deviation of a run among perturbed twins [unit of the measure]; None without twins."""
    order: float
    """Order p of the error [-]; 1 where it is taken for want of a better one."""
    known: bool
    """Whether the order comes from the differences."""
    chance: bool
    """Whether the differences are no larger than those of twins."""
    last_resolved: int
    """Number, from 0, of the last difference above the scatter of twins: later ones are chance."""
    limit: float
    """Value without error of the step, Q0; the mean of all where the differences are chance."""

    def error(self, step: float) -> float:
        """Error of the measure with a step [s], above 0, [unit of the measure]; an upper bound where it is chance."""
        if self.chance:
            return CHANCE * math.sqrt(2.0) * (self.scatter or 0.0)
        factor = 2.0**self.order / (2.0**self.order - 1.0)
        sizes = [abs(a - b) * 2.0 ** (self.order * k) for k, (a, b) in enumerate(pairwise(self.values))]
        largest = max(sizes[: self.last_resolved + 1])
        return float(largest * factor * (step / self.steps[0]) ** self.order)


def step_error(steps: Sequence[float], values: Sequence[float], scatter: float | None) -> StepError:
    """The error of the step from three runs or more.

    Args:
        steps: h, h/2, h/4 ... [s].
        values: the measure with each.
        scatter: standard deviation among perturbed twins of the first run; None without twins.
    """
    differences = [a - b for a, b in pairwise(values)]
    size, last = SAME * max(map(abs, values)), len(values) - 2
    bound = CHANCE * math.sqrt(2.0) * (scatter or 0.0)
    given = tuple(steps), tuple(values), scatter
    if max(map(abs, differences)) <= max(bound, size):
        return StepError(*given, 1.0, False, True, last, sum(values) / len(values))
    for k in range(last, 0, -1):  # from the finest on
        first, second = differences[k - 1 : k + 1]
        ratio = first / second if abs(second) > max(bound, size) else math.nan
        order = math.log2(ratio) if ratio > 0.0 and math.isfinite(ratio) else math.nan
        if ORDERS[0] <= order <= ORDERS[1]:
            return StepError(*given, order, True, False, k, values[k + 1] - second / (2.0**order - 1.0))
    return StepError(*given, 1.0, False, False, last, values[-1] - differences[-1])


def chosen_step(found: StepError, allowed: float) -> float:
    """The largest step, that of the first run at most, whose error is at most ``allowed`` [its unit]; rounded down."""
    most = found.steps[0]
    if found.chance or found.error(most) <= allowed:
        return most
    step = most * (allowed / found.error(most)) ** (1.0 / found.order)
    unit = 10.0 ** (math.floor(math.log10(step)) - DIGITS + 1)
    return float(np.floor(step / unit) * unit)


def runs_needed(scatter: float, allowed: float) -> int:
    """Runs with other seeds whose mean is off by no more than ``allowed`` by chance, with probability 0.95."""
    return max(1, math.ceil((1.96 * scatter / allowed) ** 2))
