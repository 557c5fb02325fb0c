"""Warnings about the time step, and about impacts and their restitution at that step."""

from collections.abc import Iterator

from warpdem.engine.neighbor_list import skin_bounds
from warpdem.guards.stability import DANGER
from warpdem.model.adhesion import adhesions
from warpdem.model.impact import damped_time
from warpdem.model.restitution_error import restitution_error
from warpdem.model.stiffer import deepest_overlap, least_factor
from warpdem.model.time_step import FIELD_ANGLE, FRAME_ANGLE, IMPACT_STEPS, STABLE_SHARE
from warpdem.scene.messages import rounded_down, rounded_up
from warpdem.scene.models import model
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
REBUILD_STEPS = 10.0
"""Steps in which a grain at the expected speed crosses half the skin."""


def step(sim: Simulation) -> Iterator[str]:
    """The time step against its limits, and how often the lists are rebuilt at it."""
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
    skin, speed = skin_bounds(sim.model)[1], found.max_speed  # a run widens its skin up to this where grains are fast
    if len(sim.state) and speed * dt > 0 and 0.5 * skin / (speed * dt) < REBUILD_STEPS:
        yield (
            f"a grain at {speed:.3g} m/s crosses half the skin of the lists ({skin:.3g} m) in {0.5 * skin / (speed * dt):.2g} "
            f"steps, and the lists are rebuilt that often: take engine.skin = {rounded_up(2 * REBUILD_STEPS * speed * dt)} m, "
            "or a smaller time.step"
        )


def impacts(sim: Simulation) -> Iterator[str]:
    """Overlaps of impacts at time.max_speed, and the stiffness that makes them small enough."""
    overlap, speed = sim.limits.overlap, sim.limits.max_speed
    limit = sim.scene.engine.max_overlap
    sound = min(OVERLAP, limit)
    if overlap <= sound:
        return
    normal = model("normal", sim.scene.normal_law)
    key = getattr(normal, "STIFFNESS_KEY", "young_modulus")
    factor = least_factor(sim.scene, sim.expected, speed, sound, key)
    remedy = f"no {key} brings that to {sound:.0%}" if factor is None else (
        f"{rounded_up(factor)} times the {key} brings that to {sound:.0%}, at a smaller time step"
    )  # fmt: skip
    stops = f"; over engine.max_overlap = {limit:g} the run stops itself" if overlap > limit else ""
    yield (
        f"impacts at {speed:.3g} m/s (time.max_speed) overlap by up to {overlap:.1%} of the radius{stops}: "
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


def restitutions(sim: Simulation) -> Iterator[str]:
    """Restitutions at which damping is nearly critical."""
    for i, pair in enumerate(sim.scene.pairs):
        if pair.restitution < RESTITUTION:
            law = sim.plan.contact.normal
            longer = damped_time(law, pair.restitution)
            opens = "" if getattr(model("normal", law), "CLAMPED", False) else ", attracts before it opens"
            yield (
                f"pairs[{i}].restitution = {pair.restitution:g}: a contact lasts {longer:.2g} times as long as an undamped one "
                f"or more{opens}, and needs a smaller time step: take {RESTITUTION:g} or more"
            )


def jumps(sim: Simulation) -> Iterator[str]:
    """Laws whose force jumps under integrators that do not weigh it by the part of the step."""
    law, scheme = model("normal", sim.plan.contact.normal), sim.plan.backend.scheme
    if getattr(law, "JUMPS", False) and not getattr(scheme, "WEIGHS_JUMPS", True):
        yield (
            f'engine.integrator = "{sim.scene.engine.integrator}" kicks several times a step: where the force of '
            f'contact.normal = "{sim.scene.contact.normal}" jumps at touch and parting, single impacts are off by a first '
            'order of the step; "exact_drift" weighs jumps by the part of the step that they act in'
        )
