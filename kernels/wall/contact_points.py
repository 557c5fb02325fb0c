"""Contact points of a grain with walls: its closest points on many triangles, each contact counted once.

1. Closest point of every candidate, in float64 and body axes; a hit is one closer than the cutoff (radius + gap).
2. A hit on an edge or vertex is dropped when another triangle that holds the same point comes closer, or holds it too and
   comes first: it is no local minimum of the distance to the surface, or one seen twice. Triangles hold a point when they share
   the corners, or when it lies on them (unwelded seams, T-junctions).
3. A hit seen through another triangle is dropped (the far side of a plate thinner than the overlap), and so is one that equals
   another (two triangles of a flat piece that meet below the centre). Hits of one wall that are seen from several images of the
   grain (``images``) count as those of one surface: what overlaps with its own image is one contact point, and so is its seam.
4. What is left of one smooth piece is one contact point when all directions differ by less than 30 degrees from that of the
   deepest hit. It has the depth of the deepest; its direction is the mean of the hits with weights (depth)^4, which turns from
   one facet to the next as the depths do, so a grain may rest between two facets of a tessellated cylinder, where the direction
   of the deepest would jump to and fro. The mean is a little shorter than one and scales the force, as the slope of the depth
   along the bisector does.
5. Directions further apart mean a grain that is wedged or cradled: a tube narrower than it, a fillet of its own radius, a cone.
   Then every hit is a contact point, whose force is shared with its neighbours by the weight

       w_c = depth_c^4 / sum_o K(c, o) depth_o^4,   K = 1 up to 15 degrees apart, 0 from 30, linear in the cosine between,

   so that the sum of weights counts how many separate contact points there would be room for, and the net force is continuous
   and, on a regular tessellation, symmetric. Picking contact points 30 degrees apart from the deepest on leaves 0.3 of a force
   in a ring of 64.
"""

import functools

import warp as wp
from warpdem.kernels.step.schedule import Placement, local
from warpdem.kernels.wall.surface import Surface, is_corner_set_within
from warpdem.kernels.wall.triangle import FACE, closest_point, corner_count

MERGE_COSINE = 0.8660254037844386  # 30 degrees
SAME_COSINE = 0.9659258262890683  # 15 degrees
EQUAL = 1.0e-12  # cosine from one, and distance in radii, within which two hits are the same
ON = 1.0e-5  # distance in radii within which a point lies on a triangle
# what becomes of a candidate; those from TAKEN on are contact points, SHARED those of a grain that is wedged or cradled
IDLE, HIT, MERGED, TAKEN, SHARED = 0, 1, 2, 3, 4
Hit = wp.types.vector(8, wp.float64)  # distance [m], fraction of a full contact [-], closest point [m], direction to the centre


@wp.func
def packed(distance: wp.float64, weight: wp.float64, point: wp.vec3d, direction: wp.vec3d) -> Hit:
    """A hit of these parts."""
    return Hit(distance, weight, point[0], point[1], point[2], direction[0], direction[1], direction[2])


@wp.func
def point_of(hit: Hit) -> wp.vec3d:
    """Closest point [m]."""
    return wp.vec3d(hit[2], hit[3], hit[4])


@wp.func
def direction_of(hit: Hit) -> wp.vec3d:
    """Unit vector from the closest point to the centre."""
    return wp.vec3d(hit[5], hit[6], hit[7])


@functools.cache
def build(WallContacts, closest_on_feature, around, *, meshes: bool, moving: int, gap: float):
    """Return the function that finds the contact points of a grain.

    ``WallContacts`` is the struct of ``contact``, ``around`` of ``images``.
    """
    repeated = around.images > 1

    @wp.func
    def holds(surface: Surface, o: int, f: int, mask: int, point: wp.vec3d, tolerance: wp.float64, together: bool) -> bool:
        """Whether triangle ``o`` holds ``point``, which the corners ``mask`` of triangle ``f``, seen ``together``, span."""
        if together and is_corner_set_within(surface.vertex[f], mask, surface.vertex[o]):
            return True
        plane = surface.plane[o]
        height = wp.dot(wp.vec3d(plane[0], plane[1], plane[2]), point) - plane[3]
        if wp.abs(height) > tolerance:
            return False
        nearest, _ = closest_point(point, surface.corner[o])
        return wp.length(point - nearest) <= tolerance

    @wp.func
    def hides(surface: Surface, o: int, q: wp.vec3d, point: wp.vec3d, tolerance: wp.float64) -> bool:
        """Whether the way from ``q`` to ``point`` leads through triangle ``o``."""
        plane = surface.plane[o]
        normal = wp.vec3d(plane[0], plane[1], plane[2])
        here = wp.dot(normal, q) - plane[3]
        there = wp.dot(normal, point) - plane[3]
        if here * there >= wp.float64(0.0) or wp.abs(there) <= tolerance:
            return False
        crossing = q + (point - q) * (here / (here - there))
        nearest, _ = closest_point(crossing, surface.corner[o])
        return wp.length(crossing - nearest) <= tolerance

    @wp.func
    def is_repeated(c: int, first: int, last: int, radius: wp.float64, surface: Surface, wall_contacts: WallContacts) -> bool:
        """Steps 2 and 3: whether hit ``c`` on a triangle is no contact point of its own."""
        f = around.feature_of(surface, wall_contacts.feature[c])
        mask = wall_contacts.hit_mask[c]
        wall = surface.wall[f]
        hit = wall_contacts.hit[c]
        distance = hit[0]
        point = point_of(hit)
        direction = direction_of(hit)
        centre = point + direction * distance
        same = wp.float64(wp.static(EQUAL)) * radius + surface.rounding[wall]
        tolerance = wp.float64(wp.static(ON)) * radius + surface.rounding[wall]
        for o in range(first, last):
            of = around.feature_of(surface, wall_contacts.feature[o])
            if o != c and of < surface.triangles and surface.wall[of] == wall:
                other_hit = wall_contacts.hit[o]
                together = bool(True)
                if wp.static(repeated):
                    other_image = around.image_of(surface, wall_contacts.feature[o])
                    together = other_image == around.image_of(surface, wall_contacts.feature[c])
                    if not together:  # what follows happens beside the other's triangle
                        centre = point_of(other_hit) + direction_of(other_hit) * other_hit[0]
                        point = centre - direction * distance
                    else:
                        point = point_of(hit)
                        centre = point + direction * distance
                closer = distance - other_hit[0]
                other = wall_contacts.hit_mask[o]
                before = corner_count(other) > corner_count(mask) or (corner_count(other) == corner_count(mask) and o < c)
                if closer > same or (closer >= -same and before):
                    if mask == wp.static(FACE):
                        if wp.dot(direction, direction_of(other_hit)) > wp.float64(wp.static(1.0 - EQUAL)):
                            return True
                    elif holds(surface, of, f, mask, point, tolerance, together):
                        return True
                    if closer > same and hides(surface, of, centre, point, tolerance):
                        return True
        return False

    @wp.func
    def is_seen_twice(c: int, first: int, last: int, radius: wp.float64, surface: Surface, wall_contacts: WallContacts) -> bool:
        """Whether the point of hit ``c`` on an analytic wall lies on another image of the wall, which comes closer."""
        f = around.feature_of(surface, wall_contacts.feature[c])
        hit = wall_contacts.hit[c]
        tolerance = wp.float64(wp.static(ON)) * radius
        for o in range(first, last):
            if o != c and around.feature_of(surface, wall_contacts.feature[o]) == f:
                other = wall_contacts.hit[o]
                closer = hit[0] - other[0]
                if closer > tolerance or (closer >= -tolerance and o < c):
                    point = point_of(other) + direction_of(other) * other[0] - direction_of(hit) * hit[0]
                    nearest, direction, distance, mask, weight = closest_on_feature(surface, f, point, radius, radius)
                    if wp.abs(distance) <= tolerance:
                        return True
        return False

    @wp.func
    def piece_of(c: int, surface: Surface, wall_contacts: WallContacts) -> int:
        """Smooth piece of a candidate's feature."""
        return surface.piece[around.feature_of(surface, wall_contacts.feature[c])]

    @wp.func
    def nearness(depth: wp.float64) -> wp.float64:
        """Weight of a hit of this depth [m] in means: the fourth power, which leaves a third of one that is 25 % shallower."""
        return depth * depth * depth * depth

    @wp.func
    def join(best: int, first: int, last: int, cutoff: wp.float64, surface: Surface, wall_contacts: WallContacts):
        """Steps 4 and 5 for the smooth piece of ``best``, the deepest hit left."""
        piece = piece_of(best, surface, wall_contacts)
        wall_contacts.hit_state[best] = wp.static(TAKEN)
        hit = wall_contacts.hit[best]
        distance = hit[0]
        deepest = direction_of(hit)
        members = int(1)
        least = wp.float64(1.0)
        total = nearness(cutoff - distance)
        mean = deepest * total
        for c in range(first, last):
            if wall_contacts.hit_state[c] == wp.static(HIT) and piece_of(c, surface, wall_contacts) == piece:
                member = wall_contacts.hit[c]
                weight = nearness(cutoff - member[0])
                mean += direction_of(member) * weight
                total += weight
                least = wp.min(least, wp.dot(direction_of(member), deepest))
                members += 1
        if members > 1:
            if least > wp.float64(wp.static(MERGE_COSINE)):
                centre = point_of(hit) + deepest * distance
                length = wp.length(mean)
                wall_contacts.hit[best] = packed(distance, length / total, centre - mean * (distance / length), mean / length)
                for c in range(first, last):
                    if wall_contacts.hit_state[c] == wp.static(HIT) and piece_of(c, surface, wall_contacts) == piece:
                        wall_contacts.hit_state[c] = wp.static(MERGED)
            else:
                wall_contacts.hit_state[best] = wp.static(SHARED)
                for c in range(first, last):
                    if wall_contacts.hit_state[c] == wp.static(HIT) and piece_of(c, surface, wall_contacts) == piece:
                        wall_contacts.hit_state[c] = wp.static(SHARED)
                for c in range(first, last):
                    if wall_contacts.hit_state[c] == wp.static(SHARED) and piece_of(c, surface, wall_contacts) == piece:
                        crowd = wp.float64(0.0)
                        mine = wall_contacts.hit[c]
                        for o in range(first, last):
                            if wall_contacts.hit_state[o] == wp.static(SHARED) and piece_of(o, surface, wall_contacts) == piece:
                                other = wall_contacts.hit[o]
                                cosine = wp.dot(direction_of(mine), direction_of(other))
                                kernel = (cosine - wp.float64(wp.static(MERGE_COSINE))) / wp.float64(
                                    wp.static(SAME_COSINE - MERGE_COSINE)
                                )
                                share = wp.clamp(kernel, wp.float64(0.0), wp.float64(1.0))
                                crowd += share * nearness(cutoff - other[0])
                        wall_contacts.hit[c] = packed(
                            mine[0], nearness(cutoff - mine[0]) / crowd, point_of(mine), direction_of(mine)
                        )

    @wp.func
    def find_contact_points(
        i: int, q: wp.vec3d, radius: wp.float64, surface: Surface, wall_contacts: WallContacts,
        placements: wp.array2d(dtype=Placement), now_row: int,
    ) -> int:  # fmt: skip
        """Mark the candidates of grain ``i`` that are contact points as TAKEN or SHARED; 0 when there are none."""
        first = wall_contacts.first[i]
        last = first + wall_contacts.candidates[i]
        cutoff = radius + wp.float64(wp.static(gap))
        hits = int(0)
        hit = int(0)
        for c in range(first, last):
            f = around.feature_of(surface, wall_contacts.feature[c])
            body = around.seen(q, around.image_of(surface, wall_contacts.feature[c]))
            if wp.static(moving > 0):
                body = local(placements[now_row, surface.motion[surface.wall[f]]], body)
            point, direction, distance, mask, weight = closest_on_feature(surface, f, body, radius, cutoff)
            wall_contacts.hit_state[c] = wp.static(IDLE)
            if distance < cutoff:
                wall_contacts.hit_state[c] = wp.static(HIT)
                hits += 1
                hit = c
            wall_contacts.hit_mask[c] = mask
            wall_contacts.hit[c] = packed(distance, weight, point, direction)
        if hits == 0:
            return 0
        if hits == 1:  # the usual case has nothing to sort out
            wall_contacts.hit_state[hit] = wp.static(TAKEN)
            return 1
        if wp.static(meshes):
            for c in range(first, last):
                f = around.feature_of(surface, wall_contacts.feature[c])
                if wall_contacts.hit_state[c] == wp.static(HIT) and f < surface.triangles:
                    if is_repeated(c, first, last, radius, surface, wall_contacts):
                        wall_contacts.hit_state[c] = wp.static(IDLE)
        if wp.static(repeated):
            for c in range(first, last):
                f = around.feature_of(surface, wall_contacts.feature[c])
                if wall_contacts.hit_state[c] == wp.static(HIT) and f >= surface.triangles:
                    if is_seen_twice(c, first, last, radius, surface, wall_contacts):
                        wall_contacts.hit_state[c] = wp.static(IDLE)
        left = int(1)
        while left == 1:
            best = int(-1)
            for c in range(first, last):
                if wall_contacts.hit_state[c] == wp.static(HIT):
                    if best < 0:
                        best = c
                    else:
                        one, other = wall_contacts.hit[c], wall_contacts.hit[best]
                        if one[0] < other[0]:
                            best = c
            if best < 0:
                left = 0
            else:
                join(best, first, last, cutoff, surface, wall_contacts)
        return hits

    return find_contact_points
