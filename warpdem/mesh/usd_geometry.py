"""Surfaces of a USD stage as triangles in metres, z upwards, at their position at time 0.

    x = U s X(0) p,   U: rotation of the stage's upAxis to z,   s: metersPerUnit,   X(0): local-to-world transform at time 0

The computation is in float64; the points are then rounded to float32, as an STL file in metres would hold them. So the stage
and the STL file of one vessel give the same points and the same run, bit for bit. X includes parents, instances, scale and
mirroring; a transform with time samples is evaluated at time 0, and ``wall.motion = {usd, prim}`` moves the wall from there.
Physics of bound materials is not read. Primitive shapes have `SEGMENTS` facets around their axis.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from warpdem.errors import SceneError
from warpdem.mesh.polygons import triangulate
from warpdem.usd import stage as usd_stage

SEGMENTS = 96
"""Facets of a round shape [-]: they lie at most 5.4e-4 of the radius inside the true surface."""
NOT_READ = "physics is not read"
"""Text of the notes on physics in a mesh file; a scene in USD has read the physics of its own stage."""
ZERO = 2.0**-40
"""A coordinate this small relative to the largest is set to 0 [-]: the rounding error of the cosine of a right angle."""
AXES = {"X": [1, 2, 0], "Y": [2, 0, 1], "Z": [0, 1, 2]}
"""Coordinate along each shape's first, second and own axis, ordered so that the handedness is kept."""


def read_triangles(
    path: Path, prim: str, key: str, folders: Sequence[Path] | None = None
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Corners of all triangles of a prim and its descendants [m], shape (t, 3, 3), float64 with float32 values, and notes.

    Args:
        path: USD file.
        prim: Path of the prim; "" for the only surface of the stage.
        key: Scene key, for messages.
        folders: Folders that must hold all files it refers to; None for no restriction.

    Raises:
        SceneError: The file cannot be read, there is no such prim, or it holds an unsupported or deforming surface.
    """
    content, arrays = usd_stage.read(path, "geometry", prim, key, folders)
    parts = []
    for number, surface in enumerate(content["surfaces"]):
        fields = {name.split(".")[1]: a for name, a in arrays.items() if name.split(".")[0] == str(number)}
        try:
            points, triangles = _polygons(fields) if surface["kind"] == "Mesh" else shape_triangles(surface)
        except ValueError as error:
            raise SceneError(f"{key}: {path.name}: {surface['path']}: {error}") from None
        matrix = fields["matrix"]
        points = points @ matrix[:3, :3].T + matrix[:3, 3]
        if surface["left_handed"] != (np.linalg.det(matrix[:3, :3]) < 0.0):
            triangles = triangles[:, ::-1]
        parts.append(points[triangles])
    with np.errstate(over="ignore"):  # a length beyond float32 becomes infinite and is refused with its triangle
        corners = np.concatenate(parts) @ usd_stage.TO_Z_UP[content["up"]].T * content["metres"]
        corners[np.abs(corners) < ZERO * np.abs(corners).max(initial=0.0)] = 0.0
        corners = corners.astype(np.float32).astype(np.float64)
    return corners, tuple(_notes(content))


def _notes(content: dict[str, Any]) -> list[str]:
    """Notes for the user on the surfaces of a stage."""
    surfaces = content["surfaces"]
    notes = [f"the file does not state its {unsaid}" for unsaid in content["unsaid"]]
    notes += content["noticed"]
    notes += [f"left out: {', '.join(content['left_out'])}"] if content["left_out"] else []
    for surface in surfaces:
        if surface["kind"] not in ("Mesh", "Cube", "Plane"):
            notes.append(
                f"{surface['path']} ({surface['kind']}) was divided into {SEGMENTS} facets; an analytic wall is exact"
            )
        if surface.get("subdivision"):
            notes.append(
                f"{surface['path']}: its {surface['subdivision']} subdivision is not evaluated, its control cage is used"
            )
        if surface["moves"]:
            notes.append(
                f"{surface['path']} is used at time 0; with wall.motion = {{usd, prim}} it follows its time samples"
            )
    materials = sorted({surface["material"] for surface in surfaces if surface["material"]})
    notes += [f"bound material: {', '.join(materials)} (its {NOT_READ})"] if materials else []
    physics, more = content["physics"], max(0, len(content["physics"]) - 8)
    notes += [f"{NOT_READ}: {', '.join(physics[:8])}{f' and {more} more' * (more > 0)}"] if physics else []
    return notes


def _polygons(fields: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points (v, 3) and triangles (t, 3) of a mesh, without faces marked as holes."""
    counts, indices, holes = fields["counts"], fields["indices"], fields["holes"]
    if len(holes):
        solid = np.ones(len(counts), bool)
        solid[holes[(holes >= 0) & (holes < len(counts))]] = False
        if counts.min(initial=0) < 0 or counts.sum(dtype=float) != len(indices):
            raise ValueError(f"its face vertex counts do not match its {len(indices)} face vertex indices")
        counts, indices = counts[solid], indices[np.repeat(solid, counts)]
    points = fields["points"].astype(np.float64)
    return points, triangulate(points, counts, indices)


def shape_triangles(shape: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Points (v, 3) and triangles (t, 3), with outward normals, of a primitive shape about its centre, in its own units.

    Args:
        shape: ``kind`` (Cube, Sphere, Cylinder, Cone, Capsule or Plane), its ``sizes`` and its ``axis`` (X, Y or Z).
    """
    kind, sizes = shape["kind"], shape["sizes"]
    if kind == "Cube":
        points, triangles = _cube(sizes["size"])
    elif kind == "Plane":
        # a sheet normal to its axis: the width is along x (z if x is the axis), the length along y (z if y is the axis)
        sides = [sizes["width"], sizes["length"]] if shape["axis"] == "Z" else [sizes["length"], sizes["width"]]
        points = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*sides, 0.0]
        triangles = np.array([[0, 1, 2], [0, 2, 3]])
    else:
        points, triangles = _revolved(_profile(kind, **sizes))
    oriented = np.empty_like(points)
    oriented[:, AXES[shape["axis"]]] = points
    return oriented, triangles


def _cube(size: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners numbered 4 x + 2 y + z."""
    points = size * (np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _profile(kind: str, radius: float, height: float = 0.0) -> np.ndarray:
    """Radii and heights of the profile of a shape of revolution, in order of height, shape (k, 2)."""
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
    """Surface of revolution of a profile (k, 2) that starts and ends on the axis."""
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
