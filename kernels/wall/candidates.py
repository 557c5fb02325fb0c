"""Which features of the walls a grain may touch.

``wp.Mesh`` is float32 and only finds triangles: boxes are asked for with a slack for its rounding, in the body axes of the
wall, so the tree of a moving mesh is never rebuilt. The distance that decides is computed in float64. How far a
grain may go, in the wall's body axes, before the list is rebuilt, its allowance says. What a candidate is, ``images`` says.
"""

import functools

import warp as wp
from warpdem.kernels import MODULE_OPTIONS, KernelSet, grain
from warpdem.kernels.lists.path import FAR, Flight, in_flight
from warpdem.kernels.step.schedule import Placement, local
from warpdem.kernels.wall.surface import MeshTrees, Surface

MET = 8
"""Wall features per grain that the counting pass stores for the writing pass; a grain with more is searched again."""


@functools.cache
def build(around, border, WallContacts, ListedGrains, *, spins: bool, meshes: bool, shapes: bool, gap: float, leave: bool,
          apart: bool = False, wetting=None):  # fmt: skip
    """Return the kernels for walls with ``meshes`` and with analytic ``shapes``.

    ``around``: of ``images.build``; ``border``: of ``border.build``; ``ListedGrains``: of ``neighbors.build``; ``gap`` as in
    ``pairs.build``. Where grains may ``leave`` the domain, those that have are beside no wall; ``apart``: some materials pass
    through each other; ``wetting``: of ``films.build``, None for a law without bridges.
    """
    g = grain.build(spins)
    kernel = functools.partial(wp.kernel, enable_backward=False, module="unique", module_options=MODULE_OPTIONS)

    @wp.func
    def insert(candidate: int, at: int, n: int, out: wp.array(dtype=wp.int32)) -> int:
        """Number of candidates with one more, inserted in ascending order."""
        s = at + n
        while s > at and out[s - 1] > candidate:
            out[s] = out[s - 1]
            s -= 1
        out[s] = candidate
        return n + 1

    @wp.func
    def add(
        i: int, candidate: int, fill: int, at: int, n: int, met: wp.array2d(dtype=wp.int32), out: wp.array(dtype=wp.int32)
    ) -> int:  # fmt: skip
        """As ``insert`` when filling; when counting, the first ``MET`` are stored."""
        if fill == 1:
            return insert(candidate, at, n, out)
        if n < met.shape[1]:
            met[i, n] = candidate
        return n + 1

    @kernel
    def near_features(
        first: int,
        fill: int,  # 0 counts, 1 fills
        grains: ListedGrains,
        allowance: wp.array(dtype=wp.float64),  # (n,) how far each grain may go [m]
        surface: Surface,
        trees: MeshTrees,
        placements: wp.array(dtype=Placement),
        met: wp.array2d(dtype=wp.int32),  # (n, MET) first features of each grain, written when counting; (n, 0): none
        start: wp.array(dtype=wp.int32),
        count_out: wp.array(dtype=wp.int32),
        feature_out: wp.array(dtype=wp.int32),
    ):
        i = first + wp.tid()
        state = grains.record[i]
        if fill == 1 and count_out[i] <= met.shape[1]:
            for k in range(count_out[i]):
                insert(met[i, k], start[i], k, feature_out)
            return
        if wp.static(leave):
            if g.is_removed(state):
                count_out[i] = 0
                return
        q = g.position(state)
        radius = state[3]
        travel = allowance[i]
        reach = radius + wp.float64(wp.static(gap)) + travel
        n = int(0)
        at = int(0)
        if fill == 1:
            at = start[i]
        if wp.static(meshes):
            for m in range(trees.tree.shape[0]):
                wall = trees.wall[m]
                if wp.static(apart):
                    if grains.through[grains.material[i], surface.material[wall]] == 1:
                        continue
                placement = placements[surface.motion[wall]]
                for image in range(wp.static(around.images)):
                    if around.counts(surface, wall, image):
                        # where the grain is, and where it may come round to
                        for place in range(wp.static(around.images)):
                            near = bool(True)
                            if wp.static(around.images > 1):
                                near = border.may_cross(q, place, travel)
                            if near:
                                body = local(placement, around.seen(around.seen(q, image), place))
                                centre = wp.vec3(float(body[0]), float(body[1]), float(body[2]))
                                largest = wp.max(wp.abs(centre[0]), wp.max(wp.abs(centre[1]), wp.abs(centre[2])))
                                half = float(reach) * 1.0001 + largest * 1.0e-6
                                box = wp.vec3(half, half, half)
                                query = wp.mesh_query_aabb(trees.tree[m], centre - box, centre + box)
                                t = int(0)
                                while wp.mesh_query_aabb_next(query, t):
                                    c = around.candidate_of(surface, trees.first[m] + t, image)
                                    # a large triangle may be met from several of these places
                                    if around.reached(surface, placement, c, q, radius, reach, travel) == place:
                                        n = add(i, c, fill, at, n, met, feature_out)
        if wp.static(shapes):
            for k in range(surface.analytic):
                f = surface.triangles + k
                wall = surface.wall[f]
                if wp.static(apart):
                    if grains.through[grains.material[i], surface.material[wall]] == 1:
                        continue
                placement = placements[surface.motion[wall]]
                for image in range(wp.static(around.images)):
                    if around.counts(surface, wall, image):
                        c = around.candidate_of(surface, f, image)
                        if around.reached(surface, placement, c, q, radius, reach, travel) >= 0:
                            n = add(i, c, fill, at, n, met, feature_out)
        count_out[i] = n

    @wp.func
    def select_features(
        i: int, state: g.Record, travel: wp.float64, surface: Surface, placements: wp.array(dtype=Placement),
        near_feature: wp.array(dtype=wp.int32), flight: wp.array(dtype=Flight), wall_contacts: WallContacts,
    ):  # fmt: skip
        """As ``close_features``, of grain ``i``."""
        q = g.position(state)
        radius = state[3]
        at = wall_contacts.first[i]
        n = int(0)
        within = radius + wp.float64(wp.static(gap)) + travel
        if in_flight(flight, i):
            within = wp.float64(wp.static(FAR))
        last = wall_contacts.first[i + 1]
        if wp.static(leave):
            if g.is_removed(state):
                last = at
        for e in range(at, last):
            c = near_feature[e]
            placement = placements[surface.motion[surface.wall[around.feature_of(surface, c)]]]
            if around.reached(surface, placement, c, q, radius, within, travel) >= 0:
                n = insert(c, at, n, wall_contacts.feature)
        wall_contacts.candidates[i] = n
        if n == 0:
            if wp.static(wetting is not None):  # only one of the generations holds bridges
                wetting.give_all_back(i, 0, i, 0, wall_contacts, wall_contacts)
                wetting.give_all_back(i, 1, i, 0, wall_contacts, wall_contacts)
            wall_contacts.point_count[0, i] = 0
            wall_contacts.point_count[1, i] = 0

    @kernel
    def close_features(
        first: int,
        grains: wp.array(dtype=g.Record),
        share: wp.float64,
        allowance: wp.array(dtype=wp.float64),
        surface: Surface,
        placements: wp.array(dtype=Placement),
        near_feature: wp.array(dtype=wp.int32),
        flight: wp.array(dtype=Flight),
        wall_contacts: WallContacts,
    ):
        """Candidates within ``share`` of the allowance, at the start of a grain's slots; with none, no contact points.

        All that are near one in flight.
        """
        i = first + wp.tid()
        select_features(i, grains[i], share * allowance[i], surface, placements, near_feature, flight, wall_contacts)

    @kernel
    def carry_wall_contacts(
        first: int,
        parity: int,
        old_slot: wp.array(dtype=wp.int32),  # slot in the lists that are being replaced, -1 if it is new; of size 0: the same
        before: WallContacts,
        now: WallContacts,
    ):
        """Copy the contact points of the last force call to the new slots of the grain."""
        i = first + wp.tid()
        o = int(i)
        if old_slot.shape[0] > 0:
            o = old_slot[i]
        n = int(0)
        if o >= 0:
            n = wp.min(before.point_count[parity, o], now.first[i + 1] - now.first[i])
        now.point_count[parity, i] = n
        if wp.static(wetting is not None):
            if o >= 0:
                wetting.give_all_back(i, parity, o, n, before, now)
        for k in range(n):
            s = before.first[o] + k
            d = now.first[i] + k
            now.point[parity, d] = before.point[parity, s]

    return KernelSet(
        near_features=near_features, close_features=close_features, carry_wall_contacts=carry_wall_contacts,
        select_features=select_features,
    )  # fmt: skip
