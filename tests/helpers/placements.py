"""Placements of bodies for tests: axes that are turned, shifted and move, and how points of a body move."""

import numpy as np

from warpdem.core import rigid_motion


def turned(axis, angle: float) -> np.ndarray:
    """Rotation about an axis by an angle [rad], shape (3, 3)."""
    return np.eye(3) + rigid_motion.rotation_increment(rigid_motion.unit(axis), np.array([angle]))[0].astype(float)


def moving_axes() -> np.ndarray:
    """Placement of axes that are turned, shifted and move, and whose surface moves as well."""
    return np.concatenate([turned([1, 2, 3], 0.7).ravel(), np.random.default_rng(1).normal(size=15)])


def point_and_velocity(placement: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where a body point is [m], and how fast it moves [m/s]."""
    where = placement[:9].reshape(3, 3) @ point + placement[9:12]
    return where, placement[15:18] + np.cross(placement[12:15], where)
