"""Which grains another rank sees: those that may come near a grain of its own before the lists are rebuilt.

A rank is described by boxes around its grains, one for each class of sizes, since large grains reach farther: among many small
ones they are few. A grain is seen if it is nearer to a box than its radius, the largest radius there, and what the lists hold
beyond that.
"""

import numpy as np

from warpdem.filling.size_grids import size_classes

SLACK = 1.0 + 1.0e-12
"""Factor for the rounding of distances."""


def boxes(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Boxes around grains by size class: corners and largest radius [m], shape (classes, 7); empty without grains."""
    if not len(radius):
        return np.zeros((0, 7))
    classes = size_classes(radius)
    out = []
    for number in np.unique(classes):
        mine = classes == number
        out.append(np.concatenate([position[mine].min(axis=0), position[mine].max(axis=0), [radius[mine].max()]]))
    return np.array(out)


def seen(
    position: np.ndarray, radius: np.ndarray, there: np.ndarray, beyond: float, period: tuple[float, float, float]
) -> np.ndarray:
    """Grains that a rank sees, as a mask, shape (n,).

    Args:
        position: of the grains [m], shape (n, 3).
        radius: of the grains [m], shape (n,).
        there: ``boxes`` of the rank.
        beyond: gap [m] up to which pairs are listed.
        period: length of the domain along each periodic axis [m], else 0.
    """
    out = np.zeros(len(radius), dtype=bool)
    for box in there:
        square = np.zeros(len(radius))
        for k in range(3):
            at = position[:, k]
            gap = np.maximum(np.maximum(box[k] - at, at - box[3 + k]), 0.0)
            if period[k]:
                for image in (at - period[k], at + period[k]):
                    gap = np.minimum(gap, np.maximum(np.maximum(box[k] - image, image - box[3 + k]), 0.0))
            square += gap * gap
        far = (radius + box[6] + beyond) * SLACK
        out |= square < far * far
    return out
