"""Several closed bodies in one mesh: separate, nested, or intersecting because no boolean union was made.

Each body is a surface of its own, and all of it is a wall, also the part inside another body. A point is inside the mesh if an
odd number of bodies contain it. So the inside of a vessel with lifters through its side is the space between them, and crossing
any surface leads from inside to outside or back.
"""

from collections.abc import Callable

import numpy as np

from warpdem.mesh.distance import DistanceQuery
from warpdem.mesh.edges import Edges
from warpdem.mesh.grouping import components, renumber

MAX_BODIES = 1000
"""Largest number of bodies whose nesting is determined [-]: the effort grows with its square."""


class Bodies:
    """Closed bodies in groups; the bounding boxes of the bodies of one group are disjoint.

    Attributes:
        group: Group of each triangle that has an area, shape (t,).
        outward: Whether the normal of each of these points out of its own body, shape (t,).
        note: Text for the user: number of bodies and the position of the first intersection or contact; "" if there is none.
        intersect: Whether the surface of one passes through that of another.
    """

    def __init__(self, group: np.ndarray, outward: np.ndarray, note: str, intersect: bool) -> None:
        self.group, self.outward, self.note, self.intersect = group, outward, note, intersect

    def distances(self, vertices: np.ndarray, triangles: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Function of points (n, 3) [m] that gives their signed distance [m] and its gradient, see `DistanceQuery`."""
        wound = np.where(self.outward[:, None], triangles, triangles[:, ::-1])
        queries = [DistanceQuery(vertices, wound[self.group == k]) for k in range(int(self.group.max()) + 1)]

        def signed_distance(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            found = [query(points) for query in queries]
            distance, gradient = (np.stack(values) for values in zip(*found, strict=True))
            nearest = np.abs(distance).argmin(axis=0)[None]
            outside = np.where((distance < 0.0).sum(axis=0) % 2 == 1, -1.0, 1.0)
            nearest_distance = np.take_along_axis(distance, nearest, axis=0)[0]
            # the nearest surface may lie within other bodies: its outward side then is the inside of the mesh
            sign = outside * np.where(nearest_distance < 0.0, -1.0, 1.0)
            direction = np.take_along_axis(gradient, nearest[..., None], axis=0)[0]
            return outside * np.abs(nearest_distance), direction * sign[:, None]

        return signed_distance


def find_bodies(vertices: np.ndarray, triangles: np.ndarray, edges: Edges, solid: np.ndarray) -> Bodies | None:
    """The bodies of a closed mesh if some may be nested, touch or intersect; else None.

    Args:
        vertices: Corners [m], shape (v, 3).
        triangles: Corner numbers, shape (t, 3).
        edges: Their edges.
        solid: Whether a triangle has an area, shape (t,).
    """
    if not edges.is_closed or len(edges.forked) or edges.twisted.any():
        return None
    joined = np.concatenate([edges.sides, edges.pairs_at_shared(vertices, triangles)])
    body = renumber(components(len(triangles), joined)[solid])
    triangles = triangles[solid]
    count = int(body.max()) + 1
    if not 1 < count <= MAX_BODIES:
        return None
    corners = vertices[triangles]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, body, corners.min(axis=1))
    np.maximum.at(high, body, corners.max(axis=1))
    apart = np.asarray(((low[:, None] > high) | (high[:, None] < low)).any(axis=2))
    if (apart | np.eye(count, dtype=bool)).all():
        return None
    volume = np.bincount(body, np.linalg.det(corners - 0.5 * (low + high)[body][:, None]))
    outward = (volume >= 0.0)[body]
    group = _groups(apart, high - low)[body]
    note, position = "", _first_intersection(vertices, np.where(outward[:, None], triangles, triangles[:, ::-1]), group)
    intersect = position is not None
    if position is not None:
        note = (
            f"{count} closed bodies, of which some intersect, first at ({_text(position)}) m: all their surfaces act on "
            "grains, and a point in an odd number of them is inside; use a boolean union if they are meant as one body"
        )
    elif len(edges.shared):
        position = vertices[edges.shared[0]].mean(axis=0)
        note = f"{count} closed bodies, of which some touch along edges, first at ({_text(position)}) m"
    return Bodies(group, outward, note, intersect)


def _text(position: np.ndarray) -> str:
    return ", ".join(f"{x:.6g}" for x in position)


def _groups(apart: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Group number of each body, largest body first, so that the bounding boxes within a group are disjoint."""
    group = np.full(len(apart), -1)
    for k in np.argsort(-size.prod(axis=1), kind="stable"):
        occupied = group[~apart[k]]
        group[k] = np.setdiff1d(np.arange(len(apart) + 1), occupied)[0]
    return group


def _first_intersection(vertices: np.ndarray, triangles: np.ndarray, group: np.ndarray) -> np.ndarray | None:
    """Midpoint [m] of the first edge of a body that passes through the surface of another; None if there is none."""
    first = None
    start, end = vertices[triangles].reshape(-1, 3), vertices[np.roll(triangles, -1, axis=1)].reshape(-1, 3)
    number = np.repeat(np.arange(len(triangles)), 3)
    for k in range(int(group.max()) + 1):
        query, other = DistanceQuery(vertices, triangles[group == k]), np.flatnonzero(group[number] != k)
        crossing = other[query.pierced(start[other], end[other])]
        if len(crossing) and (first is None or crossing[0] < first):
            first = int(crossing[0])
    return None if first is None else 0.5 * (start[first] + end[first])
