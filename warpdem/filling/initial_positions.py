"""Random positions inside a region and clear of its walls, from which a packing starts."""

import numpy as np

from warpdem.core.progress import report_state
from warpdem.errors import SceneError
from warpdem.filling.fill_request import Filling
from warpdem.filling.placed_walls import TOUCH
from warpdem.mesh.triangle_mesh import signed_distance

TRIES = 1_000_000
"""Random positions in a row that are all outside the mesh, after which no grain fits (20 to 5000 for each)."""
MOST_TRIES = 300_000_000
"""Random positions tried for all grains together, after which the rest finds none [-]."""


def initial_positions(request: Filling) -> np.ndarray:
    """Random centers [m] at least a radius inside the region, shape (n, 3)."""
    space, radius = request.region, request.radius
    narrow = (2.0 * radius[:, None] > space.high - space.low).any(axis=1)
    if narrow.any():
        raise _no_position(request, radius[narrow])
    position = np.empty((len(radius), 3))
    left = np.arange(len(radius))
    in_vain = tried = 0
    while len(left):
        report_state(f"placing {len(radius)} grains: {len(left)} left")
        position[left] = space.random_points(request.generator, radius[left])
        tried += len(left)
        if space.mesh is None and space.open_space is None and not request.walls:
            break
        outside = left[~_is_free(request, position[left], radius[left])]
        in_vain = in_vain + 1 if len(outside) == len(left) else 0
        if in_vain > np.clip(TRIES // len(left), 20, 5000) or (tried > MOST_TRIES and len(outside)):
            raise _no_position(request, radius[left])
        left = outside
    return position


def _is_free(request: Filling, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Whether grains, (n, 3) and (n,) [m], are clear of the mesh and the walls of a filling, bool, shape (n,)."""
    space = request.region
    free = np.ones(len(position), bool) if space.open_space is None else space.open_space.holds(position)
    if space.mesh is not None:
        free &= signed_distance(space.mesh, position)[0] <= -radius
    for wall in request.walls:
        some = np.flatnonzero(free)
        free[some] = wall.gap(position[some], radius[some]) >= -TOUCH * radius[some]
    return free


def _no_position(request: Filling, radius: np.ndarray) -> SceneError:
    size = " x ".join(f"{v:.6g}" for v in request.region.high - request.region.low)
    return SceneError(
        f"{request.key}: no position found for {len(radius)} grains, the largest {2 * radius.max():.6g} m in diameter, "
        f"in a region of {size} m; ask for smaller grains or a larger region"
    )
