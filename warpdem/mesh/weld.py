"""Welding of the corners of separate triangles: equal corners, and corners that differ by no more than the file's rounding.

An STL file repeats each corner in every triangle, and programs write one corner in more than one way: 1.2e-16 for a cosine of
90 degrees in one facet and 0 in the next, or another last digit. Corners that are equal in float32 are always joined. Other
corners are joined only where the surface has a gap (at edges of an odd number of triangles), nearest first, within

    2^-22 of the largest coordinate: two units in the last place of float32, or
    1e-6, 1e-5 of it where all numbers are written with seven, with six digits: one unit in the last place of these,

and only where that closes edges. So a surface without gaps is not changed, however small its features, and no triangle with an
area loses a corner. The result does not depend on the order of the triangles.
"""

import itertools

import numpy as np

from warpdem.mesh.grouping import components, first_and_group
from warpdem.mesh.pieces import ROUNDING, Shape

BINARY = (2.0**-40, 2.0**-26, 2.0**-22)
"""Distances to try, over the largest coordinate [-]: first rounded zeros, then the rounding of float32."""
MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd multipliers that hash cells to 64 bits [-]."""
DECIMAL = {7: 1.05e-6, 6: 1.05e-5}
"""One unit in the last of so many digits, over the largest number [-]; numbers of fewer digits are exact."""


def weld(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, int, float]:
    """Vertices (v, 3) and corner numbers (t, 3) of triangles (t, 3, 3), in the order of the file.

    Returns:
        Vertices, corner numbers, the number of vertices that were joined with others not equal in float32, and their largest
        distance, in units of the file.
    """
    vertices, triangles = _equal(corners)
    loose, gaps = _open_ends(triangles)
    if not gaps:
        return vertices, triangles, 0, 0.0
    before, largest = len(vertices), float(np.abs(vertices).max())
    # only these triangles may change
    at_loose = np.isin(np.arange(before), loose)
    near = np.flatnonzero(at_loose[triangles].any(axis=1))
    part, farthest = triangles[near], 0.0
    for fraction in _relative_distances(corners):
        kept = _joined(vertices, part, loose, fraction * largest)
        left, open_still = _open_ends(kept[part], at_loose)
        if open_still < gaps:
            moved = np.linalg.norm(vertices - vertices[kept], axis=1)
            farthest, part, loose, gaps = max(farthest, float(moved.max())), kept[part], left, open_still
        if not gaps:
            break
    if farthest == 0.0:
        return vertices, triangles, 0, 0.0
    triangles[near] = part
    used, triangles = np.unique(triangles, return_inverse=True)
    return vertices[used], triangles.reshape(-1, 3), before - len(used), farthest


def _equal(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and corner numbers: corners equal in float32 become one, in the order of the file."""
    flat = corners.reshape(-1, 3)
    rough = flat.astype(np.float32) + np.float32(0.0)  # makes -0 and 0 alike
    first, group = first_and_group(rough.view(np.uint32))
    # text files hold more digits than float32: the first corner of a group keeps them
    return flat[first] + 0.0, group.reshape(-1, 3)


def _open_ends(triangles: np.ndarray, among: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    """Ends of the edges of an odd number of triangles, ascending, and the number of such edges.

    A duplicate triangle counts once.

    Args:
        triangles: Corner numbers, shape (t, 3).
        among: Vertices at which such edges are possible, bool, shape (v,); None for all.
    """
    once = triangles[first_and_group(np.sort(triangles, axis=1))[0]]
    edge = np.sort(np.stack([once, np.roll(once, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edge = edge[edge[:, 0] != edge[:, 1]]
    if among is not None:
        edge = edge[among[edge].all(axis=1)]
    size = int(edge.max(initial=0)) + 1
    key, uses = np.unique(edge[:, 0] * size + edge[:, 1], return_counts=True)
    odd = key[uses % 2 == 1]
    return np.unique(np.divmod(odd, size)), len(odd)


def _relative_distances(corners: np.ndarray) -> list[float]:
    """Distances to try over the largest coordinate [-], ascending."""
    values = np.abs(corners[corners != 0.0])
    for digits in sorted(DECIMAL):
        scaled = values * 10.0 ** (digits - 1.0 - np.floor(np.log10(values)))
        # a rounded zero either was not written with so many digits, or does not matter
        if (np.abs(scaled - np.rint(scaled)) <= 1e-6).all():
            return [*BINARY, *(DECIMAL[d] for d in sorted(DECIMAL, reverse=True) if d >= digits)]
    return list(BINARY)


def _joined(vertices: np.ndarray, triangles: np.ndarray, loose: np.ndarray, distance: float) -> np.ndarray:
    """Vertex that replaces each vertex, shape (v,): ``loose`` ones within about ``distance`` of each other are joined.

    Of a cluster the vertex with the most triangles is kept, among equals the lowest by its coordinates.
    """
    points = vertices[loose]
    label = components(len(points), _close(points, distance))
    cluster = np.arange(len(vertices))
    cluster[loose] = loose[label]
    # two corners of a triangle with an area are never joined, nor is the rest of their cluster
    moving = triangles[(cluster[triangles] != triangles).any(axis=1)]
    solid = moving[Shape(vertices, moving, ROUNDING * np.abs(vertices).max()).area > 0.0]
    of_corner = cluster[solid]
    lost = (of_corner == np.roll(of_corner, 1, axis=1)) & (solid != np.roll(solid, 1, axis=1))
    blocked = np.zeros(len(vertices), bool)
    blocked[of_corner[lost]] = True
    cluster = np.where(blocked[cluster], np.arange(len(vertices)), cluster)
    uses = np.bincount(triangles.ravel(), minlength=len(vertices))[loose]
    order = np.lexsort((*points.T[::-1], -uses, cluster[loose]))
    begins = np.ones(len(order), bool)
    begins[1:] = np.diff(cluster[loose][order]) != 0
    kept = np.arange(len(vertices))
    kept[loose[order]] = loose[order][np.maximum.accumulate(np.where(begins, np.arange(len(order)), 0))]
    return kept


def _close(points: np.ndarray, distance: float) -> np.ndarray:
    """Pairs (k, 2) that link all points (n, 3) within ``distance`` along each axis, and none beyond twice the distance.

    Two such points share a cell of edge 2 ``distance`` in at least one of eight grids, each shifted by half a cell or not.
    """
    edge = 2.0 * distance
    pairs = [np.zeros((0, 2), np.int64)]
    for shift in itertools.product((0.0, 0.5), repeat=3):
        cell = np.floor(points / edge + shift).astype(np.int64)
        # a hash of each cell: sorting by it takes a third of the time; collisions are removed below
        mixed = (cell.astype(np.uint64) * MIX).sum(axis=1, dtype=np.uint64)
        first, group = first_and_group(mixed[:, None])
        link = np.stack([first[group], np.arange(len(points))], axis=1)
        same = (cell[link[:, 0]] == cell[link[:, 1]]).all(axis=1)
        pairs.append(link[same & (link[:, 0] != link[:, 1])])
    return np.concatenate(pairs)
