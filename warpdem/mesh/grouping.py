"""Groups of equal rows, connected components and their numbers, for welding, edges and pieces of a mesh."""

import numpy as np


def first_and_group(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row of each group of equal rows (ascending), and the group of each row; faster than `np.unique`."""
    order = np.lexsort(keys.T)  # stable: the first row of a group comes first
    new = np.ones(len(keys), bool)
    new[1:] = (keys[order[1:]] != keys[order[:-1]]).any(axis=1)
    first = order[new]
    rank = np.argsort(np.argsort(first))
    group = np.empty(len(keys), np.int64)
    group[order] = rank[np.cumsum(new) - 1]
    return np.sort(first), group


def components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Label of the connected component of each of `count` nodes: its lowest node, shape (count,).

    Labels decrease along the pairs and by pointer jumping until none changes; this takes about log(count) rounds.
    """
    label = np.arange(count)
    a, b = pairs.T
    while True:
        low = np.minimum(label[a], label[b])
        before = label.copy()
        # the root of each end gets the lower label too
        np.minimum.at(label, before[a], low)
        np.minimum.at(label, before[b], low)
        label = label[label]
        while (label != label[label]).any():
            label = label[label]
        if (label == before).all():
            return label


def renumber(label: np.ndarray) -> np.ndarray:
    """Numbers 0, 1, ... in the order in which the labels first appear, int32."""
    return first_and_group(label[:, None])[1].astype(np.int32)
