"""Mesh files to triangles: read, weld, place, and find what belongs together (smooth pieces, flat pieces).

Everything after the file is float64. The file itself is usually float32 (binary STL), so two triangles of one flat
floor differ by the rounding of their corners; the tolerance within which they count as one plane follows from that.
"""

import functools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.kernels.wall import distance as distance_kernel

SMOOTH_ANGLE = math.radians(30.0)
"""Triangles that meet at a smaller angle belong to one smooth piece [rad]."""
ANGLE_ROUNDING = 1e-5
"""An angle so near to `SMOOTH_ANGLE` counts as equal [rad]: a tube of twelve facets must not fall into random parts."""
ROUNDING = 2.0**-21
"""Rounding of a corner in the file relative to the largest coordinate [-]: four units in the last place of float32,
which also covers ASCII files written with seven digits."""
SLIVER = 8.0
"""A triangle thinner than this many roundings has no direction of its own [-]."""
LARGEST_MESH = 20_000.0
"""Largest mesh size in mean grain diameters [-]: more grains abreast than that never fit into a computer."""
SMALLEST_MESH = 2.0
"""Smallest mesh size in mean grain diameters [-]."""


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
    open_edges: int
    """Edges that are not used by exactly two triangles."""
    open_at: tuple[float, float, float] | None
    """Middle of one of these edges [m]."""
    twisted_edges: int
    """Edges whose two triangles are wound against each other."""
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
        """Whether each edge is used by exactly two triangles."""
        return self.open_edges == 0

    @property
    def corners(self) -> np.ndarray:
        """Corners of each triangle [m], shape (t, 3, 3)."""
        return self.vertices[self.triangles]

    @functools.cached_property
    def _query(self) -> "_DistanceQuery":
        return _DistanceQuery(self)


def load_mesh(path, scale=1.0, rotate=None, translate=(0.0, 0.0, 0.0), key: str = "mesh") -> TriangleMesh:
    """Read a mesh file (STL binary or ASCII, OBJ, PLY), weld its corners, then scale, rotate and translate it.

    Args:
        path: File.
        scale: Metres per unit of the file [m], one number.
        rotate: None, or an object with `axis` (any length) and `angle` [rad] (turn about the origin).
        translate: Shift after scaling and turning [m].
        key: Scene key, for messages.

    Raises:
        SceneError: File missing, unreadable, empty, or with a corner that is not a finite number.
    """
    path = Path(path)
    corners = _read(path, key)
    pose = (_rotation_matrix(rotate) * float(scale), np.asarray(translate, float))
    return build_mesh(corners, pose, path.name, key)


def build_mesh(corners: np.ndarray, pose=None, name: str = "mesh", key: str = "mesh") -> TriangleMesh:
    """Mesh of loose triangles.

    Args:
        corners: Corners in units of the file, shape (t, 3, 3).
        pose: None, or matrix (3, 3) and shift (3,) that take the file's coordinates to metres.
        name: Shown in messages.
        key: Scene key, for messages.

    Raises:
        SceneError: No triangle with an area, or a corner that is not a finite number.
    """
    corners = np.asarray(corners, np.float64)
    bad = ~np.isfinite(corners).all(axis=(1, 2))
    if bad.any():
        first = int(np.argmax(bad))
        raise SceneError(
            f"{key}: {name}: {bad.sum()} of {len(corners)} triangles have a corner that is not a finite number, "
            f"the first is triangle {first}: {corners[first].tolist()}"
        )
    vertices, triangles = _weld(corners)
    rounding = ROUNDING * np.abs(vertices).max(initial=0.0)
    if pose is not None:
        matrix, shift = pose
        rounding *= np.cbrt(abs(np.linalg.det(matrix)))
        vertices = vertices @ matrix.T + shift
    # a triangle whose corners coincide cancels itself; one with three corners on a line still joins its neighbours
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    if len(triangles) == 0:
        raise SceneError(f"{key}: {name}: the mesh is empty ({len(corners)} triangles in the file, none with an area)")
    shape = _Shape(vertices, triangles, rounding)
    edges = _Edges(triangles)
    keep = shape.area > 0.0
    if not keep.any():
        raise SceneError(f"{key}: {name}: the mesh is empty: none of its {len(corners)} triangles has an area")
    piece, plane = _pieces(shape, edges)
    plane = _split_bent(shape, plane)
    piece, plane = _renumber(piece[keep]), _renumber(plane[keep])
    normal, offset = _fit_planes(shape.select(keep), plane)
    p = vertices[triangles]
    middle = p.mean(axis=(0, 1))
    at = None if edges.open_count == 0 else tuple(float(v) for v in vertices[edges.an_open_edge].mean(axis=0))
    return TriangleMesh(
        name=name,
        vertices=vertices,
        triangles=triangles[keep].astype(np.int32),
        dropped=int(len(corners) - keep.sum()),
        open_edges=edges.open_count,
        open_at=at,
        twisted_edges=int(edges.twisted.sum()),
        volume=float(np.linalg.det(p - middle).sum() / 6.0),
        bounds=np.stack([p.min(axis=(0, 1)), p.max(axis=(0, 1))]),
        piece=piece,
        plane=plane,
        plane_normal=normal,
        plane_offset=offset,
    )


def require_closed(mesh: TriangleMesh, key: str) -> None:
    """Refuse a mesh that has no inside.

    Raises:
        SceneError: Some edge is not shared by exactly two triangles, or the two are wound against each other.
    """
    if not mesh.is_closed:
        where = ", ".join(f"{v:.6g}" for v in mesh.open_at)
        raise SceneError(
            f"{key}: {mesh.name}: the mesh must be closed to tell inside from outside, but has {mesh.open_edges} open "
            f"edges (not shared by exactly two triangles), one of them at ({where}) m"
        )
    if mesh.twisted_edges:
        raise SceneError(
            f"{key}: {mesh.name}: the triangles must all face outwards, but at {mesh.twisted_edges} edges the two "
            "triangles are wound against each other; mend the normals in the program the mesh came from"
        )


def check_size(mesh: TriangleMesh, diameters, key: str) -> None:
    """Refuse a mesh whose size cannot belong to the grains, as when millimetres are read as metres.

    Args:
        mesh: Placed mesh.
        diameters: Grain diameters [m], any shape.
        key: Scene key of the mesh, for messages.

    Raises:
        SceneError: The mesh is more than `LARGEST_MESH` or less than `SMALLEST_MESH` mean grain diameters large.
    """
    diameter = float(np.mean(diameters))
    size = float((mesh.bounds[1] - mesh.bounds[0]).max())
    ratio = size / diameter
    if SMALLEST_MESH <= ratio <= LARGEST_MESH:
        return
    factor = 0.001 if ratio > LARGEST_MESH else 1000.0
    advice = "check scale and the diameters"
    if SMALLEST_MESH <= ratio * factor <= LARGEST_MESH:
        unit = "millimetres" if factor < 1.0 else "kilometres, or was scaled twice"
        advice = f"is the file in {unit}? Then multiply its scale by {factor:g} (scale = {factor:g} if it had none)"
    raise SceneError(
        f"{key}: {mesh.name}: the mesh is {size:.6g} m large and the grains are {diameter:.6g} m in diameter: "
        f"{ratio:.3g} diameters, allowed {SMALLEST_MESH:g} to {LARGEST_MESH:g}; {advice}"
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


def clipped_volume(mesh: TriangleMesh, box) -> float:
    """Volume [m3] of the inside of a closed mesh within an axis-aligned box, exact.

    The divergence theorem for the field (0, 0, clip(z, z_low, z_high)), whose flux through the cut faces of the box is
    zero or, at its lids, constant: only the mesh's own triangles, cut at the box, are needed.

    Args:
        mesh: Closed mesh.
        box: Least and greatest corner [m], shape (2, 3).
    """
    low, high = np.asarray(box, float)
    t = mesh.corners
    for axis in (0, 1):
        t = _split(t, axis, low[axis])[1]
        t = _split(t, axis, high[axis])[0]
    t = np.concatenate([part for side in _split(t, 2, low[2]) for part in _split(side, 2, high[2])])
    height = (np.clip(t[:, :, 2], low[2], high[2]) - low[2]).mean(axis=1)
    edge = t[:, 1:] - t[:, :1]
    area_z = 0.5 * (edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    return abs(float((height * area_z).sum()))


def _read(path: Path, key: str) -> np.ndarray:
    """Corners of all triangles of a file in its own units, shape (t, 3, 3)."""
    import trimesh  # slow to import: only scenes with meshes pay

    if not path.is_file():
        raise SceneError(f"{key}: no such mesh file: {path}")
    try:
        mesh = trimesh.load_mesh(path, process=False, validate=False)
        corners = np.asarray(mesh.vertices, np.float64)[np.asarray(mesh.faces)]
    except Exception as error:  # trimesh raises whatever its parsers run into
        raise SceneError(
            f"{key}: {path.name} ({path.stat().st_size} bytes) cannot be read as a mesh ({error}); "
            "allowed: STL (binary or ASCII), OBJ, PLY"
        ) from error
    if len(corners) == 0:
        raise SceneError(f"{key}: {path.name}: the mesh is empty (0 triangles)")
    return corners


def _rotation_matrix(rotate) -> np.ndarray:
    """Matrix of a turn by `rotate.angle` about `rotate.axis` (Rodrigues' formula), shape (3, 3)."""
    if rotate is None:
        return np.eye(3)
    x, y, z = np.asarray(rotate.axis, float) / np.linalg.norm(rotate.axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(rotate.angle) * cross + 2.0 * math.sin(0.5 * rotate.angle) ** 2 * (cross @ cross)


def _weld(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and corner numbers: corners equal in float32 become one, in the order of the file."""
    flat = corners.reshape(-1, 3)
    rough = flat.astype(np.float32) + np.float32(0.0)  # makes -0 and 0 alike
    first, group = _first_and_group(rough.view(np.uint32))
    # text files hold more digits than float32: the first corner of a group keeps them
    return flat[first] + 0.0, group.reshape(-1, 3)


def _first_and_group(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First row of each set of equal rows (ascending) and the set each row belongs to; faster than `np.unique`."""
    order = np.lexsort(keys.T)  # stable: the first row of a set comes first
    new = np.ones(len(keys), bool)
    new[1:] = (keys[order[1:]] != keys[order[:-1]]).any(axis=1)
    first = order[new]
    rank = np.argsort(np.argsort(first))
    group = np.empty(len(keys), np.int64)
    group[order] = rank[np.cumsum(new) - 1]
    return np.sort(first), group


class _Edges:
    """Which triangles meet at each edge."""

    def __init__(self, triangles: np.ndarray):
        ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        key = np.sort(ends, axis=1)
        first, group = _first_and_group(key)
        uses = np.bincount(group)
        open_edge = uses != 2
        self.open_count = int(open_edge.sum())
        self.an_open_edge = key[first[np.argmax(open_edge)]]
        """Ends of the first open edge; meaningless when none is open."""
        order = np.argsort(group, kind="stable")
        paired = order[~open_edge[group[order]]].reshape(-1, 2)
        self.sides = paired // 3
        """The two triangles at each edge shared by exactly two, shape (e, 2)."""
        self.opposite = paired % 3
        """Number 0..2 of the edge within each of the two triangles (edge k runs from corner k to k + 1)."""
        self.twisted = ends[paired[:, 0], 0] == ends[paired[:, 1], 0]
        """Whether the two triangles run through the edge in the same direction, shape (e,)."""


class _Shape:
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
        self.height = double_area / length.max(axis=1)
        self.is_sliver = self.height < SLIVER * rounding

    def select(self, keep: np.ndarray) -> "_Shape":
        """The same of some triangles."""
        part = object.__new__(_Shape)
        part.__dict__.update({k: v[keep] if isinstance(v, np.ndarray) else v for k, v in self.__dict__.items()})
        return part


def _pieces(shape: _Shape, edges: _Edges) -> tuple[np.ndarray, np.ndarray]:
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
    return tuple(_components(count, np.concatenate([pairs[joined], follow])) for joined in (smooth, flat))


def _components(count: int, pairs: np.ndarray) -> np.ndarray:
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


def _renumber(label: np.ndarray) -> np.ndarray:
    """Numbers 0, 1, ... in the order in which the labels first appear, int32."""
    return _first_and_group(label[:, None])[1].astype(np.int32)


def _fit_planes(shape: _Shape, plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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


def _split_bent(shape: _Shape, plane: np.ndarray) -> np.ndarray:
    """Flat pieces that are not flat as a whole fall apart into their triangles.

    On a surface tessellated so finely that neighbours differ by no more than rounding, joining neighbours would go on
    around the bend.
    """
    plane = _renumber(plane)
    solid = shape.area > 0.0
    flat = np.unique(plane[solid])
    number = np.searchsorted(flat, plane[solid])
    normal, offset = _fit_planes(shape.select(solid), number.astype(np.int64))
    corners = shape.corners[solid]
    gap = np.abs((corners * normal[number][:, None]).sum(axis=2) - offset[number][:, None]).max(axis=1)
    worst = np.zeros(len(flat))
    np.maximum.at(worst, number, gap)
    bent = np.zeros(int(plane.max()) + 1, bool)
    bent[flat] = worst > 4.0 * shape.rounding
    return np.where(bent[plane], len(plane) + np.arange(len(plane)), plane)


def _split(t: np.ndarray, axis: int, value: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (t, 3, 3) cut at the plane x[axis] = value: those below it and those above it, wound as before."""
    d = t[:, :, axis] - value
    below, above = (d <= 0.0).all(axis=1), (d >= 0.0).all(axis=1) & ~(d <= 0.0).all(axis=1)
    cut = ~below & ~above
    t_cut, d = t[cut], d[cut]
    high = d > 0.0
    # turn each so that the corner alone on its side comes first; a corner in the plane counts as below
    alone_high = high.sum(axis=1) == 1
    lone = np.where(alone_high, high.argmax(axis=1), (~high).argmax(axis=1))
    index = (lone[:, None] + np.arange(3)) % 3
    row = np.arange(len(t_cut))[:, None]
    (a, b, c), (da, db, dc) = t_cut[row, index].transpose(1, 0, 2), d[row, index].T
    ab = a + (da / (da - db))[:, None] * (b - a)
    ac = a + (da / (da - dc))[:, None] * (c - a)
    tip = np.stack([a, ab, ac], axis=1)
    rest = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    twice = np.tile(alone_high, 2)
    return (
        np.concatenate([t[below], tip[~alone_high], rest[twice]]),
        np.concatenate([t[above], tip[alone_high], rest[~twice]]),
    )


class _DistanceQuery:
    """Search tree of a mesh on the CPU, built once; answers signed distances."""

    def __init__(self, mesh: TriangleMesh):
        low, high = mesh.bounds
        self._centre, self._size = 0.5 * (low + high), float((high - low).max())
        # the sign needs outward normals
        outward = mesh.triangles if mesh.volume >= 0.0 else mesh.triangles[:, ::-1]
        unit = ((mesh.vertices - self._centre) / self._size).astype(np.float32)
        with wp.ScopedDevice("cpu"):
            self._vertex = wp.array(mesh.vertices, dtype=wp.vec3d)
            self._triangle = wp.array(np.ascontiguousarray(outward), dtype=wp.vec3i)
            self._tree = wp.Mesh(
                wp.array(unit, dtype=wp.vec3),
                wp.array(outward.flatten(), dtype=wp.int32),
                support_winding_number=True,
            )

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance = wp.empty(len(points), dtype=wp.float64, device="cpu")
        gradient = wp.empty(len(points), dtype=wp.vec3d, device="cpu")
        wp.launch(
            distance_kernel.signed_distance,
            dim=len(points),
            inputs=[
                self._tree.id,
                wp.vec3d(*self._centre),
                self._size,
                self._vertex,
                self._triangle,
                wp.array(points, dtype=wp.vec3d, device="cpu"),
            ],
            outputs=[distance, gradient],
            device="cpu",
        )
        return distance.numpy(), gradient.numpy()
