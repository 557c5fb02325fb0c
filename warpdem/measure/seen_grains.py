"""Grains and contacts as they are seen from a region that is at rest in the laboratory, or that a wall carries."""

from dataclasses import dataclass, replace

import numpy as np

from warpdem.core.snapshot import ContactNetwork
from warpdem.measure.observers import Particles
from warpdem.model.schedule import WallMotion
from warpdem.state.view import RunView


@dataclass(frozen=True, eq=False)
class SeenGrains:
    """Grains in the axes of a region, velocities relative to it; ordered by id."""

    id: np.ndarray
    """Ids, shape (n,)."""
    mass: np.ndarray
    """Masses [kg], shape (n,)."""
    radius: np.ndarray
    """Radii [m], shape (n,)."""
    position: np.ndarray
    """Positions [m], shape (n, 3)."""
    velocity: np.ndarray
    """Velocities relative to the region [m/s], shape (n, 3)."""


def seen_from(
    carrier: WallMotion, view: RunView, particles: Particles, network: ContactNetwork
) -> tuple[SeenGrains, ContactNetwork]:
    """Grains and contacts at the time of the view as seen from a region.

    With A the axes and t the origin of the region in the frame, and V + W x q the velocity of its points there:

        position   A^T (q - t)
        velocity   A^T (v - V - W x q),   v absolute

    Args:
        carrier: what carries the region.
        view: the run.
        particles: its grains.
        network: its contacts.
    """
    schedule, time = view.model.schedule, view.clock.time
    (axes, origin), position = schedule.place(carrier, time), particles.position
    velocity = particles.velocity_lab @ schedule.pose(time).rotation - schedule.velocity_of(carrier, time, position)
    seen = SeenGrains(particles.id, particles.mass, particles.radius, (position - origin) @ axes, velocity @ axes)
    in_axes = {name: getattr(network, name) @ axes for name in ("force", "friction_force")}
    moved = {name: (getattr(network, name) - origin) @ axes for name in ("start", "end")}
    return seen, replace(network, **in_axes, **moved)
