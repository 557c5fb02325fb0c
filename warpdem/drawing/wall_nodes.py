"""Values of triangles as values of nodes, between which a picture shades smoothly."""

import numpy as np
import pyvista as pv

SHARP_ANGLE = 35.0
"""Angle between two faces above which their values stay apart [degree]; above it an edge is drawn too."""


def nodes_of(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes that the triangles of a smooth surface share; along a sharp edge each side has nodes of its own.

    Args:
        vertices: Corners [m], shape (v, 3); the same point may be there more than once, as in an STL file.
        triangles: Corner numbers of each triangle, shape (t, 3).

    Returns:
        Positions of the nodes [m], shape (n, 3), and the nodes of each triangle, shape (t, 3).
    """
    welded, corner = np.unique(vertices, axis=0, return_inverse=True)
    mesh = pv.PolyData.from_regular_faces(welded, corner.reshape(-1)[triangles])
    split = mesh.compute_normals(
        split_vertices=True, feature_angle=SHARP_ANGLE, consistent_normals=False, non_manifold_traversal=False
    )
    return np.asarray(split.points, dtype=float), np.asarray(split.regular_faces)


def at_nodes(values: np.ndarray, nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Mean over the triangles around each node, weighted by their areas, shape (n,).

    Interpolated linearly over the triangles these have the integral over the surface that the values of the triangles have:
    a pressure keeps its force.

    Args:
        values: Values of the triangles, shape (t,); a node beside one that is no number is none either.
        nodes: Positions of the nodes [m], shape (n, 3).
        triangles: Nodes of each triangle, shape (t, 3).
    """
    a, b, c = (nodes[triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    def gathered(of_triangles: np.ndarray) -> np.ndarray:
        return np.bincount(triangles.ravel(), weights=np.repeat(of_triangles, 3), minlength=len(nodes))

    around = gathered(area)
    return np.asarray(gathered(area * values) / np.where(around > 0.0, around, 1.0))
