"""Edges of a triangle mesh: which triangles meet at each, and how they are wound there."""

import math

import numpy as np

from warpdem.mesh.grouping import first_and_group

ANGLE_ROUNDING = 1e-5
"""Rounding of angles [rad]: an angle this close to `SMOOTH_ANGLE` counts as equal, as in a tube of twelve facets."""


class Edges:
    """Which triangles meet at each edge."""

    def __init__(self, triangles: np.ndarray) -> None:
        ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        key = np.sort(ends, axis=1)
        first, group = first_and_group(key)
        uses = np.bincount(group)
        self.border = key[first[uses == 1]]
        """Ends of the edges that only one triangle has, in the order of the triangles, shape (b, 2)."""
        orientation = np.bincount(group, np.where(ends[:, 0] == key[:, 0], 1.0, -1.0), minlength=len(first))
        self.forked = key[first[(uses > 2) & (orientation != 0.0)]]
        """Ends of the edges at which three or more triangles meet, with unbalanced orientations, shape (f, 2)."""
        self.shared = key[first[(uses > 2) & (orientation == 0.0)]]
        """Ends of the edges at which four or more meet with balanced orientations: bodies touch there, shape (s, 2)."""
        at = np.flatnonzero(((uses > 2) & (orientation == 0.0))[group])
        self._at_shared = at[np.argsort(group[at], kind="stable")]
        self._ends, self._edge = ends[self._at_shared], group[self._at_shared]
        self.is_closed = not (uses % 2).any()
        """Whether an even number of triangles meet at each edge."""
        order = np.argsort(group, kind="stable")
        paired = order[uses[group[order]] == 2].reshape(-1, 2)
        self.sides = paired // 3
        """The two triangles at each edge shared by exactly two, shape (e, 2)."""
        self.opposite = paired % 3
        """Number 0..2 of the edge within each of the two triangles (edge k runs from corner k to k + 1)."""
        self.twisted = ends[paired[:, 0], 0] == ends[paired[:, 1], 0]
        """Whether the two triangles run through the edge in the same direction, shape (e,)."""
        self.ends = key[paired[:, 0]]
        """Ends of the edge between the two, shape (e, 2)."""

    def pairs_at_shared(self, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """Pairs of triangles of one body at the edges where bodies touch, shape (p, 2), if the windings there are right.

        Around the edge from its lower to its higher end, a triangle of the opposite orientation begins a body, since its normal
        points outwards, and a triangle of the same orientation ends it.
        """
        if not len(self._at_shared):
            return np.zeros((0, 2), np.int64)
        low, high = np.sort(self._ends, axis=1).T
        axis = vertices[high] - vertices[low]
        axis /= np.linalg.norm(axis, axis=1)[:, None]
        tip = triangles[self._at_shared // 3, (self._at_shared % 3 + 2) % 3]
        arm = vertices[tip] - vertices[low]
        # angles are counted from the arm of the edge's first triangle
        _, first = np.unique(self._edge, return_index=True)
        first = first[np.cumsum(np.isin(np.arange(len(arm)), first)) - 1]
        zero = arm[first] - (arm[first] * axis).sum(axis=1)[:, None] * axis
        angle = np.arctan2((arm * np.cross(axis, zero)).sum(axis=1), (arm * zero).sum(axis=1))
        # coincident faces: a body ends before the next begins
        angle = np.rint(angle / ANGLE_ROUNDING) % round(2.0 * math.pi / ANGLE_ROUNDING)
        begins = self._ends[:, 0] != low
        order = np.lexsort((begins, angle, self._edge))
        pairs = []
        for around in np.split(order, np.flatnonzero(np.diff(self._edge[order])) + 1):
            depth = np.cumsum(np.where(begins[around], 1, -1))
            open_ones: list[int] = []
            for use in np.roll(around, -int(depth.argmin()) - 1).tolist():
                if begins[use]:
                    open_ones.append(use)
                else:
                    pairs.append((open_ones.pop(), use))
        return np.asarray(self._at_shared[np.array(pairs)] // 3)
