"""What the streams of a scene are expected to insert: how many grains, and the extremes of their sizes."""

from collections.abc import Callable

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.filling.stream_amount import brought_by, mean_mass
from warpdem.scene.model import Scene
from warpdem.scene.regions import Placed
from warpdem.scene.streams import Stream

Motion = Callable[[Placed, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Position (3,) [m] and velocity (3,) [m/s] in and relative to the frame at time 0, of what is given in a region's axes."""


def extreme_grains(scene: Scene, motion: Motion = lambda place, position, velocity: (position, velocity)) -> InitialGrains:
    """The smallest and the largest grain that each portion of each stream may bring, for what is decided before the run.

    Args:
        scene: Validated scene.
        motion: Takes a place and a velocity from a region's axes to the frame; as they are by default.
    """
    names = list(scene.materials)
    rows = [(names.index(p.material), d, s) for s in scene.streams for p in s.portions for d in p.sizes.extremes]
    moving = [motion(s, _middle(s), np.array(s.velocity, dtype=float)) for _, _, s in rows]
    n = len(rows)
    return InitialGrains(
        id=np.full(n, -1, dtype=np.int64),
        type=np.array([kind for kind, _, _ in rows], dtype=np.int32),
        group=np.zeros(n, dtype=np.int32),
        radius=np.array([0.5 * d for _, d, _ in rows]).reshape(n),
        position=np.array([position for position, _ in moving]).reshape(n, 3),
        velocity=np.array([velocity for _, velocity in moving]).reshape(n, 3),
        spin=np.zeros((n, 3)),
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

    Args:
        scene: Validated scene.
        stream: One of its streams.
        end: End of the run [s].
    """
    mass = mean_mass(stream, [scene.materials[portion.material].density for portion in stream.portions])
    brought = brought_by(stream, end)
    grains = min(
        brought if stream.count_rate or stream.mass_rate is None else brought / mass,
        np.inf if stream.count is None else stream.count,
        np.inf if stream.mass is None else stream.mass / mass,
    )
    return int(grains + 1e-6)  # round-off takes none away


def mean_count(scene: Scene, stream: Stream, end: float) -> float:
    """Mean over a run to ``end`` [s] of the number of grains that a stream has brought; arguments as of ``expected_count``."""
    times = np.linspace(0.0, end, 200)
    counts = np.array([expected_count(scene, stream, time) for time in times.tolist()], dtype=float)
    return float((0.5 * (counts[1:] + counts[:-1])).mean()) if end > 0.0 else 0.0
