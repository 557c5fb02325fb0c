r"""Volume that a ball and a box share, in closed form.

A box is the sum over its corners, with alternating signs, of the octants x > a, y > b, z > c. What a unit ball has of one whose
corner lies in the ball is bounded by three flat faces and a triangle of arcs on the sphere. By the divergence theorem

    3 V = S - a A_a - b A_b - c A_c,        S = 2 pi - sum of the outer angles - sum of the geodesic curvatures

with S by Gauss and Bonnet: the arc of angle w on the face x = a has the curvature a w, and two faces a and b meet on the sphere
at the outer angle acos(-a b / sqrt((1 - a^2)(1 - b^2))). Other octants follow by mirroring, from caps and from two faces.
"""

import itertools

import numpy as np

_PAIRS = ((0, 1), (1, 2), (2, 0))


def ball_in_box(centre: np.ndarray, radius: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Volume of each ball that lies in a box [m3], shape (n,), to some 1e-15 of the whole ball.

    Args:
        centre: centres [m], shape (n, 3).
        radius: radii [m], shape (n,), > 0.
        low: lowest corner of the box [m], shape (3,); -inf where it has no end.
        high: highest corner [m], shape (3,); inf where it has no end.
    """
    ball = 4.0 / 3.0 * np.pi * radius**3
    reach = radius[:, None]
    touched = ((centre + reach > low) & (centre - reach < high)).all(axis=1)
    within = ((centre - reach >= low) & (centre + reach <= high)).all(axis=1)
    out = np.where(within, ball, 0.0)
    cut = np.flatnonzero(touched & ~within)
    if len(cut):
        ends = [np.clip((end - centre[cut]) / reach[cut], -1.0, 1.0) for end in (low, high)]
        share = np.zeros(len(cut))
        for sides in itertools.product((0, 1), repeat=3):
            share += (-1.0) ** sum(sides) * _octant(*(ends[side][:, k] for k, side in enumerate(sides)))
        out[cut] = np.clip(share * radius[cut] ** 3, 0.0, ball[cut])
    return out


def _octant(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Volume of a unit ball at x > a, y > b, z > c, all from -1 to 1, shape (n,)."""
    p, q, r = np.abs(a), np.abs(b), np.abs(c)
    inner = np.where(c < 0.0, _wedge(p, q) - _corner(p, q, r), _corner(p, q, r))  # x > p, y > q, z > c
    inner = np.where(b < 0.0, _wedge(p, c) - inner, inner)  # x > p, y > b, z > c
    return np.where(a < 0.0, _wedge(b, c) - inner, inner)


def _wedge(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Volume of a unit ball at x > a, y > b, shape (n,)."""
    p, q = np.abs(a), np.abs(b)
    half = 2.0 * _corner(p, q, np.zeros_like(p))
    half = np.where(b < 0.0, _cap(p) - half, half)  # x > p, y > b
    return np.where(a < 0.0, _cap(b) - half, half)


def _cap(a: np.ndarray) -> np.ndarray:
    """Volume of a unit ball at x > a, shape (n,)."""
    return np.pi / 3.0 * (1.0 - a) ** 2 * (2.0 + a)


def _corner(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Volume of a unit ball at x > a, y > b, z > c, none of them negative, shape (n,)."""
    at = np.stack([a, b, c])
    out = np.zeros(len(a))
    inside = (at**2).sum(axis=0) < 1.0  # else the octant is beyond the ball
    at = at[:, inside]
    disk = np.sqrt(1.0 - at**2)  # radius of the ball's section on each face
    surface = np.full(at.shape[1], 2.0 * np.pi)
    flats = np.zeros(at.shape[1])
    for k, (i, j) in enumerate(_PAIRS):
        surface -= np.arccos(np.clip(-at[i] * at[j] / (disk[i] * disk[j]), -1.0, 1.0))
        i, j = (k + 1) % 3, (k + 2) % 3
        u, v, r = at[i], at[j], disk[k]
        arc = np.arccos(np.minimum(u / r, 1.0)) - np.arcsin(np.minimum(v / r, 1.0))
        surface -= at[k] * arc
        # the disk at y > u, z > v: its sector, less the triangles from the centre to the two sides, more the corner twice
        area = 0.5 * (r * r * arc - u * np.sqrt(np.maximum(r * r - u * u, 0.0)) - v * np.sqrt(np.maximum(r * r - v * v, 0.0)))
        flats += at[k] * (area + u * v)
    out[inside] = (surface - flats) / 3.0
    return out
