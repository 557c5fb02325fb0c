r"""Lacey's mixing index of two kinds of grains.

    M = (S_0^2 - S^2) / (S_0^2 - S_r^2),     S_0^2 = p (1 - p),     S_r^2 = p (1 - p) sum_c w_c / n_c
    S^2 = sum_c w_c (p_c - p)^2,             w_c = n_c / n

    p, p_c   fraction of the first kind among all grains and in cell c, by number   [-]
    n, n_c   grains in all and in cell c                                        [-]

0 where the kinds are apart, 1 where they are mixed as if by chance (a little above 1 is chance too). Cells are cubes along the
frame axes from the frame's origin; every cell counts by its grains, so that those at the border of a bed weigh little. The
variance of a random mixture of cells with n_c grains is p (1 - p) / n_c. Source: Lacey 1954, doi 10.1002/jctb.5010040504.
"""

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.measure.observers import Particles


def lacey_index(first: np.ndarray, position: np.ndarray, cell: float) -> float:
    """Mixing index [-]; nan if there is one kind only, or no cell holds two grains.

    Args:
        first: whether each grain is of the first kind, shape (n,).
        position: centres [m], shape (n, 3).
        cell: edge of the cells [m].
    """
    n = len(first)
    p = float(np.mean(first)) if n else 0.0
    if not 0.0 < p < 1.0:
        return float("nan")
    # whole numbers as float64, which no cell is too small for; without negative zeros
    _, number = np.unique(np.floor(position / cell) + 0.0, axis=0, return_inverse=True)
    count = np.bincount(number.ravel())
    fraction = np.bincount(number.ravel(), weights=first) / count
    apart = p * (1.0 - p)
    by_chance = apart * len(count) / n
    variance = float(count @ (fraction - p) ** 2) / n
    return (apart - variance) / (apart - by_chance) if by_chance < apart else float("nan")


def kinds(by: str, p: Particles, start: InitialGrains) -> tuple[np.ndarray, np.ndarray]:
    """Whether each grain is of the first kind, and whether it is of any, by id, shapes (n,).

    Args:
        by: "material", "group", "size", or an axis: the halves of the start along it.
        p: the grains; those that were inserted later belong to no half of the start.
        start: grains at the start, and those that represent the streams.
    """
    everyone = np.ones(len(p.id), dtype=bool)
    if by == "material":
        return p.type == p.type.min(initial=0), everyone
    if by == "group":
        return p.group == p.group.min(initial=0), everyone
    if by == "size":
        return p.radius <= np.median(start.radius), everyone
    known = np.isin(p.id, start.id)
    order = np.argsort(start.id)
    place = start.position[order, "xyz".index(by)]
    at = np.clip(np.searchsorted(start.id[order], p.id), 0, max(len(start.id) - 1, 0))
    return place[at] < np.median(place), known
