"""What the streams of a scene are expected to insert: how many grains, and the extremes of their sizes."""

from collections.abc import Callable

import numpy as np

from warpdem.filling.clump_grains import of_groups
from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.stream_amount import brought_by, mean_mass, mean_members
from warpdem.filling.stream_portions import extreme_bodies, portions_of
from warpdem.scene.model import Scene
from warpdem.scene.regions import Placed
from warpdem.scene.streams import Stream

Motion = Callable[[Placed, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Position (3,) [m] and velocity (3,) [m/s] in and relative to the frame at time 0, of what is given in a region's axes."""


def extreme_grains(scene: Scene, motion: Motion = lambda place, position, velocity: (position, velocity)) -> InitialGrains:
    """The smallest and the largest grain that each portion of each stream may bring, for what is decided before the run.

    Of clumps it is one, turned as it may come.

    Args:
        scene: Validated scene.
        motion: Takes a place and a velocity from a region's axes to the frame; as they are by default.

    Raises:
        SceneError: A file of a clump is missing or wrong.
    """
    groups, names = [], list(scene.materials)
    for stream in scene.streams:
        center, velocity = motion(stream, _middle(stream), np.array(stream.velocity, dtype=float))
        for portion, bodies in zip(stream.portions, portions_of(scene, stream), strict=True):
            clumps, members = extreme_bodies(bodies, center, velocity)
            groups.append((names.index(portion.material), clumps if len(clumps) else None, members))
    counts = [len(members[1]) for _, _, members in groups]
    n = sum(counts)
    rows = [np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3))]
    position, radius, velocity, spin = (
        np.concatenate([none, *(members[k] for _, _, members in groups)]) for k, none in enumerate(rows)
    )
    return InitialGrains(
        id=np.full(n, -1, dtype=np.int64),
        type=np.repeat(np.array([kind for kind, _, _ in groups], dtype=np.int32), counts),
        group=np.zeros(n, dtype=np.int32),
        radius=radius,
        position=position,
        velocity=velocity,
        spin=spin,
        clumps=of_groups([clumps for _, clumps, _ in groups], counts) if groups else None,
    )


def _middle(stream: Stream) -> np.ndarray:
    """Middle of the region of a stream [m], shape (3,); of a mesh where it is translated to, before it is read."""
    shape = getattr(stream, stream.shape_key)
    if stream.mesh is not None or stream.face is not None:
        return np.array(shape.translate, dtype=float)
    low, high = shape.bounds
    return np.asarray(0.5 * (low + high))


def expected_count(scene: Scene, stream: Stream, end: float) -> int:
    """How many grains a stream brings up to ``end`` [s] if each finds room, at the mean mass of its sizes; 0 before it begins.

    Members of clumps count one by one.

    Args:
        scene: Validated scene.
        stream: One of its streams.
        end: End of the run [s].
    """
    mass, members = _means(scene, stream)
    return int(members * _bodies(stream, mass, end))


def _means(scene: Scene, stream: Stream) -> tuple[float, float]:
    """Mean mass [kg] and mean number of grains of the bodies of a stream."""
    portions = portions_of(scene, stream)
    masses = [one.mean_mass for one in portions]
    return mean_mass(stream, masses), mean_members(stream, masses, [one.members for one in portions])


def _bodies(stream: Stream, mass: float, end: float) -> int:
    """Grains and clumps of ``mass`` [kg] that a stream brings up to ``end`` [s]."""
    brought = brought_by(stream, end)
    bodies = min(
        brought if stream.count_rate or stream.mass_rate is None else brought / mass,
        np.inf if stream.count is None else stream.count,
        np.inf if stream.mass is None else stream.mass / mass,
    )
    return int(bodies + 1e-6)  # round-off takes none away


def mean_count(scene: Scene, stream: Stream, end: float) -> float:
    """Mean over a run to ``end`` [s] of the number of grains that a stream has brought; arguments as of ``expected_count``."""
    mass, members = _means(scene, stream)
    times = np.linspace(0.0, end, 200)
    counts = members * np.array([_bodies(stream, mass, time) for time in times.tolist()], dtype=float)
    return float((0.5 * (counts[1:] + counts[:-1])).mean()) if end > 0.0 else 0.0
