r"""Liquid bridges in a contact: when they form and break, what they pull and how they damp; joined to any normal law.

Liquid is counted: films of grains and bridges hold whole counts of a fixed volume, so their sum is the same integer for ever.
What a contact remembers of its bridge, beside what the law of the bridge keeps (``kernels/liquid``):

    count   n > 0 a bridge of n counts;  0 none;  PENDING it has touched and asks the films of its two bodies for liquid;
            DRY it asked in vain, and stays dry until its surfaces part
    late    share of a step that the force of a bridge is behind, see below

**Birth.** Where two surfaces touch (d > 0) and there is no bridge, the contact asks. The films give in the motion of that step
(``contact.films``), so the force of the bridge begins one step after the touch. What it has missed by then, tau + 1/2 of a
step (``contact.jumps``), is given with its first force: the impulse is that of a force that begins at d = 0. A contact that did
not cross d = 0 (late < 0) missed nothing.

**Rupture.** A bridge ends where the gap exceeds its rupture distance S_r; its last force, that at S_r, is given for the part of
the step that it acted in. Half of its counts, which are even, go back to each film.

**Viscous part**, where a pair has a viscosity eta: two dashpots that friction does not limit, of a gap S no smaller than the
roughness S_min

    c_n = 6 pi eta R*^2/S (1 - S/sqrt(S^2 + c^2))^2                  (Adams and Perchard 1985; Pitois et al. 2000)
    c_t = 6 pi eta R* ((8/15) ln(R*/S) + 0.9588), at least 0         (Goldman, Cox and Brenner 1967)

**Energy.** A bridge holds U(S) = -(its work from S to S_r), and -F(0) d more in contact. It is there at once as it forms: that
is what ``lost`` books as "liquid"; at rupture U is 0. What the viscous dashpots take is lost to liquid too (``dissipation``).
"""

import functools
from types import ModuleType

import numpy as np
import warp as wp
from warpdem.kernels import KernelSet, series
from warpdem.kernels.contact import columns, jumps
from warpdem.kernels.contact.columns import PairKey, scalars

PENDING, DRY = -1.0, -2.0
COUNT = "bridge"
"""Column of the contact history that holds the counts of a bridge."""
PULL = {"bridge_pull": "N", "bridge_wetting": "-"}
"""Own numbers of materials: surface tension [N/m] and cos(theta); of a contact: 4 pi R* g cos(theta) [N] and cos(theta)."""
DRAG = {"bridge_drag": "N s", "bridge_roughness": "m", "bridge_radius": "m"}
"""Of materials: viscosity [Pa s], S_min [m] and 1; of a contact: 6 pi eta R*^2 [N s], S_min and R* [m]."""
PAIR = {
    "surface_tension": PairKey("N/m", None, "Surface tension of the liquid between the two [N/m], >= 0."),
    "contact_angle": PairKey(
        "rad",
        0.0,
        "Contact angle of the liquid on the two, their mean where they differ [rad], >= 0 and below 90 degrees, default 0.",
    ),
    "viscosity": PairKey("Pa s", 0.0, "Viscosity of the liquid [Pa s], >= 0, default 0: bridges do not damp."),
    "roughness": PairKey(
        "m",
        0.0,
        "Gap below which the viscous force of a bridge grows no more, the roughness [m], >= 0, default 0; > 0 with viscosity.",
    ),
}
"""Keys of ``[[pairs]]`` of every law of bridges."""
KEPT = 2  # numbers of the history before those of the law of the bridge: count and late
DIFFERENCE, LEAST = 1.0e-4, 1.0e-100  # step of the derivatives, over the overlap [-] and at least [m]
FAR = 2.0  # rupture distances beyond which a bridge ends without a last force: one of its grains has left


def problems(pair) -> dict[str, str]:
    """What is wrong with the keys of a pair, by key."""
    found = {}
    if not pair.contact_angle < 0.5 * np.pi:
        found["contact_angle"] = "must be below 90 deg: liquid that does not wet makes no bridges"
    if pair.viscosity > 0.0 and not pair.roughness > 0.0:
        found["roughness"] = "missing: with a viscosity the force of a bridge has no bound without it; some 1e-3 of the radius"
    return found


def own_coefficients(pair, viscous: bool) -> tuple[float, ...]:
    """Own numbers of two materials, as of ``PULL`` and ``DRAG``."""
    pull = pair.surface_tension, float(np.cos(pair.contact_angle))
    return (*pull, pair.viscosity, pair.roughness, 1.0) if viscous else pull


def own_names(viscous: bool) -> dict[str, str]:
    """Names of the own numbers."""
    return PULL | DRAG if viscous else PULL


def history(liquid: ModuleType) -> dict[str, str]:
    """What a contact remembers of its bridge: names and units."""
    named = {f"{COUNT}_{name}": "" for name in liquid.BRIDGE.names}
    return {COUNT: "-", f"{COUNT}_late": "-"} | named


@functools.cache
def build(real, liquid: ModuleType, viscous: bool):
    """Return ``constants``, ``force``, ``drag`` and ``lost`` of the bridges of a law, and the types of their numbers.

    Args:
        real: precision.
        liquid: module of the law of the bridges.
        viscous: some pair has a viscosity.
    """
    at = scalars(own_names(viscous))
    Own, History = at.vector(real), scalars(history(liquid)).vector(real)
    Bridge, width = liquid.BRIDGE.vector(real), liquid.BRIDGE.width
    rupture, square = liquid.BRIDGE.rupture, liquid.BRIDGE.square
    share_of = jumps.build(real)
    of_bridge, of_numbers = liquid.build(real), series.build(real)

    @wp.func
    def constants(given: Own, radius: real) -> Own:
        """Own numbers of a contact from those of its materials and R* [m]."""
        made = Own()
        around = real(wp.static(np.pi)) * radius
        made[0] = real(4.0) * around * given[0] * given[1]
        made[1] = given[1]
        if wp.static(viscous):
            made[2] = real(6.0) * around * radius * given[2]
            made[3] = given[3]
            made[4] = radius
        return made

    @wp.func
    def bridge_in(h: History) -> Bridge:
        bridge = Bridge()
        for f in range(wp.static(width)):
            bridge[f] = h[wp.static(KEPT) + f]
        return bridge

    @wp.func
    def force(overlap: real, overlap_before: real, own: Own, before: History):
        """Pull [N] and what is remembered."""
        count = before[0]
        bridge = bridge_in(before)
        far = bridge[wp.static(rupture)]
        gap = -overlap if overlap < real(0.0) else real(0.0)
        there = real(1.0) if count > real(0.0) else real(0.0)
        holds = there if gap <= far else real(0.0)
        place = gap if holds > real(0.0) else far
        pull = of_bridge.force(place, own[0], bridge)
        ending = share_of(overlap, overlap_before, -far)
        ending = ending if gap < real(wp.static(FAR)) * far else real(0.0)
        late = before[1] if before[1] > real(0.0) else real(0.0)
        share = holds * (real(1.0) + late) + (there - holds) * ending

        touching = real(1.0) if overlap > real(0.0) else real(0.0)
        asks = touching if count == real(0.0) else real(0.0)
        missed = share_of(overlap, overlap_before, real(0.0)) if overlap_before <= real(0.0) else real(-1.0)
        unwetted = touching * (real(wp.static(PENDING)) if asks > real(0.0) else real(wp.static(DRY)))
        now = History()
        now[0] = holds * count + (real(1.0) - there) * unwetted
        now[1] = asks * missed
        for f in range(wp.static(width)):
            now[wp.static(KEPT) + f] = holds * bridge[f]
        return share * pull, now

    @wp.func
    def drag(overlap: real, own: Own, before: History):
        """Viscous dashpots of a bridge along the normal and across [N s/m]."""
        c_n = real(0.0)
        c_t = real(0.0)
        if wp.static(viscous):
            gap = -overlap if overlap < real(0.0) else real(0.0)
            far = before[wp.static(KEPT + rupture)]
            there = real(1.0) if before[0] > real(0.0) else real(0.0)
            holds = there if gap <= far else real(0.0)
            near = gap if gap > own[3] else own[3]
            near = near if near > real(0.0) else real(1.0)
            open = real(1.0) - near / wp.sqrt(near * near + before[wp.static(KEPT + square)])
            c_n = holds * own[2] / near * open * open
            ratio = own[4] / near
            ratio = ratio if ratio > real(0.1) else real(0.1)
            slip = real(wp.static(8.0 / 15.0)) * of_numbers.log(ratio) + real(wp.static(0.9588))
            slip = slip if slip > real(0.0) else real(0.0)
            radius = own[4] if own[4] > real(0.0) else real(1.0)
            c_t = holds * own[2] / radius * slip
        return c_n, c_t

    @wp.func
    def lost(overlap: real, own: Own, before: History) -> real:
        """What a bridge loses as it forms [J]: in the step of its first force."""
        bridge = bridge_in(before)
        depth = overlap if overlap > real(0.0) else real(0.0)
        begins = real(1.0) if before[0] > real(0.0) else real(0.0)
        begins = begins if before[1] != real(0.0) else real(0.0)
        inside = depth if before[1] < real(0.0) else real(0.0)
        return begins * (of_bridge.work(own[0], bridge) + inside * of_bridge.force(real(0.0), own[0], bridge))

    return KernelSet(
        Own=Own, History=History, constants=constants, force=force, drag=drag, lost=lost, formed=of_bridge.formed, width=width,
        at=at,
    )  # fmt: skip


@functools.cache
def joined(normal: ModuleType, liquid: ModuleType, viscous: bool) -> ModuleType:
    """A normal law with bridges: a module with what laws of numbers of their own declare, which ``normal_law`` takes apart."""
    own, kept = own_names(viscous), history(liquid)
    dry_own, dry_kept = getattr(normal, "COEFFICIENTS", {}), getattr(normal, "HISTORY", {})
    out = ModuleType(f"{normal.__name__}_with_{liquid.__name__.rsplit('.', 1)[-1]}")

    def dry(numbers: dict) -> dict:
        return {name: value for name, value in numbers.items() if name in dry_own or name in dry_kept}

    def depth(overlap):
        return overlap if hasattr(normal, "gap") else np.maximum(overlap, 0.0)

    def coefficients(a, b, pair):
        return *normal.coefficients(a, b, pair), *own_coefficients(pair, viscous)

    def own_constants(radius, **numbers):
        of_law = getattr(normal, "own_constants", None)
        given = dry(numbers)
        made = {**(of_law(radius, **given) if of_law else given)}
        made["bridge_pull"] = 4.0 * np.pi * radius * numbers["bridge_pull"] * numbers["bridge_wetting"]
        made["bridge_wetting"] = numbers["bridge_wetting"]
        if viscous:
            made["bridge_drag"] = 6.0 * np.pi * radius**2 * numbers["bridge_drag"]
            made["bridge_roughness"], made["bridge_radius"] = numbers["bridge_roughness"], radius
        return made

    def of_bridge(overlap, numbers: dict):
        pull = numbers["bridge_pull"]
        kept_of = [np.asarray(numbers[f"{COUNT}_{name}"], dtype=float) for name in liquid.BRIDGE.names]
        far, square = kept_of[0], np.where(kept_of[1] > 0.0, kept_of[1], 1.0)
        gap, inside = np.minimum(np.maximum(-overlap, 0.0), far), np.maximum(overlap, 0.0)
        touching = kept_of[liquid.BRIDGE.touching] if "touching" in liquid.BRIDGE else pull
        held = liquid.energy(gap, pull, square, far, *kept_of[2:]) - touching * inside
        return np.where(np.asarray(numbers[COUNT]) > 0.0, held, 0.0)

    def energy(overlap, stiffness, **numbers):
        return normal.energy(depth(overlap), stiffness, **dry(numbers)) + of_bridge(overlap, numbers)

    def stored(overlap, stiffness, **numbers):
        return normal.stored(depth(overlap), stiffness, **dry(numbers)) + of_bridge(overlap, numbers)

    def secant(overlap, stiffness, **numbers):
        given, d = dry(numbers), depth(overlap)
        if hasattr(normal, "secant"):
            return normal.secant(d, stiffness, **given)
        step = np.maximum(DIFFERENCE * d, LEAST)
        rise = normal.energy(d + step, stiffness, **given) - normal.energy(np.maximum(d - step, 0.0), stiffness, **given)
        return rise / (2.0 * step * np.maximum(d, LEAST))

    def slope(overlap, stiffness, **numbers):  # of the law alone: a bridge adds none in contact, and its energy is large beside
        given, d = dry(numbers), depth(overlap)  # what changes over a small overlap
        if hasattr(normal, "slope"):
            return normal.slope(d, stiffness, **given)
        step = np.maximum(DIFFERENCE * d, LEAST)
        around = normal.energy(d + step, stiffness, **given) + normal.energy(np.maximum(d - step, 0.0), stiffness, **given)
        return (around - 2.0 * normal.energy(d, stiffness, **given)) / step**2

    parts = {"coefficients": coefficients, "own_constants": own_constants, "energy": energy, "secant": secant, "slope": slope}
    if hasattr(normal, "stored"):
        parts["stored"] = stored
    if (contact_depth := getattr(normal, "contact_depth", None)) is not None:
        parts["contact_depth"] = lambda overlap, stiffness, **numbers: contact_depth(overlap, stiffness, **dry(numbers))
    if (adhesion := getattr(normal, "adhesion", None)) is not None:
        parts["adhesion"] = lambda stiffness, radius, **numbers: adhesion(stiffness, radius, **dry(numbers))
    as_they_are = "stiffness", "damping_coefficient", "damped_time", "gap"
    for name in ("PASSIVE", "TANGENT", "CLAMPED", "CLOSENESS", "STIFFNESS_KEY", *as_they_are):
        if hasattr(normal, name):
            parts[name] = getattr(normal, name)
    parts["LOSSES"] = tuple(dict.fromkeys((*columns.losses(normal), "liquid")))  # those of the law first: ``normal_law``
    parts |= {"COEFFICIENTS": {**dry_own, **own}, "HISTORY": {**dry_kept, **kept}}
    parts |= {"DRY": normal, "LIQUID": liquid, "VISCOUS": viscous, "SUMMARY": getattr(normal, "SUMMARY", "")}
    vars(out).update(parts)
    return out
