"""What a scene takes over from the checkpoint that it starts from."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.scene.model import Scene


@dataclass(frozen=True)
class Past:
    """What a scene starts from; read by ``state.restart``."""

    scene: Scene
    """The scene with frame, walls and streams as they go on."""
    grains: InitialGrains
    """The grains at time 0."""
    data: dict[str, np.ndarray]
    """Contact history, as ``contact_history.remember`` takes it; orientation of the grains, if that was kept."""
    old_walls: tuple[str, ...]
    """Names of walls that were there with the same geometry."""
    next_id: int
    """Least id that no grain had so far."""
    inlets: dict[int, dict[str, Any]]
    """State of the random numbers of streams that go on."""
    notes: tuple[str, ...]
    """What was left behind."""
    film: np.ndarray | None = None
    """Liquid of the grains in counts, shape (n, 3); None without a law of bridges."""
