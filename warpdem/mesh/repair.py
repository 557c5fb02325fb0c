"""Repair of the triangles of a mesh file: duplicates and windings.

Triangles that are there twice count once. In a closed mesh, triangles that are wound against their neighbours are turned
round, and so are whole bodies: with outward normals, one more normal points inwards for each body that a body lies in.
Nothing else is changed; what cannot be mended is counted and said with its place.
"""

import math

import numpy as np

from warpdem.mesh.bodies import MOST_BODIES
from warpdem.mesh.edges import Edges
from warpdem.mesh.grouping import components, first_and_group

PROBES = 8
"""Points of a body that must agree on which other bodies it lies in [-]."""


def first_of_each(triangles: np.ndarray) -> np.ndarray:
    """Whether a triangle is the first with its three corners, whichever way they run, shape (t, 3) gives (t,)."""
    first = np.zeros(len(triangles), bool)
    first[first_and_group(np.sort(triangles, axis=1))[0]] = True
    return first


def not_cancelled(triangles: np.ndarray, solid: np.ndarray, single: np.ndarray, distinct: np.ndarray) -> np.ndarray:
    """Which triangles count, shape (t,): the first of each, but none of those at which two bodies touch face to face.

    There a triangle is there twice, once for each body and with opposite windings. Left in once it would fork the surface;
    that both are left out is only meant where nothing stays open then.

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
    way = np.bincount(group, np.where(following[:, 0] < following[:, 1], 1.0, -1.0))
    meant = single & (way[group] != 0.0)
    return meant if Edges(triangles[np.where(solid, meant, distinct)]).is_closed else single


def wrongly_wound(vertices: np.ndarray, triangles: np.ndarray, edges: Edges, area: np.ndarray) -> np.ndarray:
    """Which triangles of a closed mesh to turn round so that all are wound alike, shape (t,).

    In each body the smaller part of its area is turned; among bodies those that disagree with most of the area. A
    one-sided surface (Klein's bottle) has no such winding; nothing of it is turned, nor whole bodies beside it.

    Args:
        vertices: Corners [m], shape (v, 3).
        triangles: Corner numbers, shape (t, 3).
        edges: Their edges.
        area: Area of each triangle [m2], shape (t,).
    """
    count = len(triangles)
    a, b = edges.sides.T
    # each triangle stands for two: as it is, and (count further on) turned round; those that fit together are joined
    other = np.where(edges.twisted, count, 0)
    c, d = edges.pairs_at_shared(vertices, triangles).T
    fits = np.concatenate(
        [np.stack(pair, axis=1) for pair in ((a, b + other), (a + count, b + count - other), (c, d), (c + count, d + count))]
    )
    as_is, turned = components(2 * count, fits).reshape(2, count)
    body = first_and_group(np.minimum(as_is, turned)[:, None])[1]
    wrong = as_is > turned
    one_sided = np.bincount(body, as_is == turned) > 0
    wrong ^= (2.0 * np.bincount(body, area * wrong) > np.bincount(body, area))[body]
    if one_sided.any() or not 1 < body.max() + 1 <= MOST_BODIES:
        return wrong
    wound = np.where(wrong[:, None], triangles[:, ::-1], triangles)
    inverted, doubt = _inverted_bodies(vertices[wound], body)
    of_area = np.bincount(body, area)
    if of_area[inverted & ~doubt].sum() > of_area[~inverted & ~doubt].sum():
        inverted = ~inverted
    return wrong ^ (inverted & ~doubt)[body]


def _inverted_bodies(corners: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether the normals of a body point the wrong way: outwards is right for one that lies in an even number of others.

    A body that is partly in another is in doubt.

    Args:
        corners: Corners of the triangles [m], shape (t, 3, 3), wound alike within each body.
        body: Number of the body of each triangle, shape (t,).

    Returns:
        For each body whether it is inverted, and whether that is in doubt.
    """
    count = int(body.max()) + 1
    order = np.argsort(body, kind="stable")
    parts = [corners[which] for which in np.split(order, np.cumsum(np.bincount(body))[:-1])]
    low, high = np.array([[p.min(axis=(0, 1)), p.max(axis=(0, 1))] for p in parts]).transpose(1, 0, 2)
    volume = np.array([np.linalg.det(p - p.mean(axis=(0, 1))).sum() for p in parts])
    depth, doubt = np.zeros(count, int), np.zeros(count, bool)
    for k, part in enumerate(parts):
        probes = part[:: max(1, len(part) // PROBES)].mean(axis=1)
        near = ((low <= high[k]) & (low[k] <= high)).all(axis=1)
        near[k] = False
        for around in np.flatnonzero(near):
            held = np.array([abs(_winding(parts[around], point)) > 0.5 for point in probes])
            doubt[k] |= held.any() and not held.all()
            depth[k] += bool(held[0])
    return (volume < 0.0) != (depth % 2 == 1), doubt


def _winding(corners: np.ndarray, point: np.ndarray) -> float:
    """How often closed triangles (t, 3, 3) run round a point: the sum of their solid angles over 4 pi.

    Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    a, b, c = (corners - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(arm, axis=1) for arm in (a, b, c))
    top = (a * np.cross(b, c)).sum(axis=1)
    bottom = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return float(np.arctan2(top, bottom).sum()) / (2.0 * math.pi)
