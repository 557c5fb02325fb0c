"""Best values of the parameters, their errors, and what the targets do not tell.

With surfaces g_t, targets y_t and variances w_t = u_t^2 + v_t (of the target, and of the surface by the chance in the runs),

    x = argmin sum_t (g_t(x) - y_t)^2 / w_t,        C = (J' W J)^-1,   J = dg / dx,   W = diag(1 / w_t)

is found by scipy's trust region reflective method from several starts. Intervals come from fits to targets drawn anew from
their uncertainty and to surfaces drawn anew from theirs (Student's t, by the few runs that the scatter is known from): they
take in what C does not, that slopes are uncertain, that surfaces are curved, and where the ranges end. Eigenvectors of the
information J' W J whose standard deviation is a large part of the ranges are combinations of parameters that the targets do not
tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from warpdem.calibration.surface import Surface, features, slopes, terms
from warpdem.errors import SceneError

UNKNOWN = 0.2
"""Standard deviation of a combination of parameters, as a fraction of their ranges, above which the targets do not tell it."""
PRIOR = 1.0
"""Standard deviation, as a fraction of the ranges, of a weak pull to the middle: it decides where nothing else does [-]."""
STARTS = 8
"""Starts of the search for the best values, beside the middle."""
ROUNDS = 3
"""Times that the variances are taken anew at the best values."""
DRAWN = 400
"""Fits to what is drawn anew."""
TINY = 1e-300
"""Keeps a variance of none from dividing none."""
EDGE = 1e-6
"""Distance of starts from the ends of the ranges, as a fraction of these."""


@dataclass(frozen=True)
class Goal:
    """What the measures shall be."""

    targets: np.ndarray
    """Values y, shape (targets,)."""
    uncertainties: np.ndarray
    """Their standard deviations u, shape (targets,)."""
    confidence: float
    """Probability with which the intervals hold all true values, such as 0.95."""
    seed: int
    """Of the starts of the search, and of what is drawn."""


@dataclass(frozen=True)
class Estimate:
    """Best values and their errors, as fractions of the ranges."""

    best: np.ndarray
    """x, shape (p,)."""
    covariance: np.ndarray
    """C with the weak pull to the middle, shape (p, p)."""
    values: np.ndarray
    """g_t(x) of each target, shape (targets,)."""
    deviations: np.ndarray
    """sqrt(v_t) of each target, shape (targets,)."""
    off: np.ndarray
    """(g_t - y_t) / sqrt(w_t) of each target [-], shape (targets,)."""
    simulated: np.ndarray
    """Part of each parameter's variance that comes from the chance in the runs [-], shape (p,)."""
    unknown: list[np.ndarray]
    """Combinations of parameters that the targets do not tell, shapes (p,): as long as their standard deviation, 1 at most."""
    chance: float
    """Probability that a model which meets the targets is off by so much [-]; nan with no more targets than it tells."""

    @property
    def error(self) -> np.ndarray:
        """Standard error of each parameter, shape (p,)."""
        out: np.ndarray = np.sqrt(np.diag(self.covariance))
        return out


def estimate(surfaces: Sequence[Surface], goal: Goal) -> Estimate:
    """Fit the parameters to the targets; ``surfaces`` are those of each target, about one centre."""
    stats = scipy_part("stats")
    centre = surfaces[0].box.centre
    p = len(centre)
    starts = [np.full(p, 0.5), centre, *np.random.default_rng(goal.seed).random((STARTS, p))]
    best = centre
    for turn in range(ROUNDS):
        variances = goal.uncertainties**2 + _variances(surfaces, best)
        best = _solved(surfaces, goal.targets, variances, starts if turn == 0 else [best])
    runs = _variances(surfaces, best)
    variances = goal.uncertainties**2 + runs
    jacobian = np.array([one.slope(best) for one in surfaces])
    information = jacobian.T / variances @ jacobian
    covariance = np.linalg.inv(information + np.eye(p) / PRIOR**2)
    gain = covariance @ (jacobian.T / variances)
    simulated = (gain**2 @ runs) / np.maximum(gain**2 @ variances, TINY)
    found, vectors = np.linalg.eigh(information)
    unknown = [vectors[:, k] / np.sqrt(max(found[k], 1.0)) for k in range(p) if found[k] * UNKNOWN**2 < 1.0]
    values = np.array([one.value(best) for one in surfaces])
    off = (values - goal.targets) / np.sqrt(variances)
    spare = len(goal.targets) - p + len(unknown)
    chance = float(stats.chi2.sf(np.sum(off**2), spare)) if spare > 0 else float("nan")
    return Estimate(best, covariance, values, np.sqrt(runs), off, simulated, unknown, chance)


def drawn_fits(surfaces: Sequence[Surface], goal: Goal, found: Estimate) -> np.ndarray:
    """Best values for targets and surfaces drawn anew from their uncertainties, shape (DRAWN, p)."""
    random = np.random.default_rng([goal.seed, 1])
    p = len(found.best)
    variances = goal.uncertainties**2 + found.deviations**2
    factors = [one.scatter * np.linalg.cholesky(one.inverse) for one in surfaces]
    fits = np.zeros((DRAWN, p))
    for fit in fits:
        targets = goal.targets + goal.uncertainties * random.standard_normal(len(surfaces))
        others = []
        for one, factor in zip(surfaces, factors, strict=True):
            wide = np.sqrt(one.freedom / random.chisquare(one.freedom))
            moved = one.coefficients + wide * factor @ random.standard_normal(len(factor))
            others.append(replace(one, coefficients=moved))
        middle = 0.5 + PRIOR * random.standard_normal(p)
        fit[:] = _solved(others, targets, variances, [found.best], middle)
    return fits


def interval(fits: np.ndarray, found: Estimate, confidence: float) -> np.ndarray:
    """Least and greatest value of each parameter, within the ranges, shape (p, 2); with a probability they hold all values.

    The probability that one of p intervals misses is at most the sum of theirs (Bonferroni), so each has 1 / p of it.

    The wider of what the fits and the standard errors say: fits that end where a surface turns round lie closer than they know.
    """
    tail = 0.5 * (1.0 - confidence) / len(found.best)
    low, high = np.quantile(fits, [tail, 1.0 - tail], axis=0)
    reach = scipy_part("stats").norm.ppf(1.0 - tail) * found.error
    wider = np.stack([np.minimum(low, found.best - reach), np.maximum(high, found.best + reach)], axis=1)
    return np.asarray(np.clip(wider, 0.0, 1.0))


def _variances(surfaces: Sequence[Surface], x: np.ndarray) -> np.ndarray:
    return np.array([one.variance(x) for one in surfaces])


def _solved(
    surfaces: Sequence[Surface],
    targets: np.ndarray,
    variances: np.ndarray,
    starts: Sequence[np.ndarray],
    middle: np.ndarray | float = 0.5,
) -> np.ndarray:
    """The parameters that meet the targets best, shape (p,)."""
    root, p = np.sqrt(variances), len(starts[0])
    pull = np.eye(p) / PRIOR

    def misfit(x: np.ndarray) -> np.ndarray:
        away = np.einsum("tk,tk->t", features((x - centre) / half, True), b) - targets
        return np.concatenate([away / root, (x - middle) / PRIOR])

    def slope(x: np.ndarray) -> np.ndarray:
        steep = np.einsum("tka,tk->ta", slopes((x - centre) / half, True), b) / half
        return np.concatenate([steep / root[:, None], pull])

    optimize, half, whole = scipy_part("optimize"), np.array([one.box.half for one in surfaces]), terms(p, True)
    centre = np.array([one.box.centre for one in surfaces])
    # a plane is a quadratic whose last coefficients are none
    b = np.array([np.pad(one.coefficients, (0, whole - len(one.coefficients))) for one in surfaces])
    tried = [optimize.least_squares(misfit, np.clip(start, EDGE, 1.0 - EDGE), slope, bounds=(0.0, 1.0)) for start in starts]
    out: np.ndarray = min(tried, key=lambda one: float(one.cost)).x
    return out


def scipy_part(name: str) -> Any:
    """A module of scipy, which only calibration needs.

    Raises:
        SceneError: it is not installed.
    """
    from importlib import import_module

    try:
        return import_module(f"scipy.{name}")
    except ImportError as error:
        raise SceneError('calibrate: needs the package scipy: pip install "warpdem[calibrate]"') from error
