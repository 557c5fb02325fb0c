r"""What wears walls, added up at their contact points step by step: per feature (triangle of a mesh, or analytic wall).

    normal impulse   sum F_n dt                                                        [N s]
    shear work       -sum F_t . v_t dt                                                 [J]
    impact work      -sum F_n v_n dt                                                   [J]
    sliding          sum max(F_n, 0) |v_t| dt                                          [J]
    erosion          sum m u^2 f(a) over touches,                                      [J]
                     f = sin 2a - (6/K) sin^2 a where tan a <= K/6, else (K/6) cos^2 a

v is the velocity of the grain relative to the wall at the contact point, v_n along the normal; V_k and W_k of that time, as
in ``budget``, so that shear and impact work are what friction and normal force take from the relative motion, to round-off. u
is the velocity of the grain's centre relative to the wall at first touch and a its angle to the wall: 0 for one that grazes. A
touch begins where the overlap grows above 0: a law that reaches beyond it (a tail, a neck, a bridge) pulls without eroding, and
a grain that bounces within that reach touches each time. A contact point that takes over the history of another one, with an
overlap, does not begin; one that separates when it begins erodes nothing.

From these: mean pressure = normal impulse/(time area); depth by Archard's law k sliding/(H area), k the wear coefficient and H
the hardness; depth by Finnie's law for ductile walls erosion/(psi K p area), K the ratio of normal to tangential force while
cutting, psi the ratio of the depth of contact to that of the cut, p the flow pressure. Sources: Archard 1953, doi
10.1063/1.1721448; Finnie 1960, doi 10.1016/0043-1648(60)90055-7. The shape of the wall does not change.
"""

import functools

import warp as wp
from warpdem.kernels import grain
from warpdem.kernels.contact.columns import scalars
from warpdem.kernels.measure import window_sum
from warpdem.kernels.wall.record import RESULT

SUMS = scalars(("normal_impulse", "shear_work", "impact_work", "sliding", "erosion"))
"""What is added up per feature."""


@wp.func
def finnie(normal_speed: wp.float64, tangential_speed: wp.float64, ratio: wp.float64) -> wp.float64:
    """u^2 f(a) [m2/s2] at a speed towards the wall and one along it [m/s]; ``ratio``: K [-]."""
    # sin 2a = 2 v_n v_t/u^2, sin^2 a = v_n^2/u^2, cos^2 a = v_t^2/u^2
    cut = wp.float64(2.0) * normal_speed * tangential_speed - wp.float64(6.0) / ratio * normal_speed * normal_speed
    if wp.float64(6.0) * normal_speed > ratio * tangential_speed:
        cut = ratio / wp.float64(6.0) * tangential_speed * tangential_speed
    if normal_speed <= wp.float64(0.0):
        cut = wp.float64(0.0)
    return cut


@functools.cache
def build(one, WallContacts, spins: bool):
    """Return ``add``.

    Args:
        one: namespace of ``wall.contact.build``, whose results hold the wall's velocity.
        WallContacts: struct of ``wall.evaluate.build``.
        spins: grains spin.
    """
    g = grain.build(spins)
    at = one.at

    @wp.func
    def add(
        i: int, generation: int, state: g.Record, v: wp.vec3d, w: wp.vec3d, mass: wp.float64, weight: wp.float64,
        wall_contacts: WallContacts, cutting: wp.array(dtype=wp.float64), row: int, sums_out: wp.array3d(dtype=wp.int64),
    ):  # fmt: skip
        """Add what the contact points of grain ``i`` do over ``weight`` [s]; ``cutting``: [1], K of Finnie's law."""
        first = wall_contacts.first[i]
        for s in range(first, first + wall_contacts.point_count[generation, i]):
            point = wall_contacts.point[generation, s]
            result = wall_contacts.result[s]
            n = one.normal_in(point)
            force = one.force_in(result)
            moving = wp.vec3d(
                result[wp.static(RESULT.wall_velocity)], result[wp.static(RESULT.wall_velocity + 1)],
                result[wp.static(RESULT.wall_velocity + 2)],
            )  # fmt: skip
            u = v - moving
            slip = u - wp.cross(w, n) * (state[3] - point[wp.static(at.overlap)])
            normal_force = wp.dot(force, n)
            normal_speed = wp.dot(slip, n)
            across = slip - n * normal_speed
            first_sum = int(result[wp.static(RESULT.feature)]) * wp.static(SUMS.width)
            window_sum.add(normal_force * weight, row, first_sum + wp.static(SUMS.normal_impulse), sums_out)
            window_sum.add(-wp.dot(force, across) * weight, row, first_sum + wp.static(SUMS.shear_work), sums_out)
            window_sum.add(-normal_force * normal_speed * weight, row, first_sum + wp.static(SUMS.impact_work), sums_out)
            pressed = wp.max(normal_force, wp.float64(0.0)) * wp.length(across)
            window_sum.add(pressed * weight, row, first_sum + wp.static(SUMS.sliding), sums_out)
            if result[wp.static(RESULT.begins)] > wp.float64(0.0):
                along = wp.length(u - n * wp.dot(u, n))
                cut = finnie(-wp.dot(u, n), along, cutting[0]) * mass * point[wp.static(at.weight)]
                window_sum.add(cut, row, first_sum + wp.static(SUMS.erosion), sums_out)

    return add
