"""Shells of a closed mesh: their nesting, and the cavities that they bound."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpdem.core.rigid_motion import rotation_increment, unit
from warpdem.mesh import file as mesh_file
from warpdem.mesh.grouping import components
from warpdem.mesh.triangle_mesh import Rotate, TriangleMesh, build_mesh, inside

MAX_SHELLS = 200
"""Largest number of shells for which cavities are found [-]: the effort grows with its square."""


def shells(mesh: TriangleMesh) -> list[np.ndarray]:
    """Triangle numbers of each shell of a mesh: the triangles connected by their corners."""
    ends = mesh.triangles[:, [0, 1, 1, 2]].reshape(-1, 2).astype(np.int64)
    label = components(len(mesh.vertices), ends)[mesh.triangles[:, 0]]
    return [np.flatnonzero(label == shell) for shell in np.unique(label)]


def cavities(mesh: TriangleMesh, corners_in_file: np.ndarray | None = None) -> list[TriangleMesh]:
    """Cavities within a closed mesh, each bounded by one shell, such as the inside of a vessel with a wall thickness.

    A separate body within a vessel of one shell bounds no cavity. After the repair of the mesh both look alike; in the file the
    winding of the shell of a cavity is opposite to that of the shell around it, and that of a body is the same.

    Args:
        mesh: Closed mesh.
        corners_in_file: Corners of the triangles with the winding of the file [m], shape (t, 3, 3), at the position of the
            mesh; None if the mesh is as its file.
    """
    parts = shells(mesh)
    if not 1 < len(parts) <= MAX_SHELLS:
        return []
    shell_meshes = [build_mesh(mesh.corners[part], name=mesh.name) for part in parts]
    probe = [shell.corners.mean(axis=1)[:: max(1, len(shell.triangles) // 20)] for shell in shell_meshes]
    low, high = (np.array([shell.bounds[side] for shell in shell_meshes]) for side in (0, 1))
    found = []
    for k, shell in enumerate(shell_meshes):
        around = [
            j
            for j, other in enumerate(shell_meshes)
            if j != k and (low[j] <= low[k]).all() and (high[k] <= high[j]).all() and inside(other, probe[k]).all()
        ]
        if len(around) != 1 or (corners_in_file is not None and _was_flipped(shell, shell_meshes[around[0]], corners_in_file)):
            continue
        found.append(shell)
    return found


def _was_flipped(one: TriangleMesh, other: TriangleMesh, corners: np.ndarray) -> bool:
    """Whether the winding of one of two shells, but not of both, differs from that of the file."""
    middle, normal = corners.mean(axis=1), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    signs = []
    for shell in (one, other):
        own = np.cross(*(shell.corners[:, k] - shell.corners[:, 0] for k in (1, 2)))
        largest = int(np.argmax(np.linalg.norm(own, axis=1)))
        same = int(np.argmin(np.linalg.norm(middle - shell.corners[largest].mean(axis=0), axis=1)))
        signs.append(float(own[largest] @ normal[same]) > 0.0)
    return signs[0] != signs[1]


def corners_in_file(
    path: Path,
    scale: float | Sequence[float],
    rotate: Rotate | None,
    translate: Sequence[float],
    prim: str,
    key: str,
    folders: Sequence[Path] | None = None,
    part: str = "",
    tolerance: float | None = None,
) -> np.ndarray:
    """Corners of the triangles of a mesh file [m], shape (t, 3, 3), with its own winding; arguments as of ``load_mesh``."""
    corners, _ = mesh_file.read_any(Path(path), key, prim, folders, part, tolerance)
    matrix = np.eye(3)
    if rotate is not None:
        matrix = matrix + rotation_increment(unit(rotate.axis), np.array([rotate.angle]))[0].astype(float)
    return np.asarray((np.asarray(corners, float) * np.asarray(scale, float)) @ matrix.T + np.asarray(translate, float))
