"""Surfaces of a USD stage as loose triangles in metres, z upwards, where they stand at time 0.

    x = U s X(0) p,   U: turn of the stage's upAxis to z,   s: metersPerUnit,   X(0): local-to-world transform at time 0

All of it is done in float64; the points are then rounded to float32, as an STL file in metres would hold them. So the
stage and the STL file of one vessel give the same points and the same run, bit for bit. Parents, instances, scale and
mirroring are in X; a transform with time samples is taken at time 0, and ``wall.motion = {usd, prim}`` moves the wall from
there. Physics of bound materials is not read. Primitive shapes are cut into `SEGMENTS` facets round about.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh.polygons import triangulate
from warpdem.usd import stage as usd_stage

SEGMENTS = 96
"""Facets of a round shape [-]: it lies at most 5.4e-4 of its radius inside the true one."""
NOT_READ = "physics is not read"
"""Words of the notes on physics that a mesh file does not bring along; a scene in USD has read that of its own stage."""
NOTHING = 2.0**-40
"""A coordinate this small against the largest is 0 [-]: what the cosine of a right angle leaves, far below float32."""
AXES = {"X": [1, 2, 0], "Y": [2, 0, 1], "Z": [0, 1, 2]}
"""Number of the coordinate along each shape's first, second and own axis, sorted so that handedness stays."""


def read_triangles(
    path: Path, prim: str, key: str, folders: Sequence[Path] | None = None
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Corners of all triangles at and below a prim [m], shape (t, 3, 3), float64 of float32, and what was met.

    Args:
        path: USD file.
        prim: Path of the prim; "" for the only surface of the stage.
        key: Scene key, for messages.
        folders: Folders that all files it refers to must lie in; None is no bound.

    Raises:
        SceneError: The file cannot be read, there is no such prim, or it holds something that is no surface at rest.
    """
    said, arrays = usd_stage.read(path, "geometry", prim, key, folders)
    parts = []
    for number, surface in enumerate(said["surfaces"]):
        held = {name.split(".")[1]: a for name, a in arrays.items() if name.split(".")[0] == str(number)}
        try:
            points, triangles = _polygons(held) if surface["kind"] == "Mesh" else shape_triangles(surface)
        except ValueError as error:
            raise SceneError(f"{key}: {path.name}: {surface['path']}: {error}") from None
        matrix = held["matrix"]
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
        if surface["left_handed"] != (np.linalg.det(matrix[:3, :3]) < 0.0):
            triangles = triangles[:, ::-1]
        parts.append(points[triangles])
    with np.errstate(over="ignore"):  # a length beyond float32 becomes infinite and is refused with its triangle
        corners = np.concatenate(parts) @ usd_stage.TO_Z_UP[said["up"]].T * said["metres"]
        corners[np.abs(corners) < NOTHING * np.abs(corners).max(initial=0.0)] = 0.0
        corners = corners.astype(np.float32).astype(np.float64)
    return corners, tuple(_notes(said))


def _notes(said: dict) -> list[str]:
    """What a user may want to know about the surfaces of a stage."""
    surfaces = said["surfaces"]
    notes = [f"the file does not say its {unsaid}" for unsaid in said["unsaid"]]
    notes += said["noticed"]
    notes += [f"left out: {', '.join(said['left_out'])}"] if said["left_out"] else []
    for surface in surfaces:
        if surface["kind"] not in ("Mesh", "Cube", "Plane"):
            notes.append(
                f"{surface['path']} ({surface['kind']}) was cut into {SEGMENTS} facets; an analytic wall is exact"
            )
        if surface.get("subdivision"):
            notes.append(
                f"{surface['path']}: its {surface['subdivision']} subdivision is not evaluated, its cage is taken"
            )
        if surface["moves"]:
            notes.append(
                f"{surface['path']} is taken at time 0; wall.motion = {{usd, prim}} lets it follow its samples"
            )
    materials = sorted({surface["material"] for surface in surfaces if surface["material"]})
    notes += [f"bound material: {', '.join(materials)} (its {NOT_READ})"] if materials else []
    physics, more = said["physics"], max(0, len(said["physics"]) - 8)
    notes += [f"{NOT_READ}: {', '.join(physics[:8])}{f' and {more} more' * (more > 0)}"] if physics else []
    return notes


def _polygons(held: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points (v, 3) and triangles (t, 3) of a mesh, without the faces that are holes."""
    counts, indices, holes = held["counts"], held["indices"], held["holes"]
    if len(holes):
        solid = np.ones(len(counts), bool)
        solid[holes[(holes >= 0) & (holes < len(counts))]] = False
        if counts.min(initial=0) < 0 or counts.sum(dtype=float) != len(indices):
            raise ValueError(f"its counts of corners do not fit its {len(indices)} corners")
        counts, indices = counts[solid], indices[np.repeat(solid, counts)]
    points = held["points"].astype(np.float64)
    return points, triangulate(points, counts, indices)


def shape_triangles(shape: dict) -> tuple[np.ndarray, np.ndarray]:
    """Points (v, 3) and triangles (t, 3), wound outwards, of a primitive shape about its centre, in its own units.

    Args:
        shape: ``kind`` (Cube, Sphere, Cylinder, Cone, Capsule or Plane), its ``sizes`` and its ``axis`` (X, Y or Z).
    """
    kind, sizes = shape["kind"], shape["sizes"]
    if kind == "Cube":
        points, triangles = _cube(sizes["size"])
    elif kind == "Plane":
        # a sheet across its axis: its width runs along x (along z if x is the axis), its length along y (z if y is)
        sides = [sizes["width"], sizes["length"]] if shape["axis"] == "Z" else [sizes["length"], sizes["width"]]
        points = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*sides, 0.0]
        triangles = np.array([[0, 1, 2], [0, 2, 3]])
    else:
        points, triangles = _revolved(_profile(kind, **sizes))
    turned = np.empty_like(points)
    turned[:, AXES[shape["axis"]]] = points
    return turned, triangles


def _cube(size: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners numbered 4 x + 2 y + z."""
    points = size * (np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _profile(kind: str, radius: float, height: float = 0.0) -> np.ndarray:
    """Distances from the axis and heights of the line that a round shape is swept by, from below upwards, shape (k, 2)."""
    half = 0.5 * height
    if kind == "Cylinder":
        return np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]])
    if kind == "Cone":
        return np.array([[0.0, -half], [radius, -half], [0.0, half]])
    angle = np.linspace(0.0, 0.5 * np.pi, SEGMENTS // 4 + 1)
    quarter = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    quarter[-1, 0] = 0.0
    shift = np.array([0.0, half])
    upper, lower = quarter + shift, (quarter * [1.0, -1.0] - shift)[::-1]
    return np.concatenate([lower, upper if half > 0.0 else upper[1:]])


def _revolved(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A profile (k, 2) that starts and ends on the axis, swept round it."""
    angle = 2.0 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner = profile[1:-1]
    rings = np.concatenate([np.column_stack([r * ring, np.full(SEGMENTS, z)]) for r, z in inner])
    points = np.concatenate([rings, [[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]]])
    bottom, top = len(rings), len(rings) + 1
    k, after = np.arange(SEGMENTS), (np.arange(SEGMENTS) + 1) % SEGMENTS
    parts = [np.stack([np.full(SEGMENTS, bottom), after, k], axis=1)]
    for level in range(len(inner) - 1):
        low, high = level * SEGMENTS, (level + 1) * SEGMENTS
        parts += [np.stack([low + k, low + after, high + after], axis=1)]
        parts += [np.stack([low + k, high + after, high + k], axis=1)]
    last = (len(inner) - 1) * SEGMENTS
    parts.append(np.stack([last + k, last + after, np.full(SEGMENTS, top)], axis=1))
    return points, np.concatenate(parts)
