"""Observers of a scene: a number per grain by a Warp function, and the columns of history.csv that reduce it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.kernels.field import Numbers
from warpdem.kernels.observer import build_each
from warpdem.measure.column import Column, Readings
from warpdem.measure.observers import Particles
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.parameters import numbers
from warpdem.state.view import RunView

REDUCTIONS: dict[str, Callable[[np.ndarray], np.floating]] = {"sum": np.sum, "mean": np.mean, "min": np.min, "max": np.max}


def observe(view: RunView, name: str) -> np.ndarray:
    """What the observer ``name`` of the scene reads off each grain at the time of the view, by id, shape (n,).

    Raises:
        SceneError: the scene has no observer of that name.
    """
    run = view.model
    known = {observer.name: observer for observer in run.scene.observers}
    if name not in known:
        raise SceneError(f'{run.scene.source}: no observer "{name}"; the scene has {", ".join(known) or "none"}')
    asked, p = known[name], Particles(view)
    module = model("observer", run.scene.located(asked.model))
    lab = asked.axes == "laboratory"
    vectors = (p.position_lab, p.velocity_lab, p.spin_lab) if lab else (p.position, p.velocity, p.spin)
    inputs: list[Any] = [wp.array(values, dtype=wp.vec3d, device=run.device) for values in vectors]
    inputs += [wp.array(values, dtype=wp.float64, device=run.device) for values in (p.mass, p.radius)]
    value = wp.zeros(len(p.id), dtype=wp.float64, device=run.device)
    inputs += [wp.float64(view.clock.time), Numbers(*numbers(asked.parameters)), value]
    wp.launch(build_each(module.build()), dim=len(value), inputs=inputs, device=run.device)
    return value.numpy()


def columns(scene: Scene) -> list[Column]:
    """The columns of all observers of a scene in history.csv: "NAME REDUCTION [UNIT]"."""
    return [
        Column(f"{one.name} {reduction}", model("observer", scene.located(one.model)).UNIT, _reduced(one.name, reduction), True)
        for one in scene.observers
        for reduction in one.reduce
    ]


def observed(view: RunView) -> dict[str, np.ndarray]:
    """What every observer of the scene reads off each grain at the time of the view, by the observer's name, shapes (n,)."""
    return {one.name: observe(view, one.name) for one in view.model.scene.observers}


def _reduced(name: str, reduction: str) -> Callable[[Readings], float]:
    """One number of all grains; without grains a sum is 0 and the others are nan."""

    def read(readings: Readings) -> float:
        values = readings.observed[name]
        return float(REDUCTIONS[reduction](values)) if len(values) or reduction == "sum" else float("nan")

    return read
