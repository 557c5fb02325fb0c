"""Everything that a writer needs of a run at one time."""

from dataclasses import replace

import numpy as np

from warpdem.core.snapshot import Snapshot, WallLoad
from warpdem.measure import clumps
from warpdem.measure.contact_network import read_network
from warpdem.measure.observers import Particles
from warpdem.measure.wall_loads import read_loads
from warpdem.measure.wall_wear import read_wear
from warpdem.state.view import RunView


def take_snapshot(view: RunView, loads: bool = True) -> Snapshot:
    """The snapshot of a run at the time of the view: what its scene writes, and nothing else.

    Args:
        view: the run.
        loads: with the loads on walls, if the scene writes them: those of the grains in the view.
    """
    model, clock, p = view.model, view.clock, Particles(view)
    scene = model.scene
    return Snapshot(
        step=clock.step_number,
        time=clock.time,
        frame=model.schedule.pose(clock.time),
        id=p.id,
        type=p.type,
        group=p.group,
        radius=p.radius,
        mass=p.mass,
        position=p.position,
        velocity=p.velocity,
        spin=p.spin,
        force=p.force,
        walls=model.schedule.wall_placements(scene, clock.time),
        loads=take_loads(view) if loads else {},
        orientation=p.orientation if scene.output.orientation else None,
        contacts=read_network(view, scene.output.contacts) if scene.output.contacts or scene.measures.grid else None,
        clump=clumps.of_grains(view) if view.state.clumps is not None else None,
        clumps=clumps.read_clumps(view) if view.state.clumps is not None else None,
        liquid=p.liquid if model.liquid is not None else None,
        gravity=np.array(scene.gravity, dtype=float),
    )


def take_loads(view: RunView) -> dict[str, WallLoad]:
    """Loads on the walls, in frame axes, with the wear of meshes where the scene asks for it; none if it leaves them out."""
    if not view.model.scene.output.wall_loads:
        return {}
    loads = read_loads(view)
    for name, wear in read_wear(view).items():
        if len(loads[name].pressure):
            loads[name] = replace(loads[name], wear=wear.of_triangles())
    return loads
