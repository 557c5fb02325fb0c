"""Mesh files to triangles in metres, mended and taken apart into smooth and flat pieces; distance and volume of closed ones.

Everything after the file is float64.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh import file as mesh_file
from warpdem.mesh import usd_geometry
from warpdem.mesh.bodies import Bodies, find_bodies
from warpdem.mesh.distance import DistanceQuery
from warpdem.mesh.edges import Edges
from warpdem.mesh.grouping import renumber
from warpdem.mesh.pieces import ROUNDING, Shape, find_pieces, fit_planes, split_bent
from warpdem.mesh.repair import first_of_each, not_cancelled, wrongly_wound
from warpdem.mesh.weld import weld
from warpdem.usd.stage import USD_SUFFIXES

LARGEST_NUMBER = 1e30
"""Largest coordinate that is taken for one [-]: its square still fits into a float64, and float32 holds it."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh in metres, placed where it stands at time 0, with its pieces."""

    name: str
    """File it came from, for messages."""
    vertices: np.ndarray
    """Corners [m], shape (v, 3), float64; corners that are one in the file are one here."""
    triangles: np.ndarray
    """Corner numbers of each triangle, shape (t, 3), int32."""
    dropped: int
    """Triangles without area that the file held and that were left out."""
    duplicates: int
    """Triangles that the file held a second time and that were left out."""
    turned: int
    """Triangles of a closed mesh that were wound the wrong way and were turned round."""
    open_edges: int
    """Edges that only one triangle has."""
    forked_edges: int
    """Edges at which three or more triangles meet that do not close a surface: as many run one way as the other in those of
    bodies that touch."""
    twisted_edges: int
    """Edges whose two triangles are wound against each other."""
    bodies: Bodies | None
    """The closed bodies, if there are several that may lie in each other, touch or cut; else None."""
    notes: tuple[str, ...]
    """What was mended, left out or is odd, each with its count and the place of the first, for people."""
    volume: float
    """Enclosed volume [m3]; negative when the normals of a closed mesh point inwards, without meaning when open."""
    bounds: np.ndarray
    """Least and greatest corner [m], shape (2, 3)."""
    piece: np.ndarray
    """Smooth piece each triangle belongs to, shape (t,), int32: joined where they meet below `SMOOTH_ANGLE`."""
    plane: np.ndarray
    """Flat piece each triangle belongs to, shape (t,), int32."""
    plane_normal: np.ndarray
    """Unit normal of each flat piece [-], shape (p, 3), on the side its triangles turn to."""
    plane_offset: np.ndarray
    """Offset of each flat piece [m], shape (p,): its points satisfy normal . x = offset."""

    @property
    def is_closed(self) -> bool:
        """Whether the triangles at each edge are two, or as many one way as the other."""
        return self.open_edges == self.forked_edges == 0

    @property
    def corners(self) -> np.ndarray:
        """Corners of each triangle [m], shape (t, 3, 3)."""
        return self.vertices[self.triangles]

    @functools.cached_property
    def _query(self) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        if self.bodies is None:
            # the sign needs outward normals
            return DistanceQuery(self.vertices, self.triangles if self.volume >= 0.0 else self.triangles[:, ::-1])
        return self.bodies.distances(self.vertices, self.triangles)


def load_mesh(
    path, scale=1.0, rotate=None, translate=(0.0, 0.0, 0.0), prim="", key: str = "mesh", folders=None
) -> TriangleMesh:
    """Read a mesh file, weld its corners, then scale, rotate and translate it, and mend it (see `warpdem.mesh.repair`).

    Args:
        path: STL (binary or ASCII), OBJ, PLY or USD file; of a USD file the lengths are metres and z is upwards already.
        scale: Metres per unit of the file [m], one number.
        rotate: None, or an object with `axis` (any length) and `angle` [rad] (turn about the origin).
        translate: Shift after scaling and turning [m].
        prim: Path of a prim of a USD file; "" if the file holds one surface only.
        key: Scene key, for messages.
        folders: Folders that all files which a USD file refers to must lie in; None is no bound.

    Raises:
        SceneError: File missing, unreadable, empty, or with a corner that is not a finite number.
    """
    path, notes = Path(path), ()
    if path.suffix.lower() in USD_SUFFIXES:
        corners, notes = usd_geometry.read_triangles(path, prim, key, folders)
    else:
        corners = mesh_file.read_triangles(path, key)
    pose = (_rotation_matrix(rotate) * float(scale), np.asarray(translate, float))
    return build_mesh(corners, pose, path.name, key, notes)


def build_mesh(
    corners: np.ndarray, pose=None, name: str = "mesh", key: str = "mesh", notes: tuple[str, ...] = ()
) -> TriangleMesh:
    """Mesh of loose triangles.

    Args:
        corners: Corners in units of the file, shape (t, 3, 3).
        pose: None, or matrix (3, 3) and shift (3,) that take the file's coordinates to metres.
        name: Shown in messages.
        key: Scene key, for messages.
        notes: What reading the file has noted already.

    Raises:
        SceneError: No triangle with an area, or a corner that is not a finite number.
    """
    corners = np.asarray(corners, np.float64)
    bad = ~(np.abs(corners) <= LARGEST_NUMBER).all(axis=(1, 2))
    if bad.any():
        first = int(np.argmax(bad))
        raise SceneError(
            f"{key}: {name}: {bad.sum()} of {len(corners)} triangles have a corner that is not a finite number up to "
            f"{LARGEST_NUMBER:g}, the first is triangle {first}: {corners[first].tolist()}"
        )
    vertices, triangles, joined, apart = weld(corners)
    rounding, size = ROUNDING * np.abs(vertices).max(initial=0.0), 1.0
    if pose is not None:
        matrix, shift = pose
        size = np.cbrt(abs(np.linalg.det(matrix)))
        rounding *= size
        vertices = vertices @ matrix.T + shift
    solid, single = Shape(vertices, triangles, rounding).area > 0.0, first_of_each(triangles)
    if not solid.any():
        raise SceneError(f"{key}: {name}: the mesh is empty: none of its {len(corners)} triangles has an area")
    report = _Report(vertices, list(notes))
    report.joined(joined, apart * size)
    dropped = report.triangles(triangles[~solid], "without area left out")
    # a triangle whose corners coincide cancels itself; one with three corners on a line still joins its neighbours
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    meant = not_cancelled(triangles, solid, single, distinct)
    cancelled = report.triangles(
        triangles[solid & single & ~meant], "left out at which bodies touch face to face: two of opposite winding cancel"
    )
    duplicates = report.triangles(triangles[solid & ~single], "that are there twice left out") if not cancelled else cancelled
    triangles = triangles[np.where(solid, meant, distinct)]
    shape, edges = Shape(vertices, triangles, rounding), Edges(triangles)
    turned = 0
    if edges.is_closed:
        wrong = wrongly_wound(vertices, triangles, edges, shape.area)
        turned = report.triangles(triangles[wrong], "wound the wrong way turned round")
    if turned:
        triangles = np.where(wrong[:, None], triangles[:, ::-1], triangles)
        shape, edges = Shape(vertices, triangles, rounding), Edges(triangles)
    report.edges(edges.border, "open edges (of one triangle only)")
    report.edges(edges.forked, "edges at which three or more triangles meet")
    report.edges(edges.ends[edges.twisted], "edges whose two triangles are wound against each other")
    keep = shape.area > 0.0
    bodies = find_bodies(vertices, triangles, edges, keep)
    if bodies is not None and bodies.note:
        report.notes.append(bodies.note)
    piece, plane = find_pieces(shape, edges)
    plane = split_bent(shape, plane)
    piece, plane = renumber(piece[keep]), renumber(plane[keep])
    normal, offset = fit_planes(shape.select(keep), plane)
    p = vertices[triangles]
    return TriangleMesh(
        name=name,
        vertices=vertices,
        triangles=triangles[keep].astype(np.int32),
        dropped=dropped,
        duplicates=duplicates,
        turned=turned,
        open_edges=len(edges.border),
        forked_edges=len(edges.forked),
        twisted_edges=int(edges.twisted.sum()),
        bodies=bodies,
        notes=tuple(report.notes),
        volume=float(np.linalg.det(p - p.mean(axis=(0, 1))).sum() / 6.0),
        bounds=np.stack([p.min(axis=(0, 1)), p.max(axis=(0, 1))]),
        piece=piece,
        plane=plane,
        plane_normal=normal,
        plane_offset=offset,
    )


class _Report:
    """Collects notes about triangles and edges: how many, and where the first is."""

    def __init__(self, vertices: np.ndarray, notes: list[str]):
        self._vertices = vertices
        self.notes = notes

    def triangles(self, which: np.ndarray, what: str) -> int:
        """Note triangles (k, 3), if there are any; returns how many."""
        self._add(which, "triangle" if len(which) == 1 else "triangles", what)
        return len(which)

    def edges(self, ends: np.ndarray, what: str) -> None:
        """Note edges (k, 2), if there are any."""
        self._add(ends, "", what)

    def joined(self, count: int, apart: float) -> None:
        """Note corners that were joined, up to ``apart`` [m] from each other."""
        if count:
            noun = "corner" if count == 1 else "corners"
            self.notes.append(f"{count} {noun} joined with others, up to {apart:.2g} m away: one point but for its rounding")

    def _add(self, corners: np.ndarray, noun: str, what: str) -> None:
        if len(corners):
            where = ", ".join(f"{v:.6g}" for v in self._vertices[corners[0]].mean(axis=0))
            self.notes.append(f"{len(corners)} {noun}{' ' if noun else ''}{what}, the first at ({where}) m")


def require_closed(mesh: TriangleMesh, key: str, remedy: str) -> None:
    """Refuse a mesh that has no inside.

    Args:
        mesh: The mesh.
        key: Scene key, for messages.
        remedy: What to write instead, for messages.

    Raises:
        SceneError: The triangles at some edge are neither two nor as many one way as the other, or the two are wound
            against each other and cannot be mended since the surface has only one side.
    """
    if mesh.is_closed and not mesh.twisted_edges:
        return
    found = "; ".join(note for note in mesh.notes if "edges" in note)
    raise SceneError(
        f"{key}: {mesh.name}: the mesh must be closed to tell inside from outside, each edge shared by exactly two "
        f"triangles (where bodies touch, by as many one way as the other), but has {found}; {remedy}"
    )


def signed_distance(mesh: TriangleMesh, points) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points from the surface of a closed mesh, negative inside, whichever way its normals point.

    Args:
        mesh: Closed mesh (see `require_closed`).
        points: Points [m], shape (n, 3).

    Returns:
        Distance [m], shape (n,), and its gradient [-], shape (n, 3): the unit vector that leads outwards.
    """
    return mesh._query(np.asarray(points, float).reshape(-1, 3))


def inside(mesh: TriangleMesh, points) -> np.ndarray:
    """Whether points [m], shape (n, 3), lie inside a closed mesh; bool, shape (n,)."""
    return signed_distance(mesh, points)[0] < 0.0


def _rotation_matrix(rotate) -> np.ndarray:
    """Matrix of a turn by `rotate.angle` about `rotate.axis` (Rodrigues' formula), shape (3, 3)."""
    if rotate is None:
        return np.eye(3)
    x, y, z = np.asarray(rotate.axis, float) / np.linalg.norm(rotate.axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(rotate.angle) * cross + 2.0 * math.sin(0.5 * rotate.angle) ** 2 * (cross @ cross)
