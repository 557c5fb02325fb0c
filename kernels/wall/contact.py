"""Grain-wall contacts: one contact per contact point, however the wall is divided into triangles.

A grain near a wall owns a range of slots, one per feature of its near list; its candidates (the features within the inner
skin) and its contact points are at the start of that range. Each step, for the grains that have candidates:

1. the closest points of its candidates are reduced to contact points (``places``);
2. each contact point takes the history of the nearest one of the step before on that wall (in body axes: the history is kept
   across triangle borders) and the contact law of the scene is evaluated.

The wall's displacement over the step is that of a material point along its exact path, the one halfway between the last
contact point and this one: order 2 for a grain that rolls over a turning wall (the point under the contact now: order 1),
and the slip of a grain that rests in a turning body is exactly zero. The torque arm is the distance to the contact point; the
slip takes that of mid-step.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.contact.dissipation import PARTS_AT
from warpdem.kernels.measure.budget import WALL_ENTRY_AT, WallEntry
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
    """Return the struct of wall contacts and the function that evaluates those of one grain.

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
    class WallContacts:
        """Wall contacts, in slots of the grains near walls; hits are only used while a grain is evaluated."""

        grain: wp.array(dtype=wp.int32)  # grains that have candidates
        first: wp.array(dtype=wp.int32)  # per grain: its first slot
        candidates: wp.array(dtype=wp.int32)  # per grain: how many it has
        load: wp.array(dtype=vec6)  # per grain: force [N] and torque [N m] of all its contact points
        # per slot
        feature: wp.array(dtype=wp.int32)
        hit: wp.array(dtype=Hit)
        hit_state: wp.array(dtype=wp.int32)
        hit_mask: wp.array(dtype=wp.int32)
        result: wp.array(dtype=Result)
        # contact points [generation, grain or slot]: 0 and 1 in alternate steps, 2 for the stages within a step
        place_count: wp.array2d(dtype=wp.int32)
        place: wp.array2d(dtype=Memory)
        # per grain, when energies are added up
        entry: wp.array(dtype=WallEntry)
        power: wp.array2d(dtype=wp.float64)  # of each wall's motion [W]

    parts, stored = dissipation or (None, None)
    find_contact_points = places.build(WallContacts, closest_on_feature, around, meshes=meshes, moving=moving, gap=gap)

    @wp.func
    def history_of(wall_contact: Memory) -> History:
        """Contact history of the law."""
        out = History()
        for f in range(wp.static(remembers)):
            out[f] = wall_contact[wp.static(history_at) + f]
        return out

    @wp.func
    def point_in(wall_contact: Memory) -> wp.vec3d:
        """Contact point in body axes of the wall [m]."""
        return wp.vec3d(
            wall_contact[wp.static(at.point)], wall_contact[wp.static(at.point + 1)], wall_contact[wp.static(at.point + 2)]
        )

    @wp.func
    def normal_in(wall_contact: Memory) -> wp.vec3d:
        """Unit vector from the wall to the grain."""
        return wp.vec3d(
            wall_contact[wp.static(at.normal)], wall_contact[wp.static(at.normal + 1)], wall_contact[wp.static(at.normal + 2)]
        )

    @wp.func
    def remembered(
        i: int, c: int, wall: int, radius: wp.float64, old: int, surface: Surface, wall_contacts: WallContacts
    ) -> int:
        """Slot of the contact point of the step before on ``wall`` that is nearest to the new one at ``c``, else -1.

        An old contact point that is nearer to another new one belongs to that, unless ``c`` is one of several that share a
        force: then a new one takes over the history of its neighbor.
        """
        first = wall_contacts.first[i]
        hit = wall_contacts.hit[c]
        point = point_of(hit)
        found = int(-1)
        nearest = radius * radius
        for s in range(first, first + wall_contacts.place_count[old, i]):
            wall_contact = wall_contacts.place[old, s]
            if int(wall_contact[wp.static(at.wall)]) == wall:
                before = point_in(wall_contact)
                square = wp.length_sq(border.nearest(before - point))
                mine = int(1)
                if wall_contacts.hit_state[c] != wp.static(SHARED):
                    for o in range(first, first + wall_contacts.candidates[i]):
                        if wall_contacts.hit_state[o] >= wp.static(TAKEN) and o != c and surface.wall[
                            around.feature_of(surface, wall_contacts.feature[o])
                        ] == wall:
                            if wp.length_sq(border.nearest(before - point_of(wall_contacts.hit[o]))) < square:
                                mine = 0
                if square < nearest and mine == 1:
                    nearest = square
                    found = s
        return found

    @wp.func
    def wall_entry(n: wp.vec3d, distance: wp.float64, u: wp.vec3d, w: wp.vec3d, p: Parts) -> WallEntry:
        """Energy entry of a full contact with a wall whose material moves at ``u`` [m/s] and turns at ``w`` [rad/s]."""
        normal_force = n * p[wp.static(PARTS_AT.damping)]
        tangential_force = wp.vec3d(
            p[wp.static(PARTS_AT.tangential)], p[wp.static(PARTS_AT.tangential + 1)], p[wp.static(PARTS_AT.tangential + 2)]
        )
        sliding_force = tangential_force * p[wp.static(PARTS_AT.slides)]
        sticking_force = tangential_force - sliding_force
        sliding_torque = wp.cross(sliding_force, n) * distance
        sticking_torque = wp.cross(sticking_force, n) * distance
        rolling_torque = wp.vec3d(
            p[wp.static(PARTS_AT.rolling)], p[wp.static(PARTS_AT.rolling + 1)], p[wp.static(PARTS_AT.rolling + 2)]
        )
        return WallEntry(
            normal_force[0], normal_force[1], normal_force[2], sticking_force[0], sticking_force[1],
            sticking_force[2], sticking_torque[0], sticking_torque[1],
            sticking_torque[2], sliding_force[0], sliding_force[1], sliding_force[2], sliding_torque[0],
            sliding_torque[1], sliding_torque[2], rolling_torque[0], rolling_torque[1],
            rolling_torque[2], wp.dot(normal_force, u), wp.dot(sticking_force, u), wp.dot(sliding_force, u),
            wp.dot(rolling_torque, w), p[wp.static(PARTS_AT.cut_spring)], p[wp.static(PARTS_AT.cut_angle)],
            -p[wp.static(PARTS_AT.springs_now)],
        )  # fmt: skip

    @wp.func
    def in_springs(
        i: int, old: int, radius: wp.float64, inv: Inverse, kind: wp.array(dtype=wp.int32), materials: int,
        coefficients: wp.array(dtype=Coefficients), surface: Surface, wall_contacts: WallContacts, dt: wp.float64,
    ) -> wp.float64:  # fmt: skip
        """Energy in the springs of the contact points of the step before [J]."""
        total = wp.float64(0.0)
        for s in range(wall_contacts.first[i], wall_contacts.first[i] + wall_contacts.place_count[old, i]):
            wall_contact = wall_contacts.place[old, s]
            c = coefficients[0]
            if wp.static(table):
                c = coefficients[kind[i] * materials + surface.material[int(wall_contact[wp.static(at.wall)])]]
            numbers = law.constants(c, radius, wp.float64(1.0) / inv[0])
            inertia = wp.float64(0.0)
            if wp.static(rolling):
                inertia = wp.float64(wp.static(inertia_factor)) / inv[1]
            total += stored(
                wall_contact[wp.static(at.overlap)], numbers, radius, inertia, c, history_of(wall_contact), dt
            ) * wall_contact[wp.static(at.weight)]
        return total

    @wp.func
    def evaluate_wall_contacts(
        r: int,  # number in the list of grains that have candidates
        grains: wp.array(dtype=g.Record),
        inverse: wp.array(dtype=Inverse),
        kind: wp.array(dtype=wp.int32),
        materials: int,
        coefficients: wp.array(dtype=Coefficients),
        surface: Surface,
        wall_contacts: WallContacts,
        placements: wp.array2d(dtype=Placement),
        before_row: int,  # of the placements: where springs slip from
        now_row: int,
        state: Row,
        old: int,  # generation of contact points that is read
        new: int,  # and the one that is written
        dt: wp.float64,
    ):
        """Evaluate one grain; returns the largest overlap ratio [-] and approach speed [m/s] of its wall contacts."""
        i = wall_contacts.grain[r]
        grain_i = grains[i]
        q = g.position(grain_i)
        radius = grain_i[3]
        inv = inverse[i]
        entry = WallEntry()
        if wp.static(parts is not None):
            for wall in range(wall_contacts.power.shape[1]):
                wall_contacts.power[i, wall] = wp.float64(0.0)
            if wp.static(remembers > 0):
                # over all of them: one contact point may pass its springs on to several, or to none
                entry[wp.static(WALL_ENTRY_AT.rescaled)] = in_springs(
                    i, old, radius, inv, kind, materials, coefficients, surface, wall_contacts, dt
                )
        if find_contact_points(i, q, radius, surface, wall_contacts, placements, now_row) == 0:
            if wp.static(parts is not None):
                wall_contacts.entry[i] = entry
            wall_contacts.place_count[new, i] = 0
            wall_contacts.load[i] = vec6()
            return wp.float64(0.0), wp.float64(0.0)
        first = wall_contacts.first[i]
        count = int(0)
        overlap_ratio = wp.float64(0.0)
        approach = wp.float64(0.0)
        total = vec6()
        slip_dt = slip_time(state)
        turn = past_turn(state)
        v = g.velocity(grain_i)
        w = g.spin(grain_i)
        half = wp.float64(0.5) * dt
        v_predicted = v + g.acceleration(grain_i) * half
        w_predicted = w + g.angular_acceleration(grain_i) * half
        for c in range(first, first + wall_contacts.candidates[i]):
            if wall_contacts.hit_state[c] >= wp.static(TAKEN):
                f = around.feature_of(surface, wall_contacts.feature[c])
                wall = surface.wall[f]
                motion = surface.motion[wall]
                now = placements[now_row, motion]
                hit = wall_contacts.hit[c]
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
                s = remembered(i, c, wall, radius, old, surface, wall_contacts)
                if s >= 0:
                    wall_contact = wall_contacts.place[old, s]
                    n_before = normal_in(wall_contact)
                    overlap_before = wall_contact[wp.static(at.overlap)]
                    point_before = point_in(wall_contact)
                    midway = body_point + border.nearest(point_before - body_point) * wp.float64(0.5)
                    arm = radius - wp.float64(0.5) * (overlap + overlap_before)
                    history = history_of(wall_contact)
                    if wp.static(turning_frame):
                        n_before = n_before + turn * n_before
                        history = past.rotated(history, turn)
                after = midway
                before = midway
                if wp.static(moving > 0):
                    after = placed(now, midway)
                    before = placed(placements[before_row, motion], midway)
                wall_displacement = around.nearest_way(after - before)
                if wp.static(turning_frame):
                    wall_displacement = wall_displacement - turn * before
                if wp.static(moving_frame):
                    wall_displacement = wall_displacement - past_shift(state)
                if slip_dt == wp.float64(0.0):
                    wall_displacement = wp.vec3d()
                w_wall = wall_spin(now)
                slip = v * slip_dt - wp.cross(w, n + n_before) * (wp.float64(0.5) * arm * slip_dt) - wall_displacement
                if s < 0:  # no contact before: the overlap follows from the displacement in the step
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
                    force_parts = parts(
                        n, n_before, overlap, overlap_before, velocity, slip, (w + w_wall) * (wp.float64(0.5) * slip_dt),
                        w - w_wall, dt, numbers, radius, inertia, c_kind, history, force, moment, after_step,
                    )  # fmt: skip
                    entry += wall_entry(n, distance, wall_velocity(now, point), w_wall, force_parts) * weight
                    wall_contacts.power[i, wall] = wall_contacts.power[i, wall] + weight * (
                        wp.dot(force, wall_velocity(now, point)) + wp.dot(moment, w_wall)
                    )
                force = force * weight
                torque = moment * weight - wp.cross(n, force) * distance
                total += vec6(force[0], force[1], force[2], torque[0], torque[1], torque[2])
                slot = first + count
                count += 1
                p = body_point
                wall_contact_now = Memory()
                wall_contact_now[wp.static(at.wall)] = wp.float64(wall)
                wall_contact_now[wp.static(at.overlap)] = overlap
                wall_contact_now[wp.static(at.weight)] = weight
                for d in range(3):
                    wall_contact_now[wp.static(at.point) + d] = p[d]
                    wall_contact_now[wp.static(at.normal) + d] = n[d]
                for d in range(wp.static(remembers)):
                    wall_contact_now[wp.static(history_at) + d] = after_step[d]
                wall_contacts.place[new, slot] = wall_contact_now
                if wp.static(rolling):
                    weighted = moment * weight
                    wall_contacts.result[slot] = Result(
                        wp.float64(f), force[0], force[1], force[2], weighted[0], weighted[1], weighted[2]
                    )
                else:
                    wall_contacts.result[slot] = Result(wp.float64(f), force[0], force[1], force[2])
                overlap_ratio = wp.max(overlap_ratio, overlap / radius)
                approach = wp.max(approach, -wp.dot(velocity, n))
        wall_contacts.place_count[new, i] = count
        wall_contacts.load[i] = total
        if wp.static(parts is not None):
            wall_contacts.entry[i] = entry
        return overlap_ratio, approach

    return WallContacts, evaluate_wall_contacts
