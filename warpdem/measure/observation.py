"""Observers of a scene: a number per grain by a Warp function, and what is made of it in history.csv."""

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.kernels.field import Numbers
from warpdem.kernels.observer import build_each
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


def columns(scene) -> list[str]:
    """Header in history.csv: "NAME REDUCTION [UNIT]" of each observer."""
    return [
        f"{one.name} {reduction} [{model('observer', scene.located(one.model)).UNIT}]"
        for one in scene.observers
        for reduction in one.reduce
    ]


def row(sim) -> list[float]:
    """What stands below ``columns`` at the present time; without grains a sum is 0 and the others are nan."""
    found = []
    for one in sim.scene.observers:
        values = observe(sim, one.name)
        there = len(values) > 0
        found += [float(REDUCTIONS[key](values)) if there or key == "sum" else float("nan") for key in one.reduce]
    return found
