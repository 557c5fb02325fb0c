"""Grains in flight: far from all that is not listed with them, for a while known beforehand.

Lists hold as long as every grain is near its reference: a place, for most. One grain that is fast would have them rebuilt all
the time, though nothing is near it. A grain in flight is near a *path* instead, the parabola of its free fall from the
place where it was when the path was laid,

    P(t) = q + V t + (1/2) a t^2,      |q(t) - P(t)| <= allowance  at every step up to the last of the path,

and the path was laid so that up to there its grain can touch no other outside of its row in the outer list:

    |P(t) - reference of j| >= R_i + R_j + gap + allowance + allowance of j      j any other grain, as far as it may move
    |P_i(t) - P_j(t)|       >= R_i + R_j + gap + 2 allowance             j in flight too
    distance of P(t) to a wall >= R_i + gap + allowance

What is in its row is in the contact list too, whatever the distance; so is an analytic wall that is listed beside it.
Whether the fall is free does not matter for the proof: a grain that leaves its path is noticed, as one that leaves its place
is. So what is laid here changes no bit of the result.

The first time at which a path may come too near is found by conservative advancement: over a distance d that is free now the
grain needs at least the time 2 d / (v + sqrt(v^2 + 2 |a| d)); then it is looked at again from there. A look goes no further
than a distance that doubles with each: what is beyond is neither searched for in the mesh nor among the grains. References of
other grains are first asked for by the boxes around BLOCK of them that follow each other in memory, and so are close together.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, grain
from warpdem.kernels.lists.displacement import Watched
from warpdem.kernels.lists.neighbors import NeighborRows
from warpdem.kernels.lists.path import FAR, Flight, bend, in_flight, position_at, velocity_at
from warpdem.kernels.step.schedule import Placement, local
from warpdem.kernels.wall.surface import MeshTrees, Surface

BLOCK = 64
LOOKS = 24  # along one path
FIRST_LOOK = 8.0  # how far the first one goes, over the radius [-]


@wp.func
def least_time(distance: wp.float64, speed: wp.float64, acceleration: wp.float64) -> wp.float64:
    """Time [s] that travelling this distance [m] takes at least, from this speed [m/s] on."""
    zero = wp.float64(0.0)
    if distance <= zero:
        return zero
    fastest = speed + wp.sqrt(speed * speed + wp.float64(2.0) * acceleration * distance)
    return wp.float64(2.0) * distance / fastest if fastest > zero else wp.float64(FAR)


@wp.func
def largest_distance(time: wp.float64, speed: wp.float64, acceleration: wp.float64) -> wp.float64:
    """Distance [m] that can be travelled in this time [s] at most."""
    return (speed + wp.float64(0.5) * acceleration * time) * time


@functools.cache
def build(
    travel, border, closest_on_feature, WallContacts, *, spins: bool, moving: int, meshes: bool, shapes: bool,
    gap: float, stages: int,
    shortest: float,
):  # fmt: skip
    """Return the kernels.

    Args:
        travel: namespace of ``motion.build_travel``.
        border: periodic images, of ``border.build``.
        closest_on_feature: of ``wall.feature.build``.
        WallContacts: struct of the wall contacts.
        spins: grains spin.
        moving: number of wall motions relative to the frame.
        meshes: there are mesh walls.
        shapes: there are analytic walls.
        gap: how far beyond contact the normal law acts [m].
        stages: force calls per step.
        shortest: of the periods [m], 0 when no axis is periodic.
    """
    g = grain.build(spins)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)
    periodic = border.images > 1

    @wp.struct
    class OtherGrains:
        """The grains that a path must keep away from; read only."""

        record: wp.array(dtype=g.Record)  # (n,)
        reference: wp.array2d(dtype=wp.vec3d)  # (n, 1 + motions) of the outer list
        flight: wp.array(dtype=Flight)  # (n,)
        flyer: wp.array(dtype=wp.int32)  # slots of those in flight
        low: wp.array(dtype=wp.vec3d)  # (blocks,) of ``enclose``
        high: wp.array(dtype=wp.vec3d)
        rows: NeighborRows  # the outer list

    @wp.struct
    class WallsAhead:
        """The walls that a path must keep away from, and where they will be; read only."""

        surface: Surface
        trees: MeshTrees
        watched: Watched
        placements: wp.array2d(dtype=Placement)  # (rows, motions)
        row: wp.int32  # of the placements at present
        fastest: wp.array(dtype=wp.vec2d)  # (motions,) largest speed at the origin [m/s] and spin [rad/s]
        wall_contacts: WallContacts
        near_feature: wp.array(dtype=wp.int32)  # (wall slots,) features listed beside each grain

    @kernel
    def enclose(
        first: int,
        grains: wp.array(dtype=g.Record),
        reference: wp.array2d(dtype=wp.vec3d),
        flight: wp.array(dtype=Flight),
        allowance: wp.array(dtype=wp.float64),
        low_out: wp.array(dtype=wp.vec3d),
        high_out: wp.array(dtype=wp.vec3d),
    ):
        """Boxes around the spheres at the references of each block of grains, without those in flight or gone."""
        b = first + wp.tid()
        far = wp.float64(FAR)
        low = wp.vec3d(far, far, far)
        high = -low
        for j in range(b * wp.static(BLOCK), wp.min((b + 1) * wp.static(BLOCK), grains.shape[0])):
            if not in_flight(flight, j) and not g.is_removed(grains[j]):
                there = reference[j, 0]
                r = grains[j][3] + allowance[j]
                room = wp.vec3d(r, r, r)
                low = wp.min(low, there - room)
                high = wp.max(high, there + room)
        low_out[b] = low
        high_out[b] = high

    @wp.func
    def gap_to_box_alone(x: wp.vec3d, low: wp.vec3d, high: wp.vec3d) -> wp.float64:
        """Distance [m] of a place from a box."""
        zero = wp.vec3d()
        return wp.length(wp.max(wp.max(low - x, x - high), zero))

    @wp.func
    def gap_to_box(x: wp.vec3d, low: wp.vec3d, high: wp.vec3d) -> wp.float64:
        """Distance [m] of a place from a box, or from its nearest image."""
        away = border.nearest(x - (low + high) * wp.float64(0.5))
        half = (high - low) * wp.float64(0.5)
        zero = wp.float64(0.0)
        out = wp.vec3d(
            wp.max(wp.abs(away[0]) - half[0], zero), wp.max(wp.abs(away[1]) - half[1], zero),
            wp.max(wp.abs(away[2]) - half[2], zero),
        )  # fmt: skip
        return wp.length(out)

    @wp.func
    def is_listed(j: int, start: int, count: int, slot: wp.array(dtype=wp.int32)) -> bool:
        for e in range(start, start + count):
            if slot[e] == j:
                return True
        return False

    @wp.func
    def until_meeting(path: Flight, other: Flight, now: wp.float64, dt: wp.float64, need: wp.float64) -> wp.float64:
        """Time [s] from step ``now`` on for which two paths stay ``need`` [m] apart, at least."""
        t = (now - path[10]) * dt
        u = (now - other[10]) * dt
        r = border.nearest(position_at(path, t) - position_at(other, u))
        w = velocity_at(path, t) - velocity_at(other, u)
        b = bend(path) - bend(other)
        zero = wp.float64(0.0)
        free = wp.dot(r, r) - need * need
        if free <= zero:
            return zero
        if wp.static(periodic) or wp.length_sq(b) > zero:
            return least_time(wp.length(r) - need, wp.length(w), wp.length(b))
        closing = wp.dot(r, w)
        if closing >= zero:
            return wp.float64(FAR)
        inside = closing * closing - wp.dot(w, w) * free
        if inside < zero:
            return wp.float64(FAR)
        return free / (wp.sqrt(inside) - closing)

    @wp.func
    def until_grain(
        f: int, x: wp.vec3d, speed: wp.float64, acceleration: wp.float64, need: wp.float64, best: wp.float64,
        others: OtherGrains,
    ) -> wp.float64:  # fmt: skip
        """Time [s], at most ``best``, for which the grain at ``x`` meets none at its reference."""
        time = best
        start = others.rows.start[f]
        count = others.rows.count[f]
        for b in range(others.low.shape[0]):
            first = others.low[b]
            last = others.high[b]
            if first[0] <= last[0]:
                if gap_to_box(x, first, last) - need < largest_distance(time, speed, acceleration):
                    for j in range(b * wp.static(BLOCK), wp.min((b + 1) * wp.static(BLOCK), others.record.shape[0])):
                        if j != f and not in_flight(others.flight, j) and not g.is_removed(others.record[j]):
                            room = others.record[j][3] + others.rows.allowance[j]
                            free = wp.length(border.nearest(x - others.reference[j, 0])) - need - room
                            until = least_time(free, speed, acceleration)
                            if until < time:
                                if not is_listed(j, start, count, others.rows.slot):
                                    time = until
        return time

    @wp.func
    def until_wall(
        f: int, k: int, x: wp.vec3d, v: wp.vec3d, radius: wp.float64, acceleration: wp.float64, need: wp.float64,
        best: wp.float64, dt: wp.float64, walls: WallsAhead,
    ) -> wp.float64:  # fmt: skip
        """Time [s], at most ``best``, for which the grain at ``x`` meets no wall, ``k`` steps from now."""
        time = best
        now = walls.row
        if wp.static(moving > 0):
            now = walls.row + k * wp.static(stages)
        speed = wp.length(v)
        if wp.static(meshes):
            for m in range(walls.trees.tree.shape[0]):
                wall = walls.trees.wall[m]
                motion = walls.surface.motion[wall]
                most = walls.fastest[motion]
                body = local(walls.placements[now, motion], x)
                closing = speed + most[0] + most[1] * wp.length(x)
                apparent = acceleration + wp.float64(2.0) * most[1] * closing
                away = gap_to_box_alone(body, walls.watched.low[m], walls.watched.high[m])
                # what is fast beside a mesh is for the guard of the travel to see (``travel``)
                free = away - need - closing * dt * wp.float64(2.0)
                slow = closing * dt * wp.float64(1.1) < walls.watched.max_travel[m] * radius
                ahead = largest_distance(time, closing, apparent)
                if slow and free < ahead:
                    p = wp.vec3(float(body[0]), float(body[1]), float(body[2]))
                    # nothing further than that matters; somewhat more for the rounding of single precision
                    within = (need + ahead) * wp.float64(1.001) + wp.float64(1.0e-4) * wp.length(body)
                    within = within + wp.float64(2.0) * walls.surface.rounding[wall]
                    found = wp.mesh_query_point_no_sign(walls.trees.tree[m], p, wp.float32(wp.min(within, wp.float64(FAR))))
                    free = ahead
                    if found.result:
                        point = wp.mesh_eval_position(walls.trees.tree[m], found.face, found.u, found.v)
                        apart = body - wp.vec3d(wp.float64(point[0]), wp.float64(point[1]), wp.float64(point[2]))
                        rounding = wp.float64(1.0e-5) * (wp.length(body) + wp.length(apart)) + walls.surface.rounding[wall]
                        free = wp.length(apart) - need - rounding
                time = wp.min(time, least_time(free, closing, apparent))
        if wp.static(shapes):
            for s in range(walls.surface.analytic):
                feature = walls.surface.triangles + s
                begin = walls.wall_contacts.first[f]
                if not is_listed(feature, begin, walls.wall_contacts.first[f + 1] - begin, walls.near_feature):
                    motion = walls.surface.motion[walls.surface.wall[feature]]
                    most = walls.fastest[motion]
                    body = local(walls.placements[now, motion], x)
                    closing = speed + most[0] + most[1] * wp.length(x)
                    nearest, direction, distance, mask, weight = closest_on_feature(
                        walls.surface, feature, body, radius, wp.float64(FAR)
                    )
                    apparent = acceleration + wp.float64(2.0) * most[1] * closing
                    time = wp.min(time, least_time(distance - need, closing, apparent))
        return time

    @kernel
    def steps_of_paths(
        first: int,
        wanted: wp.array(dtype=wp.int32),  # (k,) slots of the grains whose paths are looked at
        now: wp.float64,  # present step
        longest: int,  # steps to look ahead
        others: OtherGrains,  # all grains, those of the paths among them
        walls: WallsAhead,
        dt: wp.float64,
        steps_out: wp.array(dtype=wp.int32),  # (k,)
    ):
        """Steps from now on for which each path holds."""
        t = first + wp.tid()
        f = wanted[t]
        steps_out[t] = 0
        if wp.static(meshes):
            for e in range(walls.wall_contacts.first[f], walls.wall_contacts.first[f + 1]):
                if walls.near_feature[e] < walls.surface.triangles:  # the distance of a mesh is that of all its triangles
                    return
        path = others.flight[f]
        radius = others.record[f][3]
        base = radius + wp.float64(wp.static(gap)) + path[9]
        steps = int(longest)
        for n in range(others.flyer.shape[0]):
            j = others.flyer[n]
            if j != f:
                other = others.flight[j]
                until = until_meeting(path, other, now, dt, base + others.record[j][3] + other[9]) / dt
                # a path that ends before does not count beyond its end: a new one will be laid against this one
                if until < wp.float64(steps) and until < other[11] - now:
                    if not is_listed(j, others.rows.start[f], others.rows.count[f], others.rows.slot):
                        steps = int(until)
        k = int(0)
        look = int(0)
        bent = wp.length(bend(path))
        reaching = wp.float64(1.0)
        while k < steps and look < wp.static(LOOKS):
            x = position_at(path, (now - path[10] + wp.float64(k)) * dt)
            v = velocity_at(path, (now - path[10] + wp.float64(k)) * dt)
            speed = wp.length(v)
            reach = wp.float64(wp.static(FIRST_LOOK)) * radius * reaching + wp.float64(16.0) * speed * dt
            time = wp.min(wp.float64(steps - k) * dt, least_time(reach, speed, bent))
            reaching = reaching * wp.float64(2.0)
            look += 1
            if wp.static(periodic):
                if not border.within(x, wp.float64(0.0)):
                    look = wp.static(LOOKS)
                    time = wp.float64(0.0)
                time = wp.min(time, least_time(wp.float64(wp.static(0.2 * shortest)), speed, bent))
            if wp.static(meshes or shapes):
                time = until_wall(f, k, x, v, radius, bent, base, time, dt, walls)
            time = until_grain(f, x, speed, bent, base, time, others)
            go = wp.min(time / dt, wp.float64(steps - k))
            if go < wp.float64(1.0):
                look = wp.static(LOOKS)
            k += int(go)
        steps_out[t] = k

    return KernelSet(enclose=enclose, steps_of_paths=steps_of_paths, OtherGrains=OtherGrains, WallsAhead=WallsAhead)
