"""Triangulation of the polygons of mesh files: fans for convex polygons, ear clipping for others."""

import numpy as np

MAX_CONCAVE = 5000
"""Largest number of corners of a polygon for ear clipping [-]: the effort grows with its square."""


def triangulate(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Triangles of polygons, polygon after polygon, with the winding of the polygons.

    Args:
        points: Corners, shape (v, 3).
        counts: Number of corners of each polygon, shape (f,).
        indices: Corner numbers, polygon after polygon, shape (sum of counts,).

    Returns:
        Corner numbers of each triangle, shape (t, 3), int64.

    Raises:
        ValueError: The counts do not fit the indices, a polygon has fewer than three corners, a corner does not exist, or
            a polygon that is not convex has more than `MAX_CONCAVE` corners. The text names it.
    """
    counts, indices = np.asarray(counts, np.int64).ravel(), np.asarray(indices, np.int64).ravel()
    few = counts < 3
    if few.any():
        at = int(np.argmax(few))
        raise ValueError(f"face {at} has {counts[at]} corners, at least 3 are needed")
    # in floating point: the sum of counts from a damaged file may exceed 64 bits
    if counts.sum(dtype=float) != len(indices):
        raise ValueError(f"the faces have {counts.sum(dtype=float):.0f} corners in all, but {len(indices)} are given")
    wrong = (indices < 0) | (indices >= len(points))
    if wrong.any():
        at = int(np.argmax(wrong))
        raise ValueError(f"a face names the point {indices[at]}, there are the points 0 to {len(points) - 1}")
    # a corner that is not a number is refused later, with its triangle
    with np.errstate(invalid="ignore", over="ignore"):
        return _triangulated(points, counts, indices)


def _triangulated(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """As `triangulate`, for valid faces."""
    first = np.cumsum(counts) - counts
    faces, triangles = [], []
    for corners in np.unique(counts):
        number = np.flatnonzero(counts == corners)
        polygon = indices[first[number, None] + np.arange(corners)]
        concave = np.zeros(len(number), bool) if corners == 3 else ~_is_convex(points[polygon])
        convex, k = polygon[~concave], np.arange(1, corners - 1)
        fan = np.stack([np.broadcast_to(convex[:, :1], (len(convex), corners - 2)), convex[:, k], convex[:, k + 1]], axis=2)
        triangles.append(fan.reshape(-1, 3))
        faces.append(np.repeat(number[~concave], corners - 2))
        for which in np.flatnonzero(concave):
            if corners > MAX_CONCAVE:
                raise ValueError(
                    f"face {number[which]} is not convex and has {corners} corners, allowed are {MAX_CONCAVE}; triangulate "
                    "it in the program that made the mesh"
                )
            triangles.append(polygon[which][_ears(_projected(points[polygon[which]]))])
            faces.append(np.full(corners - 2, number[which]))
    if not triangles:
        return np.zeros((0, 3), np.int64)
    return np.concatenate(triangles)[np.argsort(np.concatenate(faces), kind="stable")]


def _normal(polygon: np.ndarray) -> np.ndarray:
    """Twice the vector area of polygons, shape (..., n, 3) gives (..., 3) (Newell)."""
    arm = polygon - polygon[..., :1, :]
    return np.asarray(np.cross(arm, np.roll(arm, -1, axis=-2)).sum(axis=-2))


def _is_convex(polygon: np.ndarray) -> np.ndarray:
    """Whether a polygon has no reflex corner, shape (f, n, 3) gives (f,)."""
    edge = np.roll(polygon, -1, axis=1) - polygon
    bend = np.cross(np.roll(edge, 1, axis=1), edge)
    return np.asarray(((bend * _normal(polygon)[:, None]).sum(axis=2) >= 0.0).all(axis=1))


def _projected(polygon: np.ndarray) -> np.ndarray:
    """Counterclockwise projection of a polygon (n, 3) along the axis nearest to its normal, shape (n, 2)."""
    normal = _normal(polygon)
    axis = int(np.argmax(np.abs(normal)))
    seen = polygon[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return seen if normal[axis] >= 0.0 else seen * [1.0, -1.0]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _ears(p: np.ndarray) -> np.ndarray:
    """Triangles of a counterclockwise polygon (n, 2) by ear clipping, shape (n - 2, 3).

    A polygon that intersects itself may have no ear; then the sharpest corner is clipped.
    """
    ring = list(range(len(p)))
    triangles = []
    start = 0
    while len(ring) > 3:
        here = np.array(ring)
        before, after = np.roll(here, 1), np.roll(here, -1)
        corner = _cross(p[here] - p[before], p[after] - p[here])
        # an ear contains no reflex corner
        reflex = here[corner <= 0.0]
        order = np.roll(np.arange(len(ring)), -start)
        found = next((k for k in order if corner[k] > 0.0 and not _holds(p, before[k], here[k], after[k], reflex)), None)
        ear = int(np.argmax(corner)) if found is None else int(found)
        triangles.append((before[ear], here[ear], after[ear]))
        del ring[ear]
        # continuing from here avoids a fan of slivers about one corner
        start = ear % len(ring)
    return np.array([*triangles, ring], dtype=np.int64)


def _holds(p: np.ndarray, a: int, b: int, c: int, others: np.ndarray) -> bool:
    """Whether the triangle a, b, c of points (n, 2) contains one of the others that is none of its corners."""
    q = p[others[~np.isin(others, (a, b, c))]]
    corners = p[[a, b, c]]
    edge = np.roll(corners, -1, axis=0) - corners
    return bool((_cross(edge, q[:, None] - corners) >= 0.0).all(axis=1).any())
