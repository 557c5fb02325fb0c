"""Smooth and flat pieces of a triangle mesh.

A file is usually float32, so two triangles of one flat floor differ by the rounding of their corners; the tolerance within
which they count as one plane follows from that.
"""

import math

import numpy as np

from warpdem.mesh.edges import ANGLE_ROUNDING, Edges
from warpdem.mesh.grouping import components, renumber

SMOOTH_ANGLE = math.radians(30.0)
"""Triangles whose normals differ by less belong to one smooth piece [rad]."""
ROUNDING = 2.0**-21
"""Rounding of a corner in the file relative to the largest coordinate [-]: four units in the last place of float32,
which also covers ASCII files written with seven digits."""
SLIVER = 8.0
"""A triangle thinner than this many roundings has no meaningful normal [-]."""


class Shape:
    """Normal, area and height of triangles, as needed to find pieces."""

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, rounding: float) -> None:
        p = vertices[triangles]
        cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        double_area = np.linalg.norm(cross, axis=1)
        length = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
        # below a thousandth of the rounding of the corners there is no area: the corners are collinear
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
        """The shape of a selection of triangles."""
        part = object.__new__(Shape)
        part.__dict__.update({k: v[keep] if isinstance(v, np.ndarray) else v for k, v in self.__dict__.items()})
        return part


def find_pieces(shape: Shape, edges: Edges) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the smooth piece and of the flat piece of each triangle.

    The normal of a sliver is rounding noise. A sliver belongs to the neighbour at its longest edge, and its neighbours there
    and at its other edges are compared as if they were adjacent.
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
        [np.stack([across, neighbour[thin, (shape.longest[thin] + shift) % 3]], axis=1) for shift in (1, 2)]
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
    # rounding of the corners changes the direction of a normal by up to rounding / height
    loose = shape.rounding * (1.0 / shape.height[pairs]).sum(axis=1)
    flat = smooth & (sine <= loose)
    smooth_label, flat_label = (components(count, np.concatenate([pairs[joined], follow])) for joined in (smooth, flat))
    return smooth_label, flat_label


def folded(shape: Shape, edges: Edges) -> np.ndarray:
    """Whether the two triangles of an edge lie on each other, normals opposite within the rounding of corners, shape (e,).

    Such a fold has no thickness, and which side of it is inside is not defined. Slivers, whose normals are noise, are no folds.
    """
    sides = edges.sides
    first, second = shape.normal[sides[:, 0]], shape.normal[sides[:, 1]]
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    with np.errstate(divide="ignore"):
        loose = shape.rounding * (1.0 / shape.height[sides]).sum(axis=1)
    opposite = ((first * second).sum(axis=1) < 0.0) & (sine <= loose)
    return np.asarray(opposite & ~edges.twisted & ~shape.is_sliver[sides].any(axis=1))


def fit_planes(shape: Shape, plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normal (p, 3) and offset (p,) of each flat piece: area-weighted means over its triangles."""
    count = int(plane.max()) + 1
    first = np.full(count, len(plane))
    np.minimum.at(first, plane, np.arange(len(plane)))
    # triangles of opposite winding would cancel: all get the winding of the first one of their piece
    sign = np.where((shape.normal * shape.normal[first][plane]).sum(axis=1) < 0.0, -1.0, 1.0)
    weight = shape.area / np.bincount(plane, shape.area, count)[plane]

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(plane, weight * values[:, k], count) for k in range(3)], axis=1)

    normal = mean(shape.normal * sign[:, None])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    return normal, (normal * mean(shape.corners.mean(axis=1))).sum(axis=1)


def split_curved(shape: Shape, plane: np.ndarray) -> np.ndarray:
    """Split flat pieces that are not flat as a whole into their triangles.

    On a surface tessellated so finely that neighbours differ by no more than rounding, joining neighbours would continue along
    its curvature.
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
    curved = np.zeros(int(plane.max()) + 1, bool)
    curved[flat] = worst > 4.0 * shape.rounding
    return np.where(curved[plane], len(plane) + np.arange(len(plane)), plane)
