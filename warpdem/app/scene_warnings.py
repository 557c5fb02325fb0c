"""Warnings about a scene: what is likely to go wrong or to take long, each with its number and a remedy."""

import math
from collections.abc import Iterator
from itertools import chain

from warpdem.app import step_warnings, wall_warnings
from warpdem.core import memory
from warpdem.model import needs
from warpdem.model.walls import size_warnings
from warpdem.scene.model import Scene
from warpdem.scene.motion import Translation
from warpdem.scene.rotation import Rotation
from warpdem.simulation import Simulation

SIZE_RATIO = 10.0
"""Largest over smallest radius [-] above which is warned: the smallest grain sets the time step."""
TURN = 2.0 * math.pi
"""Largest plausible angle of a rotation or phase of an oscillation [rad]: a larger one is likely in another unit."""
DENSITIES = 5.0, 30000.0
"""Least and greatest plausible density, of aerogel and of osmium [kg/m3]."""
SOFTEST = 1e3
"""Young's modulus of the softest gels [Pa]."""


def warnings(sim: Simulation) -> list[str]:
    """What to look at before the run, most dangerous first."""
    of_step = step_warnings.step(sim), step_warnings.impacts(sim), step_warnings.restitutions(sim), step_warnings.jumps(sim)
    return [
        *chain(*of_step),
        *_materials(sim),
        *_angles(sim.scene),
        *wall_warnings.light(sim),
        *_laws_without_effect(sim),
        *wall_warnings.pulling_servos(sim.scene),
        *size_warnings(sim.scene, sim.meshes, 2.0 * sim.expected.radius),
        *wall_warnings.outside(sim),
        *_sizes(sim),
        *wall_warnings.open_meshes(sim),
        *wall_warnings.openings_below(sim),
        *_machine(sim),
    ]


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


def _sizes(sim: Simulation) -> Iterator[str]:
    radius = sim.expected.radius
    if len(radius) and radius.max() > SIZE_RATIO * radius.min():
        yield (
            f"the largest grain is {radius.max() / radius.min():.3g} times the smallest, {2 * radius.min():.3g} m wide: "
            "the step is that of the smallest; leave out the finest grains if they do not matter"
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
