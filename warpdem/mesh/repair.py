"""Repair of the triangles of a mesh file: duplicates and windings.

Duplicate triangles count once. In a closed mesh, triangles whose winding is opposite to that of their neighbours are flipped,
and so are whole bodies: the normals of a body point outwards if it lies in an even number of other bodies. Nothing else is
changed; faults that cannot be repaired are reported with their number and position.
"""

import math

import numpy as np

from warpdem.mesh.bodies import MAX_BODIES
from warpdem.mesh.edges import Edges
from warpdem.mesh.grouping import components, first_and_group

PROBES = 8
"""Number of points of a body that must agree on the bodies that contain it [-]."""
ON_SURFACE = 1e-4
"""Distance of a point from a triangle over its size below which it lies on it [-]: far above the rounding of corners."""


def first_of_each(triangles: np.ndarray) -> np.ndarray:
    """Whether a triangle is the first with its three corners, in any order; shape (t, 3) gives (t,)."""
    first = np.zeros(len(triangles), bool)
    first[first_and_group(np.sort(triangles, axis=1))[0]] = True
    return first


def not_cancelled(triangles: np.ndarray, solid: np.ndarray, single: np.ndarray, distinct: np.ndarray) -> np.ndarray:
    """Which triangles count, shape (t,): the first of duplicates, but none of those at which two bodies touch face to face.

    Such a triangle exists twice, once for each body, with opposite windings. If one of them stayed, its edges would be
    non-manifold. Both are left out only if no edge is open then.

    Args:
        triangles: Corner numbers, shape (t, 3).
        solid: Whether each has an area.
        single: Whether each is the first with its corners, see `first_of_each`.
        distinct: Whether its three corners are three.
    """
    if single[solid].all() or Edges(triangles[np.where(solid, single, distinct)]).is_closed:
        return single
    group = first_and_group(np.sort(triangles, axis=1))[1]
    low = triangles.argmin(axis=1)[:, None]
    following = np.take_along_axis(triangles, np.concatenate([(low + 1) % 3, (low + 2) % 3], axis=1), axis=1)
    winding = np.bincount(group, np.where(following[:, 0] < following[:, 1], 1.0, -1.0))
    counted: np.ndarray = single & (winding[group] != 0.0)
    return counted if Edges(triangles[np.where(solid, counted, distinct)]).is_closed else single


def wrongly_wound(vertices: np.ndarray, triangles: np.ndarray, edges: Edges, area: np.ndarray) -> np.ndarray:
    """Which triangles of a closed mesh to flip so that all windings are consistent, shape (t,).

    In each body the smaller part of its area is flipped; among bodies those that disagree with most of the area. A one-sided
    surface (Klein bottle) has no consistent winding; nothing of it is flipped, nor other bodies of the mesh.

    Args:
        vertices: Corners [m], shape (v, 3).
        triangles: Corner numbers, shape (t, 3).
        edges: Their edges.
        area: Area of each triangle [m2], shape (t,).
    """
    count = len(triangles)
    a, b = edges.sides.T
    # each triangle has two nodes: as it is, and (offset by count) flipped; consistent neighbours are joined
    other = np.where(edges.twisted, count, 0)
    c, d = edges.pairs_at_shared(vertices, triangles).T
    fits = np.concatenate(
        [np.stack(pair, axis=1) for pair in ((a, b + other), (a + count, b + count - other), (c, d), (c + count, d + count))]
    )
    as_is, flipped = components(2 * count, fits).reshape(2, count)
    body = first_and_group(np.minimum(as_is, flipped)[:, None])[1]
    wrong: np.ndarray = as_is > flipped
    one_sided = np.bincount(body, as_is == flipped) > 0
    wrong ^= (2.0 * np.bincount(body, area * wrong) > np.bincount(body, area))[body]
    if one_sided.any() or not 1 < body.max() + 1 <= MAX_BODIES:
        return wrong
    wound = np.where(wrong[:, None], triangles[:, ::-1], triangles)
    inverted, doubt = _inverted_bodies(vertices[wound], body)
    of_area = np.bincount(body, area)
    if of_area[inverted & ~doubt].sum() > of_area[~inverted & ~doubt].sum():
        inverted = ~inverted
    return np.asarray(wrong ^ (inverted & ~doubt)[body])


def _inverted_bodies(corners: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether the normals of a body point the wrong way: outwards is right if it lies in an even number of others.

    A body that is partly inside another is undecided. Where two touch face to face, points of the one on the surface of the
    other are neither in it nor out of it and are not asked; a body that has no other points is undecided.

    Args:
        corners: Corners of the triangles [m], shape (t, 3, 3), wound alike within each body.
        body: Number of the body of each triangle, shape (t,).

    Returns:
        For each body whether it is inverted, and whether it is undecided.
    """
    count = int(body.max()) + 1
    order = np.argsort(body, kind="stable")
    parts = [corners[which] for which in np.split(order, np.cumsum(np.bincount(body))[:-1])]
    low, high = np.array([[p.min(axis=(0, 1)), p.max(axis=(0, 1))] for p in parts]).transpose(1, 0, 2)
    volume = np.array([np.linalg.det(p - p.mean(axis=(0, 1))).sum() for p in parts])
    depth, doubt = np.zeros(count, int), np.zeros(count, bool)
    for k, part in enumerate(parts):
        probes = part.mean(axis=1)
        near = ((low <= high[k]) & (low[k] <= high)).all(axis=1)
        near[k] = False
        for around in np.flatnonzero(near):
            held = _held(probes, parts[around])
            doubt[k] |= not held or len(set(held)) > 1
            depth[k] += bool(held and held[0])
    return (volume < 0.0) != (depth % 2 == 1), doubt


def _held(points: np.ndarray, corners: np.ndarray) -> list[bool]:
    """Whether each of up to about `PROBES` of points (n, 3) is inside closed triangles (t, 3, 3), without those on them."""
    held: list[bool] = []
    stride = max(1, len(points) // PROBES)
    for first in range(stride):  # the next ones only while all are on the surface
        winding = [_winding(corners, point) for point in points[first::stride]]
        held = [abs(turns) > 0.5 for turns in winding if turns is not None]
        if held:
            break
    return held


def _winding(corners: np.ndarray, point: np.ndarray) -> float | None:
    """Winding number of closed triangles (t, 3, 3) about a point, None on one of them: the sum of their solid angles over 4 pi.

    On a triangle the solid angle jumps from -2 pi to 2 pi, and its sign would be one of rounding.
    Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    a, b, c = (corners - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(arm, axis=1) for arm in (a, b, c))
    top = (a * np.cross(b, c)).sum(axis=1)
    bottom = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    near = ON_SURFACE * la * lb * lc
    if ((np.abs(top) < near) & (bottom < near)).any():
        return None
    return float(np.arctan2(top, bottom).sum()) / (2.0 * math.pi)
