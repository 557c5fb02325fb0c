"""Volume of the inside of a closed mesh within a box."""

import numpy as np
import numpy.typing as npt

from warpdem.mesh.triangle_mesh import TriangleMesh


def clipped_volume(mesh: TriangleMesh, box: npt.ArrayLike) -> float:
    """Volume [m3] of the inside of a closed mesh within an axis-aligned box, exact.

    The divergence theorem for the field (0, 0, clip(z, z_low, z_high)), whose flux through the cut faces of the box is
    zero or, at its lids, constant: only the triangles of the mesh, clipped at the box, are needed.

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


def _split(t: np.ndarray, axis: int, value: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (t, 3, 3) split at the plane x[axis] = value: those below it and those above it, with the same winding."""
    d = t[:, :, axis] - value
    below, above = (d <= 0.0).all(axis=1), (d >= 0.0).all(axis=1) & ~(d <= 0.0).all(axis=1)
    cut = ~below & ~above
    t_cut, d = t[cut], d[cut]
    high = d > 0.0
    # permute each so that the corner alone on its side comes first; a corner in the plane counts as below
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
