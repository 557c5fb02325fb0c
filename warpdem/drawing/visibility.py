"""Which balls of a bed a camera may see: the hidden ones need not be drawn, which would take most of the time.

On a grid of cells smaller than the balls' pictures, a cell is covered from the depth on at which a ball fills it whole. A ball
is hidden if all cells that its picture may touch are covered nearer to the camera than the ball itself. Balls are taken
in order of depth, some at a time, so that only those seen need to be entered.
"""

from functools import cache

import numpy as np

from warpdem.drawing.camera import Camera

_FINE = 9.0
"""Median radius over cell size [-]."""
_LARGEST = 24
"""Radius in cells beyond which a ball is always drawn, and enters only its middle."""
_MOST_CELLS = 4e6
_ROUNDS = 40


def visible(position: np.ndarray, radius: np.ndarray, camera: Camera) -> np.ndarray:
    """Whether each ball may be seen, shape (n,), bool.

    Args:
        position: Centres [m], shape (n, 3).
        radius: Radii [m], shape (n,).
        camera: The camera.
    """
    shown = np.ones(len(radius), dtype=bool)
    seen = (position - camera.position) @ camera.axes.T
    depth = seen[:, 2]
    if not len(radius) or depth.min() <= 10.0 * radius.max():
        return shown  # the camera stands among the balls
    scale = 1.0 / depth if camera.height is None else np.ones(len(depth))
    point, size = seen[:, :2] * scale[:, None], radius * scale
    # off the axis of the camera the picture of a ball is longer than that of its disk, by 1 / cos^2 of the angle
    stretch = 1.01 + (0.0 if camera.height is not None else float(np.square(point).sum(axis=1).max()))
    point -= point.min(axis=0)
    extent = point.max(axis=0)
    cell = max(float(np.median(size)) / _FINE, float(np.sqrt(extent.prod() / _MOST_CELLS)))
    # a border that nothing covers, wide enough for the cells that any ball tested may touch
    border = int(stretch * _LARGEST) + 3
    width, height = np.ceil(extent / cell).astype(int) + 2 * border
    at = (point[:, 0] / cell).astype(int) + border + width * ((point[:, 1] / cell).astype(int) + border)
    cells = (size / cell).astype(int)
    covered = np.full(width * height, np.inf)
    for part in np.array_split(np.argsort(depth, kind="stable"), _ROUNDS):
        for k in np.unique(cells[part]):
            balls = part[cells[part] == k]
            if k < _LARGEST:
                touched = covered[at[balls][:, None] + _touched(k, stretch) @ (1, width)].max(axis=1)
                shown[balls] = depth[balls] - radius[balls] <= touched
            balls = balls[shown[balls]]
            filled = at[balls][:, None] + _filled(min(k, _LARGEST)) @ (1, width)
            np.minimum.at(covered, filled, depth[balls][:, None])
    return shown


@cache
def _filled(k: int) -> np.ndarray:
    """Cells that a disk of at least k cells' radius fills, from the cell of its centre, shape (m, 2)."""
    steps = _steps(k)
    return np.asarray(steps[np.hypot(*(np.abs(steps) + 1).T) <= k])


@cache
def _touched(k: int, stretch: float) -> np.ndarray:
    """Cells that the picture of a ball of less than k + 1 cells may touch, from the cell of its centre, shape (m, 2)."""
    cells = stretch * (k + 1)
    steps = _steps(int(cells) + 1)
    return np.asarray(steps[np.hypot(*np.maximum(np.abs(steps) - 1, 0).T) <= cells])


def _steps(most: int) -> np.ndarray:
    along = np.arange(-most, most + 1)
    return np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
