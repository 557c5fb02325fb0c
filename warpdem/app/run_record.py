"""What run.json holds: what was run, how, and with what result."""

import inspect
import json
import platform
from contextlib import suppress
from dataclasses import asdict
from typing import Any

import numpy as np

from warpdem.app import scene_warnings, step_limits, summary
from warpdem.errors import WarpdemError
from warpdem.measure.dimensionless import Turning
from warpdem.model import digests
from warpdem.ranks.front import Front
from warpdem.scene import pair_keys
from warpdem.scene.models import model
from warpdem.scene.user_models import parts_of
from warpdem.simulation import Simulation


def record(sim: Simulation, status: str, wall_seconds: float, turning: Turning | None) -> dict[str, Any]:
    """What run.json holds."""
    import warp as wp

    from warpdem import __version__

    scene = sim.scene.model_dump(mode="json")
    with suppress(WarpdemError):  # forces that cannot be evaluated: the grains are known as they are
        sim.live.gather()
    whole = sim.live.gather()  # of a run over ranks that cannot answer nobody knows the present state
    return {
        "status": status,
        "scene": sim.scene.source,
        "title": sim.scene.title,
        "scene_hash": digests.scene_hash(sim.scene),
        "state_hash": sim.state_hash() if whole else None,
        "versions": {"warpdem": __version__, "warp": wp.config.version, "numpy": np.__version__,
                     "python": platform.python_version()},
        "device": str(sim.device),
        "threads": sim.threads.count,
        "groups": sim.scene.groups,
        "plan": sim.plan.explain(),
        "notes": sim.notes,
        "warnings": [*scene_warnings.warnings(sim), *summary.shortfalls(sim)],
        "grains": len(sim.state) if whole else None,
        "time": sim.time,
        "steps": sim.step_number,
        "time_step": {"used": sim.dt, "candidates": sim.limits.candidates, "binding": sim.limits.binding,
                      "stability_limit": sim.limits.stable, "max_speed": sim.limits.max_speed},
        "limits": step_limits.limit_rows(sim),
        "models": _models(sim),
        "pair_keys": pair_keys.read_by(sim.scene.contact, sim.scene.pairs, sim.scene.located),
        "diameters": _diameters(sim),
        "clumps": _clumps(sim),
        "extremes": {**sim.extremes, "steps_per_contact": summary.steps_per_contact(sim),
                     "step_over_stability_limit": sim.guards.stability.seen.largest},
        "noticed": sim.noticed,
        "left": {name: {"grains": count, "mass": mass} for name, (count, mass) in sim.left.items()},
        "came": [{"name": f.stream.name, "grains": f.count, "mass": f.mass, "due": f.due(sim.step_number)[0]}
                 for f in sim.inlets],
        "turning": asdict(turning) if turning is not None else None,
        "packings": [asdict(packing) for packing in sim.expected.packings],
        "ranks": sim.loop.report() if isinstance(sim.loop, Front) else [],
        "lists": {"rebuilds": sim.lists.rebuilds, "refreshes": sim.lists.inner_rebuilds, "skin": sim.lists.skin},
        "seconds": {**sim.seconds, "total": wall_seconds},
        "scene_data": scene if len(json.dumps(scene)) < 100_000 else "left out: explicit arrays; see scene_hash",
    }  # fmt: skip


def _models(sim: Simulation) -> dict[str, dict[str, str]]:
    """Name of each model that was run and what its file says of itself, equations and sources, by its role."""
    scene, contact = sim.scene, sim.plan.contact
    normal, *liquid = parts_of(contact.normal)
    names = {"normal": normal, "tangential": contact.tangential, "rolling": contact.rolling}
    names |= {"liquid": liquid[0] if liquid else None, "twisting": contact.twisting, "integrator": sim.plan.backend.integrator}
    found = {}
    for role, name in names.items():
        if name:
            doc = model(role, scene.located(name)).__doc__
            found[role] = {"name": name, "doc": inspect.cleandoc(doc or "")}
    return found


def _clumps(sim: Simulation) -> dict[str, dict[str, Any]]:
    """Number of clumps that are there, members of each, and diameters [m] of spheres of their material and mass, by name."""
    found = sim.clumps
    if found is None:
        return {}
    kinds, materials = sim.particles.type, list(sim.scene.materials.values())
    first = np.searchsorted(sim.particles.id, found.id)
    density = np.array([materials[kind].density for kind in kinds[first]])
    diameter = np.cbrt(6.0 * found.mass / (np.pi * density))
    made = {}
    for number, name in enumerate(sim.scene.clumps):
        of = found.type == number
        if of.any():
            sizes = {"least": diameter[of].min(), "mean": diameter[of].mean(), "greatest": diameter[of].max()}
            made[name] = {"count": int(of.sum()), "members": int(found.members[of][0]),
                          "equivalent_diameter": {key: float(value) for key, value in sizes.items()}}  # fmt: skip
    return made


def _diameters(sim: Simulation) -> dict[str, float] | None:
    """Least, mean and greatest diameter [m] of the grains that are there, and their mass [kg]; None without grains."""
    radius = sim.particles.radius
    if not len(radius):
        return None
    least, mean, greatest = (2.0 * float(value) for value in (radius.min(), radius.mean(), radius.max()))
    return {"least": least, "mean": mean, "greatest": greatest, "mass": float(sim.particles.mass.sum())}
