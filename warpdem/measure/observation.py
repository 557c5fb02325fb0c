"""Observers of a scene: a number per grain by a Warp function, and the columns of history.csv that reduce it."""

from collections.abc import Callable

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.kernels.field import Numbers
from warpdem.kernels.observer import build_each
from warpdem.measure.column import Column, Readings
from warpdem.scene.model import Scene
from warpdem.scene.models import model, numbers

REDUCTIONS = {"sum": np.sum, "mean": np.mean, "min": np.min, "max": np.max}


def observe(sim, name: str) -> np.ndarray:
    """What the observer ``name`` of the scene reads off each grain at the present time, by id, shape (n,).

    Raises:
        SceneError: the scene has no observer of that name.
    """
    known = {observer.name: observer for observer in sim.scene.observers}
    if name not in known:
        raise SceneError(f'{sim.scene.source}: no observer "{name}"; the scene has {", ".join(known) or "none"}')
    asked, p = known[name], sim.particles
    module = model("observer", sim.scene.located(asked.model))
    lab = asked.axes == "laboratory"
    vectors = (p.position_lab, p.velocity_lab, p.spin_lab) if lab else (p.position, p.velocity, p.spin)
    inputs = [wp.array(values, dtype=wp.vec3d, device=sim.device) for values in vectors]
    inputs += [wp.array(values, dtype=wp.float64, device=sim.device) for values in (p.mass, p.radius)]
    value = wp.zeros(len(p.id), dtype=wp.float64, device=sim.device)
    inputs += [wp.float64(sim.time), Numbers(*numbers(asked.parameters)), value]
    wp.launch(build_each(module.build()), dim=len(value), inputs=inputs, device=sim.device)
    return value.numpy()


def columns(scene: Scene) -> list[Column]:
    """The columns of all observers of a scene in history.csv: "NAME REDUCTION [UNIT]"."""
    return [
        Column(f"{one.name} {reduction}", model("observer", scene.located(one.model)).UNIT, _reduced(one.name, reduction))
        for one in scene.observers
        for reduction in one.reduce
    ]


def observed(sim) -> dict[str, np.ndarray]:
    """What every observer of the scene reads off each grain at the present time, by the observer's name, shapes (n,)."""
    return {one.name: observe(sim, one.name) for one in sim.scene.observers}


def _reduced(name: str, reduction: str) -> Callable[[Readings], float]:
    """One number of all grains; without grains a sum is 0 and the others are nan."""

    def read(readings: Readings) -> float:
        values = readings.observed[name]
        return float(REDUCTIONS[reduction](values)) if len(values) or reduction == "sum" else float("nan")

    return read
