"""Power of the surface velocity of belts, from the contact points at walls."""

import numpy as np

from warpdem.measure.part import Each, Part
from warpdem.model.model import Model


def surface_powers(each: Each, model: Model, bodies: np.ndarray) -> dict[str, float]:
    """Power of the surface velocity of each wall that has one [W]: the sum of F . (V - n (n . V) + a x n).

    Args:
        each: of ``Totals``.
        model: what is run.
        bodies: placements of its walls, shape (w, 24).
    """
    place, wall_of = contact_points(each, model)
    powers = {}
    for number, wall in enumerate(model.scene.walls):
        if wall.surface_velocity is not None:
            here = wall_of[place["feature"]] == number
            force, normal = place["force"][here], place["normal"][here]
            vector, circulation = bodies[number][18:21], bodies[number][21:24]
            tangential = force - np.einsum("ij,ij->i", force, normal)[:, None] * normal
            powers[wall.name] = float(tangential.sum(axis=0) @ vector + np.cross(normal, force).sum(axis=0) @ circulation)
    return powers


def contact_points(each: Each, model: Model) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Contact points with walls in order of grain id, so that sums do not depend on the lists, and the wall of each feature.

    Of the points there are ``feature``, ``force`` and ``normal``. Arguments as of ``surface_powers``.
    """
    assert model.walls is not None
    found = each(own_points)
    order = np.argsort(np.concatenate([ids for ids, _ in found]), kind="stable")  # the points of a grain keep theirs
    return {name: np.concatenate([one[name] for _, one in found])[order] for name in NOTHING}, model.walls.wall_of


NOTHING = {"feature": np.zeros(0, dtype=np.int64), "force": np.zeros((0, 3)), "normal": np.zeros((0, 3))}
"""What is read of contact points, of none."""


def own_points(part: Part) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Ids of the grains of the contact points with walls of one process, and what is read of the points."""
    lists, state, parity = part.listed, part.view.state, part.view.clock.step_number & 1
    if not (len(state) and lists.row_count):
        return np.zeros(0, dtype=np.int64), NOTHING
    slot, g = lists.point_slots(parity, lists.wall_grains)
    points = lists.contact_points(parity, slot)
    return state.id.numpy()[g], {name: points[name] for name in NOTHING}
