"""Liquid between a grain and walls: the thread of the grain takes it from the grain's film and gives it back.

A dry wall gives nothing, and gets nothing back: its bridges are of the grain's liquid alone. A wall with a film gives as much
as lies under the grain, h pi R^2, and gets back half of each bridge; what it has given in all, less what it got, is kept per
grain (``contact.films.FILM_AT``). A bridge belongs to one contact point: if that passes its history on to several, the others
begin without one.
"""

import functools

import numpy as np
import warp as wp
from warpdem.kernels import KernelSet
from warpdem.kernels.contact import liquid
from warpdem.kernels.contact.films import RELEASED
from warpdem.kernels.wall.record import FOUND


@functools.cache
def build(WallContacts, Model, films, at, *, table: bool):
    """Return the functions of the liquid at walls.

    Args:
        WallContacts: struct of ``evaluate.build``.
        Model: of ``structs.build``.
        films: namespace of ``contact.films.build``.
        at: columns of what a wall contact remembers.
        table: coefficients differ between contacts.
    """
    bridge, wall_at = at.of(liquid.COUNT), at.wall
    kept = bridge + liquid.KEPT
    f64 = wp.float64

    @wp.func
    def give_back(i: int, counts: wp.int64, wall: int, wall_contacts: WallContacts):
        """The liquid of a bridge that has ended: to the grain, or half of it to a wet wall."""
        of_wall = wp.int64(0)
        if wall_contacts.wall_film[wall] > f64(0.0):
            of_wall = counts // wp.int64(2)
        wall_contacts.film[i, 1] = wall_contacts.film[i, 1] + counts - of_wall
        wall_contacts.film[i, 2] = wall_contacts.film[i, 2] - of_wall

    @wp.func
    def counts_in(counts: f64) -> wp.int64:
        """Counts of liquid of a contact point: in its bridge, or of one that has broken."""
        held = wp.int64(0)
        if counts > f64(0.0):
            held = wp.int64(counts)
        elif counts < f64(wp.static(RELEASED)):
            held = wp.int64(f64(wp.static(RELEASED)) - counts)
        return held

    @wp.func
    def give_all_back(
        i: int, generation: int, before: int, skipped: int, of: WallContacts, wall_contacts: WallContacts
    ):  # fmt: skip
        """Give grain ``i`` the liquid of its contact points in ``of``, but that of the first ``skipped``: they are dropped.

        There it is grain ``before``.
        """
        first = of.first[before]
        for s in range(first + skipped, first + of.point_count[generation, before]):
            point = of.point[generation, s]
            held = counts_in(point[wp.static(bridge)])
            if held > wp.int64(0):
                give_back(i, held, int(point[wp.static(wall_at)]), wall_contacts)
                point[wp.static(bridge)] = f64(0.0)
                of.point[generation, s] = point

    @wp.func
    def acts(before: int, generation: int, wall_contacts: WallContacts) -> bool:
        """Whether contact point ``before`` of a generation, -1 for none, holds liquid or has asked for it."""
        counts = f64(0.0)
        if before >= 0:
            counts = wall_contacts.point[generation, before][wp.static(bridge)]
        return counts > f64(0.0) or counts == f64(wp.static(liquid.PENDING))

    @wp.func
    def exchange(
        i: int, radius: f64, old: int, listed: int, end: int, material: int, model: Model, wall_contacts: WallContacts
    ):  # fmt: skip
        """Before the contact points ``listed`` to ``end`` of grain ``i`` are evaluated, from those of the step before."""
        first = wall_contacts.first[i]
        for s in range(first, first + wall_contacts.point_count[old, i]):
            point = wall_contacts.point[old, s]
            counts = point[wp.static(bridge)]
            if counts == f64(0.0) or counts == f64(wp.static(liquid.DRY)):
                continue
            heirs = int(0)
            for e in range(listed, end):
                found = wall_contacts.found[e]
                if found[wp.static(FOUND.before)] == s:
                    heirs += 1
                    if heirs > 1 and counts > f64(0.0):
                        found[wp.static(FOUND.before)] = -1
                        wall_contacts.found[e] = found
            if counts > f64(0.0) and heirs > 0:  # a bridge that goes on
                continue
            wall = int(point[wp.static(wall_at)])
            held = counts_in(counts)
            if held > wp.int64(0):
                give_back(i, held, wall, wall_contacts)
                point[wp.static(bridge)] = f64(0.0)
            elif counts == f64(wp.static(liquid.PENDING)) and heirs > 0:
                taken = films.even_part(f64(0.5) * f64(wall_contacts.film[i, 0]), model.most_from_film)
                area = f64(wp.static(np.pi)) * radius * radius
                drawn = films.even_part(wall_contacts.wall_film[wall] * area / model.quantum, model.most_from_film)
                wall_contacts.film[i, 0] = wall_contacts.film[i, 0] - taken
                wall_contacts.film[i, 2] = wall_contacts.film[i, 2] + drawn
                got = f64(taken + drawn)
                point[wp.static(bridge)] = f64(wp.static(liquid.DRY))
                if got > f64(0.0):
                    c = model.coefficients[0]
                    if wp.static(table):
                        c = model.coefficients[material * model.materials + model.surface.material[wall]]
                    made = films.formed(got * model.quantum, radius, c[wp.static(films.tension)], c[wp.static(films.wetting)])
                    point[wp.static(bridge)] = got
                    for f in range(wp.static(films.width)):
                        point[wp.static(kept) + f] = made[f]
            wall_contacts.point[old, s] = point

    @wp.func
    def forget(i: int, generation: int, wall_contacts: WallContacts):
        """A generation that has passed its bridges on has no contact points: what is there holds no liquid any more."""
        wall_contacts.point_count[generation, i] = 0

    return KernelSet(acts=acts, exchange=exchange, give_all_back=give_all_back, forget=forget)
