"""Where the grains of a packing begin, and how grains and clumps are moved back into the region that they fill."""

from dataclasses import replace

import numpy as np

from warpdem.filling.fill_request import Filling
from warpdem.filling.initial_positions import initial_positions
from warpdem.filling.packing_walls import PackingWall
from warpdem.filling.rigid_moves import RigidMoves


def starting_positions(request: Filling, cell: float) -> tuple[np.ndarray, np.ndarray, RigidMoves | None]:
    """Order of the grains of a filling by space, random positions in that order [m], and how clumps move.

    Args:
        request: The filling.
        cell: Edge of the cells that are gone through [m].
    """
    clumps = request.clumps
    if clumps is None:
        points = initial_positions(request)
        order = np.lexsort(np.floor(points / cell).T)
        return order, points[order], None
    centre = initial_positions(replace(request, radius=clumps.reach, clumps=None))
    by_space = np.lexsort(np.floor(centre / cell).T)
    place = np.argsort(by_space)  # of each clump in that order
    order = np.argsort(place[clumps.of], kind="stable")
    sorted_clumps = replace(
        clumps, of=place[clumps.of][order], arm=clumps.arm[order], turn=clumps.turn[by_space], size=clumps.size[by_space]
    )
    rigid = RigidMoves(sorted_clumps, request.radius[order], centre[by_space])
    return order, rigid.positions(), rigid


def keep_grains_in(
    request: Filling, loose: np.ndarray, before: np.ndarray, radius: np.ndarray, walls: list[PackingWall]
) -> None:
    """Move grains (n, 3) [m] of a filling back into its region, in place."""
    request.region.clamp(loose, radius)
    for wall in walls:
        came_from = loose.copy() if len(walls) > 1 else None
        wall.push_in(loose)
        if came_from is not None:  # the other walls count on knowing of every move
            for other in walls:
                if other is not wall:
                    other.note(loose - came_from)
    if request.region.open_space is not None:
        strayed = ~request.region.open_space.is_near(loose)
        loose[strayed] = before[strayed]
        for wall in walls:
            wall.slack[strayed] = np.minimum(wall.slack[strayed], 0.0)  # to be measured again


def moved_and_kept_in(
    request: Filling, rigid: RigidMoves, move: np.ndarray, radius: np.ndarray, walls: list[PackingWall]
) -> np.ndarray:
    """Move clumps as the rigid moves of their members say, and back into the region; positions of the members [m]."""
    centre, turn = rigid.centre.copy(), rigid.turn.copy()
    rigid.advance(move)
    members = rigid.positions()
    inside = members.copy()
    request.region.clamp(inside, radius)
    members += rigid.keep_in(inside - members, along_axes=True)
    for wall in walls:
        off = members.copy()
        wall.push_in(off)
        shift = rigid.keep_in(off - members, along_axes=False)
        members += shift
        for one in walls:
            one.note(shift)
    if request.region.open_space is not None:
        strayed = ~request.region.open_space.is_near(members)
        if strayed.any():
            rigid.restore(strayed, centre, turn)
            members = rigid.positions()
            for wall in walls:
                wall.slack[:] = np.minimum(wall.slack, 0.0)  # to be measured again
    return members
