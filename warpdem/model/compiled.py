"""From the features of a scene to its kernels: imports only the chosen models and builds each once."""

import functools

import warp as wp

from warpdem.kernels import Built
from warpdem.kernels.contact import dissipation, law, pairs, thread_contact
from warpdem.kernels.lists import displacement, flight, inner, neighbors, rebuild
from warpdem.kernels.measure import budget, flow
from warpdem.kernels.observer import build_each
from warpdem.kernels.step import border, loop, motion, orientation
from warpdem.kernels.step import graph as captured
from warpdem.kernels.wall import candidates, contact, feature
from warpdem.kernels.wall import images as wall_images
from warpdem.model.features import Features
from warpdem.scene.model import Scene
from warpdem.scene.models import is_file, model, using


def compile_kernels(features: Features, device: wp.Device | None = None) -> Built:
    """Kernels and array structs of the chosen features.

    Nothing is compiled until it is launched, except on ``device`` what holds the user's own models: their mistakes come
    before the run.

    Returns:
        Namespace with ``loop`` (the step), ``graph`` and ``rebuild`` (the GPU's, or None), ``lists`` (neighbors),
        ``displacement``, ``inner`` (the inner list on CPU threads), ``walls`` (candidate kernels or None), ``paths`` (grains
        in flight), ``WallContacts``.

    Raises:
        SceneError: Warp cannot compile a file of the user.
    """
    laws = features.contact
    names = [laws.normal, laws.tangential or "", laws.rolling or "", *(name for name, _ in features.fields)]
    with using(names):
        built = _built(features)
        if device is not None and any(is_file(name) for name in names):
            stepping = vars(built.graph).values() if features.backend.resident else (built.loop.run,)
            for thing in (*stepping, built.loop.read_budget):
                if isinstance(thing, wp.Kernel):
                    wp.load_module(thing.module, device=device)
    return built


def compile_observers(scene: Scene, device: wp.Device) -> None:
    """Compile the observers that are files of the user, so that their mistakes come before the run.

    Raises:
        SceneError: Warp cannot compile a file of the user.
    """
    for name in {scene.located(one.model): None for one in scene.observers}:
        if is_file(name):
            with using([name]):
                wp.load_module(build_each(model("observer", name).build()).module, device=device)


@functools.cache
def _built(features: Features) -> Built:
    """Kernels and array structs of the chosen features, each built once."""
    laws, frame, walls = features.contact, features.frame, features.walls
    domain, backend, measures = features.domain, features.backend, features.measures
    models = (
        model("normal", laws.normal),
        model("tangential", laws.tangential) if laws.tangential else None,
        model("rolling", laws.rolling) if laws.rolling else None,
    )
    wall_law = law.build(wp.float64, *models, laws.torsion, wall=True)
    pair_law = law.build(backend.real, *models, laws.torsion)
    pair_parts = dissipation.build(backend.real, *models, laws.torsion)[0] if measures.energy else None
    wall_parts = dissipation.build(wp.float64, *models, laws.torsion) if measures.energy else None
    spins = {"spins": laws.spins}
    shared = {**spins, "table": laws.table, "gap": laws.gap}
    met = {"rolling": laws.rolling is not None, "inertia_factor": laws.inertia_factor}
    scheme = backend.scheme
    # a scheme with frame-relative velocities sees contacts as if the frame were at rest
    turning = frame.rotates and not scheme.RELATIVE
    shifting = frame.moves and not scheme.RELATIVE
    images = border.build(domain.period, domain.lower)
    pair_kernels = pairs.build(
        backend.real, pair_law, pair_parts, images, backend.lanes, **shared, stored=laws.constants, turning_frame=turning
    )
    shapes = [count > 0 for count in (walls.planes, walls.revolutions, walls.spheres)]
    meshes = walls.meshes > 0
    closest_on_feature = feature.build(meshes, *shapes)
    around = wall_images.build(closest_on_feature, images, repeated=walls.images)
    WallContacts, evaluate_wall_contacts = contact.build(
        wall_law, wall_parts, closest_on_feature, images, around, **shared, **met, turning_frame=turning,
        moving_frame=shifting, meshes=meshes, moving=walls.moving,
    )  # fmt: skip
    fields = tuple((model("field", name).build(), axes == "laboratory") for name, axes in features.fields)
    stages = len(scheme.STAGES)
    sums = None
    if measures.energy or measures.momentum:
        sums = budget.build(
            backend.real, fields, tuple(hasattr(model("field", name), "energy") for name, _ in features.fields), **spins,
            walls=walls.present, energy=measures.energy, momentum=measures.momentum, turning_frame=frame.rotates,
            moving_frame=frame.moves, periodic=any(domain.period),
        )  # fmt: skip
    # a stage may look ahead of the step's beginning by about a step
    travel = motion.build_travel(
        images, **spins, moving=walls.moving, in_frame=frame.tracked, outlets=domain.outlets, ahead=1.5 if stages > 1 else 0.0,
        stages=stages,
    )  # fmt: skip
    step = loop.build(
        pair_kernels,
        evaluate_wall_contacts,
        WallContacts,
        motion.build_load(backend.real, **spins, walls=walls.present),
        motion.build_acceleration(fields, **spins, relative=scheme.RELATIVE),
        travel,
        scheme.build(**spins, turning_frame=frame.rotates, moving_frame=frame.moves),
        images,
        orientation.build(turning_axes=turning) if measures.orientation else None,
        sums,
        flow.build(moving_frame=frame.moves) if measures.flows else None,
        **spins,
        stages=stages,
        walls=walls.present,
        leave=domain.outlets > 0,
    )
    lists = neighbors.build(
        backend.real, wall_law, images, backend.lanes, **shared, stored=laws.constants, history=laws.memory,
        inertia_factor=laws.inertia_factor, keep_constants=not backend.resident,
    )  # fmt: skip
    wall_lists = None
    if walls.present:
        wall_lists = candidates.build(
            around,
            images,
            WallContacts,
            spins=laws.spins,
            meshes=meshes,
            shapes=any(shapes),
            gap=laws.gap,
            leave=domain.outlets > 0,
        )
    paths = flight.build(
        travel, images, closest_on_feature, WallContacts, **spins, moving=walls.moving, meshes=meshes,
        shapes=any(shapes), gap=laws.gap,
        stages=stages, shortest=min((length for length in domain.period if length), default=0.0),
    )  # fmt: skip
    moved = displacement.build(
        travel, images, step.Control, **spins, moving=walls.moving, stages=stages, leave=domain.outlets > 0
    )
    on_threads = inner.build(
        lists, moved, wall_lists, step.Control, WallContacts, **spins, lanes=backend.lanes, stages=stages
    )
    graph = again = None
    if backend.resident:
        evaluate = thread_contact.build(
            backend.real, pair_law, wall_law.constants, pair_kernels, images, pair_parts is not None, **shared, **met,
            turning_frame=turning,
        )  # fmt: skip
        graph = captured.build(
            step, pair_kernels, evaluate, WallContacts, backend.real, history=laws.memory, stages=stages, lanes=backend.lanes
        )
        again = rebuild.build(WallContacts)
    return Built(
        loop=step, graph=graph, rebuild=again, lists=lists, walls=wall_lists, WallContacts=WallContacts,
        pairs=pair_kernels, paths=paths,
        displacement=moved, inner=on_threads,
    )  # fmt: skip
