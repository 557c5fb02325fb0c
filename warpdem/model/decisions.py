"""What was decided of a scene from all its grains: with it another process makes the same model without them."""

from dataclasses import dataclass, replace

import numpy as np

from warpdem.filling.initial_grains import InitialGrains
from warpdem.model.digests import Given
from warpdem.model.dynamic_walls import DynamicWall
from warpdem.model.features import Features
from warpdem.model.model import Model
from warpdem.model.time_step import Limits
from warpdem.scene.model import Scene

SAMPLE = 256
"""Grains of a sample at most."""


@dataclass(frozen=True)
class Decisions:
    """Fields as of ``Model``; where ranks get them (``of``), scenes are without arrays of grains (positions, radii ...)."""

    given: Given
    scene: Scene
    expected: InitialGrains
    """A sample of them: the smallest, the largest, and others evenly in between."""
    features: Features
    limits: Limits
    dt: float
    coefficient_table: np.ndarray
    dynamic: list[DynamicWall]
    """Walls that move by the load on them, with what meshes and grains make of them."""

    @classmethod
    def of(cls, model: Model) -> "Decisions":
        """Those that a model was made with."""
        table, walls, scene = model.coefficient_table, model.schedule.dynamic, _without_arrays(model.scene)
        given = replace(model.given, scene=_without_arrays(model.given.scene), json="")
        return cls(given, scene, sample(model.expected), model.features, model.limits, model.dt, table, walls)


def _without_arrays(scene: Scene) -> Scene:
    """The scene without what it says of its grains one by one."""
    groups = [
        group.model_copy(update={name: None for name, value in group if isinstance(value, np.ndarray)})
        for group in scene.grains
    ]
    return scene.model_copy(update={"grains": groups})


def sample(grains: InitialGrains) -> InitialGrains:
    """At most ``SAMPLE`` of the grains, without clumps: the smallest, the largest, and others evenly in between."""
    order = np.argsort(grains.radius, kind="stable")
    some = np.unique(np.linspace(0, len(order) - 1, SAMPLE).round().astype(np.int64)) if len(order) else order
    names = ("id", "type", "group", "radius", "position", "velocity", "spin")
    picked = {name: getattr(grains, name)[order[some]] for name in names}
    return replace(grains, **picked, packings=(), notes=(), clumps=None)
