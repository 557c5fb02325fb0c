"""Triangles of the surface of a union of spheres, for drawing only: contacts and mass properties use the spheres."""

from dataclasses import dataclass

import numpy as np

SUBDIVISIONS = 3
"""Of an icosahedron: 642 corners on a sphere, whose faces lie within 0.3 % of the radius below it."""


@dataclass(frozen=True)
class SphereMesh:
    """Triangles whose corners lie on spheres."""

    vertices: np.ndarray
    """Corners [m], shape (v, 3)."""
    normals: np.ndarray
    """Outward normals of the spheres at the corners, shape (v, 3)."""
    triangles: np.ndarray
    """Corner numbers of each triangle, counterclockwise seen from outside, shape (t, 3), int32."""


def union_mesh(centre: np.ndarray, radius: np.ndarray) -> SphereMesh:
    """Surface of a union of spheres, without the triangles whose corners all lie within another sphere.

    Where spheres meet, triangles of both go on to the next corner below the other surface: no gap is seen from outside.

    Args:
        centre: Centres [m], shape (n, 3).
        radius: Radii [m], shape (n,).
    """
    from trimesh.creation import icosphere  # slow to import

    ball = icosphere(subdivisions=SUBDIVISIONS)
    normal, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    count = 0
    for i in range(len(radius)):
        corners = centre[i] + radius[i] * normal
        depth = np.linalg.norm(corners[:, None] - centre[None], axis=2) < radius * (1.0 - 1e-9)
        depth[:, i] = False
        seen = faces[~depth.any(axis=1)[faces].all(axis=1)]
        used, numbers = np.unique(seen, return_inverse=True)
        parts.append((corners[used], normal[used], numbers.reshape(-1, 3) + count))
        count += len(used)
    vertices, normals, triangles = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return SphereMesh(vertices, normals, triangles.astype(np.int32))
