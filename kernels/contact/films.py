r"""Films of liquid on grains: what bridges take from them and give back, in whole counts, so that none is lost.

Of each grain FILM_AT: its film, what was returned to it beside the steps, and what it has drawn from walls [counts]. In the
order of a step:

1. The pair pass writes to the force slots of a grain, beside its force, a wish (the radius of the partner, where surfaces have
   just touched) and a gift (half of a bridge that has broken).
2. The motion of the grain (``exchange``) adds the gifts to its film, and answers its wishes, in the order of partner ids, with

       2 floor(L s_j / (2 max(1, sum s))),   s_j = (1 - sqrt(1 - R_j^2/(R_i + R_j)^2))/2       (Shi and McCarthy 2008)

   s_j is half of the film's part that lies under the cap that the partner covers: 6.7 % for equal spheres. A film never goes
   below zero, and no bridge grows beyond the volume that the reach of the lists is made for.
3. The next pair pass finds the answers of both grains in their slots and makes a bridge of them (``settle``), or stays dry.

At a wall (``wall.films``) s is 1/2, the limit of a large partner; a wet wall of film thickness h adds h pi R^2. There the
thread of the grain takes and returns the liquid.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, grain
from warpdem.kernels.contact import liquid
from warpdem.kernels.contact.columns import scalars
from warpdem.kernels.contact.pairs import force_width

FILM_AT = scalars(["film", "returned", "drawn"])
"""Counts of liquid of a grain: on it, returned to it since its last motion, taken from walls less what they got back."""
QUANTUM = {wp.float64: 2.0**-36, wp.float32: 2.0**-26}
"""A count over the volume of the largest grain, by the precision of the contact history, at most."""
LARGEST = {wp.float64: 2.0**50, wp.float32: 2.0**23}
"""Counts that a number of the history and the sum of two hold exactly."""
RELEASED = -2.0
"""At a wall: a history RELEASED - n tells of n counts of a bridge that has broken, and are the grain's."""

ASKS = """
    int found = 0;
    for (int k = 0; k < history.shape[2]; ++k) found |= *wp::address(history, p, {at}, k) == {pending};
    return found != 0;
"""


def covered(radius, partner):
    """Part of its film that a grain of ``radius`` [m] gives to a bridge with one of radius ``partner`` [m] [-]."""
    return 0.5 * (1.0 - np.sqrt(radius * (radius + 2.0 * partner)) / (radius + partner))


@functools.cache
def build(pairs, liquid_law, *, table: bool, reach: float, longest: float):
    """Return the functions and kernels of the exchange of liquid.

    Args:
        pairs: namespace of ``pairs.build`` of a law with bridges.
        liquid_law: module of the law of the bridges.
        table: coefficients differ between contacts.
        reach: how far beyond contact the lists reach [m].
        longest: rupture distance [m] that no bridge exceeds: lists are made for it.
    """
    real, at_bridge, spins = pairs.real, pairs.bridge_at, pairs.spins
    g = grain.build(spins)
    PairForce, Coefficients, width = pairs.PairForce, pairs.Coefficients, liquid_law.BRIDGE.width
    wish, gift = force_width(spins), force_width(spins) + 1
    tension = pairs.law.at.bridge_pull
    wetting = pairs.law.at.bridge_wetting
    formed_64 = liquid_law.build(wp.float64).formed
    first = at_bridge + liquid.KEPT
    f64 = wp.float64

    Bridge_64 = liquid_law.BRIDGE.vector(wp.float64)
    rupture_at = liquid_law.BRIDGE.rupture

    @wp.func
    def formed(volume: f64, radius: f64, surface_tension: f64, cosine: f64) -> Bridge_64:
        """Numbers of a bridge of ``volume`` [m3]."""
        bridge = formed_64(volume, radius, surface_tension, cosine)
        bridge[wp.static(rupture_at)] = wp.min(bridge[wp.static(rupture_at)], f64(wp.static(longest)))
        return bridge

    @wp.func
    def share(radius: f64, partner: f64) -> f64:
        """Part of its film that a grain gives to one bridge [-]."""
        return f64(0.5) * (f64(1.0) - wp.sqrt(radius * (radius + f64(2.0) * partner)) / (radius + partner))

    @wp.func
    def even_part(counts: f64, most: f64) -> wp.int64:
        """Largest even number of counts that is no more than either."""
        return wp.int64(2) * wp.int64(wp.floor(f64(0.5) * wp.min(counts, most)))

    @wp.func
    def exchange(
        i: int, radius: f64, first_slot: int, last_slot: int, most: f64, slot_force: wp.array(dtype=PairForce),
        film: wp.array2d(dtype=wp.int64),
    ):  # fmt: skip
        """Give grain ``i`` its gifts, and answer its wishes from its film."""
        given = film[i, 1]
        wanted = f64(0.0)
        for e in range(first_slot, last_slot):
            given += wp.int64(slot_force[e][wp.static(gift)])
            partner = f64(slot_force[e][wp.static(wish)])
            if partner > f64(0.0):
                wanted += share(radius, partner)
        if given == wp.int64(0) and wanted == f64(0.0):
            return
        left = film[i, 0] + given
        part = f64(left) / wp.max(f64(1.0), wanted)
        for e in range(first_slot, last_slot):
            one = slot_force[e]
            partner = f64(one[wp.static(wish)])
            if partner > f64(0.0):
                taken = even_part(wp.min(part * share(radius, partner), f64(left)), most)
                left -= taken
                one[wp.static(wish)] = real(taken)
                slot_force[e] = one
        film[i, 0] = left
        film[i, 1] = wp.int64(0)

    @wp.func_native(ASKS.format(at=at_bridge, pending=liquid.PENDING))
    def asks(p: int, history: wp.array3d(dtype=real)) -> bool:
        """Whether a contact of batch ``p`` has asked for liquid."""
        ...

    @wp.func
    def settle(
        p: int, k: int, quantum: f64, record: wp.array(dtype=g.Record), owner: wp.array2d(dtype=wp.int32),
        partner: wp.array2d(dtype=wp.int32), kind: wp.array2d(dtype=wp.int32), coefficients: wp.array(dtype=Coefficients),
        slot_i: wp.array2d(dtype=wp.int32), slot_j: wp.array2d(dtype=wp.int32), slot_force: wp.array(dtype=PairForce),
        history: wp.array3d(dtype=real),
    ):  # fmt: skip
        """Make a bridge of what the films have given to the contact in lane ``k`` of batch ``p``, if it has asked."""
        if history[p, wp.static(at_bridge), k] == real(wp.static(liquid.PENDING)):
            counts = slot_force[slot_i[p, k]][wp.static(wish)] + slot_force[slot_j[p, k]][wp.static(wish)]
            if counts > real(0.0):
                c = coefficients[0]
                if wp.static(table):
                    c = coefficients[kind[p, k]]
                radius = pairs.reduced_radius(record[owner[p, k]], record[partner[p, k]])
                bridge = formed(
                    f64(counts) * quantum, radius, c[wp.static(tension)], c[wp.static(wetting)]
                )  # fmt: skip
                history[p, wp.static(at_bridge), k] = counts
                for f in range(wp.static(width)):
                    history[p, wp.static(first) + f, k] = real(bridge[f])
            else:
                history[p, wp.static(at_bridge), k] = real(wp.static(liquid.DRY))

    @wp.kernel(enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    def settle_contacts(
        first: int,
        lanes: int,
        quantum: f64,
        record: wp.array(dtype=g.Record),
        owner: wp.array2d(dtype=wp.int32),
        partner: wp.array2d(dtype=wp.int32),
        kind: wp.array2d(dtype=wp.int32),
        coefficients: wp.array(dtype=Coefficients),
        slot_i: wp.array2d(dtype=wp.int32),
        slot_j: wp.array2d(dtype=wp.int32),
        slot_force: wp.array(dtype=PairForce),
        # written
        history: wp.array3d(dtype=real),
        film: wp.array2d(dtype=wp.int64),
    ):
        """Before lists are built: bridges of what films have given, and those that no list would hold go back to their films.

        Those of grains that have left, and beyond the reach of the lists. Whole numbers: the order of the additions is nothing.
        """
        t = first + wp.tid()
        p = t // lanes
        k = t % lanes
        if slot_i[p, k] + 1 == slot_force.shape[0] or history[p, wp.static(at_bridge), k] == real(0.0):
            return
        settle(p, k, quantum, record, owner, partner, kind, coefficients, slot_i, slot_j, slot_force, history)
        counts = history[p, wp.static(at_bridge), k]
        if counts > real(0.0):
            i = owner[p, k]
            j = partner[p, k]
            gi = record[i]
            gj = record[j]
            away = pairs.border.nearest(g.position(gi) - g.position(gj))
            cutoff = gi[3] + gj[3] + f64(wp.static(reach))
            if g.is_removed(gi) or g.is_removed(gj) or wp.dot(away, away) > cutoff * cutoff:
                half = wp.int64(counts) // wp.int64(2)
                wp.atomic_add(film, i, 1, half)
                wp.atomic_add(film, j, 1, half)
                for f in range(wp.static(liquid.KEPT + width)):
                    history[p, wp.static(at_bridge) + f, k] = real(0.0)

    return KernelSet(
        exchange=exchange, asks=asks, settle=settle, settle_contacts=settle_contacts, even_part=even_part, formed=formed,
        width=width, tension=tension, wetting=wetting, wish=wish,
    )  # fmt: skip
