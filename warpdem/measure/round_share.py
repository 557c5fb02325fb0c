r"""How much of grains and of lines between them lies in a sphere or cylinder, as ``box_share`` for a box.

Balls in a sphere of radius S, d apart, share the lens  pi (S + r - d)^2 (d^2 + 2 d (S + r) - 3 (S - r)^2) / (12 d).
Balls in a cylinder are cut across its axis: at the height z from its centre a ball is a circle of radius sqrt(r^2 - z^2), of
which the cylinder's circle holds all, none or a lens. Between the heights at which that changes, Gauss's rule is taken over
z = a + (b - a) (3 u^2 - 2 u^3), in which the lens is smooth up to both ends: to 1e-9 of a ball.
"""

from collections.abc import Sequence

import numpy as np

from warpdem.measure.image_share import ImageShare
from warpdem.scene.regions import CylinderRegion, SphereRegion

NODES = 24
"""Of Gauss's rule between two heights: 1e-9 of a ball (16: 3e-7)."""


class RoundShare(ImageShare):
    """A sphere, or a cylinder with ends.

    Args:
        shape: Sphere, or cylinder with a length.
        period: Length of the domain along each periodic axis [m], else 0; shape (3,).
    """

    def __init__(self, shape: SphereRegion | CylinderRegion, period: Sequence[float]) -> None:
        super().__init__(shape.bounds, shape.volume, period)
        self._shape = shape

    def _balls(self, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
        if isinstance(self._shape, SphereRegion):
            return balls_in_sphere(self._shape, centre, radius)
        return balls_in_cylinder(self._shape, centre, radius)

    def _lines(self, start: np.ndarray, way: np.ndarray) -> np.ndarray:
        return _line_share(self._shape, start, way)


def _line_share(shape: SphereRegion | CylinderRegion, start: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Share of each line start + t way, t from 0 to 1, that is in a shape; shape (n,)."""
    if isinstance(shape, SphereRegion):
        return _within_ball(start - np.array(shape.centre), way, shape.radius, 0.0, 1.0)
    axis, arm = np.array(shape.axis), start - np.array(shape.point)
    height, climb = arm @ axis, way @ axis
    (first, last), level = shape.ends, climb == 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (first - height) / climb, (last - height) / climb
    between = (height >= first) & (height <= last)
    enters = np.where(level, np.where(between, 0.0, 2.0), np.minimum(a, b))
    leaves = np.where(level, 1.0, np.maximum(a, b))
    across = arm - height[:, None] * axis, way - climb[:, None] * axis
    return _within_ball(*across, shape.radius, np.maximum(enters, 0.0), np.minimum(leaves, 1.0))


def _within_ball(
    arm: np.ndarray, way: np.ndarray, radius: float, low: np.ndarray | float, high: np.ndarray | float
) -> np.ndarray:
    """Length of t from ``low`` to ``high`` in which |arm + t way| is at most ``radius``, shape (n,), 0 where there is none."""
    a, b, c = (way**2).sum(axis=1), (arm * way).sum(axis=1), (arm**2).sum(axis=1) - radius**2
    square = b * b - a * c
    root = np.sqrt(np.maximum(square, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = (-b - root) / a, (-b + root) / a
    still = a == 0.0  # a line along the axis, or of no length
    first, last = np.where(still, -np.inf, first), np.where(still, np.inf, last)
    length = np.minimum(last, high) - np.maximum(first, low)
    return np.where((square > 0.0) | (still & (c <= 0.0)), np.maximum(length, 0.0), 0.0)


def balls_in_sphere(shape: SphereRegion, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Volume of each ball in a sphere [m3], shape (n,)."""
    s, r = shape.radius, radius
    d = np.linalg.norm(centre - np.array(shape.centre), axis=1)
    inner = 4.0 / 3.0 * np.pi * np.minimum(r, s) ** 3
    cut = (d > np.abs(s - r)) & (d < s + r)
    apart = np.where(cut, d, 1.0)
    lens = np.pi * (s + r - d) ** 2 * (d**2 + 2.0 * d * (s + r) - 3.0 * (s - r) ** 2) / (12.0 * apart)
    return np.where(cut, lens, np.where(d >= s + r, 0.0, inner))


def balls_in_cylinder(shape: CylinderRegion, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Volume of each ball in a cylinder with ends [m3], shape (n,)."""
    axis, arm = np.array(shape.axis), centre - np.array(shape.point)
    height = arm @ axis
    d = np.linalg.norm(arm - height[:, None] * axis, axis=1)
    low = np.clip(shape.ends[0] - height, -radius, radius)
    high = np.clip(shape.ends[1] - height, -radius, radius)
    s = shape.radius
    turns = [np.sqrt(np.maximum(radius**2 - side**2, 0.0)) for side in (np.abs(s - d), s + d)]
    cuts = [low, high, *(np.clip(sign * turn, low, high) for turn in turns for sign in (-1.0, 1.0))]
    edges = np.sort(np.stack(cuts, axis=1), axis=1)
    x, weight = np.polynomial.legendre.leggauss(NODES)
    u = 0.5 * (x + 1.0)
    share, slope = 3.0 * u**2 - 2.0 * u**3, 6.0 * u * (1.0 - u)
    first, length = edges[:, :-1, None], np.diff(edges, axis=1)[:, :, None]
    z = first + length * share
    r = np.sqrt(np.maximum(radius[:, None, None] ** 2 - z**2, 0.0))
    return (_lens(r, s, d[:, None, None]) * length * slope) @ (0.5 * weight) @ np.ones(edges.shape[1] - 1)


def _lens(r: np.ndarray, s: float, d: np.ndarray) -> np.ndarray:
    """Area that circles of radius r and s with centres d apart share [m2]."""
    cut = (d > np.abs(s - r)) & (d < s + r) & (r > 0.0)
    r1, d1 = np.where(cut, r, 1.0), np.where(cut, d, 1.0)
    kite = np.sqrt(np.maximum((s + r1 - d1) * (d1 + r1 - s) * (d1 + s - r1) * (d1 + s + r1), 0.0))
    # by the tangent: the cosine of a small angle has lost its digits
    first, second = np.arctan2(kite, d1**2 + r1**2 - s**2), np.arctan2(kite, d1**2 + s**2 - r1**2)
    lens = r1**2 * first + s**2 * second - 0.5 * kite
    return np.asarray(np.where(cut, lens, np.where(d >= s + r, 0.0, np.pi * np.minimum(r, s) ** 2)))
