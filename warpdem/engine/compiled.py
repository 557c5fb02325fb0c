"""From a plan to its kernels: imports only the chosen models and builds each once."""

import functools

import warp as wp

from warpdem.kernels import Built
from warpdem.kernels.contact import columns, dissipation, law, pairs, thread_contact
from warpdem.kernels.lists import flight, neighbors, rebuild
from warpdem.kernels.measure import budget, flow
from warpdem.kernels.step import border, loop, motion, orientation
from warpdem.kernels.step import graph as captured
from warpdem.kernels.wall import candidates, contact, feature
from warpdem.kernels.wall import images as wall_images
from warpdem.model.plan import Plan
from warpdem.scene.models import is_file, model, using


def compile_plan(plan: Plan, device=None) -> Built:
    """Kernels and array structs of a plan.

    Nothing is compiled until it is launched, except on ``device`` what holds the user's own models: their mistakes come
    before the run.

    Returns:
        Namespace with ``loop`` (the step), ``resident`` and ``renewal`` (the GPU's, or None), ``lists`` (neighbours),
        ``walls`` (candidate kernels or None), ``paths`` (grains in flight), ``Rows``.

    Raises:
        SceneError: Warp cannot compile a file of the user.
    """
    names = [plan.normal, plan.tangential or "", plan.rolling or "", *(name for name, _ in plan.fields)]
    with using(names):
        built = _built(plan)
        if device is not None and any(is_file(name) for name in names):
            stepping = vars(built.resident).values() if plan.resident else (built.loop.run,)
            for thing in (*stepping, built.loop.read_budget):
                if isinstance(thing, wp.Kernel):
                    wp.load_module(thing.module, device=device)
    return built


@functools.cache
def _built(plan: Plan) -> Built:
    """Kernels and array structs of a plan, each built once."""
    models = (
        model("normal", plan.normal),
        model("tangential", plan.tangential) if plan.tangential else None,
        model("rolling", plan.rolling) if plan.rolling else None,
    )
    wall_law = law.build(wp.float64, *models, plan.torsion, wall=True)
    pair_law = law.build(plan.real, *models, plan.torsion)
    pair_parts = dissipation.build(plan.real, *models, plan.torsion)[0] if plan.energy else None
    wall_parts = dissipation.build(wp.float64, *models, plan.torsion) if plan.energy else None
    spins = {"spins": plan.spins}
    rolling = plan.rolling is not None
    stored = columns.stored_constants(models[0], rolling)
    shared = {**spins, "table": plan.table, "gap": plan.gap}
    met = {"rolling": rolling, "inertia_factor": plan.inertia_factor}
    scheme = plan.scheme
    # a scheme with frame-relative velocities sees contacts as if the frame were at rest
    turning = plan.turning_frame and not scheme.RELATIVE
    shifting = plan.moving_frame and not scheme.RELATIVE
    images = border.build(plan.period, plan.lower)
    pair_pack = pairs.build(plan.real, pair_law, pair_parts, images, plan.lanes, **shared, stored=stored, turning_frame=turning)
    shapes = [count > 0 for count in (plan.planes, plan.revolutions, plan.spheres)]
    meshes = plan.meshes > 0
    closest_on_feature = feature.build(meshes, *shapes)
    around = wall_images.build(closest_on_feature, images, repeated=plan.wall_images)
    Rows, touch = contact.build(
        wall_law, wall_parts, closest_on_feature, images, around, **shared, **met, turning_frame=turning,
        moving_frame=shifting, meshes=meshes, moving=plan.moving,
    )  # fmt: skip
    fields = tuple((model("field", name).build(), axes == "laboratory") for name, axes in plan.fields)
    stages = len(scheme.STAGES)
    sums = None
    if plan.energy or plan.momentum:
        sums = budget.build(
            plan.real, fields, tuple(hasattr(model("field", name), "energy") for name, _ in plan.fields), **spins,
            walls=plan.walls, energy=plan.energy, momentum=plan.momentum, turning_frame=plan.turning_frame,
            moving_frame=plan.moving_frame, periodic=any(plan.period),
        )  # fmt: skip
    # a stage may look ahead of the step's beginning by about a step
    travel = motion.build_travel(
        images, **spins, moving=plan.moving, in_frame=plan.in_frame, outlets=plan.outlets, ahead=1.5 if stages > 1 else 0.0,
        stages=stages,
    )  # fmt: skip
    step = loop.build(
        pair_pack,
        touch,
        Rows,
        motion.build_load(plan.real, **spins, walls=plan.walls),
        motion.build_acceleration(fields, **spins, relative=scheme.RELATIVE),
        travel.travelled,
        scheme.build(**spins, turning_frame=plan.turning_frame, moving_frame=plan.moving_frame),
        images,
        orientation.build(turning_axes=turning) if plan.orientation else None,
        sums,
        flow.build(moving_frame=plan.moving_frame) if plan.flows else None,
        **spins,
        stages=stages,
        walls=plan.walls,
        leave=plan.outlets > 0,
    )
    lists = neighbors.build(
        plan.real, wall_law, images, plan.lanes, **shared, stored=stored, history=plan.memory,
        inertia_factor=plan.inertia_factor, keep_constants=not plan.resident,
    )  # fmt: skip
    walls = None
    if plan.walls:
        walls = candidates.build(
            around,
            images,
            Rows,
            spins=plan.spins,
            meshes=meshes,
            shapes=any(shapes),
            gap=plan.gap,
            leave=plan.outlets > 0,
        )
    paths = flight.build(
        travel, images, closest_on_feature, Rows, **spins, moving=plan.moving, meshes=meshes, shapes=any(shapes), gap=plan.gap,
        stages=stages, shortest=min((length for length in plan.period if length), default=0.0),
    )  # fmt: skip
    graph = again = None
    if plan.resident:
        evaluate = thread_contact.build(
            plan.real, pair_law, wall_law.constants, pair_pack, images, pair_parts is not None, **shared, **met,
            turning_frame=turning,
        )  # fmt: skip
        graph = captured.build(
            step, pair_pack, evaluate, Rows, travel, images, plan.real, **spins, history=plan.memory, stages=stages,
            lanes=plan.lanes, moving=plan.moving, table=plan.table, leave=plan.outlets > 0,
        )  # fmt: skip
        again = rebuild.build(Rows)
    return Built(loop=step, resident=graph, renewal=again, lists=lists, walls=walls, Rows=Rows, pairs=pair_pack, paths=paths)
