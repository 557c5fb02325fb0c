"""Response surfaces: what runs measure as a smooth function of the parameters, fitted to runs that scatter.

Parameters are fractions x of their ranges, from 0 to 1. Within a box of half widths h around a centre c, with z = (x - c)/h, a
measure is fitted by weighted least squares with

    g(x) = b . f(z),      f = 1, z_a, and z_a z_b where there are runs enough

and runs outside the box lose their weight smoothly up to twice its size (tricube, Cleveland 1979). Its scatter comes from
the residuals, so it holds both the chance in the runs and what the polynomial lacks. Box and Wilson 1951; Myers and
Montgomery, Response Surface Methodology.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SPARE = 3
"""Runs beyond the number of coefficients that a fit needs at least."""
WANTED = 2
"""Runs over coefficients in the narrowest box, where there are so many: with fewer, few degrees of freedom tell the scatter."""
ROOM = 1.25
"""Factor by which a box grows."""
AGREE = 1.5
"""Errors within which the surface of a wider box agrees with those of narrower ones."""
ROUNDING = 1e-9
"""Relative difference that counts as none [-]."""
ALIKE = 1e-6
"""Ratio of singular values below which runs do not tell all coefficients."""


@dataclass(frozen=True)
class Box:
    """Region of the parameters that surfaces describe: x with abs(x - centre) <= half."""

    centre: np.ndarray
    """Centre, as fractions of the ranges, shape (p,)."""
    half: np.ndarray
    """Half widths, shape (p,)."""

    def scaled(self, x: np.ndarray) -> np.ndarray:
        """Positions relative to the box, -1 to 1 inside, shape that of ``x``, (..., p)."""
        out: np.ndarray = (x - self.centre) / self.half
        return out

    def weights(self, x: np.ndarray) -> np.ndarray:
        """Weights of points of shape (n, p): 1 inside, 0 from twice the size on, shape (n,)."""
        beyond = np.clip(np.abs(self.scaled(x)).max(axis=1) - 1.0, 0.0, 1.0)
        out: np.ndarray = (1.0 - beyond**3) ** 3
        return out


def terms(count: int, quadratic: bool) -> int:
    """Number of coefficients for ``count`` parameters."""
    return 1 + count + (count * (count + 1) // 2 if quadratic else 0)


def features(z: np.ndarray, quadratic: bool) -> np.ndarray:
    """f(z) of points of shape (n, p), shape (n, terms)."""
    n, p = z.shape
    columns = [np.ones(n), *z.T]
    if quadratic:
        columns += [z[:, a] * z[:, b] for a in range(p) for b in range(a, p)]
    return np.stack(columns, axis=1)


def slopes(z: np.ndarray, quadratic: bool) -> np.ndarray:
    """Slopes of f(z) at points of shape (n, p), shape (n, terms, p)."""
    n, p = z.shape
    unit = np.eye(p)
    out = np.zeros((n, terms(p, quadratic), p))
    out[:, 1 : p + 1] = unit
    if quadratic:
        pairs = [(a, b) for a in range(p) for b in range(a, p)]
        for k, (a, b) in enumerate(pairs, p + 1):
            out[:, k] = unit[a] * z[:, b, None] + unit[b] * z[:, a, None]
    return out


@dataclass(frozen=True)
class Surface:
    """A measure as a function of the parameters."""

    box: Box
    quadratic: bool
    coefficients: np.ndarray
    """b [unit of the measure], shape (terms,)."""
    inverse: np.ndarray
    """Covariance of b over the variance of a run [-], shape (terms, terms)."""
    scatter: float
    """Standard deviation of a run about the surface [unit of the measure]."""
    freedom: float
    """Degrees of freedom of the scatter."""

    def value(self, x: np.ndarray) -> float:
        """Value of g at a point of shape (p,)."""
        return float(features(self.box.scaled(x)[None], self.quadratic)[0] @ self.coefficients)

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Slope of g at a point of shape (p,), shape (p,)."""
        z = self.box.scaled(x)
        out: np.ndarray = (slopes(z[None], self.quadratic)[0].T @ self.coefficients) / self.box.half
        return out

    def variance(self, x: np.ndarray) -> float:
        """Variance of g at a point of shape (p,), by the chance in the runs."""
        f = features(self.box.scaled(x)[None], self.quadratic)[0]
        return float(self.scatter**2 * (f @ self.inverse @ f))


def fit(x: np.ndarray, y: np.ndarray, box: Box) -> Surface | None:
    """The surface of a measure.

    Of boxes that grow from the one asked for, it takes the widest whose surface agrees, over the one asked for, with those of
    all narrower ones within their errors (Lepski's rule, 1991): runs far off count where a polynomial holds that far.

    Args:
        x: parameters of each run, shape (n, p).
        y: measure of each run, nan where it has none, shape (n,).
        box: where it is to describe the runs.

    Returns:
        The surface; None with fewer runs than a linear one needs.
    """
    known = np.isfinite(y)
    x, y, p = x[known], y[known], x.shape[1]
    for quadratic in (True, False):
        least = terms(p, quadratic) + SPARE
        if len(y) < least:
            continue
        wanted = max(least, min(WANTED * terms(p, quadratic), len(y) - 1e-9))
        while box.weights(x).sum() < wanted:
            box = Box(box.centre, box.half * ROOM)
        marks = box.centre + np.concatenate([np.zeros((1, p)), np.diag(box.half), -np.diag(box.half)])
        low, high, chosen = np.full(len(marks), -np.inf), np.full(len(marks), np.inf), None
        while True:
            one = _fitted(x, y, box, quadratic)
            if one is not None:
                values = np.array([one.value(mark) for mark in marks])
                errors = AGREE * np.sqrt([one.variance(mark) for mark in marks]) + ROUNDING * np.abs(values)
                low, high = np.maximum(low, values - errors), np.minimum(high, values + errors)
                if (low > high).any():
                    break
                chosen = one
            if box.weights(x).min() == 1.0:
                break
            box = Box(box.centre, box.half * ROOM)
        if chosen is not None:
            return chosen
    return None


def _fitted(x: np.ndarray, y: np.ndarray, box: Box, quadratic: bool) -> Surface | None:
    """The surface of one box; None where the runs lie on a line or a plane and do not tell all coefficients."""
    weights = box.weights(x)
    a = features(box.scaled(x), quadratic)
    root = np.sqrt(weights)[:, None]
    u, s, vt = np.linalg.svd(a * root, full_matrices=False)
    if s[-1] < ALIKE * s[0]:
        return None
    b = vt.T @ ((u.T @ (y * root[:, 0])) / s)
    freedom = float(weights.sum() - len(b))
    scatter = float(np.sqrt(np.sum(weights * (y - a @ b) ** 2) / freedom))
    # (A'WA)^-1 A'W W A (A'WA)^-1: runs of little weight scatter as much as others
    back = vt.T / s @ u.T * root.T
    return Surface(box, quadratic, b, back @ back.T, scatter, freedom)
