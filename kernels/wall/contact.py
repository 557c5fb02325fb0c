"""Grain-wall contacts: one contact per touching place, whatever the triangles.

A grain near a wall owns a range of slots, one per feature of its near list; its candidates (the features within the margin)
and its places stand at the start of that range. Each step, for the grains that have candidates:

1. the closest points of its candidates are sorted out into touching places (``places``);
2. each place takes the memory of the nearest place of the step before on that wall (in body axes: it survives any
   triangle border) and goes through the contact law of the scene.

The wall's displacement over the step is that of a material point along its exact path, the one halfway between the last
contact point and this one: order 2 for a grain that rolls over a turning wall (the point under the contact now: order 1),
and a grain that rests in a turning body slips by nothing at all. The torque arm is the distance to the contact point; the
slip takes that of mid-step.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.contact.dissipation import PARTS_AT
from warpdem.kernels.measure.budget import WallEntry
from warpdem.kernels.step.schedule import (
    Placement,
    Row,
    past_shift,
    past_turn,
    placed,
    slip_time,
    turned,
    wall_spin,
    wall_velocity,
)
from warpdem.kernels.wall import places, record
from warpdem.kernels.wall.places import SHARED, TAKEN, Hit, direction_of, point_of
from warpdem.kernels.wall.surface import Surface


@functools.cache
def build(
    law, dissipation, closest_on_feature, border, around, *, spins: bool, rolling: bool, turning_frame: bool,
    moving_frame: bool, table: bool, inertia_factor: float, meshes: bool, moving: int, gap: float,
):  # fmt: skip
    """Return the struct of rows and the function that evaluates one.

    Arguments as in ``pairs.build``; ``law`` of ``law.build`` for walls; ``dissipation``: (parts, stored) of
    ``dissipation.build`` when energies are added up, else None; ``closest_on_feature`` of ``feature.build``; ``around`` of
    ``images.build``; ``rolling``: there is a rolling model, which meets the inertia of the grain times ``inertia_factor``;
    ``moving_frame``: the frame moves at all; ``meshes``: some walls are meshes; ``moving``: number of wall motions relative to
    the frame.
    """
    g = grain.build(spins)
    vec6 = wp.types.vector(6, wp.float64)
    Coefficients, History, past = law.Coefficients, law.History, law.history
    Inverse = wp.types.vector(2, wp.float64)
    at, remembers = record.columns(past.at), past.at.width
    history_at = record.GEOMETRY.width
    Memory = record.memory_type(past.at)
    Parts = PARTS_AT.vector(wp.float64)
    Result = record.result_type(rolling)

    @wp.struct
    class Rows:
        """Slots of the grains near walls; hits are only used while a grain is worked on."""

        grain: wp.array(dtype=wp.int32)  # grains that have candidates
        first: wp.array(dtype=wp.int32)  # per grain: its first slot
        candidates: wp.array(dtype=wp.int32)  # per grain: how many it has
        load: wp.array(dtype=vec6)  # per grain: force [N] and torque [N m] of all its places
        # per slot
        feature: wp.array(dtype=wp.int32)
        hit: wp.array(dtype=Hit)
        hit_state: wp.array(dtype=wp.int32)
        hit_mask: wp.array(dtype=wp.int32)
        result: wp.array(dtype=Result)
        # places [generation, grain or slot]: 0 and 1 by turns of step, 2 for the stages within a step
        place_count: wp.array2d(dtype=wp.int32)
        place: wp.array2d(dtype=Memory)
        # per grain, when energies are added up
        entry: wp.array(dtype=WallEntry)
        power: wp.array2d(dtype=wp.float64)  # of each wall's motion [W]

    parts, stored = dissipation or (None, None)
    find_places = places.build(Rows, closest_on_feature, around, meshes=meshes, moving=moving, gap=gap)

    @wp.func
    def history_of(place: Memory) -> History:
        """Contact history of the law."""
        out = History()
        for f in range(wp.static(remembers)):
            out[f] = place[wp.static(history_at) + f]
        return out

    @wp.func
    def point_in(place: Memory) -> wp.vec3d:
        """Contact point in body axes of the wall [m]."""
        return wp.vec3d(place[wp.static(at.point)], place[wp.static(at.point + 1)], place[wp.static(at.point + 2)])

    @wp.func
    def normal_in(place: Memory) -> wp.vec3d:
        """Unit vector from the wall to the grain."""
        return wp.vec3d(place[wp.static(at.normal)], place[wp.static(at.normal + 1)], place[wp.static(at.normal + 2)])

    @wp.func
    def remembered(i: int, c: int, wall: int, radius: wp.float64, old: int, surface: Surface, rows: Rows) -> int:
        """Slot of the nearest place of the step before on ``wall`` to the place at ``c``, else -1.

        A place that is nearer to another of the new places is that one's, unless ``c`` is one of many that share a force:
        then a new one takes over what its neighbour knows.
        """
        first = rows.first[i]
        hit = rows.hit[c]
        point = point_of(hit)
        found = int(-1)
        nearest = radius * radius
        for s in range(first, first + rows.place_count[old, i]):
            place = rows.place[old, s]
            if int(place[wp.static(at.wall)]) == wall:
                before = point_in(place)
                square = wp.length_sq(border.nearest(before - point))
                mine = int(1)
                if rows.hit_state[c] != wp.static(SHARED):
                    for o in range(first, first + rows.candidates[i]):
                        if rows.hit_state[o] >= wp.static(TAKEN) and o != c and surface.wall[
                            around.feature_of(surface, rows.feature[o])
                        ] == wall:
                            if wp.length_sq(border.nearest(before - point_of(rows.hit[o]))) < square:
                                mine = 0
                if square < nearest and mine == 1:
                    nearest = square
                    found = s
        return found

    @wp.func
    def wall_entry(n: wp.vec3d, distance: wp.float64, u: wp.vec3d, w: wp.vec3d, p: Parts) -> WallEntry:
        """What the grain gets of a full contact with a wall whose material moves at ``u`` [m/s] and turns at ``w`` [rad/s]."""
        pushed = n * p[0]
        rest = wp.vec3d(p[1], p[2], p[3])
        slid = rest * p[4]
        stuck = rest - slid
        slid_torque = wp.cross(slid, n) * distance
        stuck_torque = wp.cross(stuck, n) * distance
        rough = wp.vec3d(p[5], p[6], p[7])
        return WallEntry(
            pushed[0], pushed[1], pushed[2], stuck[0], stuck[1], stuck[2], stuck_torque[0], stuck_torque[1],
            stuck_torque[2], slid[0], slid[1], slid[2], slid_torque[0], slid_torque[1], slid_torque[2], rough[0], rough[1],
            rough[2], wp.dot(pushed, u), wp.dot(stuck, u), wp.dot(slid, u), wp.dot(rough, w), p[8], p[9], -p[11],
        )  # fmt: skip

    @wp.func
    def in_springs(
        i: int, old: int, radius: wp.float64, inv: Inverse, kind: wp.array(dtype=wp.int32), materials: int,
        coefficients: wp.array(dtype=Coefficients), surface: Surface, rows: Rows, dt: wp.float64,
    ) -> wp.float64:  # fmt: skip
        """Energy in the springs of the places of the step before [J]."""
        total = wp.float64(0.0)
        for s in range(rows.first[i], rows.first[i] + rows.place_count[old, i]):
            place = rows.place[old, s]
            c = coefficients[0]
            if wp.static(table):
                c = coefficients[kind[i] * materials + surface.material[int(place[wp.static(at.wall)])]]
            numbers = law.constants(c, radius, wp.float64(1.0) / inv[0])
            inertia = wp.float64(0.0)
            if wp.static(rolling):
                inertia = wp.float64(wp.static(inertia_factor)) / inv[1]
            total += stored(
                place[wp.static(at.overlap)], numbers, radius, inertia, c, history_of(place), dt
            ) * place[wp.static(at.weight)]
        return total

    @wp.func
    def touch(
        r: int,  # number in the list of grains that have candidates
        grains: wp.array(dtype=g.Record),
        inverse: wp.array(dtype=Inverse),
        kind: wp.array(dtype=wp.int32),
        materials: int,
        coefficients: wp.array(dtype=Coefficients),
        surface: Surface,
        rows: Rows,
        placements: wp.array2d(dtype=Placement),
        before_row: int,  # of the placements: where springs slip from
        now_row: int,
        state: Row,
        old: int,  # generation of places that is read
        new: int,  # and the one that is written
        dt: wp.float64,
    ):
        """Evaluate one grain; returns the largest overlap share [-] and approach speed [m/s] of its places."""
        i = rows.grain[r]
        grain_i = grains[i]
        q = g.position(grain_i)
        radius = grain_i[3]
        inv = inverse[i]
        entry = WallEntry()
        if wp.static(parts is not None):
            for wall in range(rows.power.shape[1]):
                rows.power[i, wall] = wp.float64(0.0)
            if wp.static(remembers > 0):
                # over all of them: a place may hand its springs on to several, or to none
                entry[24] = in_springs(i, old, radius, inv, kind, materials, coefficients, surface, rows, dt)
        if find_places(i, q, radius, surface, rows, placements, now_row) == 0:
            if wp.static(parts is not None):
                rows.entry[i] = entry
            rows.place_count[new, i] = 0
            rows.load[i] = vec6()
            return wp.float64(0.0), wp.float64(0.0)
        first = rows.first[i]
        count = int(0)
        share = wp.float64(0.0)
        approach = wp.float64(0.0)
        total = vec6()
        slip_dt = slip_time(state)
        turn = past_turn(state)
        v = g.velocity(grain_i)
        w = g.spin(grain_i)
        half = wp.float64(0.5) * dt
        v_predicted = v + g.acceleration(grain_i) * half
        w_predicted = w + g.angular_acceleration(grain_i) * half
        for c in range(first, first + rows.candidates[i]):
            if rows.hit_state[c] >= wp.static(TAKEN):
                f = around.feature_of(surface, rows.feature[c])
                wall = surface.wall[f]
                motion = surface.motion[wall]
                now = placements[now_row, motion]
                hit = rows.hit[c]
                distance = hit[0]
                body_point = point_of(hit)
                n = direction_of(hit)
                point = body_point
                if wp.static(moving > 0):
                    n = turned(now, n)
                    point = placed(now, body_point)
                overlap = radius - distance
                midway = body_point
                arm = distance
                n_before = n
                overlap_before = overlap
                history = History()
                s = remembered(i, c, wall, radius, old, surface, rows)
                if s >= 0:
                    place = rows.place[old, s]
                    n_before = normal_in(place)
                    overlap_before = place[wp.static(at.overlap)]
                    point_before = point_in(place)
                    midway = body_point + border.nearest(point_before - body_point) * wp.float64(0.5)
                    arm = radius - wp.float64(0.5) * (overlap + overlap_before)
                    history = history_of(place)
                    if wp.static(turning_frame):
                        n_before = n_before + turn * n_before
                        history = past.rotated(history, turn)
                after = midway
                before = midway
                if wp.static(moving > 0):
                    after = placed(now, midway)
                    before = placed(placements[before_row, motion], midway)
                way = around.nearest_way(after - before)
                if wp.static(turning_frame):
                    way = way - turn * before
                if wp.static(moving_frame):
                    way = way - past_shift(state)
                if slip_dt == wp.float64(0.0):
                    way = wp.vec3d()
                w_wall = wall_spin(now)
                slip = v * slip_dt - wp.cross(w, n + n_before) * (wp.float64(0.5) * arm * slip_dt) - way
                if s < 0:  # no contact before: as far apart as the displacement since then says
                    overlap_before = overlap + wp.dot(slip, n)
                velocity = v_predicted - wp.cross(w_predicted, n) * distance - wall_velocity(now, point)
                c_kind = coefficients[0]
                if wp.static(table):
                    c_kind = coefficients[kind[i] * materials + surface.material[wall]]
                numbers = law.constants(c_kind, radius, wp.float64(1.0) / inv[0])
                inertia = wp.float64(0.0)
                if wp.static(rolling):
                    inertia = wp.float64(wp.static(inertia_factor)) / inv[1]
                force, moment, after_step = law.force(
                    n, n_before, overlap, overlap_before, velocity, slip, (w + w_wall) * (wp.float64(0.5) * slip_dt),
                    w - w_wall, w_predicted - w_wall, dt, numbers, radius, inertia, c_kind, history,
                )  # fmt: skip
                weight = hit[1]
                if wp.static(parts is not None):
                    lossy = parts(
                        n, n_before, overlap, overlap_before, velocity, slip, (w + w_wall) * (wp.float64(0.5) * slip_dt),
                        w - w_wall, dt, numbers, radius, inertia, c_kind, history, force, moment, after_step,
                    )  # fmt: skip
                    entry += wall_entry(n, distance, wall_velocity(now, point), w_wall, lossy) * weight
                    rows.power[i, wall] = rows.power[i, wall] + weight * (
                        wp.dot(force, wall_velocity(now, point)) + wp.dot(moment, w_wall)
                    )
                force = force * weight
                torque = moment * weight - wp.cross(n, force) * distance
                total += vec6(force[0], force[1], force[2], torque[0], torque[1], torque[2])
                slot = first + count
                count += 1
                p = body_point
                place_now = Memory()
                place_now[wp.static(at.wall)] = wp.float64(wall)
                place_now[wp.static(at.overlap)] = overlap
                place_now[wp.static(at.weight)] = weight
                for d in range(3):
                    place_now[wp.static(at.point) + d] = p[d]
                    place_now[wp.static(at.normal) + d] = n[d]
                for d in range(wp.static(remembers)):
                    place_now[wp.static(history_at) + d] = after_step[d]
                rows.place[new, slot] = place_now
                if wp.static(rolling):
                    bend = moment * weight
                    rows.result[slot] = Result(wp.float64(f), force[0], force[1], force[2], bend[0], bend[1], bend[2])
                else:
                    rows.result[slot] = Result(wp.float64(f), force[0], force[1], force[2])
                share = wp.max(share, overlap / radius)
                approach = wp.max(approach, -wp.dot(velocity, n))
        rows.place_count[new, i] = count
        rows.load[i] = total
        if wp.static(parts is not None):
            rows.entry[i] = entry
        return share, approach

    return Rows, touch
