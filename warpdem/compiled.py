"""From a plan to its kernels: imports only the chosen models and builds each once."""

import functools

import warp as wp

from warpdem.kernels import Built, law, loop, motion, neighbours, pairs
from warpdem.kernels.wall import candidates, contact
from warpdem.plan import Plan, model


@functools.cache
def compile_plan(plan: Plan) -> Built:
    """Kernels and array structs of a plan; nothing is compiled until it is launched.

    Returns:
        Namespace with ``loop`` (the step), ``lists`` (neighbours), ``walls`` (candidate kernels or None), ``Rows``.
    """
    real = wp.float64
    constants, contact_law = law.build(
        real,
        model("normal", plan.normal),
        model("tangential", plan.tangential) if plan.tangential else None,
        model("rolling", plan.rolling) if plan.rolling else None,
        plan.torsion,
    )
    shared = {"spins": plan.spins, "rolling": plan.rolling is not None, "memory": plan.memory, "table": plan.table}
    turning = {"turning_frame": plan.turning_frame}
    pair_pack = pairs.build(real, contact_law, plan.lanes, **shared, **turning)
    Rows, touch = contact.build(contact_law, constants, **shared, **turning, lag=plan.lag, moving=plan.moving)
    load, advance = motion.build(spins=plan.spins, walls=plan.walls, moving=plan.moving, **turning)
    step = loop.build(pair_pack, touch, Rows, load, advance, spins=plan.spins, walls=plan.walls)
    lists = neighbours.build(constants, plan.lanes, **shared, lag=plan.lag)
    walls = None
    if plan.walls:
        walls = candidates.build(
            contact.closest_on_feature,
            Rows,
            spins=plan.spins,
            meshes=plan.meshes,
            planes=plan.planes,
            memory=plan.memory,
        )
    return Built(loop=step, lists=lists, walls=walls, Rows=Rows, pairs=pair_pack)
