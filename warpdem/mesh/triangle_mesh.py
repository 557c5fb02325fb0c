"""Triangle meshes in metres: read from a file, repaired and divided into smooth and flat pieces; signed distance.

Everything after the file is float64.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from warpdem.errors import SceneError
from warpdem.mesh import file as mesh_file
from warpdem.mesh.bodies import Bodies, find_bodies
from warpdem.mesh.distance import DistanceQuery
from warpdem.mesh.edges import Edges
from warpdem.mesh.grouping import renumber
from warpdem.mesh.pieces import ROUNDING, Shape, find_pieces, fit_planes, folded, split_curved
from warpdem.mesh.repair import first_of_each, not_cancelled, wrongly_wound
from warpdem.mesh.weld import weld

LARGEST_NUMBER = 1e30
"""Largest valid coordinate [-]: its square fits into float64, and float32 can hold it."""


class Rotate(Protocol):
    """A rotation about the origin, as the key ``rotate`` of a wall."""

    @property
    def axis(self) -> Sequence[float]:
        """Direction of the axis [-], any length but zero."""

    @property
    def angle(self) -> float:
        """Angle [rad]."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A triangle mesh in metres at its position at time 0, with its pieces."""

    name: str
    """Name of its file, for messages."""
    vertices: np.ndarray
    """Corners [m], shape (v, 3), float64; each corner of the file once."""
    triangles: np.ndarray
    """Corner numbers of each triangle, shape (t, 3), int32."""
    dropped: int
    """Number of triangles without area in the file, which are left out."""
    duplicates: int
    """Number of duplicate triangles in the file, which are left out."""
    flipped: int
    """Number of triangles of a closed mesh whose wrong winding was reversed."""
    open_edges: int
    """Number of edges of only one triangle."""
    nonmanifold_edges: int
    """Number of edges at which three or more triangles meet with unbalanced orientations; where closed bodies touch, the
    orientations are balanced."""
    mismatched_edges: int
    """Number of edges whose two triangles have inconsistent windings."""
    folded_edges: int
    """Number of edges at which the surface folds back onto itself: near them neither side is the inside."""
    bodies: Bodies | None
    """The closed bodies, if there are several that may be nested, touch or intersect; else None."""
    notes: tuple[str, ...]
    """Repairs, omissions and faults, each with its number and the position of the first, for the user."""
    volume: float
    """Enclosed volume [m3]; negative if the normals of a closed mesh point inwards, meaningless for an open mesh."""
    bounds: np.ndarray
    """Minimum and maximum of the coordinates [m], shape (2, 3)."""
    piece: np.ndarray
    """Smooth piece of each triangle, shape (t,), int32: neighbours below `SMOOTH_ANGLE` belong to one piece."""
    plane: np.ndarray
    """Flat piece of each triangle, shape (t,), int32."""
    plane_normal: np.ndarray
    """Unit normal of each flat piece [-], shape (p, 3), with the orientation of its triangles."""
    plane_offset: np.ndarray
    """Offset of each flat piece [m], shape (p,): its points satisfy normal . x = offset."""

    @property
    def is_closed(self) -> bool:
        """Whether each edge has two triangles, or triangles of balanced orientations."""
        return self.open_edges == self.nonmanifold_edges == 0

    @property
    def corners(self) -> np.ndarray:
        """Corners of each triangle [m], shape (t, 3, 3)."""
        return np.asarray(self.vertices[self.triangles])

    @functools.cached_property
    def _query(self) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
        if self.bodies is None:
            # the sign needs outward normals
            return DistanceQuery(self.vertices, self.triangles if self.volume >= 0.0 else self.triangles[:, ::-1])
        return self.bodies.distances(self.vertices, self.triangles)


def load_mesh(
    path: str | Path,
    scale: float | Sequence[float] = 1.0,
    rotate: Rotate | None = None,
    translate: Sequence[float] = (0.0, 0.0, 0.0),
    prim: str = "",
    key: str = "mesh",
    folders: Sequence[Path] | None = None,
    part: str = "",
    tolerance: float | None = None,
) -> TriangleMesh:
    """Read a mesh file, weld its corners, then scale, rotate, translate and repair it (see `warpdem.mesh.repair`).

    Args:
        path: STL (binary or ASCII), OBJ, PLY, USD or STEP file; the latter are converted to metres first, USD with z upwards.
        scale: Metres per unit of the file [m], or three numbers, one along each axis of the file.
        rotate: Rotation about the origin; None for none.
        translate: Translation after scaling and rotation [m].
        prim: Path of a prim of a USD file; "" if the file holds one surface only.
        key: Scene key, for messages.
        folders: Folders that must hold all files which a USD file refers to; None for no restriction.
        part: Name of a solid of an ASCII STL or STEP file, or of an object or group of an OBJ; "" for the whole file.
        tolerance: Of a STEP file: largest distance between triangles and surfaces [m]; None for the default.

    Raises:
        SceneError: The file is missing, unreadable, empty, or has a corner that is not a finite number.
    """
    path = Path(path)
    corners, notes = mesh_file.read_any(path, key, prim, folders, part, tolerance)
    pose = (_rotation_matrix(rotate) * np.asarray(scale, float), np.asarray(translate, float))
    return build_mesh(corners, pose, path.name, key, notes)


def build_mesh(
    corners: npt.ArrayLike,
    pose: tuple[np.ndarray, np.ndarray] | None = None,
    name: str = "mesh", key: str = "mesh", notes: tuple[str, ...] = ()
) -> TriangleMesh:
    """Mesh of loose triangles.

    Args:
        corners: Corners in units of the file, shape (t, 3, 3).
        pose: Matrix (3, 3) and translation (3,) from the file's coordinates to metres; None if they are metres.
        name: Shown in messages.
        key: Scene key, for messages.
        notes: Notes from reading the file.

    Raises:
        SceneError: There is no triangle with an area, or a corner that is not a finite number.
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
        if (stretch := np.linalg.norm(matrix, axis=0)).max() > (1.0 + 1e-9) * stretch.min():
            size = stretch.max()  # the rounding of the file is that of its most stretched axis
        rounding *= size
        vertices = vertices @ matrix.T + shift
    solid, single = Shape(vertices, triangles, rounding).area > 0.0, first_of_each(triangles)
    if not solid.any():
        raise SceneError(f"{key}: {name}: the mesh is empty: none of its {len(corners)} triangles has an area")
    report = _Report(vertices, list(notes))
    report.joined(joined, apart * size)
    dropped = report.triangles(triangles[~solid], "without area left out")
    # a triangle with coincident corners has no effect; one with three collinear corners still connects its neighbours
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    counted = not_cancelled(triangles, solid, single, distinct)
    cancelled = report.triangles(
        triangles[solid & single & ~counted], "left out where bodies touch face to face: two of opposite winding cancel"
    )
    duplicates = report.triangles(triangles[solid & ~single], "given twice left out") if not cancelled else cancelled
    triangles = triangles[np.where(solid, counted, distinct)]
    shape, edges = Shape(vertices, triangles, rounding), Edges(triangles)
    flipped = 0
    if edges.is_closed:
        wrong = wrongly_wound(vertices, triangles, edges, shape.area)
        flipped = report.triangles(triangles[wrong], "of wrong winding flipped")
    if flipped:
        triangles = np.where(wrong[:, None], triangles[:, ::-1], triangles)
        shape, edges = Shape(vertices, triangles, rounding), Edges(triangles)
    report.edges(edges.border, "open edges (of one triangle only)")
    report.edges(edges.forked, "edges at which three or more triangles meet")
    report.edges(edges.ends[edges.twisted], "edges whose two triangles have inconsistent windings")
    folds = edges.ends[folded(shape, edges)]
    report.edges(folds, "edges at which the surface folds back onto itself, so that near them neither side is the inside")
    keep = shape.area > 0.0
    bodies = find_bodies(vertices, triangles, edges, keep)
    if bodies is not None and bodies.note:
        report.notes.append(bodies.note)
    piece, plane = find_pieces(shape, edges)
    plane = split_curved(shape, plane)
    piece, plane = renumber(piece[keep]), renumber(plane[keep])
    normal, offset = fit_planes(shape.select(keep), plane)
    p = vertices[triangles]
    return TriangleMesh(
        name=name,
        vertices=vertices,
        triangles=triangles[keep].astype(np.int32),
        dropped=dropped,
        duplicates=duplicates,
        flipped=flipped,
        open_edges=len(edges.border),
        nonmanifold_edges=len(edges.forked),
        mismatched_edges=int(edges.twisted.sum()),
        folded_edges=len(folds),
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
    """Collects notes about triangles and edges: their number, and the position of the first."""

    def __init__(self, vertices: np.ndarray, notes: list[str]) -> None:
        self._vertices = vertices
        self.notes = notes

    def triangles(self, which: np.ndarray, what: str) -> int:
        """Note triangles (k, 3), if there are any; returns their number."""
        self._add(which, "triangle" if len(which) == 1 else "triangles", what)
        return len(which)

    def edges(self, ends: np.ndarray, what: str) -> None:
        """Note edges (k, 2), if there are any."""
        self._add(ends, "", what)

    def joined(self, count: int, apart: float) -> None:
        """Note corners that were joined, at distances up to ``apart`` [m]."""
        if count:
            noun = "corner" if count == 1 else "corners"
            self.notes.append(f"{count} {noun} joined with others at up to {apart:.2g} m: equal within rounding of the file")

    def _add(self, corners: np.ndarray, noun: str, what: str) -> None:
        if len(corners):
            where = ", ".join(f"{v:.6g}" for v in self._vertices[corners[0]].mean(axis=0))
            self.notes.append(f"{len(corners)} {noun}{' ' if noun else ''}{what}, the first at ({where}) m")


def require_closed(mesh: TriangleMesh, key: str, remedy: str) -> None:
    """Require a mesh that has an inside.

    Args:
        mesh: The mesh.
        key: Scene key, for messages.
        remedy: Remedy, for messages.

    Raises:
        SceneError: An edge has neither two triangles nor triangles of balanced orientations, or the surface is one-sided, so
            that the windings of its triangles cannot be made consistent.
    """
    if mesh.is_closed and not mesh.mismatched_edges:
        return
    found = "; ".join(note for note in mesh.notes if "edges" in note)
    raise SceneError(
        f"{key}: {mesh.name}: the mesh must be closed to have an inside, each edge shared by exactly two "
        f"triangles (where bodies touch, by as many of either orientation), but has {found}; {remedy}"
    )


def signed_distance(mesh: TriangleMesh, points: npt.ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points from the surface of a closed mesh, negative inside, for any orientation of its normals.

    Args:
        mesh: Closed mesh (see `require_closed`).
        points: Points [m], shape (n, 3).

    Returns:
        Distance [m], shape (n,), and its gradient [-], shape (n, 3): a unit vector that points outwards.
    """
    return mesh._query(np.asarray(points, float).reshape(-1, 3))


def inside(mesh: TriangleMesh, points: npt.ArrayLike) -> np.ndarray:
    """Whether points [m], shape (n, 3), lie inside a closed mesh; bool, shape (n,)."""
    return signed_distance(mesh, points)[0] < 0.0


def _rotation_matrix(rotate: Rotate | None) -> np.ndarray:
    """Matrix of a rotation (Rodrigues' formula), shape (3, 3)."""
    if rotate is None:
        return np.eye(3)
    x, y, z = np.asarray(rotate.axis, float) / np.linalg.norm(rotate.axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    increment = math.sin(rotate.angle) * cross + 2.0 * math.sin(0.5 * rotate.angle) ** 2 * (cross @ cross)
    return np.asarray(np.eye(3) + increment)
