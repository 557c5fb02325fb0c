"""From the features of a scene to its kernels: imports only the chosen models and builds each once."""

import functools
from contextlib import suppress

import warp as wp

from warpdem.kernels import KernelSet
from warpdem.kernels.contact import dissipation, films, law, pairs, sweep, thread_contact
from warpdem.kernels.integrator import exact_drift
from warpdem.kernels.lists import cells, contact_batches, displacement, flight, inner, neighbors, numbering, rebuild
from warpdem.kernels.measure import budget, flow, wear
from warpdem.kernels.observer import build_each
from warpdem.kernels.simd.values import NotStraight
from warpdem.kernels.step import (
    border,
    clump_phase,
    clumps,
    dynamic_walls,
    loop,
    motion,
    motion_sweep,
    move,
    orientation,
    read,
    region,
    structs,
)
from warpdem.kernels.step import forces as step_forces
from warpdem.kernels.step import graph as captured
from warpdem.kernels.wall import candidates, contact, evaluate, feature
from warpdem.kernels.wall import images as wall_images
from warpdem.kernels.wall import sweep as wall_sweep
from warpdem.model.features import Features
from warpdem.model.liquid import TRAVEL
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.user_models import is_file, parts_of, using


def compile_kernels(features: Features, device: wp.Device | None = None) -> KernelSet:
    """Kernels and array structs of the chosen features.

    Nothing is compiled until it is launched, except on ``device`` what holds the user's own models: their mistakes come
    before the run.

    Returns:
        Namespace with ``structs`` (of the step), ``loop`` (the step), ``read`` (its readers), ``graph`` and ``rebuild`` (the
        GPU's, or None), ``neighbors`` (the outer list), ``batches`` (the inner list), ``displacement``, ``inner`` (the inner
        list on CPU threads), ``walls`` (candidate kernels or None), ``paths`` (grains in flight), ``dynamic`` (walls that
        move by their load, or None), ``WallContacts``.

    Raises:
        SceneError: Warp cannot compile a file of the user.
    """
    laws = features.contact
    names = [*parts_of(laws.normal), laws.tangential or "", laws.rolling or "", laws.twisting or ""]
    names += [name for name, _ in features.fields]
    with using(names):
        built = _built(features)
        if device is not None and any(is_file(name) for name in names):
            stepping = vars(built.graph).values() if features.backend.resident else (built.loop.run,)
            for thing in (*stepping, built.read.read_budget):
                if isinstance(thing, wp.Kernel):
                    wp.load_module(thing.module, device=device)
    return built


def step_kernels(kernels: KernelSet) -> list[wp.Kernel]:
    """Kernels that the steps and the lists of a CPU launch in any run, the step itself first: it takes longest to compile.

    Args:
        kernels: of ``compile_kernels``.
    """
    lists, walls = kernels.neighbors, kernels.walls
    readers = kernels.read.read, kernels.read.read_budget, kernels.read.read_losses
    step = kernels.loop.run, kernels.inner.build_inner, *readers
    moved = kernels.displacement.save_reference, kernels.displacement.set_allowances
    outer = lists.find_neighbors, lists.count_in_cells, cells.start_lines, lists.sort_by_cell, lists.carry_contacts, *moved
    beside = (walls.near_features, walls.carry_wall_contacts, numbering.sum_blocks) if walls is not None else ()
    return [kernel for kernel in (*step, *outer, *beside) if kernel is not None]


def compile_observers(scene: Scene, device: wp.Device) -> None:
    """Compile the observers that are files of the user, so that their mistakes come before the run.

    Raises:
        SceneError: Warp cannot compile a file of the user.
    """
    for name in {scene.located(one.model): None for one in scene.observers}:
        if is_file(name):
            with using([name]):
                wp.load_module(build_each(model("observer", name).build()).module, device=device)


def axes_rotate(features: Features) -> bool:
    """Whether contacts see the axes rotate: a scheme with frame-relative velocities sees them as if the frame were at rest."""
    return features.frame.rotates and not features.backend.scheme.RELATIVE


def of_pairs(features: Features) -> KernelSet:
    """Namespace of ``pairs.build``."""
    laws, domain, real = features.contact, features.domain, features.backend.real
    tangential = model("tangential", laws.tangential) if laws.tangential else None
    rolling = model("rolling", laws.rolling) if laws.rolling else None
    models = model("normal", laws.normal), tangential, rolling
    predicted = getattr(features.backend.scheme, "PREDICTED", False)
    twisting = model("twisting", laws.twisting) if laws.twisting else None
    pair_law = law.build(real, *models, laws.torsion, predicted=predicted, twisting=twisting)
    parts = dissipation.build(real, *models, laws.torsion, predicted, twisting)[0] if features.measures.energy else None
    images = border.build(domain.period, domain.lower)
    return pairs.build(
        real, pair_law, parts, images, spins=laws.spins, gap=laws.force_gap, clumps=laws.clumps, impulses=features.impulses
    )


def no_lanes(features: Features) -> str:
    """Why contacts between grains cannot be evaluated side by side; empty if they can.

    Raises:
        SceneError: a law in a file of the user fails.
    """
    laws = features.contact
    with using([laws.normal, laws.tangential or "", laws.rolling or "", laws.twisting or ""]):
        made = of_pairs(features)
    try:
        sweep.translated(made, axes_rotate(features))
    except NotStraight as error:
        return str(error)
    except Exception as error:  # whatever the translator has not foreseen in a law: one contact after the other is right
        return f"the translation to registers fails: {type(error).__name__}: {error}"
    return ""


@functools.cache
def _built(features: Features) -> KernelSet:
    """Kernels and array structs of the chosen features, each built once."""
    laws, frame, walls = features.contact, features.frame, features.walls
    domain, backend, measures = features.domain, features.backend, features.measures
    models = (
        model("normal", laws.normal),
        model("tangential", laws.tangential) if laws.tangential else None,
        model("rolling", laws.rolling) if laws.rolling else None,
    )
    predicted = getattr(backend.scheme, "PREDICTED", False)
    twisting = model("twisting", laws.twisting) if laws.twisting else None
    wall_law = law.build(wp.float64, *models, laws.torsion, wall=True, predicted=predicted, twisting=twisting)
    wall_parts = dissipation.build(wp.float64, *models, laws.torsion, predicted, twisting) if measures.energy else None
    spins = {"spins": laws.spins}
    shared = {**spins, "table": laws.table, "gap": laws.gap}
    met = {"rolling": laws.moments, "inertia_factor": laws.inertia_factor}
    scheme = backend.scheme
    rotates = axes_rotate(features)
    shifting = frame.moves and not scheme.RELATIVE
    images = border.build(domain.period, domain.lower)
    pair_kernels = of_pairs(features)
    liquid = None
    if laws.wet:
        of_bridges = model("normal", laws.normal).LIQUID
        liquid = films.build(pair_kernels, of_bridges, table=laws.table, reach=laws.gap, longest=laws.gap / TRAVEL)
    arrays = structs.build(pair_kernels)
    seen = {"rotating_frame": rotates, "table": laws.table, "ranks": backend.ranks}
    by_lane = thread_contact.build(arrays, pair_kernels, wall_law.constants, **spins, **met, **seen)
    swept = None
    if backend.lanes > 1 and not backend.resident:
        swept = sweep.build(arrays, pair_kernels, backend.lanes, stored=laws.constants, **seen)
    meshes, shapes = walls.meshes > 0, bool(walls.shapes)
    closest_on_feature = feature.build(meshes=meshes, shapes=walls.shapes)
    around = wall_images.build(closest_on_feature, images, repeated=walls.images)
    one = contact.build(
        wall_law, wall_parts, images, around, **spins, **met, rotating_frame=rotates, moving_frame=shifting,
        moving=walls.moving, conveying=walls.conveying, wear=measures.wear, clumps=laws.clumps, yielding=walls.free > 0,
    )
    wall_kernels = evaluate.build(
        arrays, one, closest_on_feature, images, around, table=laws.table, meshes=meshes, gap=laws.gap, of_films=liquid,
        force_gap=laws.force_gap,
    )  # fmt: skip
    WallContacts = wall_kernels.WallContacts
    walls_swept = None
    if swept is not None and walls.present:
        with suppress(NotStraight):  # then one by one
            walls_swept = wall_sweep.build(arrays, one, wall_kernels, backend.lanes, laws.table)
    fields = tuple((model("field", name).build(), axes == "laboratory") for name, axes in features.fields)
    stages = len(scheme.STAGES)
    sums = None
    if measures.energy or measures.momentum:
        sums = budget.build(
            arrays, WallContacts, structs.Control, fields,
            tuple(hasattr(model("field", name), "energy") for name, _ in features.fields), **spins, walls=walls.present,
            energy=measures.energy, momentum=measures.momentum, rotating_frame=frame.rotates,
            moving_frame=frame.moves, periodic=any(domain.period), losses=measures.losses,
        )  # fmt: skip
    # a stage may look ahead of the step's beginning by about a step
    travel = motion.build_travel(
        images, region.build(count=domain.outlets, kinds=domain.kinds, placed=domain.placed), **spins, moving=walls.moving,
        in_frame=frame.tracked, outlets=domain.outlets, ahead=1.5 if stages > 1 else 0.0, stages=stages,
    )  # fmt: skip
    shared_by_steps = {"stages": stages, "walls": walls.present}
    forces = step_forces.build(
        arrays, pair_kernels, by_lane, swept, backend.lanes, wall_kernels.evaluate, walls_swept, WallContacts,
        walls=walls.present, films=liquid,
    )  # fmt: skip
    load = motion.build_load(backend.real, **spins, walls=walls.present, wet=laws.wet)
    acceleration = motion.build_acceleration(fields, **spins, relative=scheme.RELATIVE, clumps=laws.clumps)
    integrator = scheme.build(**spins, rotating_frame=frame.rotates, moving_frame=frame.moves)
    orientation_of = orientation.build(rotating_axes=rotates) if measures.orientation else None
    flowing = flow.build(moving_frame=frame.moves) if measures.flows else None
    bodies = None
    if laws.clumps:
        with_axes = orientation.build_axes(rotating_axes=rotates)
        drift = exact_drift.build_drift(**spins, rotating_frame=frame.rotates, moving_frame=frame.moves)
        rigid = clumps.build(
            arrays, WallContacts, load, acceleration, integrator, clumps.build_motion(drift, with_axes, images)
        )
        bodies = clump_phase.build(
            arrays, WallContacts, rigid, load, travel, images, orientation_of, sums, flowing, walls=walls.present,
            leave=domain.outlets > 0, driven=bool(fields), lanes=1 if backend.resident else backend.lanes,
        )  # fmt: skip
    motion_swept = None
    of_each_grain = fields, sums, flowing, measures.wear, laws.clumps, laws.wet  # computed grain by grain in the motion phase
    if swept is not None and hasattr(scheme, "build_drift") and not any(of_each_grain):
        drift = scheme.build_drift(**spins, rotating_frame=frame.rotates, moving_frame=frame.moves)
        motion_swept = motion_sweep.build(
            arrays, WallContacts, motion_sweep.build_moved(drift, images, **spins), travel, backend.lanes, **spins,
            walls=walls.present, leave=domain.outlets > 0,
        )  # fmt: skip
    moved_by = move.build(
        arrays, WallContacts, load, acceleration, travel, integrator, images, orientation_of, sums, flowing,
        wear.build(one, WallContacts, laws.spins) if measures.wear else None, bodies, **shared_by_steps, **spins,
        leave=domain.outlets > 0, films=liquid, wetting=wall_kernels.wetting,
        wet_load=motion.build_wet_load(backend.real, **spins) if laws.wet else None, sweep=motion_swept,
    )  # fmt: skip
    dynamic = dynamic_walls.build(one, WallContacts, walls.bodies > 0) if walls.dynamic else None
    step = loop.build(arrays, forces, moved_by.move_phase, dynamic, WallContacts, stages=stages, ranks=backend.ranks)
    readers = read.build(
        arrays, pair_kernels, WallContacts, load, acceleration, integrator[1], sums, bodies, **shared_by_steps,
        rotating_frame=rotates, ranks=backend.ranks,
    )  # fmt: skip
    outer = neighbors.build(
        images, **spins, gap=laws.gap, clumps=laws.clumps, apart=laws.apart, ranks=backend.ranks,
        side_by_side=not backend.resident,
    )  # fmt: skip
    batches = contact_batches.build(
        backend.real, wall_law, outer.ListedGrains, images, backend.lanes, **shared, stored=laws.constants,
        history=features.memory,
        inertia_factor=laws.inertia_factor,
        keep_constants=not (backend.resident or laws.clumps), clumps=laws.clumps, apart=laws.apart, force_gap=laws.force_gap,
    )  # fmt: skip
    wall_lists = None
    if walls.present:
        wall_lists = candidates.build(
            around,
            images,
            WallContacts,
            outer.ListedGrains,
            spins=laws.spins,
            meshes=meshes,
            shapes=shapes,
            gap=laws.gap,
            leave=domain.outlets > 0,
            apart=laws.apart,
            wetting=wall_kernels.wetting,
        )
    paths = flight.build(
        travel, images, closest_on_feature, WallContacts, **spins, moving=walls.moving, meshes=meshes,
        shapes=shapes, gap=laws.gap,
        stages=stages, shortest=min((length for length in domain.period if length), default=0.0),
    )  # fmt: skip
    moved = displacement.build(
        travel, images, **spins, moving=walls.moving, stages=stages, leave=domain.outlets > 0, clumps=laws.clumps
    )
    on_threads = inner.build(
        arrays, outer.ListedGrains, batches, moved, wall_lists, WallContacts, **spins, lanes=backend.lanes, stages=stages
    )
    graph = again = None
    if backend.resident:
        graph = captured.build(
            arrays, pair_kernels, by_lane, wall_kernels.evaluate, WallContacts, moved_by.move_phase, history=features.memory,
            stages=stages, lanes=backend.lanes, films=liquid, dynamic=dynamic, ranks=backend.ranks,
        )  # fmt: skip
        if not backend.ranks:  # over ranks the host builds all lists
            again = rebuild.build(WallContacts, wall_kernels.wetting)
    return KernelSet(
        structs=arrays, loop=step, read=readers, graph=graph, rebuild=again, neighbors=outer, batches=batches, walls=wall_lists,
        WallContacts=WallContacts, pairs=pair_kernels, paths=paths, displacement=moved, inner=on_threads,
        dynamic=dynamic, films=liquid,
    )  # fmt: skip
