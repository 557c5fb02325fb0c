"""The wall contacts of a grain: one per contact point, however the wall is divided into triangles.

A grain near a wall owns a range of slots, one per feature of its near list; its candidates (the features listed in the
inner list) and its contact points are at the start of that range. Each step, for the grains that have candidates:

1. ``search``: the closest points of its candidates are reduced to contact points (``contact_points``), and each takes the
   history of the nearest one of the step before on that wall (in body axes: it is kept across triangle borders);
2. ``evaluate``: the contact law at each contact point (``contact``), and the sum over them. On a CPU ``sweep`` does this for
   several contact points at once.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, grain
from warpdem.kernels.measure.budget import WALL_ENTRY_AT
from warpdem.kernels.step.schedule import Placement, Row
from warpdem.kernels.step.structs import ForceCall
from warpdem.kernels.wall import contact_points, films
from warpdem.kernels.wall.contact import vec6
from warpdem.kernels.wall.contact_points import SHARED, TAKEN, Hit, point_of
from warpdem.kernels.wall.mobility import Mobility
from warpdem.kernels.wall.record import FOUND, FRICTION, Found
from warpdem.kernels.wall.surface import Surface


@functools.cache
def build(
    structs, one, closest_on_feature, border, around, *, table: bool, meshes: bool, gap: float, of_films=None,
    force_gap: float = 0.0,
):  # fmt: skip
    """Return the struct of wall contacts, and the functions of a grain's.

    Args:
        structs: namespace of ``step.structs.build``.
        one: namespace of ``contact.build``.
        closest_on_feature: of ``feature.build``.
        border: periodic images, of ``border.build``.
        around: of ``images.build``.
        table: coefficients differ between contacts.
        meshes: some walls are meshes.
        gap: as in ``pairs.build``.
        of_films: of ``contact.films.build``; None for a law without bridges.
        force_gap: how far beyond contact the normal law itself acts [m]; with bridges.
    """
    g, at = grain.build(one.spins), one.at
    WallHistory, Result, WallEntry = one.WallHistory, one.Result, one.WallEntry
    Model, Grains = structs.Model, structs.Grains
    moving, energies = one.moving, one.has_parts

    @wp.struct
    class WallContacts:
        """Wall contacts, in slots of the grains near walls; hits and what is found are only used within a force call."""

        grain: wp.array(dtype=wp.int32)  # grains that have candidates, ascending
        first: wp.array(dtype=wp.int32)  # per grain: its first slot
        candidates: wp.array(dtype=wp.int32)  # per grain: how many it has
        load: wp.array(dtype=vec6)  # per grain: force [N] and torque [N m] of all its contact points
        # per slot
        feature: wp.array(dtype=wp.int32)
        hit: wp.array(dtype=Hit)
        hit_state: wp.array(dtype=wp.int32)
        hit_mask: wp.array(dtype=wp.int32)
        found: wp.array(dtype=Found)  # contact points whose law is to be evaluated; those of several grains together
        result: wp.array(dtype=Result)
        # contact points by generation: 0 and 1 in alternate steps, 2 for the stages within a step
        point_count: wp.array2d(dtype=wp.int32)  # (generations, n)
        point: wp.array2d(dtype=WallHistory)  # (generations, slots)
        # of a law with bridges
        film: wp.array2d(dtype=wp.int64)  # per grain, of ``contact.films.FILM_AT``
        wall_film: wp.array(dtype=wp.float64)  # (walls,) thickness of the film on each wall [m]
        # per grain, when energies are added up
        entry: wp.array(dtype=WallEntry)
        power: wp.array2d(dtype=wp.float64)  # of each wall's motion [W]

    wetting = None
    if of_films is not None:
        wetting = films.build(WallContacts, Model, of_films, at, table=table)
    find_contact_points = contact_points.build(
        WallContacts, closest_on_feature, around, meshes=meshes, moving=moving, gap=gap
    )

    @wp.func
    def remembered(
        i: int,
        c: int,
        alone: bool,
        wall: int,
        radius: wp.float64,
        old: int,
        surface: Surface,
        wall_contacts: WallContacts,
    ) -> int:
        """Slot of the contact point of the step before on ``wall`` that is nearest to the new one at ``c``, else -1.

        An old contact point that is nearer to another new one belongs to that, unless ``c`` is one of several that share a
        force: then a new one takes over the history of its neighbor. ``alone``: ``c`` is the only new one.
        """
        first = wall_contacts.first[i]
        hit = wall_contacts.hit[c]
        point = point_of(hit)
        found = int(-1)
        nearest = radius * radius
        for s in range(first, first + wall_contacts.point_count[old, i]):
            wall_contact = wall_contacts.point[old, s]
            if int(wall_contact[wp.static(at.wall)]) == wall:
                before = one.point_in(wall_contact)
                square = wp.length_sq(border.nearest(before - point))
                mine = int(1)
                if not alone and wall_contacts.hit_state[c] != wp.static(SHARED):
                    for o in range(first, first + wall_contacts.candidates[i]):
                        if (
                            wall_contacts.hit_state[o] >= wp.static(TAKEN)
                            and o != c
                            and surface.wall[around.feature_of(surface, wall_contacts.feature[o])] == wall
                        ):
                            if wp.length_sq(border.nearest(before - point_of(wall_contacts.hit[o]))) < square:
                                mine = 0
                if square < nearest and mine == 1:
                    nearest = square
                    found = s
        return found

    @wp.func
    def in_springs(i: int, old: int, model: Model, grains: Grains, wall_contacts: WallContacts) -> wp.float64:
        """Energy in the springs of the contact points of the step before [J]."""
        total = wp.float64(0.0)
        for s in range(wall_contacts.first[i], wall_contacts.first[i] + wall_contacts.point_count[old, i]):
            before = wall_contacts.point[old, s]
            c = model.coefficients[0]
            if wp.static(table):
                wall = int(before[wp.static(at.wall)])
                c = model.coefficients[grains.material[i] * model.materials + model.surface.material[wall]]
            total += one.in_springs(before, grains.record[i][3], grains.inverse[i], c, model.dt)
        return total

    @wp.func
    def search(
        r: int,  # number in the list of grains that have candidates
        listed: int,  # where its contact points are listed
        call: ForceCall,
        placements: wp.array2d(dtype=Placement),
        model: Model,
        grains: Grains,
        wall_contacts: WallContacts,  # written
    ) -> int:
        """List the contact points of a grain and set its sums to zero; returns where the list ends."""
        i = wall_contacts.grain[r]
        state = grains.record[i]
        radius = state[3]
        if wp.static(energies):
            for wall in range(wall_contacts.power.shape[1]):
                wall_contacts.power[i, wall] = wp.float64(0.0)
            entry = WallEntry()
            if wp.static(one.in_springs is not None):
                # over all of them: one contact point may pass its springs on to several, or to none
                entry[wp.static(WALL_ENTRY_AT.rescaled)] = in_springs(i, call.old_generation, model, grains, wall_contacts)
            wall_contacts.entry[i] = entry
        wall_contacts.load[i] = vec6()
        first = wall_contacts.first[i]
        slot = int(first)
        n = int(listed)
        hits = find_contact_points(i, g.position(state), radius, model.surface, wall_contacts, placements, call.now)
        if hits > 0:
            for c in range(first, first + wall_contacts.candidates[i]):
                if wall_contacts.hit_state[c] >= wp.static(TAKEN):
                    f = around.feature_of(model.surface, wall_contacts.feature[c])
                    wall = model.surface.wall[f]
                    row = int(0)
                    if wp.static(table):
                        row = grains.material[i] * model.materials + model.surface.material[wall]
                    before = remembered(i, c, hits == 1, wall, radius, call.old_generation, model.surface, wall_contacts)
                    if wp.static(wetting is not None):  # out of reach of the normal law only a bridge acts
                        distance = wall_contacts.hit[c][0]
                        if distance > radius + wp.float64(wp.static(force_gap)):
                            if not wetting.acts(before, call.old_generation, wall_contacts):
                                continue
                    wall_contacts.found[n] = Found(i, c, before, slot, f, wall, model.surface.motion[wall], row)
                    n += 1
                    slot += 1
        wall_contacts.point_count[call.new_generation, i] = slot - first
        if wp.static(wetting is not None):
            wetting.exchange(i, radius, call.old_generation, listed, n, grains.material[i], model, wall_contacts)
        return n

    @wp.func
    def evaluate_found(
        e: int,  # number in the list of what is found
        call: ForceCall,
        row: Row,
        placements: wp.array2d(dtype=Placement),
        model: Model,
        grains: Grains,
        wall_contacts: WallContacts,  # written
    ):
        """Evaluate one contact point and add what it does to its grain; returns overlap ratio [-] and approach speed [m/s]."""
        found = wall_contacts.found[e]
        i = found[wp.static(FOUND.grain)]
        slot = found[wp.static(FOUND.slot)]
        motion = found[wp.static(FOUND.motion)]
        now = placements[call.now, motion]
        then = now
        if wp.static(one.looks_back):
            then = placements[call.before, motion]
        mobility = Mobility()
        if wp.static(one.yielding):
            mobility = model.surface.mobility[motion]
        before = WallHistory()
        known = wp.float64(0.0)
        if found[wp.static(FOUND.before)] >= 0:
            before = wall_contacts.point[call.old_generation, found[wp.static(FOUND.before)]]
            known = wp.float64(1.0)
        memory, load, rest, overlap_ratio, approach, entry, power = one.contact(
            grains.record[i], grains.inverse[i], wall_contacts.hit[found[wp.static(FOUND.hit)]],
            wp.float64(found[wp.static(FOUND.wall)]), known, before, now, then, mobility,
            model.coefficients[found[wp.static(FOUND.coefficients)]], row, model.dt,
        )  # fmt: skip
        wall_contacts.point[call.new_generation, slot] = memory
        wall_contacts.load[i] = wall_contacts.load[i] + load
        result = Result()
        result[0] = wp.float64(found[wp.static(FOUND.feature)])
        for k in range(3):
            result[1 + k] = load[k]
        for k in range(wp.static(Result._length_ - FRICTION)):
            result[wp.static(FRICTION) + k] = rest[k]
        wall_contacts.result[slot] = result
        if wp.static(energies):
            wall = found[wp.static(FOUND.wall)]
            wall_contacts.entry[i] = wall_contacts.entry[i] + entry
            wall_contacts.power[i, wall] = wall_contacts.power[i, wall] + power
        return overlap_ratio, approach

    @wp.func
    def evaluate(
        r: int, call: ForceCall, row: Row, placements: wp.array2d(dtype=Placement), model: Model, grains: Grains,
        wall_contacts: WallContacts,
    ):  # fmt: skip
        """Evaluate one grain; returns the largest overlap ratio [-] and approach speed [m/s] of its wall contacts."""
        overlap_ratio = wp.float64(0.0)
        approach = wp.float64(0.0)
        listed = wall_contacts.first[wall_contacts.grain[r]]
        end = search(r, listed, call, placements, model, grains, wall_contacts)
        for e in range(listed, end):
            a, b = evaluate_found(e, call, row, placements, model, grains, wall_contacts)
            overlap_ratio = wp.max(overlap_ratio, a)
            approach = wp.max(approach, b)
        return overlap_ratio, approach

    return KernelSet(WallContacts=WallContacts, search=search, evaluate=evaluate, wetting=wetting)
