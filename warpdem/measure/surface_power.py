"""Power of the surface velocity of belts, from the contact points at walls."""

import numpy as np

from warpdem.state.view import RunView


def surface_powers(view: RunView, bodies: np.ndarray) -> dict[str, float]:
    """Power of the surface velocity of each wall that has one [W]: the sum of F . (V - n (n . V) + a x n)."""
    place, wall_of = contact_points(view)
    powers = {}
    for number, wall in enumerate(view.model.scene.walls):
        if wall.surface_velocity is not None:
            here = wall_of[place["feature"]] == number
            force, normal = place["force"][here], place["normal"][here]
            vector, circulation = bodies[number][18:21], bodies[number][21:24]
            tangential = force - np.einsum("ij,ij->i", force, normal)[:, None] * normal
            powers[wall.name] = float(tangential.sum(axis=0) @ vector + np.cross(normal, force).sum(axis=0) @ circulation)
    return powers


def contact_points(view: RunView) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Contact points with walls in order of grain id, so that sums do not depend on the lists, and the wall of each feature."""
    lists, state, parity = view.contacts, view.state, view.clock.step_number & 1
    assert view.model.walls is not None
    g = lists.wall_grains if len(state) else np.zeros(0, dtype=np.int32)
    slot, _ = lists.point_slots(parity, g[np.argsort(state.id.numpy()[g])])
    return lists.contact_points(parity, slot), view.model.walls.wall_of
