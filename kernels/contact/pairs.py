"""One contact of two grains: geometry and motion from their records, the law, what each of them gets.

A pair force is the force (3) [N] and, with spins, the torque (3) [N m] on one grain; it is written to the force slots of both
grains, where the summation reads them one after the other (with one slot per contact the summation waited for memory: 60
against 30 ns per grain and step). i is the grain of the lower id. Torque arms R - overlap/2 add up to the distance of the
centres, so angular momentum is conserved to round-off.

On a CPU ``sweep`` evaluates contacts in the lanes of registers, on a GPU each thread one (``thread_contact``). IEEE operations
give the same bits in any lane, so a contact's result does not depend on its place.
"""

import functools

import warp as wp
from warpdem.kernels import KernelSet, clump, grain
from warpdem.kernels.contact import liquid, memory
from warpdem.kernels.contact.columns import OF_CONTACT, Columns, scalars


def force_width(spins: bool) -> int:
    """Numbers of the force on one grain, or of force and torque."""
    return 6 if spins else 3


def pair_force_width(spins: bool, wet: bool = False) -> int:
    """Numbers of a pair force on one grain: the force, or force and torque, then of a law with bridges WISH and GIFT."""
    return force_width(spins) + (2 if wet else 0)


RESULT_AT = Columns((("force", 3), ("torque_i", 3), ("torque_j", 3)))
"""What a contact gives its two grains: force on i [N], the opposite on j, and the torques on both [N m]."""
EXCHANGE_AT = RESULT_AT.and_(scalars(["wish_i", "wish_j", "gift"]))
"""Of a law with bridges also what it asks of the films of i and j, the radius of the other grain [m] or 0, and what it gives
back to each [counts] (``films``)."""
NONE = Columns(())
INVERSE_MASS = scalars(OF_CONTACT).inverse_mass


@functools.cache
def build(real, law, parts, border, *, spins: bool, gap: float, clumps: bool = False, impulses: Columns = NONE):
    """Return ``contact``, which evaluates one, and the types of what it is given and gives.

    Args:
        real: precision of the law, its results and the contact history; geometry and motion are always float64.
        law: namespace of ``law.build`` for pairs of grains.
        parts: function of ``dissipation.build`` when energies are added up, else None.
        impulses: then ``dissipation.impulses`` of its models.
        border: periodic images, of ``border.build``.
        spins: grains spin (there is a tangential or rolling model).
        gap: how far beyond contact the law acts [m].
        clumps: there are clumps.
    """
    g = grain.build(spins)
    vec3 = wp.types.vector(3, real)
    vec3d = wp.vec3d
    Coefficients = law.at.vector(wp.float64)
    Numbers, Constants, AxesRotation = law.Coefficients, law.Constants, law.history.Rotation
    wet = law.bridge_at is not None
    bridge_at = law.bridge_at or 0
    Result = (EXCHANGE_AT if wet else RESULT_AT).vector(real)
    PairForce = wp.types.vector(pair_force_width(spins, wet), real)
    kept = memory.build(real, law, border, impulses, spins=spins, energy=parts is not None)
    Memory, Impulses, Losses = kept.Memory, kept.Impulses, kept.Losses

    @wp.func
    def cast_vector(v: vec3d) -> vec3:
        return vec3(real(v[0]), real(v[1]), real(v[2]))

    @wp.func
    def cast_rotation(m: wp.mat33d) -> AxesRotation:
        """The same matrix in the precision of the law."""
        return AxesRotation(
            real(m[0, 0]), real(m[0, 1]), real(m[0, 2]), real(m[1, 0]), real(m[1, 1]), real(m[1, 2]),
            real(m[2, 0]), real(m[2, 1]), real(m[2, 2]),
        )  # fmt: skip

    @wp.func
    def cast_coefficients(coefficients_64: Coefficients) -> Numbers:
        """The same coefficients in the precision of the law."""
        c = Numbers()
        for f in range(wp.static(law.at.width)):
            c[f] = real(coefficients_64[f])
        return c

    @wp.func
    def contact(
        gi: g.Record,
        gj: g.Record,
        k: Constants,
        radius: real,
        inertia: real,
        c: Numbers,
        remembered: Memory,
        slip_time: wp.float64,
        kick: wp.float64,  # time for which the force acts [s]
        dt: wp.float64,
    ):
        """Result, memory, overlap over the smaller radius, approach speed and losses [J] of one contact.

        The losses, up to the work of the force call before, are zero unless energies are added up.
        """
        history = kept.history_of(remembered)
        across = border.nearest(g.position(gi) - g.position(gj))
        moved = (g.velocity(gi) - g.velocity(gj)) * slip_time
        before = across - moved
        distance = wp.sqrt(wp.dot(across, across))
        distance_before = wp.sqrt(wp.dot(before, before))
        n = across * (wp.float64(1.0) / distance)
        n_before = before * (wp.float64(1.0) / distance_before)
        radii = gi[3] + gj[3]
        overlap = radii - distance
        velocity = g.velocity(gi) - g.velocity(gj) + (g.acceleration(gi) - g.acceleration(gj)) * (wp.float64(0.5) * dt)
        slip = moved
        mean_rotation = vec3d()
        spin = vec3d()
        spin_predicted = vec3d()
        arm_i = gi[3] - wp.float64(0.5) * overlap
        arm_j = gj[3] - wp.float64(0.5) * overlap
        if wp.static(spins):
            wi = g.spin(gi)
            wj = g.spin(gj)
            half = wp.float64(0.5) * dt
            wi_predicted = wi + g.angular_acceleration(gi) * half
            wj_predicted = wj + g.angular_acceleration(gj) * half
            surface = wp.cross(wi_predicted * arm_i + wj_predicted * arm_j, n)
            velocity = velocity - surface
            # arms of mid-step, as the spins are: with those of the end a pair that revolves while it deforms would slip
            quarter = wp.float64(0.25) * (radii - distance_before - overlap)
            mid_surface = wp.cross(wi * (arm_i - quarter) + wj * (arm_j - quarter), n + n_before)
            slip = moved - mid_surface * (wp.float64(0.5) * slip_time)
            mean_rotation = (wi + wj) * (wp.float64(0.5) * slip_time)
            spin = wi - wj
            spin_predicted = wi_predicted - wj_predicted
        force, moment, now = law.force(
            cast_vector(n), cast_vector(n_before), real(overlap), real(radii - distance_before), cast_vector(velocity),
            cast_vector(slip), cast_vector(mean_rotation), cast_vector(spin), cast_vector(spin_predicted),
            real(dt), k, radius, inertia, c, history,
        )  # fmt: skip
        smaller = gi[3] if gi[3] < gj[3] else gj[3]
        ratio = real(overlap / smaller)
        approach = real(-wp.dot(velocity, n)) if overlap > wp.float64(0.0) else real(0.0)
        lever = wp.cross(cast_vector(n), force)
        ti = moment - lever * real(arm_i)
        tj = -moment - lever * real(arm_j)
        result = Result()
        if wp.static(wet):
            had = history[wp.static(bridge_at)]
            has = now[wp.static(bridge_at)]
            asks = real(1.0) if has == real(wp.static(liquid.PENDING)) else real(0.0)
            gift = real(0.5) * had if had > real(0.0) and has <= real(0.0) else real(0.0)
            result = Result(
                force[0], force[1], force[2], ti[0], ti[1], ti[2], tj[0], tj[1], tj[2], asks * real(gj[3]), asks * real(gi[3]),
                gift,
            )  # fmt: skip
        else:
            result = Result(force[0], force[1], force[2], ti[0], ti[1], ti[2], tj[0], tj[1], tj[2])
        impulse = Impulses()
        lost = Losses()
        if wp.static(parts is not None):
            p = parts(
                cast_vector(n), cast_vector(n_before), real(overlap), real(radii - distance_before),
                cast_vector(velocity),
                cast_vector(slip), cast_vector(mean_rotation), cast_vector(spin), real(dt),
                k, radius, inertia, c, history, force, moment, now,
            )  # fmt: skip
            impulse = kept.impulses_after(p, real(kick))
            lost = kept.losses_of(kept.past_work(gi, gj, kept.impulses_of(remembered), slip_time, dt), p)
        return result, kept.joined(now, impulse), ratio, approach, lost

    of_clumps = clump.build(clumps)

    @wp.func
    def constants_of_clumps(
        gi: g.Record, gj: g.Record, inverse: of_clumps.Inverse, radius: real, c: Numbers
    ) -> Constants:
        """Constants of a contact from the mass that its grains have along the normal as members of clumps.

        ``inverse``: the sum of theirs.
        """
        across = border.nearest(g.position(gi) - g.position(gj))
        n = across * (wp.float64(1.0) / wp.sqrt(wp.dot(across, across)))
        along = of_clumps.inverse_mass(inverse, n)
        k = law.constants(c, radius, real(wp.float64(1.0) / along), real(wp.float64(1.0) / (gi[3] + gj[3])))
        k[wp.static(INVERSE_MASS)] = real(along)  # not 1/m* again: the contacts wait for each other's divisions
        return k

    @wp.func
    def margin_at(across: wp.vec3d, gi: g.Record, gj: g.Record) -> wp.float64:
        cutoff = gi[3] + gj[3] + wp.float64(wp.static(gap))
        return cutoff * cutoff * wp.float64(1.000001) - wp.dot(across, across)

    @wp.func
    def margin(gi: g.Record, gj: g.Record) -> wp.float64:
        """Cutoff^2 - distance^2 of two grains [m2]; negative where they are out of reach, by more than round-off."""
        return margin_at(border.nearest(g.position(gi) - g.position(gj)), gi, gj)

    @wp.func
    def margin_before(gi: g.Record, gj: g.Record, slip_time: wp.float64) -> wp.float64:
        """The same one step before."""
        across = border.nearest(g.position(gi) - g.position(gj))
        return margin_at(across - (g.velocity(gi) - g.velocity(gj)) * slip_time, gi, gj)

    @wp.func
    def reduced_radius(gi: g.Record, gj: g.Record) -> wp.float64:
        """R* [m]."""
        return gi[3] * gj[3] / (gi[3] + gj[3])

    return KernelSet(
        contact=contact, constants_of_clumps=constants_of_clumps, clumps=of_clumps, margin=margin,
        margin_before=margin_before, reduced_radius=reduced_radius,
        cast_rotation=cast_rotation, cast_coefficients=cast_coefficients, law=law, real=real, spins=spins,
        has_parts=parts is not None, PairForce=PairForce, wet=wet, bridge_at=bridge_at, border=border,
        grain=g, Coefficients=Coefficients, AxesRotation=AxesRotation, memory=kept,
    )  # fmt: skip
