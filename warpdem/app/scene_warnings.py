"""Warnings about a scene: what is likely to go wrong or to take long, each with its number and a remedy."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from warpdem.core import memory
from warpdem.engine.open_below import walls_open_below
from warpdem.filling.placed_walls import in_body_axes
from warpdem.guards.stability import DANGER
from warpdem.model import needs
from warpdem.model.adhesion import adhesions
from warpdem.model.impact import damped_time
from warpdem.model.light_walls import light_walls
from warpdem.model.restitution_error import restitution_error
from warpdem.model.stiffer import deepest_overlap, least_factor
from warpdem.model.time_step import FIELD_ANGLE, FRAME_ANGLE, IMPACT_STEPS, STABLE_SHARE
from warpdem.model.walls import size_warnings
from warpdem.scene.messages import rounded_down, rounded_up
from warpdem.scene.model import Scene
from warpdem.scene.models import model
from warpdem.scene.motion import Translation
from warpdem.scene.motion_chain import frame_chain
from warpdem.scene.rotation import Rotation
from warpdem.simulation import Simulation

RESTITUTION_ERROR = 0.005, 0.04
"""Error of the restitution [-], in the mean and of a single impact, above which is warned: "auto" stays below 0.003 and 0.035
with the law of Hertz at restitutions from 0.1 on."""
OVERLAP = 0.1
"""Overlap over the radius [-] at time.max_speed above which is warned: contacts of a grain then influence each other."""
STATIC_SHARE = 0.5
"""Part of the overlap that is sound [-] above which the pull of a surface energy alone is held to be the cause."""
BOND_NUMBER = 1000.0
"""Granular Bond number [-] above which it is: grains are then hardly meant to flow."""
RESTITUTION = 0.05
"""Restitution [-] below which is warned: damping is then nearly critical, the time step falls and contacts hardly open."""
SIZE_RATIO = 10.0
"""Largest over smallest radius [-] above which is warned: the smallest grain sets the time step."""
TURN = 2.0 * math.pi
"""Largest plausible angle of a rotation or phase of an oscillation [rad]: a larger one is likely in another unit."""
DENSITIES = 5.0, 30000.0
"""Least and greatest plausible density, of aerogel and of osmium [kg/m3]."""
SOFTEST = 1e3
"""Young's modulus of the softest gels [Pa]."""
REBUILD_STEPS = 10.0
"""Steps in which a grain at the expected speed crosses half the skin."""


def limit_rows(sim: Simulation) -> list[dict[str, Any]]:
    """Each limit of the time step: ``seconds`` [s], the step as a ``share`` of it [-], and the share that "auto" keeps below.

    Where ``refused``, a longer step is an error. ``seconds`` and ``share`` are None where nothing limits.
    """
    found, speed = sim.limits, sim.limits.max_speed
    travel = 0.5 * sim.lists.skin / speed if speed > 0 and len(sim.state) else math.inf
    rows = [
        ("rayleigh", "Rayleigh time", found.rayleigh, None),
        ("contact", "contact time of an undamped impact", found.contact_time, 1.0 / found.contact_steps),
        ("bed", "stability limit of the bed at rest", found.settled, 1.0),
        ("impact", "stability limit of one impact", found.stable, STABLE_SHARE),
        ("frame", "one radian of the frame's turn", found.frame / FRAME_ANGLE, FRAME_ANGLE),
        ("fields", "one radian of the external fields", found.field / FIELD_ANGLE, FIELD_ANGLE),
        ("travel", "limit of travel beside meshes", found.travel, 0.5),
        ("skin", "half the skin of the lists crossed", travel, None),
    ]
    if math.isfinite(found.thin_gap):
        rows.append(("liquid", "dashpot of the thinnest liquid gap", found.thin_gap, 1.0))
    return [
        {
            "key": key,
            "name": name,
            "seconds": value if math.isfinite(value) else None,
            "share": sim.dt / value if math.isfinite(value) else None,
            "auto_share": share,
            "refused": key in ("impact", "travel"),
        }
        for key, name, value, share in rows
    ]


def warnings(sim: Simulation) -> list[str]:
    """What to look at before the run, most dangerous first."""
    found = [*_step(sim), *_impacts(sim), *_restitutions(sim), *_jumps(sim), *_materials(sim), *_angles(sim.scene)]
    found += [*_light_walls(sim), *_laws_without_effect(sim), *_pulling_servos(sim.scene)]
    found += size_warnings(sim.scene, sim.meshes, 2.0 * sim.expected.radius)
    return [*found, *_outside(sim), *_sizes(sim), *_walls(sim), *_ways_out(sim), *_machine(sim)]


def _step(sim: Simulation) -> Iterator[str]:
    dt, found = sim.dt, sim.limits
    if dt > STABLE_SHARE * found.stable:
        yield (
            f"time.step = {dt:.3g} s is {dt / found.stable:.2g} of the stability limit {found.stable:.3g} s of one impact at "
            f'{found.max_speed:.3g} m/s: take at most {rounded_down(STABLE_SHARE * found.stable)} s, or "auto"'
        )
    if dt > found.settled:
        yield (
            f"time.step = {dt:.3g} s is {dt / found.settled:.3g} times the stability limit {found.settled:.3g} s of the bed at "
            f"rest: its grains vibrate, and above {DANGER:g} times the limit of the contacts present the run stops "
            f'itself; take at most {rounded_down(found.settled)} s, or "auto"'
        )
    off = restitution_error(sim.scene, sim.expected, found.max_speed, dt)
    if off is not None and (abs(off.mean) > RESTITUTION_ERROR[0] or abs(off.worst) > RESTITUTION_ERROR[1]):
        yield (
            f"impacts at {found.max_speed:.3g} m/s (time.max_speed) of {off.materials[0]} and {off.materials[1]} give back "
            f"{off.asked + off.mean:.2g} in the mean and are off by {off.worst:+.2g} at worst, where restitution = "
            f"{off.asked:g} is asked for: an impact has {found.damped_contact / dt:.3g} steps; take a time.step of at most "
            f"{rounded_down(found.contact_time / IMPACT_STEPS)} s"
        )
    if dt * FRAME_ANGLE > found.frame * FRAME_ANGLE:
        yield (
            f"the frame turns by {FRAME_ANGLE * dt / found.frame:.2g} rad per step: contacts are followed in straight lines "
            f"within a step; take a time.step of at most {rounded_down(found.frame)} s"
        )
    if dt > found.field:
        yield (
            f"the external fields change the motion by {FIELD_ANGLE * dt / found.field:.2g} rad per step (a drag is unstable "
            f"beyond 1): take a time.step of at most {rounded_down(found.field)} s"
        )
    for i, one in enumerate(sim.scene.fields):
        if not hasattr(model("field", sim.scene.located(one.model)), "rate"):
            yield (
                f"fields[{i}].model = {one.model!r} states no rate(mass, p): the time step does not know it; if the field "
                f"pulls back, brakes or turns, define rate in its file{', or give time.step' * (sim.scene.time.step == 'auto')}"
            )
    skin, speed = sim.lists.skin, found.max_speed
    if len(sim.state) and speed * dt > 0 and 0.5 * skin / (speed * dt) < REBUILD_STEPS:
        yield (
            f"a grain at {speed:.3g} m/s crosses half the skin of the lists ({skin:.3g} m) in {0.5 * skin / (speed * dt):.2g} "
            f"steps, and the lists are rebuilt that often: take engine.skin = {rounded_up(2 * REBUILD_STEPS * speed * dt)} m, "
            "or a smaller time.step"
        )


def _impacts(sim: Simulation) -> Iterator[str]:
    share, speed = sim.limits.overlap, sim.limits.max_speed
    limit = sim.scene.engine.max_overlap
    sound = min(OVERLAP, limit)
    if share <= sound:
        return
    normal = model("normal", sim.scene.normal_law)
    key = getattr(normal, "STIFFNESS_KEY", "young_modulus")
    factor = least_factor(sim.scene, sim.expected, speed, sound, key)
    remedy = f"no {key} brings that to {sound:.0%}" if factor is None else (
        f"{rounded_up(factor)} times the {key} brings that to {sound:.0%}, at a smaller time step"
    )  # fmt: skip
    stops = f"; over engine.max_overlap = {limit:g} the run stops itself" if share > limit else ""
    yield (
        f"impacts at {speed:.3g} m/s (time.max_speed) overlap by up to {share:.1%} of the radius{stops}: "
        f"{remedy}{_by_adhesion(sim, sound)}"
    )


def _by_adhesion(sim: Simulation, sound: float) -> str:
    """Words on a surface energy that is the likely cause of deep overlaps; none where it is not."""
    if not any(getattr(pair, "surface_energy", None) for pair in sim.scene.pairs):
        return ""
    still = deepest_overlap(sim.scene, sim.expected, 0.0)
    bond = max((one.bond_number or 0.0 for one in adhesions(sim.scene, sim.expected)), default=0.0)
    if still <= STATIC_SHARE * sound and bond <= BOND_NUMBER:
        return ""
    strength = f" and is {bond:.3g} times their weight (granular Bond number)" if bond else ""
    return (
        f"; the likely cause is pairs[].surface_energy: its pull alone overlaps grains by {still:.2g} of the radius{strength}; "
        "it is given in J/m2: was mJ/m2 meant?"
    )


def _restitutions(sim: Simulation) -> Iterator[str]:
    for i, pair in enumerate(sim.scene.pairs):
        if pair.restitution < RESTITUTION:
            law = sim.plan.contact.normal
            longer = damped_time(law, pair.restitution)
            opens = "" if getattr(model("normal", law), "CLAMPED", False) else ", attracts before it opens"
            yield (
                f"pairs[{i}].restitution = {pair.restitution:g}: a contact lasts {longer:.2g} times as long as an undamped one "
                f"or more{opens}, and needs a smaller time step: take {RESTITUTION:g} or more"
            )


def _jumps(sim: Simulation) -> Iterator[str]:
    law, scheme = model("normal", sim.plan.contact.normal), sim.plan.backend.scheme
    if getattr(law, "JUMPS", False) and not getattr(scheme, "WEIGHS_JUMPS", True):
        yield (
            f'engine.integrator = "{sim.scene.engine.integrator}" kicks several times a step: where the force of '
            f'contact.normal = "{sim.scene.contact.normal}" jumps at touch and parting, single impacts are off by a first '
            'order of the step; "exact_drift" weighs jumps by the part of the step that they act in'
        )


def _materials(sim: Simulation) -> Iterator[str]:
    for name, material in sim.scene.materials.items():
        if not DENSITIES[0] <= material.density <= DENSITIES[1]:
            yield (
                f"materials.{name}.density = {material.density:g} kg/m3 is that of no solid ({DENSITIES[0]:g} to "
                f'{DENSITIES[1]:g}): if it is in another unit, write it as in "2.65 g/cm3"'
            )
        if material.young_modulus < SOFTEST:
            yield (
                f"materials.{name}.young_modulus = {material.young_modulus:g} Pa is that of no solid (softest gels some "
                f'{SOFTEST:g}): if it is in another unit, write it as in "{material.young_modulus:g} MPa"'
            )


def _angles(scene: Scene) -> Iterator[str]:
    moved = {"frame": scene.frame, **{f"walls[{k}].motion": wall.motion for k, wall in enumerate(scene.walls)}}
    found = [(f"walls[{k}].rotate.angle", wall.rotate.angle) for k, wall in enumerate(scene.walls) if wall.rotate]
    for key, motions in moved.items():
        several = motions is not None and len(motions) > 1
        for k, motion in enumerate(motions or ()):
            path = f"{key}[{k}]" if several else key
            if isinstance(motion, Translation):
                found.append((f"{path}.phase", motion.phase))
            elif isinstance(motion, Rotation) and motion.sinusoid:
                found.append((f"{path}.sinusoid.phase", motion.sinusoid.phase))
    for key, angle in found:
        if abs(angle) > TURN:
            yield (
                f"{key} = {angle:g} rad is more than a full turn ({math.degrees(angle):.4g} degrees): if it is in degrees, "
                f'write "{angle:g} deg"'
            )


def _laws_without_effect(sim: Simulation) -> Iterator[str]:
    """Laws that the scene names itself and that are left out, as their coefficients are all 0."""
    contact, chosen = sim.scene.contact, {"tangential": "friction", "rolling": "rolling_friction"}
    idle = [
        (f'contact.{role} = "{name}"', key) for role, key in chosen.items()
        if role in contact.model_fields_set and (name := getattr(contact, role)) != "none"
        and len(sim.expected.id) and getattr(sim.plan.contact, role) is None
    ]  # fmt: skip
    if idle:
        laws, keys = (" and ".join(words) for words in zip(*idle, strict=True))
        zero = "are 0" if len(idle) > 1 else "is 0"
        yield f'{laws}: without effect, as {keys} {zero} in all [[pairs]] that meet: give it there, or take "none"'


def _pulling_servos(scene: Scene) -> Iterator[str]:
    for number, wall in enumerate(scene.walls):
        course = wall.servo.pressure if wall.servo is not None else None
        least = min((value for _, value in course), default=0.0) if isinstance(course, list) else course or 0.0
        if least < 0.0:
            yield (
                f"walls[{number}].servo.pressure = {least:g} Pa: the wall pulls against its axis, away from grains that lie "
                "along it; give a pressure above 0 and an axis that points from the wall to the grains"
            )


def _sizes(sim: Simulation) -> Iterator[str]:
    radius = sim.expected.radius
    if len(radius) and radius.max() > SIZE_RATIO * radius.min():
        yield (
            f"the largest grain is {radius.max() / radius.min():.3g} times the smallest, {2 * radius.min():.3g} m wide: "
            "the step is that of the smallest; leave out the finest grains if they do not matter"
        )


def _outside(sim: Simulation) -> Iterator[str]:
    """Grains all beside the closed meshes that are the only walls: one of these is likely to be meant as their vessel.

    Not where a grain is amid the corners of a mesh, as in a cup of solid walls, or falls or flies towards one.
    """
    scene, start = sim.scene, sim.expected
    if sim.model.given.scene.start or not len(start) or not scene.walls or scene.borders:
        return
    if any(wall.mesh is None or wall.open for wall in scene.walls):
        return
    gravity = np.asarray(scene.gravity, float) @ frame_chain(scene).pose(np.zeros(1)).axes[0].astype(float)
    for number, wall in enumerate(scene.walls):
        at = in_body_axes(scene, number, start.position)
        for direction in (gravity, start.velocity):
            ahead = in_body_axes(scene, number, start.position + direction) - at
            if _meets(sim.meshes[wall.name].bounds, at, ahead).any():
                return
    bodies = " and ".join(f"{wall.name!r} (from {_extent(sim.meshes[wall.name].bounds)})" for wall in scene.walls)
    yield (
        f"all {len(start)} grains, from {_extent(start.position)}, are outside the closed mesh {bodies}; they do not fall on "
        "it, and no other wall is there: if it is their vessel, check its scale, rotate and translate, and the positions of "
        "the grains"
    )


def _extent(points: np.ndarray) -> str:
    """Text of the least and the greatest corner of points (n, 3) [m]."""
    corners = points.min(axis=0), points.max(axis=0)
    return " to ".join(f"({', '.join(f'{x:.4g}' for x in corner)})" for corner in corners) + " m"


def _meets(box: np.ndarray, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Whether a box (2, 3) [m] holds each point (n, 3) [m] or lies ahead of it along ``direction`` (n, 3), shape (n,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = (box[:, None] - point) / direction
    entered, left = np.maximum(sides.min(axis=0).max(axis=1), 0.0), sides.max(axis=0).min(axis=1)
    found: np.ndarray = (entered <= left) & (entered < np.inf)
    return found


def _walls(sim: Simulation) -> Iterator[str]:
    radius = sim.expected.radius
    for number, wall in enumerate(sim.scene.walls):
        mesh = sim.meshes.get(wall.name)
        if mesh is None or not mesh.open_edges or not len(radius):
            continue
        edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        kinds, count = np.unique(edges, axis=0, return_counts=True)
        start, stop = mesh.vertices[kinds[count == 1].T]
        border = float(np.linalg.norm(stop - start, axis=1).sum())
        smallest = 2.0 * float(radius.min())
        if smallest < border / math.pi and not (sim.scene.borders or sim.scene.outlets):
            yield (
                f"walls[{number}].mesh = {wall.mesh!r} is open along {border:.3g} m ({mesh.open_edges} edges), wide enough for "
                f"a grain of {smallest:.3g} m: grains that leave fall without end; close the mesh, or add "
                "[borders] or [[outlets]]"
            )


def _light_walls(sim: Simulation) -> Iterator[str]:
    for number, grains, share, step in light_walls(sim.scene, sim.schedule.dynamic, sim.expected, sim.meshes):
        if sim.dt > step:
            yield (
                f"walls[{number}].free: the wall has {share:.2g} of the mass (of a hinge: of the moment of inertia) of the "
                f"{grains} grains that may lie on it; with all of them at once under its load it chatters at time.step = "
                f"{sim.dt:.3g} s: take at most {rounded_down(step)} s, or a heavier wall"
            )


def _ways_out(sim: Simulation) -> Iterator[str]:
    radius, scene = sim.expected.radius, sim.scene
    if not len(radius) or scene.borders or scene.outlets:
        return
    smallest = 2.0 * float(radius.min())
    if names := walls_open_below(scene, smallest):
        yield (
            f"walls {', '.join(repr(name) for name in names)} leave an opening below for a grain of {smallest:.3g} m: "
            "grains that leave fall without end; close it with a floor, or add [borders] or [[outlets]]"
        )


def _machine(sim: Simulation) -> Iterator[str]:
    coming, per_grain = sum(needs.grains_to_come(sim.scene)), sim.plan.bytes_per_grain
    needed = needs.memory_bytes(sim.scene, per_grain, len(sim.state) + coming)
    free = needs.free_bytes(sim.device) + per_grain * len(sim.state)  # which they have taken by now
    if needed > memory.WARNING_SHARE * free:
        streams = f", with the {coming} that streams bring by time.end if all find room and none leaves" if coming else ""
        remedy = " or an earlier time.end" if coming else ""
        remedy += ', or engine.precision = "mixed"' if sim.scene.engine.precision == "double" else ""
        remedy += ", or a larger measures.grid.cell" if needs.grid_bytes(sim.scene) > 0.1 * needed else ""
        yield (
            f"the grains need about {memory.size_text(needed)} of memory{streams}, and {memory.size_text(free)} are available: "
            f"take fewer grains{remedy}"
        )
