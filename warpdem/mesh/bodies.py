"""Several closed bodies in one mesh, in or beside each other, or put together without a boolean union so that they cut.

Each is a surface of its own, and each part of it is a wall, also what lies in another body. A point is inside the mesh when an
odd number of bodies hold it: so a vessel with lifters through its side has its inside between them, as one with a body
quite in it has, and going through any surface leads from inside to outside or back.
"""

from collections.abc import Callable

import numpy as np

from warpdem.mesh.distance import DistanceQuery
from warpdem.mesh.edges import Edges
from warpdem.mesh.grouping import components, renumber

MOST_BODIES = 1000
"""Bodies up to which is found out which lie in which [-]: the effort grows with their square."""


class Bodies:
    """Bodies in groups, so that the boxes around those of one group are apart.

    Attributes:
        group: Group of each triangle that has an area, shape (t,).
        outward: Whether each of these is wound outwards for its own body, shape (t,).
        note: For people, how many they are and where they cut or touch each other first; "" if they do not.
    """

    def __init__(self, group: np.ndarray, outward: np.ndarray, note: str) -> None:
        self.group, self.outward, self.note = group, outward, note

    def distances(self, vertices: np.ndarray, triangles: np.ndarray) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Function of points (n, 3) [m] that gives their signed distance [m] and its gradient, see `DistanceQuery`."""
        wound = np.where(self.outward[:, None], triangles, triangles[:, ::-1])
        queries = [DistanceQuery(vertices, wound[self.group == k]) for k in range(int(self.group.max()) + 1)]

        def signed_distance(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            found = [query(points) for query in queries]
            distance, gradient = (np.stack(values) for values in zip(*found, strict=True))
            nearest = np.abs(distance).argmin(axis=0)[None]
            outside = np.where((distance < 0.0).sum(axis=0) % 2 == 1, -1.0, 1.0)
            own = np.take_along_axis(distance, nearest, axis=0)[0]
            # the nearest surface may lie within other bodies: then its outward side is the mesh's inner one
            turn = outside * np.where(own < 0.0, -1.0, 1.0)
            way = np.take_along_axis(gradient, nearest[..., None], axis=0)[0]
            return outside * np.abs(own), way * turn[:, None]

        return signed_distance


def find_bodies(vertices: np.ndarray, triangles: np.ndarray, edges: Edges, solid: np.ndarray) -> Bodies | None:
    """The bodies of a closed mesh if some may lie in each other, touch or cut; else None.

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
    if not 1 < count <= MOST_BODIES:
        return None
    corners = vertices[triangles]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, body, corners.min(axis=1))
    np.maximum.at(high, body, corners.max(axis=1))
    apart = ((low[:, None] > high) | (high[:, None] < low)).any(axis=2)
    if (apart | np.eye(count, dtype=bool)).all():
        return None
    volume = np.bincount(body, np.linalg.det(corners - 0.5 * (low + high)[body][:, None]))
    outward = (volume >= 0.0)[body]
    group = _groups(apart, high - low)[body]
    note, place = "", _first_cut(vertices, np.where(outward[:, None], triangles, triangles[:, ::-1]), group)
    if place is not None:
        note = (
            f"{count} closed bodies, of which some cut each other, first at ({_text(place)}) m: all their surfaces act on "
            "grains, and what an odd number of them hold is inside; join them (boolean union) where they are meant as one"
        )
    elif len(edges.shared):
        place = vertices[edges.shared[0]].mean(axis=0)
        note = f"{count} closed bodies, of which some touch along edges, first at ({_text(place)}) m"
    return Bodies(group, outward, note)


def _text(place: np.ndarray) -> str:
    return ", ".join(f"{x:.6g}" for x in place)


def _groups(apart: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Number of a group for each body, the largest first, so that the boxes around those of one group are apart."""
    group = np.full(len(apart), -1)
    for k in np.argsort(-size.prod(axis=1), kind="stable"):
        taken = group[~apart[k]]
        group[k] = np.setdiff1d(np.arange(len(apart) + 1), taken)[0]
    return group


def _first_cut(vertices: np.ndarray, triangles: np.ndarray, group: np.ndarray) -> np.ndarray | None:
    """Where a body leads through the surface of another first [m]: the middle of an edge that does; None if none does."""
    first = None
    start, end = vertices[triangles].reshape(-1, 3), vertices[np.roll(triangles, -1, axis=1)].reshape(-1, 3)
    number = np.repeat(np.arange(len(triangles)), 3)
    for k in range(int(group.max()) + 1):
        query, other = DistanceQuery(vertices, triangles[group == k]), np.flatnonzero(group[number] != k)
        cut = other[query.pierced(start[other], end[other])]
        if len(cut) and (first is None or cut[0] < first):
            first = int(cut[0])
    return None if first is None else 0.5 * (start[first] + end[first])
