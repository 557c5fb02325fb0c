"""The skins of a closed mesh: which lie within which, and which of them bound a cavity."""

from pathlib import Path

import numpy as np

from warpdem.core.rigid_motion import rotation_increment, unit
from warpdem.mesh import file as mesh_file
from warpdem.mesh import usd_geometry
from warpdem.mesh.grouping import components
from warpdem.mesh.triangle_mesh import TriangleMesh, build_mesh, inside
from warpdem.usd.stage import USD_SUFFIXES

MOST_SHELLS = 200
"""Skins up to which is looked for cavities [-]: the effort grows with their square."""


def shells(mesh: TriangleMesh) -> list[np.ndarray]:
    """Triangle numbers of each skin of a mesh: those that hang together by their corners."""
    ends = mesh.triangles[:, [0, 1, 1, 2]].reshape(-1, 2).astype(np.int64)
    label = components(len(mesh.vertices), ends)[mesh.triangles[:, 0]]
    return [np.flatnonzero(label == kind) for kind in np.unique(label)]


def cavities(mesh: TriangleMesh, corners_in_file: np.ndarray | None = None) -> list[TriangleMesh]:
    """The hollows within a closed mesh, each bounded by one skin: of a vessel with a wall thickness, the space that it holds.

    A body that lies loose in a vessel of one skin is none. Once a mesh is mended both look alike; in the file the skin of a
    hollow is wound the other way than the one around it, that of a body likewise.

    Args:
        mesh: Closed mesh.
        corners_in_file: Corners of the triangles as the file winds them [m], shape (t, 3, 3), placed as those of the mesh; None
            if the mesh is as its file.
    """
    parts = shells(mesh)
    if not 1 < len(parts) <= MOST_SHELLS:
        return []
    skins = [build_mesh(mesh.corners[part], name=mesh.name) for part in parts]
    probe = [skin.corners.mean(axis=1)[:: max(1, len(skin.triangles) // 20)] for skin in skins]
    low, high = (np.array([skin.bounds[side] for skin in skins]) for side in (0, 1))
    found = []
    for k, skin in enumerate(skins):
        around = [
            j
            for j, other in enumerate(skins)
            if j != k and (low[j] <= low[k]).all() and (high[k] <= high[j]).all() and inside(other, probe[k]).all()
        ]
        if len(around) != 1 or (corners_in_file is not None and _was_turned(skin, skins[around[0]], corners_in_file)):
            continue
        found.append(skin)
    return found


def _was_turned(one: TriangleMesh, other: TriangleMesh, corners: np.ndarray) -> bool:
    """Whether the windings of one of two skins, but not of both, differ from those of the file."""
    middle, normal = corners.mean(axis=1), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    signs = []
    for skin in (one, other):
        own = np.cross(*(skin.corners[:, k] - skin.corners[:, 0] for k in (1, 2)))
        largest = int(np.argmax(np.linalg.norm(own, axis=1)))
        same = int(np.argmin(np.linalg.norm(middle - skin.corners[largest].mean(axis=0), axis=1)))
        signs.append(float(own[largest] @ normal[same]) > 0.0)
    return signs[0] != signs[1]


def corners_in_file(path: Path, scale: float, rotate, translate, prim: str, key: str, folders=None) -> np.ndarray:
    """Corners of the triangles of a mesh file [m], shape (t, 3, 3), as it winds them; arguments as of ``load_mesh``."""
    if Path(path).suffix.lower() in USD_SUFFIXES:
        corners, _ = usd_geometry.read_triangles(path, prim, key, folders)
    else:
        corners = mesh_file.read_triangles(path, key)
    turn = np.eye(3)
    if rotate is not None:
        turn = turn + rotation_increment(unit(rotate.axis), np.array([rotate.angle]))[0].astype(float)
    return (np.asarray(corners, float) * float(scale)) @ turn.T + np.asarray(translate, float)
