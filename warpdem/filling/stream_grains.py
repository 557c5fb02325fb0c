"""What the streams of a scene are expected to insert: how many grains, and the extremes of their sizes."""

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.scene.grains import Stream
from warpdem.scene.model import Scene
from warpdem.scene.size_distribution import size_law


def extreme_grains(scene: Scene) -> InitialGrains:
    """The smallest and the largest grain that each stream may bring, for what is decided before the run."""
    names = list(scene.materials)
    rows = [(names.index(s.material), d, s) for s in scene.streams for d in size_law(s.diameter).extremes]
    n = len(rows)
    return InitialGrains(
        id=np.full(n, -1, dtype=np.int64),
        type=np.array([kind for kind, _, _ in rows], dtype=np.int32),
        group=np.zeros(n, dtype=np.int32),
        radius=np.array([0.5 * d for _, d, _ in rows]).reshape(n),
        position=np.array([0.5 * (np.array(s.box.min) + s.box.max) for _, _, s in rows]).reshape(n, 3),
        velocity=np.array([s.velocity for _, _, s in rows]).reshape(n, 3),
        spin=np.zeros((n, 3)),
    )


def expected_count(stream: Stream, density: float, end: float) -> int:
    """How many grains a stream brings up to ``end`` [s] if each finds room, at the mean mass of its sizes; 0 before it begins.

    Args:
        stream: Stream of the scene.
        density: Of its material [kg/m3].
        end: End of the run [s].
    """
    elapsed = max(0.0, (end if stream.until is None else min(end, stream.until)) - stream.start)
    rate = stream.count_rate or (stream.mass_rate or 0.0) / (density * size_law(stream.diameter).mean_volume)
    return int(rate * elapsed + 1e-6)  # round-off takes none away


def mean_count(stream: Stream, density: float, end: float) -> float:
    """Mean over a run to ``end`` [s] of the number of grains that a stream has brought; arguments as of ``expected_count``."""
    last = end if stream.until is None else min(end, stream.until)
    return expected_count(stream, density, end) * max(0.0, end - 0.5 * (stream.start + last)) / end
