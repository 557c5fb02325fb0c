"""What belongs together in a triangle mesh: edges, connected parts, smooth pieces and flat pieces.

A file is usually float32, so two triangles of one flat floor differ by the rounding of their corners; the tolerance within
which they count as one plane follows from that.
"""

import math

import numpy as np

SMOOTH_ANGLE = math.radians(30.0)
"""Triangles that meet at a smaller angle belong to one smooth piece [rad]."""
ANGLE_ROUNDING = 1e-5
"""An angle so near to `SMOOTH_ANGLE` counts as equal [rad]: a tube of twelve facets must not fall into random parts."""
ROUNDING = 2.0**-21
"""Rounding of a corner in the file relative to the largest coordinate [-]: four units in the last place of float32,
which also covers ASCII files written with seven digits."""
SLIVER = 8.0
"""A triangle thinner than this many roundings has no direction of its own [-]."""


def first_and_group(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row of each set of equal rows (ascending) and the set each row belongs to; faster than `np.unique`."""
    order = np.lexsort(keys.T)  # stable: the first row of a set comes first
    new = np.ones(len(keys), bool)
    new[1:] = (keys[order[1:]] != keys[order[:-1]]).any(axis=1)
    first = order[new]
    rank = np.argsort(np.argsort(first))
    group = np.empty(len(keys), np.int64)
    group[order] = rank[np.cumsum(new) - 1]
    return np.sort(first), group


class Edges:
    """Which triangles meet at each edge."""

    def __init__(self, triangles: np.ndarray):
        ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        key = np.sort(ends, axis=1)
        first, group = first_and_group(key)
        uses = np.bincount(group)
        self.border = key[first[uses == 1]]
        """Ends of the edges that only one triangle has, in the order of the triangles, shape (b, 2)."""
        way = np.bincount(group, np.where(ends[:, 0] == key[:, 0], 1.0, -1.0), minlength=len(first))
        self.forked = key[first[(uses > 2) & (way != 0.0)]]
        """Ends of the edges at which three or more triangles meet, not as many one way as the other, shape (f, 2)."""
        self.shared = key[first[(uses > 2) & (way == 0.0)]]
        """Ends of the edges at which four or more meet, as many one way as the other: bodies touch there, shape (s, 2)."""
        at = np.flatnonzero(((uses > 2) & (way == 0.0))[group])
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
        """Triangles of one body at the edges where bodies touch, shape (p, 2), if the windings there are right.

        Around the edge from its lower to its higher end, a triangle that runs the other way begins a body, as its normal
        points outwards, and one that runs this way ends it.
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
        # faces that lie on each other: what ends there does so before the next begins
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
        return self._at_shared[np.array(pairs)] // 3


class Shape:
    """Normal, area and thickness of triangles; all that deciding about pieces needs."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, rounding: float):
        p = vertices[triangles]
        cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        double_area = np.linalg.norm(cross, axis=1)
        length = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
        # a thousandth of the corners' own rounding is no area: the corners lie on a line
        on_line = double_area <= 1e-3 * rounding * length.max(axis=1)
        self.corners = p
        self.rounding = rounding
        self.area = np.where(on_line, 0.0, 0.5 * double_area)
        self.normal = cross / np.where(double_area > 0.0, double_area, 1.0)[:, None]
        self.longest = length.argmax(axis=1)
        longest = length.max(axis=1)
        self.height = double_area / np.where(longest > 0.0, longest, 1.0)
        self.is_sliver = self.height < SLIVER * rounding

    def select(self, keep: np.ndarray) -> "Shape":
        """The same of some triangles."""
        part = object.__new__(Shape)
        part.__dict__.update({k: v[keep] if isinstance(v, np.ndarray) else v for k, v in self.__dict__.items()})
        return part


def find_pieces(shape: Shape, edges: Edges) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the smooth and of the flat piece of each triangle.

    A sliver's normal is rounding noise. It belongs to the neighbour at its longest edge, and its neighbours there and
    at its other edges are judged as if they touched each other.
    """
    count = len(shape.area)
    sides, sign = edges.sides, np.where(edges.twisted, -1.0, 1.0)
    sliver = shape.is_sliver[sides]
    neighbour = np.full((count, 3), -1)
    for near, far in ((0, 1), (1, 0)):
        neighbour[sides[:, near], edges.opposite[:, near]] = sides[:, far]
    thin = np.flatnonzero(shape.is_sliver)
    across = neighbour[thin, shape.longest[thin]]
    follow = np.stack([thin, across], axis=1)[across >= 0]
    bridge = np.concatenate(
        [np.stack([across, neighbour[thin, (shape.longest[thin] + turn) % 3]], axis=1) for turn in (1, 2)]
    )
    bridge = bridge[(bridge >= 0).all(axis=1)]
    bridge = bridge[~shape.is_sliver[bridge].any(axis=1)]
    clear = ~sliver.any(axis=1)
    pairs = np.concatenate([sides[clear], bridge])
    sign = np.concatenate([sign[clear], np.ones(len(bridge))])
    first, second = shape.normal[pairs[:, 0]], shape.normal[pairs[:, 1]]
    cosine = sign * (first * second).sum(axis=1)
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    smooth = np.arctan2(sine, cosine) < SMOOTH_ANGLE - ANGLE_ROUNDING
    # rounding of the corners turns a normal by up to rounding / height
    loose = shape.rounding * (1.0 / shape.height[pairs]).sum(axis=1)
    flat = smooth & (sine <= loose)
    return tuple(components(count, np.concatenate([pairs[joined], follow])) for joined in (smooth, flat))


def components(count: int, pairs: np.ndarray) -> np.ndarray:
    """Label of the connected component of each of `count` nodes: its least node, shape (count,).

    Labels sink along the pairs and along themselves (pointer jumping) until none changes; about log(count) rounds.
    """
    label = np.arange(count)
    a, b = pairs.T
    while True:
        low = np.minimum(label[a], label[b])
        before = label.copy()
        # hook the root of each end, not only the end itself, to the lower label
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


def fit_planes(shape: Shape, plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normal (p, 3) and offset (p,) of each flat piece: area-weighted means over its triangles."""
    count = int(plane.max()) + 1
    first = np.full(count, len(plane))
    np.minimum.at(first, plane, np.arange(len(plane)))
    # triangles wound the other way would cancel: count all as their piece's first one
    turn = np.where((shape.normal * shape.normal[first][plane]).sum(axis=1) < 0.0, -1.0, 1.0)
    weight = shape.area / np.bincount(plane, shape.area, count)[plane]

    def mean(values):
        return np.stack([np.bincount(plane, weight * values[:, k], count) for k in range(3)], axis=1)

    normal = mean(shape.normal * turn[:, None])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return normal, (normal * mean(shape.corners.mean(axis=1))).sum(axis=1)


def split_bent(shape: Shape, plane: np.ndarray) -> np.ndarray:
    """Flat pieces that are not flat as a whole fall apart into their triangles.

    On a surface tessellated so finely that neighbours differ by no more than rounding, joining neighbours would go on
    around the bend.
    """
    plane = renumber(plane)
    solid = shape.area > 0.0
    flat = np.unique(plane[solid])
    number = np.searchsorted(flat, plane[solid])
    normal, offset = fit_planes(shape.select(solid), number.astype(np.int64))
    corners = shape.corners[solid]
    gap = np.abs((corners * normal[number][:, None]).sum(axis=2) - offset[number][:, None]).max(axis=1)
    worst = np.zeros(len(flat))
    np.maximum.at(worst, number, gap)
    bent = np.zeros(int(plane.max()) + 1, bool)
    bent[flat] = worst > 4.0 * shape.rounding
    return np.where(bent[plane], len(plane) + np.arange(len(plane)), plane)
