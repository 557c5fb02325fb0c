"""From a scene to its model: every check before the first step, and the only place that decides what is run."""

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

from warpdem.errors import SceneError
from warpdem.filling.clump_grains import no_clumps
from warpdem.filling.initial_grains import InitialGrains, concatenated, load_grains
from warpdem.filling.start_check import check_start
from warpdem.filling.stream_grains import extreme_grains
from warpdem.mesh.solid import MeshSolid, shape_of
from warpdem.mesh.triangle_mesh import TriangleMesh
from warpdem.model import domain, needs, time_step
from warpdem.model.choose_features import WARP_LANES, choose_features
from warpdem.model.coefficients import coefficient_table
from warpdem.model.compiled import compile_kernels, compile_observers
from warpdem.model.decisions import Decisions
from warpdem.model.digests import Given
from warpdem.model.dynamic_walls import complete_dynamic_walls, mobilities
from warpdem.model.exits import Exits
from warpdem.model.features import Features
from warpdem.model.lanes import as_the_law_allows, simd_lanes
from warpdem.model.liquid import liquid_of
from warpdem.model.model import Model
from warpdem.model.past import Past
from warpdem.model.schedule import Schedule
from warpdem.model.wall_images import wall_images
from warpdem.model.walls import Walls, load_meshes, mesh_notes, named_diameters, size_warnings
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.regions import Placed


def require_scene(scene: Scene) -> None:
    """Refuse what is no scene, or several.

    Raises:
        SceneError: the scene has phases.
        TypeError: with the call that makes one, where the name of a file or a table is given.
    """
    if isinstance(scene, Scene):
        if scene.phases:
            raise SceneError(f"{scene.source}: phases: a simulation is one of them: take scene.phase(0), or warpdem run")
        return
    remedy = "Scene.model_validate({...})" if isinstance(scene, dict) else "load_scene(...)"
    if isinstance(scene, (str, Path)):
        remedy = f"load_scene({str(scene)!r})"
    raise TypeError(f"a Scene is needed, not {type(scene).__name__}: give {remedy}")


def prepare(
    given: Given, device: wp.Device, resident: bool, past: Past | None = None, ranks: bool = False
) -> tuple[Model, InitialGrains]:
    """The model of a scene, and the grains that it starts with, which move as the integrator holds them.

    Args:
        given: the scene.
        device: where it is run.
        resident: many steps are one captured graph.
        past: what it starts from in place of its own grains; None for its own.
        ranks: its grains are dealt out to several processes.

    Raises:
        SceneError: if the scene cannot be run: a bad mesh, overlapping start, time step above its limit.
    """
    scene = given.scene if past is None else past.scene
    needs.check_grid(scene)
    free = needs.free_bytes(device)
    meshes = load_meshes(scene)
    size_warnings(scene, meshes, named_diameters(scene))  # refuses before anything is filled
    start = load_grains(scene, meshes) if past is None else past.grains
    if past is None:  # what a run before left may have flown far away
        needs.check_places(scene, start)
    check_start(start, meshes, scene, () if past is None else past.old_walls)
    borders = domain.Domain(scene)
    start = within(borders, start)
    scheme = model("integrator", scene.engine.integrator)
    schedule = Schedule(scene, scheme.STAGES, scheme.RELATIVE)
    expected = concatenated(start, extreme_grains(scene, functools.partial(_relative, schedule)))
    if expected.clumps is not None and start.clumps is None:
        start = replace(start, clumps=no_clumps(len(start)))
    needs.check_masses(scene, expected)
    size_warnings(scene, meshes, 2.0 * expected.radius)
    images = wall_images(scene, meshes, schedule, borders, expected.radius)
    most = len(start) + sum(needs.grains_to_come(scene))
    features = choose_features(
        scene,
        expected.type,
        has_spin=bool(np.any(start.spin)),
        moving=schedule.moving,
        resting=len(schedule.motions) - schedule.moving,
        images=images is not None,
        lanes=WARP_LANES if resident else simd_lanes(most, scene.engine.precision),
        resident=resident,
        largest=float(expected.radius.max(initial=0.0)),
        clumps=expected.clumps is not None,
    )
    features = as_the_law_allows(features)
    if ranks:
        features = replace(features, backend=replace(features.backend, ranks=True))
    exits = _exits(scene, borders, schedule)
    domain.check(scene, start, schedule.frame, features.contact.gap, exits)
    for number, region in enumerate(scene.measures.regions):
        if region.shape_key:  # a mesh that cannot be read is refused before the run
            shape = shape_of(scene, region.shape, key := f"measures.regions[{number}].{region.shape_key}")
            if isinstance(shape, MeshSolid) and shape.mesh.bodies is not None and shape.mesh.bodies.intersect:
                raise SceneError(
                    f"{scene.source}: {key}.file: {shape.mesh.name}: {shape.mesh.bodies.note.partition(':')[0]}: how much of a "
                    "grain is in it is not measured; make a boolean union in the program that made it, or several regions"
                )
    needs.check_memory(scene, features.bytes_per_grain, len(start), free)
    limits = time_step.limits(scene, expected, meshes)
    dt = time_step.choose(scene, limits)
    needs.check_step(scene, limits, dt)
    schedule.dt = dt
    complete_dynamic_walls(schedule, scene, meshes, expected, len(scheme.STAGES), device.is_cuda)
    compile_observers(scene, device)
    table = np.nan_to_num(_coefficients(scene, features, expected))
    decided = Decisions(given, scene, expected, features, limits, dt, table, schedule.dynamic)
    made = _assembled(decided, device, meshes, borders, exits, schedule, images, start.notes)
    return made, start if scheme.RELATIVE else absolute(schedule, start)


def without_grains(decided: Decisions, device: wp.Device) -> Model:
    """The model that another process made of all grains, here.

    Args:
        decided: what that process has decided.
        device: where it is run.

    Raises:
        SceneError: a file of the scene is missing or another one.
    """
    scene = decided.scene
    meshes, borders = load_meshes(scene), domain.Domain(scene)
    scheme = model("integrator", scene.engine.integrator)
    schedule = Schedule(scene, scheme.STAGES, scheme.RELATIVE)
    images = wall_images(scene, meshes, schedule, borders, decided.expected.radius)
    schedule.dt, schedule.dynamic = decided.dt, decided.dynamic
    return _assembled(decided, device, meshes, borders, _exits(scene, borders, schedule), schedule, images, ())


def _exits(scene: Scene, borders: domain.Domain, schedule: Schedule) -> Exits:
    """The regions in which grains leave."""
    shapes = [shape_of(scene, shape, f"{key}.mesh") for shape, key in zip(borders.shapes, borders.keys, strict=True)]
    return Exits(shapes, borders.places, [f"{scene.source}: {key}" for key in borders.keys], schedule)


def _assembled(
    decided: Decisions, device: wp.Device, meshes: dict[str, TriangleMesh], borders: domain.Domain, exits: Exits,
    schedule: Schedule, images: np.ndarray | None, notes: tuple[str, ...],
) -> Model:  # fmt: skip
    """The model of what was decided; ``notes``: those about the grains."""
    scene, features, table = decided.scene, decided.features, decided.coefficient_table
    kernels, yields = compile_kernels(features, device), mobilities(schedule)
    return Model(
        given=decided.given,
        scene=scene,
        device=device,
        meshes=meshes,
        domain=borders,
        exits=exits,
        expected=decided.expected,
        schedule=schedule,
        features=features,
        limits=decided.limits,
        dt=decided.dt,
        kernels=kernels,
        density=np.array([material.density for material in scene.materials.values()]),
        coefficients=wp.array(table, dtype=kernels.pairs.Coefficients, device=device),
        coefficient_table=table,
        apart=wp.array(scene.apart if features.contact.apart else np.zeros((0, 0)), dtype=wp.int32, device=device),
        liquid=liquid_of(scene, float(decided.expected.radius.max(initial=0.0)), features.backend.real),
        walls=Walls(scene, meshes, schedule.wall_motion, images, yields, device) if features.walls.present else None,
        notes=(*scene.notes, *mesh_notes(scene, meshes), *notes),
    )


def within(borders: domain.Domain, grains: InitialGrains) -> InitialGrains:
    """Grains and clumps at their images within the periodic borders: each member of a clump by its own place."""
    if grains.clumps is not None:
        grains = replace(grains, clumps=replace(grains.clumps, position=borders.wrapped(grains.clumps.position)))
    return replace(grains, position=borders.wrapped(grains.position))


def _relative(
    schedule: Schedule, place: Placed, position: np.ndarray, velocity: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] in and relative to the frame at time 0, of what is given in a region's axes."""
    carrier = schedule.carrier(place)
    if carrier is not None:
        axes, origin = schedule.place(carrier, 0.0)
        position = axes @ position + origin
    return position, schedule.carried(carrier, 0.0, position[None], velocity)[0][0]


def absolute(schedule: Schedule, grains: InitialGrains, time: float = 0.0) -> InitialGrains:
    """Grains with absolute spins [rad/s] and velocities [m/s] in place of those relative to the frame at ``time`` [s]."""
    pose = schedule.pose(time)
    clumps = grains.clumps
    if clumps is not None:
        velocity = clumps.velocity + pose.velocity_at(clumps.position)
        clumps = replace(clumps, velocity=velocity, spin=clumps.spin + pose.spin)
    velocity = grains.velocity + pose.velocity_at(grains.position)
    return replace(grains, spin=grains.spin + pose.spin, velocity=velocity, clumps=clumps)


def _coefficients(scene: Scene, features: Features, grains: InitialGrains) -> np.ndarray:
    """Coefficients of every pair of materials, or the one row that all contacts share, shape (rows, columns)."""
    table = coefficient_table(scene)
    if features.contact.table:
        return table
    names = list(scene.materials)
    kinds = np.unique(grains.type).tolist() or [0]
    others = [*kinds, *(names.index(wall.material) for wall in scene.walls)]
    rows = [table[kind * len(names) + other] for kind in kinds for other in others]
    return next((row for row in rows if np.isfinite(row).all()), rows[0])[None]
