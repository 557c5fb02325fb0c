"""Two runs side by side: how far apart their histories are, measured by the scatter of perturbed twins of the first.

Grains are chaotic: runs that differ by round-off alone go different ways in detail. Twins, whose starts differ by nothing that
matters, show by how much. Of each column, over the window,

    t = (b - mean a) / (s sqrt(1 + 1/n)),      p = P(|T| > |t|), T of Student's distribution with n - 1 degrees of freedom

    a, b   mean in time of the first run and its n - 1 twins, and of the second run
    s      standard deviation of the n values a

and, for the course in time, the rms distance from the mean curve of the first and its twins, over the rms scatter of these;
that of each twin from the others is given beside it. The p of several columns are corrected by Holm's rule (1979).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpdem.errors import WarpdemError
from warpdem.runs.history import TIME, History

LEVEL = 0.01
"""Probability with which equal runs are reported to differ, in all columns together [-]."""
FAR = 3.0
"""Distance of the curves, in those of the twins, above which runs differ whatever their means [-]."""
SAME = 1e-9
"""Relative difference that counts as none where the twins do not scatter [-]."""
NOT_COMPARED = (TIME, "frame_angle [rad]")
ROWS = 3
"""Rows in the window that a comparison needs at least."""


@dataclass(frozen=True)
class Difference:
    """How a column differs between two runs."""

    column: str
    """Header of the column; all numbers but the pure ones are in its unit."""
    first: float
    """Mean in time of the first run, of it and its twins if there are some; nan with too few numbers in common."""
    second: float
    """Mean in time of the second run."""
    scatter: float | None
    """Standard deviation of the means of the first run and its twins; None without twins."""
    t: float | None
    """(second - first) over what scatter explains [-]; infinite where the twins do not scatter; None without twins."""
    p: float | None
    """Probability that runs that are equal are so far apart [-], corrected for the number of columns; None without twins."""
    curve: float | None
    """rms distance of the curves over the scatter of the twins [-]; None without twins."""
    twins: float | None
    """The largest such distance of a twin from the others [-]; None with fewer than two twins."""

    @property
    def verdict(self) -> str:
        """"same", "differs" or, without twins or numbers in common, "unknown"."""
        if self.p is None:
            equal = abs(self.second - self.first) <= SAME * max(abs(self.first), abs(self.second))
            return "same" if equal and not self.curve else "unknown"
        return "differs" if self.reasons else "same"

    @property
    def reasons(self) -> list[str]:
        """What shows that the runs differ, with its bound; nothing if they are the same."""
        found = [f"p < {LEVEL:g}"] if self.p is not None and self.p < LEVEL else []
        if self.p is not None and self.curve is not None and self.twins is not None:
            bound = FAR * max(self.twins, 1.0)
            found += [f"curve > {bound:.3g}"] if self.curve > bound else []
        return found


@dataclass(frozen=True)
class Comparison:
    """All columns of two runs, and the curves they were compared by."""

    differences: list[Difference]
    only_first: list[str]
    """Columns that the second run lacks."""
    only_second: list[str]
    """Columns that the first run lacks."""
    time: np.ndarray
    """Times of the curves [s], those of the first run in the window, shape (rows,)."""
    first: dict[str, np.ndarray]
    """Curves of the first run and its twins by column, shapes (1 + twins, rows)."""
    second: dict[str, np.ndarray]
    """Curves of the second run by column, shapes (rows,)."""

    @property
    def verdict(self) -> str:
        """"same", "differs" or, where nothing differs but something is unknown, "unknown"."""
        found = {one.verdict for one in self.differences}
        return next((word for word in ("differs", "unknown") if word in found), "same")


def compare(
    first: History,
    second: History,
    twins: Sequence[History] = (),
    columns: Sequence[str] = (),
    start: float | None = None,
    end: float | None = None,
) -> Comparison:
    """Compare two histories.

    Args:
        first: of the run to compare with.
        second: of the other run.
        twins: of perturbed twins of the first.
        columns: names or patterns as ``History.matching`` takes them; all that the runs share if there are none.
        start: beginning of the window [s]; that of the runs if not given.
        end: its end [s]; the earliest end of the runs if not given.

    Raises:
        WarpdemError: a column is missing in one of them, or fewer than three rows of the first lie in the window.
    """
    named = first.matching(columns) if columns else [name for name in first if name in list(second)]
    named = [name for name in named if columns or name not in NOT_COMPARED]
    everyone = [first, *twins]
    for history in (second, *twins):
        for name in named:
            history.header(name)
    until = min(float(history[TIME][-1]) if history.rows else -math.inf for history in (*everyone, second))
    low, high = (-math.inf if start is None else start), min(until, math.inf if end is None else end)
    inside = (first[TIME] >= low) & (first[TIME] <= high * (1.0 + 1e-12))
    time = first[TIME][inside]
    if len(time) < ROWS:
        between = f"{len(time)} rows from {max(low, 0.0):g} to {high:g} s"
        raise WarpdemError(f"{first.source} and {second.source}: {between}, at least {ROWS} are needed")
    a = {name: np.array([at_times(history, name, time) for history in everyone]) for name in named}
    b = {name: at_times(second, name, time) for name in named}
    found = [difference(name, a[name], b[name], time) for name in named]
    ordered = holm([one.p for one in found])
    corrected = [Difference(**{**vars(one), "p": p}) for one, p in zip(found, ordered, strict=True)]
    only_first = [name for name in first if name not in list(second)]
    only_second = [name for name in second if name not in list(first)]
    return Comparison(corrected, only_first, only_second, time, a, b)


def at_times(history: History, name: str, time: np.ndarray) -> np.ndarray:
    """A column at other times [s], by straight lines between its rows, shape (rows,)."""
    values: np.ndarray = np.interp(time, history[TIME], history[name])
    return values


def difference(column: str, a: np.ndarray, b: np.ndarray, time: np.ndarray) -> Difference:
    """How a curve differs from those of a run and its twins, by the rows in which all of them have a number.

    A measure may have none, as the mean velocity in a region without grains.

    Args:
        column: its header.
        a: curves of the first run and its twins, shape (n, rows).
        b: curve of the second run, shape (rows,).
        time: times of the rows [s], shape (rows,).
    """
    known = np.isfinite(a).all(axis=0) & np.isfinite(b)
    if known.sum() < ROWS:
        return Difference(column, math.nan, math.nan, None, None, None, None, None)
    a, b, time = a[:, known], b[known], time[known]
    means, second = mean_in_time(a, time), float(mean_in_time(b, time))
    first, n = float(means.mean()), len(a)
    apart = rms(b - a.mean(axis=0))
    if n < 2:
        return Difference(column, first, second, None, None, None, apart or None, None)
    scatter, width = float(means.std(ddof=1)), rms(a.std(axis=0, ddof=1))
    size, wider = max(abs(first), abs(second)), math.sqrt(1.0 + 1.0 / n)
    t, curve = _over(second - first, scatter * wider, size), _over(apart, width * wider, size)
    others = None
    if n > 2:
        left = [(a[k], np.delete(a, k, axis=0)) for k in range(n)]
        others = max(_over(rms(one - rest.mean(axis=0)), rms(rest.std(axis=0, ddof=1)) * math.sqrt(1.0 + 1.0 / (n - 1)), size)
                     for one, rest in left)  # fmt: skip
    return Difference(column, first, second, scatter, t, student_tail(t, n - 1), curve, others)


def _over(distance: float, scatter: float, size: float) -> float:
    """A distance with its sign in units of scatter; none at all is 0, one where nothing scatters infinite."""
    if scatter > SAME * size:
        return distance / scatter
    return math.copysign(math.inf, distance) if abs(distance) > SAME * size else 0.0


def mean_in_time(curves: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Mean over the time [s] of curves, straight between their rows, shape that of the curves without the last axis."""
    mean: np.ndarray = np.trapezoid(curves, time, axis=-1) / (time[-1] - time[0])
    return mean


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def student_tail(t: float, freedom: int) -> float:
    """P(|T| > |t|) for Student's distribution with a whole number of degrees of freedom.

    The finite sums of Abramowitz and Stegun 1964, 26.7.3 and 26.7.4, with theta = atan(t / sqrt(freedom)).
    """
    if math.isinf(t):
        return 0.0
    angle = math.atan(abs(t) / math.sqrt(freedom))
    cosine, odd = math.cos(angle), freedom % 2
    term, total = (cosine if odd else 1.0), 0.0
    for k in range(1 + odd, freedom, 2):
        total += term
        term *= cosine * cosine * k / (k + 1.0)
    inside = 2.0 / math.pi * (angle + math.sin(angle) * total) if odd else math.sin(angle) * total
    return max(0.0, 1.0 - inside)


def holm(p: Sequence[float | None]) -> list[float | None]:
    """Probabilities corrected for their number by Holm's rule: the smallest times their number, and so on, ascending."""
    known = sorted((value, k) for k, value in enumerate(p) if value is not None)
    out, largest = list(p), 0.0
    for rank, (value, k) in enumerate(known):
        largest = max(largest, min(1.0, value * (len(known) - rank)))
        out[k] = largest
    return out
